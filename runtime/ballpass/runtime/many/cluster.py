"""Work of ensembles and data sets on the workers of a Dask cluster.

In: a client of `dask.distributed`, models, tasks.  Out: the results of the tasks, in the order in which they come.

A generated folder is sent to each worker once, also to one that comes later.  The worker writes it to a folder of its
own, and compiles it where its cache of compiled code has no library that fits.  Dask gives the tasks of a lost worker
to others.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import io
import os
import shutil
import socket
import tempfile
import zipfile
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

from ballpass.runtime.contract.errors import CompileError, RequestError, SimulationError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.folder import read_artefact, read_unchanged
from ballpass.runtime.contract.manifest import FILE_NAME
from ballpass.runtime.contract.plugins import use, used
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.native.compile import compile_model
from ballpass.runtime.native.compilers import need_compiler
from ballpass.runtime.native.loaded_model import LoadedModel

#: How long to wait for the first worker, and for a scheduler to answer [s].
PATIENCE = 60.0

#: Tasks of a thread of a worker that are under way: one that runs, and others that wait, so that no thread does.
AHEAD = 4


#: Workers that may be asked for on this machine, each a process, where it has fewer processors.
MOST_WORKERS = 64

#: Settings of workers on this machine.  Dask's own environment lets the C library give back freed memory at once, and
#: each signal then takes its pages from the system anew: half as long again, measured.  Profiles are not needed.
LOCAL = {
    "distributed.nanny.pre-spawn-environ": {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")},
    "distributed.worker.profile.enabled": False,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """A generated folder to be sent.

    Attributes
    ----------
    key : digest of the content
    content : the files, as a ZIP archive
    version : of this package
    plugins : that it was loaded with
    """

    key: str
    content: bytes = field(repr=False)
    version: str
    plugins: tuple[str, ...]


def pack(model: LoadedModel) -> Packed:
    """The generated folder of a model; ArtefactError where it was written anew since."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        # names alone: with times of files the same content would give other bytes
        archive.writestr(zipfile.ZipInfo(FILE_NAME), model.manifest.to_json())
        for name, digest in model.manifest.files:
            archive.writestr(zipfile.ZipInfo(name), read_unchanged(model.folder / name, digest), zipfile.ZIP_DEFLATED)
    content = memory.getvalue()
    return Packed(key=hashlib.sha256(content).hexdigest(), content=content, version=__version__, plugins=used())


#: Folders that were sent to this process, by their keys.
_received: dict[str, Packed] = {}


@cache
def loaded(key: str) -> LoadedModel:
    """On a worker: the model of a folder that was sent, unpacked and compiled when first asked for."""
    packed = _received[key]
    if packed.version != __version__:
        raise RequestError(
            f"A worker has ballpass {__version__}, and {packed.version} sent it work. Install one version everywhere."
        )
    use(packed.plugins)
    place = Path(tempfile.mkdtemp(prefix="ballpass-"))
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    with zipfile.ZipFile(io.BytesIO(packed.content)) as archive:
        archive.extractall(place)
    manifest = read_artefact(place)
    try:
        need_compiler("it")
        library = compile_model(place, manifest)
    except (RequestError, CompileError) as fault:
        where = f"The worker on {socket.gethostname()}, process {os.getpid()}"
        raise type(fault)(f"{where}: {fault}") from fault
    return LoadedModel(place, manifest, library)


def _receive(packed: Sequence[Packed]) -> None:
    _received.update((one.key, one) for one in packed)


@contextlib.contextmanager
def _sent(client: Any, packed: Sequence[Packed]) -> Iterator[None]:
    """Folders on all workers, also on those that start later."""
    distributed = need("dask.distributed")

    class Sending(distributed.WorkerPlugin):  # type: ignore[misc, name-defined]
        """Gives the folders to a worker when it starts."""

        name = "ballpass-" + hashlib.sha256("".join(one.key for one in packed).encode()).hexdigest()[:16]

        def setup(self, worker: Any) -> None:
            _receive(packed)

    client.register_plugin(Sending())
    try:
        yield
    finally:
        with contextlib.suppress(OSError, ValueError):  # the scheduler is gone, and the plugin with it
            client.unregister_worker_plugin(Sending.name)


def refuse_other_clients(client: Any) -> None:
    """Refuse what is no client, before anything is computed."""
    if not hasattr(client, "nthreads"):
        raise RequestError(
            f"client: a Client of dask.distributed is expected, not {client!r:.60} ({type(client).__name__}). "
            "Example: client=dask.distributed.Client(cluster)."
        )


def run_tasks(
    client: Any,
    models: Sequence[LoadedModel],
    function: Callable[..., Any],
    tasks: Callable[[Sequence[str]], Iterable[tuple[Any, ...]]],
    kept: str,
) -> Generator[Any]:
    """Results of `function` for the tasks, in the order in which they end; a few run at a time.

    Parameters
    ----------
    models : that the function asks for with `loaded`
    function : of a module, so that workers find it
    tasks : arguments of the function, made of the keys of the models
    kept : sentence about what becomes of finished work where Dask gives up

    Raises
    ------
    RequestError
        There is no worker.
    SimulationError
        Dask has given a task up, for example because each worker that took it died.
    """
    distributed = need("dask.distributed")
    packed = [pack(model) for model in models]
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise RequestError(
            f"The cluster has no worker, and none came in {PATIENCE:g} s. Start one: dask worker "
            f"{client.scheduler.address}"
        ) from None
    with _sent(client, packed):
        waiting = iter(tasks([one.key for one in packed]))
        running = distributed.as_completed()
        under_way: set[Any] = set()

        def hand_out() -> None:
            most = AHEAD * max(1, sum(client.nthreads().values()))
            for task in islice(waiting, max(0, most - len(under_way))):
                future = client.submit(function, *task, pure=False)
                under_way.add(future)
                running.add(future)

        try:
            hand_out()
            for future in running:
                try:
                    result = future.result()
                except (distributed.KilledWorker, distributed.CancelledError) as fault:
                    why = " ".join(str(fault).split()).rstrip(".")
                    raise SimulationError(
                        f"Dask has given up a part of the work: {why}. {kept} Look at the logs of scheduler and "
                        "workers; a worker that needs more memory than it has is ended by the system."
                    ) from fault
                under_way.discard(future)
                hand_out()
                yield result
        finally:
            client.cancel(list(under_way))


@contextlib.contextmanager
def connected(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """A client of a scheduler, or of a new cluster of processes on this machine; None where neither is given.

    Raises
    ------
    RequestError
        Both are given, more workers than make sense, no scheduler answers, or Dask is not installed.
    """
    if scheduler is None and workers is None:
        yield None
        return
    if scheduler is not None and workers is not None:
        raise RequestError(
            f"--scheduler {scheduler} and --workers {workers} were both given. Allowed: one of them: workers of a "
            "scheduler that runs, or a cluster on this machine."
        )
    most = max(MOST_WORKERS, os.cpu_count() or 1)
    if workers is not None and not 1 <= workers <= most:
        raise RequestError(f"--workers: {workers} was given. Allowed: a whole number from 1 to {most}.")
    distributed = need("dask.distributed")
    if workers is not None:
        with (
            need("dask").config.set(LOCAL),
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs="ERROR"
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE / 4)
    except (OSError, ValueError) as fault:
        raise RequestError(
            f"--scheduler: no scheduler of Dask answers at {scheduler} ({str(fault).splitlines()[0]}). Start one: dask "
            "scheduler. It prints its address, as in tcp://192.168.0.10:8786."
        ) from None
    with client:
        yield client
