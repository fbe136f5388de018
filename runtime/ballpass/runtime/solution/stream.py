"""A run of any length into a file, in memory that does not grow with it.

In: a model, numbers, a request with a sampling rate.  Out: a NetCDF-4 file of the layout of `Solution.save`.

The run is made of pieces of some million numbers, each of which starts where the one before ended and is written
before the next begins.  A piece ends on a sample, where a step of the integrator ends as well: the samples are those of
one run within its tolerance.  Extremes of every step (`Solution.reductions`) are not kept.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import refuse_full_disk, replaced
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import asked_span
from ballpass.runtime.request.sampling import checked_rate
from ballpass.runtime.request.start import start_time
from ballpass.runtime.solution.netcdf import create_variable, seal
from ballpass.runtime.solution.simulate import simulate
from ballpass.runtime.solution.solution import Solution, Statistics, contents

#: Numbers of the samples of a piece, 16 MB; in memory a few times as much is needed.
PIECE = 2**21


def stream_run(model: LoadedModel, numbers: Numbers, request: Request, path: Path, piece: int = PIECE) -> Statistics:
    """Write a run to a file, which appears when it is done.

    Parameters
    ----------
    request : with a sampling rate
    piece : numbers of the samples that are kept in memory

    Raises
    ------
    RequestError
        A wrong request, or a file that cannot be written.
    IntegrationError
        The computation failed; the file is as it was.
    """
    rate = checked_rate(0.0 if request.sample_rate is None else request.sample_rate)
    span = asked_span(model, numbers, request)
    edges = _edges(model, request, path, rate, span.begin, span.end, piece)
    try:
        with replaced(path) as made:
            statistics = _write(model, numbers, request, made, rate, edges)
            _seal(made)
    except OSError as fault:
        raise RequestError(
            f"{path}: cannot be written ({fault.strerror or fault}); a file that was there is as it was. Give a path "
            "in a folder you may write, with enough free space."
        ) from fault
    return statistics


def _edges(
    model: LoadedModel, request: Request, path: Path, rate: float, begin: float, end: float, piece: int
) -> list[int]:
    """Numbers of the samples with which pieces begin, and the one behind the last; refused where no disk holds them."""
    first, behind = int(np.ceil(begin * rate - 1e-6)), int(np.floor(end * rate + 1e-6)) + 1
    if behind - first < 2:
        raise RequestError(f"sample_rate: {rate:g} Hz has fewer than two samples within the run. Give a higher rate.")
    wanted = set(model.outputs if request.outputs is None else request.outputs)
    columns = len(model.states) + sum(info.size for info in model.manifest.outputs if info.name in wanted)
    bytes_of_all = 8.0 * (columns + 1) * (behind - first)
    refuse_full_disk(path, bytes_of_all, "Give a lower sample_rate, a shorter run, or fewer outputs.")
    rows = max(piece // (columns + len(model.manifest.inputs)), 2)
    edges = list(range(first, behind, rows))
    return [*(edges[:-1] if len(edges) > 1 and behind - edges[-1] < 2 else edges), behind]


def _write(
    model: LoadedModel, numbers: Numbers, request: Request, path: Path, rate: float, edges: list[int]
) -> Statistics:
    import h5netcdf

    count, start, tell = edges[-1] - edges[0], request.initial, request.progress
    parts: list[Statistics] = []
    piece = replace(request, cycles=None, duration=None, sample_rate=None)
    with h5netcdf.File(path, "w") as file:
        for first, behind in pairwise(edges):
            times = np.maximum(np.arange(first, behind) / rate, start_time(start))
            at, share = (first - edges[0]) / count, (behind - first) / count
            shown = tell and partial(lambda at, share, fraction: tell(at + share * fraction), at, share)
            solution = simulate(model, numbers, replace(piece, times=times, initial=start, progress=shown))
            start = solution.end
            _append(file, solution, first - edges[0])
            parts.append(solution.statistics)
        counts = ("steps", "rejected", "located", "segments", "calls", "wall_time", "duration")
        each = {name: [getattr(part, name) for part in parts] for name in counts}
        sums: dict[str, Any] = {name: None if None in found else sum(found) for name, found in each.items()}
        total = replace(parts[0], **sums)
        whole = replace(solution, statistics=total, reductions=None, steady_reductions=None)
        file.attrs.update(contents(whole)[1])
    return total


def _append(file: Any, solution: Solution, done: int) -> None:
    """Samples of a piece behind those of the pieces before it."""
    variables, _ = contents(solution)
    rows = len(solution)
    if not done:
        file.dimensions["time"] = None  # it grows
        for name, (dimensions, values, attributes) in variables.items():
            chunks = (min(rows, 2**14), *values.shape[1:]) if dimensions[0] == "time" else None
            variable = create_variable(file, name, dimensions, values.shape, values.dtype, attributes, chunks=chunks)
            if dimensions[0] != "time":
                variable[...] = values
    file.resize_dimension("time", done + rows)
    for name, (dimensions, values, _) in variables.items():
        if dimensions[0] == "time":
            file.variables[name][done : done + rows] = values
    file.flush()


def _seal(path: Path) -> None:
    """Put the digest of its bytes behind a file, as `Solution.save` does."""
    with path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    with path.open("ab") as stream:
        stream.write(seal(digest))
