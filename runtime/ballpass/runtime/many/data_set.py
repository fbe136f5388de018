"""Data sets: thousands of labelled signals with all parameters they were made with.

In: classes of signals, what is recorded, a seed, a file.  Out: Zarr or NetCDF, and a `DataSetReport`.

Members are made in chunks, by this process or by the workers of a cluster.  A worker that sees the store writes its
samples there, another one sends them; this process notes that a chunk is there.  What a process that ended has left
unfinished, or what has been deleted or cut since, is made again; the rest is not.  NetCDF is written from the finished
Zarr, for HDF5 does not survive the end of a process that writes.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.folders import LOCK, locked, refuse_full_disk
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.contract.plausible_ranges import UnusualWarning, unusual
from ballpass.runtime.contract.plugins import digests
from ballpass.runtime.many.chunks import MemberFailure
from ballpass.runtime.many.cluster import loaded, run_tasks
from ballpass.runtime.many.data_set_store import (
    MADE,
    UNFINISHED,
    SignalAxes,
    SignalPlace,
    clear_store,
    create_store,
    is_complete,
    marked,
    mend,
    open_store,
    read_failures,
    read_finished,
    refuse_changed,
    refuse_foreign,
    write_netcdf,
    write_samples,
    write_status,
)
from ballpass.runtime.many.distributions import Distribution, draw
from ballpass.runtime.many.signals import Made, Member, Signals, check_outputs, make_signals
from ballpass.runtime.many.spall_entries import driven_spalls, entry_times
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import quantities_of, quantity_words
from ballpass.runtime.request.request import check_memory
from ballpass.runtime.show.progress import Progress, shown
from ballpass.runtime.show.short import ShortRepr

#: Bytes of the samples of one output in a chunk, about.
CHUNK_BYTES = 4_000_000

#: Chunks of a data set at least, as far as it has members: what workers share.
CHUNKS = 32

#: Most members of a chunk, and of a class.
MOST_IN_CHUNK, MOST_MEMBERS = 256, 10_000_000

#: Name of the ratio of signal to noise among the numbers that are drawn.
_SNR = "snr"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SignalClass(ShortRepr):
    """Members of one label.

    Attributes
    ----------
    label : what they are called
    model : what is simulated
    members : how many
    parameters : by name, a distribution or the number that all have; others keep the scene's [SI]

    Examples
    --------
    >>> wide = Distribution(name="uniform", arguments={"loc": 5e-6, "scale": 15e-6})  # [m]
    >>> vary = {"bearing.clearance": wide}
    >>> SignalClass(label="press", model=model, members=8, parameters=vary).members
    8
    """

    label: str
    model: LoadedModel
    members: int
    parameters: Mapping[str, Distribution | float]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DataSetReport(ShortRepr):
    """What became of a data set.

    Attributes
    ----------
    path : the Zarr folder, or the NetCDF file
    members : how many there are, and how many of them were `made` by this call
    failures : members without a signal, in order, also of earlier calls

    Examples
    --------
    >>> press = SignalClass(label="press", model=model, members=2, parameters={})
    >>> signals = Signals(outputs=("inner.y",), sample_rate=10e3, duration=0.05)
    >>> make_data_set("two.nc", [press], signals, seed=1).path.name
    'two.nc'
    """

    path: Path
    members: int
    made: int
    failures: tuple[MemberFailure, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _DataSetTable:
    """Class and place in it of each member, and its numbers.

    Attributes
    ----------
    kinds, places : shape (members,)
    columns : of each class, values of what varies by name, each of shape (members of the class,)
    """

    kinds: np.ndarray
    places: np.ndarray
    columns: tuple[dict[str, np.ndarray], ...]

    def member(self, number: int) -> Member:
        kind, place = int(self.kinds[number]), int(self.places[number])
        numbers = {name: float(column[place]) for name, column in self.columns[kind].items()}
        snr = numbers.pop(_SNR, None)
        return Member(kind=kind, place=place, parameters=numbers, snr=snr)


@typed
def make_data_set(
    path: str | Path,
    classes: Sequence[SignalClass],
    signals: Signals,
    *,
    seed: int,
    title: str = "",
    client: Any = None,
    chunk: int | None = None,
    progress: Progress = None,
) -> DataSetReport:
    """Make a data set, or what is missing of it.

    The samples are the same bits for a seed, whoever makes them and in whatever order, on processors of one kind with
    one compiler.  Open the result with ``xarray.open_zarr`` or ``xarray.open_dataset``.

    Parameters
    ----------
    path : a Zarr folder, or a NetCDF file where it ends in ``.nc``
    classes : what is simulated; members of all classes alternate, so that a part of the set has all labels
    signals : what is recorded
    seed : of all random numbers, a whole number from 0 on
    title : of the data set
    client : of `dask.distributed`, whose workers make the signals.  Default: this process
    chunk : members made and stored together.  Default: about 4 MB of samples
    progress : as for `Model.simulate`

    Raises
    ------
    RequestError
        A wrong request; another data set, or something else, is there already; Zarr or Dask is not installed.
    SimulationError
        A cluster gave up.  What was finished is kept: a second call continues.

    Examples
    --------
    >>> slow = Distribution(name="uniform", arguments={"loc": 30.0, "scale": 20.0})
    >>> vary = {"mechanism.driver.speed": slow}  # [rad/s]
    >>> press = SignalClass(label="press", model=model, members=3, parameters=vary)
    >>> signals = Signals(outputs=("inner.y",), sample_rate=10e3, duration=0.05)
    >>> report = make_data_set("presses.nc", [press], signals, seed=1)
    >>> report.members, report.made, report.failures
    (3, 3, ())
    """
    need("zarr")
    _check(classes, signals, seed, chunk)
    _check_room(Path(path), classes, signals)
    table = _draw(classes, signals, seed)
    fits = CHUNK_BYTES // (signals.samples * np.dtype(signals.precision).itemsize)
    count = len(table.kinds)
    size = min(chunk or max(1, min(MOST_IN_CHUNK, fits, -(-count // CHUNKS))), count)
    spec = json.loads(json.dumps(_spec(classes, signals, seed, size, title)))  # as it will be read back
    target = Path(path)
    netcdf = target.suffix == ".nc"
    if netcdf and target.exists():
        return DataSetReport(path=target, members=len(table.kinds), made=0, failures=read_finished(target, spec))
    store = target.with_name(f"{target.name}.parts") if netcdf else target
    refuse_foreign(store, scratch=netcdf)
    axes = _axes(classes, signals, table, spec, size)
    store.mkdir(parents=True, exist_ok=True)
    with locked(store):
        if is_complete(store):
            group = open_store(store)
            refuse_changed(store, dict(group.attrs), spec)
            mend(group, axes)
        else:
            group = create_store(store, axes)
        with marked(store) as place, shown("making signals", progress) as tell:
            made = _fill(place, classes, signals, seed, table, size, client, tell)
        failures = read_failures(group)
        if netcdf:
            write_netcdf(open_store(store), target)
            clear_store(store)
    if netcdf:
        (store / LOCK).unlink(missing_ok=True)
        if not store.is_symlink() and not any(store.iterdir()):
            store.rmdir()
    return DataSetReport(path=target, members=len(table.kinds), made=made, failures=failures)


def _check(classes: Sequence[SignalClass], signals: Signals, seed: int, chunk: int | None) -> None:
    faults = []
    if not classes:
        faults.append("classes: none was given. Allowed: one or more. Give a SignalClass for each label.")
    labels = [one.label for one in classes]
    if len(set(labels)) < len(labels):
        faults.append(f"classes: two have one label among {', '.join(labels)}. Give each its own.")
    for name, value, least in (("seed", seed, 0), *((("chunk", chunk, 1),) if chunk is not None else ())):
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            faults.append(f"{name}: a whole number from {least} on is expected, not {value!r}.")
    for one in classes:
        if not isinstance(one.members, int) or isinstance(one.members, bool) or not 1 <= one.members <= MOST_MEMBERS:
            faults.append(f"class {one.label}: {one.members!r} members. Allowed: 1 to {MOST_MEMBERS}.")
        known = [info.name for info in one.model.manifest.parameters]
        faults += [
            f"class {one.label}: {unknown_name('parameter', n, known)}" for n in one.parameters if n not in known
        ]
    if faults:
        raise RequestError("\n".join(faults))
    for one in classes:
        check_outputs(one.model.manifest, signals, one.label, one.model)


def _check_room(target: Path, classes: Sequence[SignalClass], signals: Signals) -> None:
    """Refuse a data set that fits neither into memory, a member at a time, nor on the disk."""
    less = "Record shorter, or at a lower sample_rate."
    check_memory(f"Signals of {signals.samples:.10g} samples of", signals.samples, len(signals.outputs) + 1, less)
    number = np.dtype(signals.precision).itemsize * len(signals.outputs)
    refuse_full_disk(target, number * signals.samples * sum(one.members for one in classes), f"Fewer members. {less}")


def _draw(classes: Sequence[SignalClass], signals: Signals, seed: int) -> _DataSetTable:
    """Numbers of all members; what is unusual is said once for a class."""
    counts = [one.members for one in classes]
    kinds = np.repeat(np.arange(len(classes)), counts)
    places = np.concatenate([np.arange(count) for count in counts])
    # members of all classes alternate, each class evenly over the whole set
    order = np.argsort((places + 0.5) / np.repeat(counts, counts), kind="stable")
    columns = []
    for kind, one in enumerate(classes):
        noise = {} if signals.snr is None else {_SNR: signals.snr}
        drawn = draw(seed, kind, one.members, {**one.parameters, **noise})
        columns.append(drawn)
        defaults = {info.name: np.full(one.members, info.default) for info in one.model.manifest.parameters}
        for text in unusual(one.model.manifest, defaults | drawn):
            warnings.warn(f"class {one.label}: {text}", UnusualWarning, stacklevel=3)
    return _DataSetTable(kinds=kinds[order], places=places[order], columns=tuple(columns))


def _spec(classes: Sequence[SignalClass], signals: Signals, seed: int, chunk: int, title: str) -> dict[str, Any]:
    """All that decides what is in the data set."""

    def plain(value: Distribution | float | None) -> Any:
        return asdict(value) if isinstance(value, Distribution) else value

    return {
        "title": title,
        "plugins": digests(),
        "seed": seed,
        "chunk": chunk,
        "signals": asdict(replace(signals, snr=None)) | {_SNR: plain(signals.snr)},
        "classes": {
            one.label: {
                "members": one.members,
                "parameters": {name: plain(value) for name, value in one.parameters.items()},
                "scene": {info.name: info.default for info in one.model.manifest.parameters},
                "rtol": one.model.manifest.run.rtol,
                "method": one.model.manifest.run.method,
                # words for people have the scene's name in them, and a data set does not depend on names of files
                "files": {name: digest for name, digest in one.model.manifest.files if not name.endswith(".md")},
            }
            for one in classes
        },
    }


def _truth(classes: Sequence[SignalClass], table: _DataSetTable, names: Sequence[str]) -> np.ndarray:
    """Parameters of all members, shape (members, parameters) [SI]."""
    found = np.full((len(table.kinds), len(names)), np.nan)
    for kind, (one, columns) in enumerate(zip(classes, table.columns, strict=True)):
        rows = np.flatnonzero(table.kinds == kind)
        for info in one.model.manifest.parameters:
            values = columns.get(info.name, np.full(one.members, info.default))
            found[rows, names.index(info.name)] = values[table.places[rows]]
    return found


def _entries(classes: Sequence[SignalClass], signals: Signals, table: _DataSetTable) -> dict[str, np.ndarray]:
    """Times in the record at which a ball reaches a spall, by spall, shape (members, entries); NaN behind the last."""
    end = signals.transient + signals.samples / signals.sample_rate
    found: dict[str, np.ndarray] = {}
    for kind, (one, columns) in enumerate(zip(classes, table.columns, strict=True)):
        rows = np.flatnonzero(table.kinds == kind)
        own = {name: column for name, column in columns.items() if name != _SNR}
        # a class without a varied number has as many equal members
        own = own or {info.name: np.full(one.members, info.default) for info in one.model.manifest.parameters[:1]}
        for name, times in entry_times(one.model, own, signals.transient, end).items():
            all_times = found.get(name, np.full((len(table.kinds), 1), np.nan))
            missing = max(0, times.shape[1] - all_times.shape[1])
            all_times = np.pad(all_times, ((0, 0), (0, missing)), constant_values=np.nan)
            all_times[rows, : times.shape[1]] = times[table.places[rows]]
            found[name] = all_times
    return found


def _axes(
    classes: Sequence[SignalClass], signals: Signals, table: _DataSetTable, spec: Mapping[str, Any], chunk: int
) -> SignalAxes:
    """What is known before anything is simulated."""
    infos = {info.name: info for one in classes for info in one.model.manifest.parameters}
    outputs = {info.name: info for info in classes[0].model.manifest.outputs}
    snr = np.full(len(table.kinds), np.inf)
    for kind, columns in enumerate(table.columns):
        if _SNR in columns:
            snr[table.kinds == kind] = columns[_SNR][table.places[table.kinds == kind]]
    model = classes[0].model
    wanted = quantities_of(model, signals.quantities) if signals.quantities else ()
    driven = _driven(classes)
    return SignalAxes(
        spec=spec,
        times=signals.times,
        precision=signals.precision,
        outputs=[(name, outputs[name].unit, outputs[name].description) for name in signals.outputs],
        quantities=[(item.name, item.unit, quantity_words(model.manifest, item)) for item in wanted],
        labels=np.array([one.label for one in classes])[table.kinds],
        names=[(info.name, info.unit, info.description) for info in infos.values()],
        parameters=_truth(classes, table, list(infos)),
        snr=snr,
        entries={name: v for name, v in _entries(classes, signals, table).items() if name not in driven},
        driven=driven,
        chunk=chunk,
    )


def _driven(classes: Sequence[SignalClass]) -> tuple[str, ...]:
    """Spalls that balls enter, in one class at least, when the motion decides."""
    return tuple(dict.fromkeys(name for one in classes for name in driven_spalls(one.model.manifest).values()))


def _fill(
    place: SignalPlace,
    classes: Sequence[SignalClass],
    signals: Signals,
    seed: int,
    table: _DataSetTable,
    size: int,
    client: Any,
    progress: Callable[[float], None] | None,
) -> int:
    """Make and write the chunks that are not finished; how many members that were."""
    group = open_store(place.path)
    status = group["status"][:]
    firsts = [first for first in range(0, len(status), size) if np.any(status[first : first + size] == UNFINISHED)]
    made = 0

    def members(first: int) -> list[Member]:
        return [table.member(number) for number in range(first, min(first + size, len(status)))]

    def tasks(keys: Sequence[str]) -> Iterator[tuple[Any, ...]]:
        for first in firsts:
            yield place, first, dict(enumerate(keys)), signals, seed, members(first), driven

    models, driven = [one.model for one in classes], _driven(classes)
    results: Iterator[tuple[int, Made]]
    if client is None:
        here = dict(enumerate(models))
        results = ((first, make_signals(here, signals, seed, members(first), driven)) for first in firsts)
    else:
        results = run_tasks(
            client, models, _make_chunk, tasks, "What was finished before is kept: a second call continues."
        )
    for first, chunk in results:
        write_samples(group, first, chunk)
        write_status(group, first, chunk)
        count = len(chunk.noise_rms)
        made += count
        status[first : first + count] = MADE
        if progress is not None:
            progress(float(np.mean(status != UNFINISHED)))
    return made


def _make_chunk(
    place: SignalPlace,
    first: int,
    keys: Mapping[int, str],
    signals: Signals,
    seed: int,
    members: Sequence[Member],
    driven: Sequence[str],
) -> tuple[int, Made]:
    """On a worker: the signals of a chunk, without the samples where the worker sees the store and has written them."""
    models = {kind: loaded(keys[kind]) for kind in {member.kind: None for member in members}}
    made = make_signals(models, signals, seed, members, driven)
    if place.seen():
        write_samples(open_store(place.path), first, made)
        made = replace(made, samples={})
    return first, made
