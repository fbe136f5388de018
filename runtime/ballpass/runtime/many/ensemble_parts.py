"""An ensemble on a cluster: its table in parts, each simulated by a worker in SIMD lanes.

In: a client, a model, a table.  Out: the `EnsembleResult` of all parts, with the bits of an ensemble in one process.
"""

from __future__ import annotations

import time as clocks
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.plausible_ranges import warn_unusual
from ballpass.runtime.many.chunks import CHUNK, COUNTS, MemberFailure
from ballpass.runtime.many.cluster import loaded, refuse_other_clients, run_tasks
from ballpass.runtime.many.ensemble import EnsembleResult, EnsembleStatistics, simulate_many
from ballpass.runtime.many.members import Table, read_table
from ballpass.runtime.native.loaded_model import LoadedModel

#: Parts of an ensemble for each thread of the cluster at least, as far as they fill a chunk; most members of a part.
PARTS, MOST = 4, 4096

#: What becomes of finished members where Dask gives up.
LOST = (
    "The members simulated before are lost: call simulate_many again, or make a data set, which continues where it "
    "ended."
)


def simulate_parts(
    model: LoadedModel,
    table: Table,
    observables: str | Sequence[str],
    *,
    client: Any,
    progress: Callable[[float], None] | None,
    **options: Any,
) -> EnsembleResult:
    """Run an ensemble on a cluster; see `ballpass.runtime.Model.simulate_many`.

    Parameters
    ----------
    options : of `ballpass.runtime.many.ensemble.simulate_many`, except threads: the cluster has its own
    """
    started = clocks.perf_counter()
    refuse_other_clients(client)
    manifest = model.manifest
    columns = read_table(manifest, table)
    count = len(next(iter(columns.values())))
    defaults = {info.name: np.full(count, info.default) for info in manifest.parameters}
    warn_unusual(manifest, defaults | columns)
    names = [observables] if isinstance(observables, str) else list(observables)
    threads = max(1, sum(client.nthreads().values()))
    size = min(MOST, max(1, -(-count // (CHUNK * PARTS * threads))) * CHUNK)
    values = {name: np.full(count, np.nan) for name in names}
    left = np.ones(count, dtype=bool)
    failures: list[MemberFailure] = []
    refused: list[str] = []
    statistics: list[EnsembleStatistics] = []
    interrupted = False

    def tasks(keys: Sequence[str]) -> Iterator[tuple[Any, ...]]:
        for first in range(0, count, size):
            part = {name: column[first : first + size] for name, column in columns.items()}
            yield keys[0], first, part, names, options

    try:
        for first, found in run_tasks(client, [model], _simulate_part, tasks, LOST):
            which = slice(first, min(first + size, count))
            left[which] = False
            if isinstance(found, RequestError):  # no member of the part can be simulated
                refused.append(str(found))
                failures += _failures(which, "REFUSED", str(found))
            else:
                part, failed, taken = found
                for name in names:
                    values[name][which] = part[name]
                failures += [replace(failure, member=first + failure.member) for failure in failed]
                statistics.append(taken)
            if progress is not None:
                progress(1.0 - float(np.mean(left)))
    except KeyboardInterrupt:
        interrupted = True
        for member in np.flatnonzero(left).tolist():
            failures += _failures(slice(member, member + 1), "INTERRUPTED", "Interrupted.")
        if not statistics:
            raise
    if not statistics:
        raise RequestError(refused[0])
    return EnsembleResult(
        observables=values,
        parameters=columns,
        failures=tuple(sorted(failures, key=lambda failure: failure.member)),
        interrupted=interrupted,
        statistics=EnsembleStatistics(
            **asdict(statistics[0])
            | {name: sum(getattr(one, name) for one in statistics) for name in COUNTS}
            | {"threads": threads, "wall_time": clocks.perf_counter() - started}
        ),
        manifest=manifest,
    )


def _failures(which: slice, status: str, message: str) -> list[MemberFailure]:
    return [
        MemberFailure(member=member, status=status, time=0.0, message=message)
        for member in range(which.start, which.stop)
    ]


def _simulate_part(
    key: str, first: int, part: Mapping[str, np.ndarray], names: Sequence[str], options: Mapping[str, Any]
) -> tuple[int, Any]:
    """On a worker: where the part begins, and its observables, failures and statistics, or why all were refused."""
    try:
        result = simulate_many(loaded(key), part, names, threads=1, **options)
    except RequestError as fault:
        return first, fault
    return first, (dict(result.observables), result.failures, result.statistics)
