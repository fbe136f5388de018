"""Ensembles: many parameter sets of one model, only the observables asked for kept.

In: a model, a table of parameters, names of observables.  Out: an `EnsembleResult`.

Members are cut into chunks whose size follows from their number alone; threads take chunks, and within a chunk several
members advance together in SIMD lanes.  A member's arithmetic depends neither on its neighbours nor on the chunk, so
the results are the same bits for any number of threads.
"""

from __future__ import annotations

import ctypes
import math
import os
import threading
import time as clocks
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import real, unknown_name, whole
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.many.chunks import MemberFailure, Work, chunk_size, member_run, note_failure, run_chunks
from ballpass.runtime.many.members import Members, Spans, Table, check_assembled_members, make_members, read_table
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.quantity.grammar import parse_quantity, quantities_of, quantity_words
from ballpass.runtime.quantity.layout import is_reduced, needed_rows
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Quantity, ReducedRuns
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.request.choose_method import choose_method
from ballpass.runtime.request.locating import LOCATED, Kinks, choose_kinks
from ballpass.runtime.request.request import asked_length, check_memory
from ballpass.runtime.request.request import tolerance as relative_tolerance
from ballpass.runtime.run.loop import RunFailed
from ballpass.runtime.time import timeline
from ballpass.runtime.time.span import MOST_TIME, MOST_TURNS, Span, check_transient
from ballpass.runtime.time.turning import TURN

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, slots=True, kw_only=True)
class EnsembleStatistics:
    """Cost of an ensemble.

    Attributes
    ----------
    steps, rejected, evaluations : over all members; evaluations only of members in lanes
    switches : changes of family, over all members
    pivoted : systems of the linearly implicit method solved with pivoting
    chunk : members of a chunk
    lanes : members that advance together in a thread
    kinks : treatment of the kinks of the laws, ``stepped-over`` or ``located``
    threads : number of threads
    rtol : relative tolerance [1]
    wall_time : [s]

    Examples
    --------
    >>> table = {"bearing.clearance": [5e-6, 10e-6]}  # [m]
    >>> statistics = model.simulate_many(table, "rms:inner.y", cycles=3).statistics
    >>> statistics.lanes, statistics.kinks
    (8, 'stepped-over')
    """

    steps: int
    rejected: int
    evaluations: int
    switches: int
    pivoted: int
    chunk: int
    lanes: int
    kinks: Kinks
    threads: int
    rtol: float
    wall_time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class EnsembleResult(Reported, Mapping[str, np.ndarray]):
    """Observables by the name they were asked for, each of shape (members,); NaN for a member without results.

    Attributes
    ----------
    observables : the values
    parameters : the varied parameters, each of shape (members,)
    failures : members without results, in order
    interrupted : whether the run was stopped by the user; members finished by then have results
    statistics : its cost
    manifest : of the model
    uncertainty : where it was asked for: ± of each observable, shape (members,)

    Examples
    --------
    >>> table = {"mechanism.bodies.slider.mass": [16.0, 17.0, -1.0]}  # [kg]
    >>> many = model.simulate_many(table, "peak_ball_force", cycles=3)
    >>> many["peak_ball_force"].round(-1)  # [N]
    array([4400., 4390.,   nan])
    >>> many.failures[0].status
    'REFUSED'
    """

    observables: Mapping[str, np.ndarray]
    parameters: Mapping[str, np.ndarray]
    failures: tuple[MemberFailure, ...]
    interrupted: bool
    statistics: EnsembleStatistics
    manifest: Manifest = field(repr=False)
    uncertainty: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __repr__(self) -> str:
        count = len(next(iter(self.parameters.values())))
        return (
            f"EnsembleResult({self.manifest.scene}: {count} members, {len(self.failures)} without results"
            f"{', interrupted' if self.interrupted else ''}; varied: {', '.join(self.parameters)}; "
            f"observables: {', '.join(self.observables)})"
        )

    def _report(self) -> Report:
        """Smallest, middle and largest value of each varied parameter and observable over the members."""
        statistic, rows = self.statistics, []
        units = {name: facts["units"] for name, facts in self.attributes().items()}
        for name, values in (*self.parameters.items(), *self.observables.items()):
            known = values[np.isfinite(values)]
            cells = [f"{f(known):z.6g}" for f in (np.min, np.median, np.max)] if len(known) else ["", "", ""]
            rows.append((name, *cells, printed_unit(units[name])))
        right = ("min", "median", "max")
        table = ReportTable(
            title=f"{self.manifest.title}: {len(next(iter(self.parameters.values())))} members",
            heads=("parameter or observable", *right, "unit"),
            rows=rows,
            right=right,
            caption=f"{len(self.failures)} without results; {statistic.threads} threads, rtol {statistic.rtol:g}, "
            f"{statistic.wall_time:.3g} s",
        )
        columns = {
            part: {name: values.tolist() for name, values in getattr(self, part).items()}
            for part in ("parameters", "observables")
        }
        return Report(parts=(table,), facts={**columns, "units": units, "failures": [asdict(f) for f in self.failures]})

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.observables[name]
        except KeyError:
            raise KeyError(unknown_name("observable", name, self.observables)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.observables)

    def __len__(self) -> int:
        return len(self.observables)

    def to_xarray(self) -> xarray.Dataset:
        """Dataset with the dimension ``member``; the varied parameters are coordinates along it, with units.

        Examples
        --------
        >>> table = {"bearing.clearance": [5e-6, 10e-6]}  # [m]
        >>> many = model.simulate_many(table, "rms:inner.y", cycles=3)
        >>> data = many.to_xarray()
        >>> dict(data.sizes), data["rms:inner.y"].units, data["bearing.clearance"].units
        ({'member': 2}, 'm', 'm')
        """
        facts = self.attributes()
        coordinates: dict[str, Any] = {"member": np.arange(len(next(iter(self.parameters.values()))))}
        coordinates |= {name: ("member", values, facts[name]) for name, values in self.parameters.items()}
        variables = {name: ("member", values, facts[name]) for name, values in self.observables.items()}
        return need("xarray").Dataset(variables, coords=coordinates, attrs={"title": self.manifest.title})

    def to_pandas(self) -> pandas.DataFrame:
        """Table with the index ``member``: varied parameters, then observables; units in ``attrs["units"]``.

        Raises
        ------
        RequestError
            pandas is not installed.

        Examples
        --------
        >>> table = {"bearing.clearance": [5e-6, 10e-6]}  # [m]
        >>> many = model.simulate_many(table, "rms:inner.y", cycles=3)
        >>> many.to_pandas().shape, many.to_pandas().attrs["units"]
        ((2, 2), {'bearing.clearance': 'm', 'rms:inner.y': 'm'})
        """
        table = need("pandas").DataFrame({**self.parameters, **self.observables}).rename_axis("member")
        table.attrs["units"] = {name: facts["units"] for name, facts in self.attributes().items()}
        return table

    def attributes(self) -> dict[str, dict[str, str]]:
        """``units`` and ``long_name`` of varied parameters and observables, by name."""
        infos = {info.name: info for info in self.manifest.parameters}
        found = {name: {"units": infos[name].unit, "long_name": infos[name].description} for name in self.parameters}
        for name in self.observables:
            quantity = parse_quantity(self.manifest, name)
            found[name] = {"units": quantity.unit, "long_name": quantity_words(self.manifest, quantity)}
        return found


def simulate_many(
    model: LoadedModel,
    table: Table,
    observables: str | Sequence[str],
    *,
    cycles: float | None = None,
    duration: float | None = None,
    transient: float | None = None,
    rtol: float | None = None,
    method: str | None = None,
    kinks: str | None = None,
    threads: int | None = None,
    lanes: bool = True,
    progress: Callable[[float], None] | None = None,
) -> EnsembleResult:
    """Run an ensemble; see `ballpass.runtime.Model.simulate_many`."""
    started = clocks.perf_counter()
    manifest = model.manifest
    chosen = _quantities(model, observables)
    chosen_method, _ = choose_method(model, method or manifest.run.method, stepper=True)
    tolerance = relative_tolerance("rtol", manifest.run.rtol if rtol is None else rtol)
    at_kinks = choose_kinks(kinks, chosen_method, manifest, tolerance, lanes=True)
    workers = thread_count(threads)
    # the table first: a wrong one is reported before the driver is compiled
    columns = read_table(manifest, table)
    count = max((len(values) for values in columns.values()), default=0)
    # parameters, constants and what belongs to them, as arrays and for the driver: measured, with room to spare
    check_memory(
        f"{count} members of",
        count,
        3 * (len(manifest.parameters) + len(manifest.constants)) + 10,
        "Run the table in parts of some millions of members: they do not depend on each other.",
    )
    driver = model.ensemble_driver if model.states else None
    members = make_members(model, columns)
    skipped = model.run_settings.transient_cycles if transient is None else real(transient)
    span = _spans(model, members, cycles, duration, skipped)
    may_lock = check_assembled_members(model, members, span)
    in_lanes = driver is not None and lanes and at_kinks != LOCATED and not may_lock
    by_steps = [item for item in chosen if is_reduced(model, item)]
    others = [item for item in chosen if not is_reduced(model, item)]
    reduced = {row for item in by_steps for row in needed_rows(item)}
    work = Work(
        model=model,
        driver=driver,
        members=members,
        span=span,
        method=chosen_method,
        rtol=tolerance,
        kinks=at_kinks,
        lanes=in_lanes,
        reducing=bool(reduced),
        end=members.initial.copy(),
        rows=reduction_rows(manifest).empty(len(members), span.starts, reduced, tolerance),
        stop=ctypes.c_int(0),
    )
    for member, message in members.refused.items():
        note_failure(work, member, "REFUSED", message)
    able = np.array([m for m in range(len(members)) if m not in members.refused], dtype=np.int_)
    lanes_of = driver.lanes if driver is not None and in_lanes else 1
    size = chunk_size(len(able), driver.lanes if driver is not None else 1)
    tell = progress or (lambda _done: None)
    share = 0.5 if by_steps and others else 1.0  # of the progress
    interrupted, found = False, {}
    if by_steps:
        interrupted = run_chunks(work, able, size, workers, lambda done: tell(done * share))
        runs = ReducedRuns(manifest=manifest, rows=work.rows, end=work.end, values=members.columns)
        with np.errstate(invalid="ignore", divide="ignore"):  # a member that never started has no duration
            found = {item.name: np.array(_reduced(runs, item)) for item in by_steps}
        for values in found.values():
            values[sorted(work.results)] = np.nan
    if others:
        table = np.full((len(members), len(others)), np.nan)
        if not interrupted:
            interrupted = measure_members(
                work, others, able, table, workers, lambda done: tell(1.0 - share + done * share)
            )
        found |= {item.name: table[:, k] for k, item in enumerate(others)}
    failed = sorted(work.results)
    found = {item.name: found[item.name] for item in chosen}
    return EnsembleResult(
        observables=found,
        parameters=members.varied,
        failures=tuple(work.results[member] for member in failed),
        interrupted=interrupted,
        statistics=EnsembleStatistics(
            **work.counts,
            chunk=size,
            lanes=lanes_of,
            kinks=at_kinks,
            threads=workers,
            rtol=tolerance,
            wall_time=clocks.perf_counter() - started,
        ),
        manifest=manifest,
    )


def _quantities(model: LoadedModel, names: str | Sequence[str]) -> tuple[Quantity, ...]:
    names = [names] if isinstance(names, str) else list(names)
    if not names:
        raise RequestError(
            "observables: one name or more is expected, none was given. Example: ['max:ball.force', 'rms:inner.y']."
        )
    return quantities_of(model, names)


def _reduced(runs: ReducedRuns, quantity: Quantity) -> np.ndarray:
    reduced = KINDS[quantity.kind].reduced
    assert reduced is not None  # `is_reduced`
    return reduced(runs, quantity)


def thread_count(given: int | None) -> int:
    """Threads that were asked for; None: as many as processors."""
    if given is None:
        # processors that this process may use, where the system reports them
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return whole("threads", given)


def _spans(
    model: LoadedModel, members: Members, cycles: float | None, duration: float | None, transient: float
) -> Spans:
    """Lengths of the members' runs; members for which there is none are refused."""
    cycles, duration = asked_length(model, cycles, duration)
    check_transient(transient)
    count, manifest = len(members), model.manifest
    name, info = timeline.speed_name(manifest), timeline.driver_info(manifest)
    speeds = np.zeros(count) if name is None else np.abs(members.columns[name])
    turns = np.divide(TURN, speeds, out=np.full(count, np.inf), where=speeds > 0.0)
    durations = np.full(count, duration) if duration is not None else (cycles or 0.0) * turns
    starts = transient * turns if transient > 0.0 else np.zeros(count)
    # the rules of `Span`, for all members at once
    able = (starts < durations * (1.0 - 1e-9)) & (durations <= np.minimum(MOST_TIME, MOST_TURNS * turns))
    tables = info is not None and info.times != ()
    able &= not tables  # each by its own rows
    for member in np.flatnonzero(~able).tolist():
        try:
            turning = timeline.driver(manifest, {name: column[member] for name, column in members.columns.items()})
            of_it = Span.of(turning, cycles=cycles, duration=duration or math.nan, transient=transient).check()
            durations[member], starts[member] = of_it.end, of_it.start
        except RequestError as fault:
            if not tables and np.all(turns == turns[member]):  # and so with every other one
                raise
            members.refused[member] = str(fault)
            durations[member] = starts[member] = 0.0
    return Spans(durations=durations, turns=turns, starts=starts)


def measure_members(
    work: Work,
    quantities: Sequence[Quantity],
    able: np.ndarray,
    found: np.ndarray,
    threads: int,
    progress: Callable[[float], None],
) -> bool:
    """Evaluate quantities that steps do not reduce, member by member; whether the user interrupted.

    Parameters
    ----------
    found : filled, NaN for a quantity that is not known, shape (members, quantities)
    """
    own = threading.local()  # a `QuantityRun` is not for several threads

    def measure(member: int, which: tuple[int, ...]) -> tuple[dict[int, float], RequestError | SimulationError | None]:
        """Values by their place, and why some are not known."""
        runs = own.__dict__.setdefault("runs", {})
        if which not in runs:
            runs[which] = QuantityRun(work.model, [quantities[k] for k in which])
        try:
            values = runs[which].measure(member_run(work, member)).values.tolist()
            return dict(zip(which, values, strict=True)), None
        except (RequestError, SimulationError) as fault:
            known: dict[int, float] = {}
            if len(which) > 1:  # one by one
                for k in which:
                    known |= measure(member, (k,))[0]
            return known, fault

    every = tuple(range(len(quantities)))
    with ThreadPoolExecutor(max_workers=threads, thread_name_prefix="ballpass") as pool:
        pending = [pool.submit(measure, member, every) for member in able.tolist()]
        done = 0
        try:
            for member, future in zip(able.tolist(), pending, strict=True):
                values, fault = future.result()
                done += 1
                found[member, list(values)] = list(values.values())
                if fault is not None and member not in work.results:
                    ended = (fault.status.name, fault.time) if isinstance(fault, RunFailed) else ("REFUSED", 0.0)
                    note_failure(work, member, ended[0], str(fault), ended[1])
                progress(done / len(pending))
        except KeyboardInterrupt:
            for future in pending:
                future.cancel()
            for member in able[done:].tolist():
                note_failure(work, member, "INTERRUPTED", "Interrupted before it was done.")
            return True
    return False
