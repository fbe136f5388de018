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
import time as clocks
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.parameters import real, unknown_name
from ballpass.runtime.many.chunks import COUNTS, MemberFailure, Work, chunk_size, run_chunks
from ballpass.runtime.many.members import Members, Span, Table, make_members, read_table
from ballpass.runtime.native.ensemble_driver import LANE_FAMILIES
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.ratings.of_bearing import refuse_swinging
from ballpass.runtime.ratings.readings import KINDS as LIFE
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.locating import LOCATED, Kinks, choose_kinks, has_kinks
from ballpass.runtime.run.reduced_run import check_span, choose_family
from ballpass.runtime.run.reductions import channel_names, channels_needed, observable_aliases, observe
from ballpass.runtime.run.request import MOST_TIME, MOST_TURNS, check_memory, on_request
from ballpass.runtime.run.request import tolerance as relative_tolerance
from ballpass.runtime.run.tables import printed, simple_table
from ballpass.runtime.show import html

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, slots=True, kw_only=True)
class EnsembleStatistics:
    """What an ensemble took.

    Attributes
    ----------
    steps, rejected, evaluations : over all members; evaluations only of members in lanes
    switches : changes of family, over all members
    pivoted : systems of the linearly implicit method solved with pivoting
    chunk : members of a chunk
    lanes : members that advance together in a thread
    kinks : what steps did at the kinks of the laws, ``stepped-over`` or ``located``
    threads : at work
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
class EnsembleResult(Mapping[str, np.ndarray]):
    """Observables by the name they were asked for, each of shape (members,); NaN for a member without results.

    Attributes
    ----------
    observables : the values
    parameters : the varied parameters, each of shape (members,)
    failures : members without results, in order
    interrupted : whether the run was stopped by the user; members finished by then are there
    statistics : what it took
    manifest : of the model
    uncertain : where growth was asked for: by observable, members whose digits the tolerance does not bear, each of
        shape (members,)

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
    uncertain: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __repr__(self) -> str:
        count = len(next(iter(self.parameters.values())))
        return (
            f"EnsembleResult({self.manifest.scene}: {count} members, {len(self.failures)} without results"
            f"{', interrupted' if self.interrupted else ''}; varied: {', '.join(self.parameters)}; "
            f"observables: {', '.join(self.observables)})"
        )

    def __str__(self) -> str:
        return printed(_render(self))

    def _repr_html_(self) -> str:
        return html.block(html.from_terminal(_render(self)))

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
        aliases = observable_aliases(channel_names(self.manifest))
        for name in self.observables:
            kind, channel = aliases[name]
            found[name] = {
                "units": observable_unit(self.manifest, kind, channel), "long_name": f"{kind} of {channel}"
            }  # fmt: skip
        return found


def simulate_many(
    model: LoadedModel,
    table: Table,
    observables: str | Sequence[str],
    *,
    cycles: float | None,
    duration: float | None,
    transient: float | None,
    rtol: float | None,
    method: str | None,
    kinks: str | None,
    threads: int | None,
    lanes: bool,
    progress: Callable[[float], None] | None,
    bounded: bool = True,
) -> EnsembleResult:
    """Run an ensemble; see `ballpass.runtime.Model.simulate_many`.

    Parameters
    ----------
    bounded : hold the numbers to their bounds
    """
    started = clocks.perf_counter()
    manifest = model.manifest
    aliases = observable_aliases(channel_names(manifest))
    chosen = _observables(manifest, observables, aliases)
    asked = method or manifest.run.method
    family = choose_family(asked)
    tolerance = relative_tolerance("rtol", manifest.run.rtol if rtol is None else rtol)
    at_kinks = choose_kinks(kinks, "stepper" if asked == "auto" else asked, manifest, tolerance)
    workers = _threads(threads)
    # the table first: a wrong one is told before the driver is compiled
    columns = read_table(manifest, table)
    count = max((len(values) for values in columns.values()), default=0)
    # parameters, constants and what belongs to them, as arrays and for the driver: measured, with room to spare
    check_memory(
        f"{count} members of",
        count,
        3 * (len(manifest.parameters) + len(manifest.constants)) + 10,
        "Run the table in parts of some millions of members: they do not depend on each other.",
    )
    driver = model.ensemble_driver
    if at_kinks == LOCATED and has_kinks(manifest):
        driver = driver.with_stepper(model.locating_stepper)
    members = make_members(model, columns, bounded=bounded)
    _refuse_lives(model, chosen)
    skipped = manifest.run.transient_cycles if transient is None else real(transient)
    span = _span(model, members, cycles, duration, skipped)
    in_lanes = lanes and at_kinks != LOCATED and family in LANE_FAMILIES
    reduced = {name for observable in chosen.values() for name in channels_needed(*observable)}
    work = Work(
        model=model,
        driver=driver,
        members=members,
        span=span,
        family=family,
        rtol=tolerance,
        lanes=in_lanes,
        reducing=bool(reduced),
        end=members.initial.copy(),
        rows=driver.rows.empty(len(members), span.starts, reduced),
        results={
            member: MemberFailure(member=member, status="REFUSED", time=0.0, message=message)
            for member, message in members.refused.items()
        },
        counts=dict.fromkeys(COUNTS, 0),
        stop=ctypes.c_int(0),
    )
    able = np.array([m for m in range(len(members)) if m not in members.refused], dtype=np.int_)
    size = chunk_size(len(able), driver.lanes)
    interrupted = run_chunks(work, able, size, workers, progress)

    failed = sorted(work.results)
    found = {}
    for name, (kind, channel) in chosen.items():
        values = observe(manifest, kind, channel, work.rows, work.end, members.columns)
        values[failed] = np.nan
        found[name] = values
    return EnsembleResult(
        observables=found,
        parameters=members.varied,
        failures=tuple(work.results[member] for member in failed),
        interrupted=interrupted,
        statistics=EnsembleStatistics(
            **work.counts,
            chunk=size,
            lanes=driver.lanes if in_lanes else 1,
            kinks=at_kinks,
            threads=workers,
            rtol=tolerance,
            wall_time=clocks.perf_counter() - started,
        ),
        manifest=manifest,
    )


def _observables(
    manifest: Manifest, names: str | Sequence[str], aliases: Mapping[str, tuple[str, str]]
) -> dict[str, tuple[str, str]]:
    names = [names] if isinstance(names, str) else list(names)
    if not names:
        raise RequestError(
            "observables: one name or more is expected, none was given. Example: ['max:ball.force', 'rms:inner.y']."
        )
    faults = [_fault(manifest, name, aliases) for name in names if name not in aliases]
    if faults:
        raise RequestError("\n".join(faults))
    return {name: aliases[name] for name in names}


def _refuse_lives(model: LoadedModel, chosen: Mapping[str, tuple[str, str]]) -> None:
    """RequestError for the life of a bearing that does not turn, whatever the numbers of a member are."""
    asked = {channel.removesuffix("ball.force") for kind, channel in chosen.values() if kind in LIFE}
    values = model.numbers({}).values if asked else {}
    for bearing in model.manifest.bearings:
        if bearing.prefix in asked:
            refuse_swinging(bearing, values, clock.shaft_speed(model.manifest, values))


def _fault(manifest: Manifest, name: str, aliases: Mapping[str, tuple[str, str]]) -> str:
    """Why a name is no observable: the steps reduce states and forces of balls, not what follows from them."""
    channel = str(name).rpartition(":")[2].partition("[")[0].partition("@")[0]
    reduced = channel_names(manifest)
    computed = channel in {info.name for info in manifest.quantities} or bool(on_request(channel))
    if computed and channel not in reduced:
        return (
            f"{name!r}: ensembles and sweeps reduce what steps give: {', '.join(reduced)}; {channel} is not among "
            "them. Ask Model.sensitivity or ballpass sensitivity for it, member by member."
        )
    return unknown_name("observable", name, aliases)


def _threads(given: int | None) -> int:
    if given is None:
        # processors that this process may use, where the system tells
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not (1.0 <= real(given) < math.inf and int(given) == given):
        raise RequestError(f"threads: a whole number from 1 on is expected, not {given!r}.")
    return int(given)


def _span(model: LoadedModel, members: Members, cycles: float | None, duration: float | None, transient: float) -> Span:
    """Lengths of the members' runs; members for which there is none are refused."""
    run = model.manifest.run
    if cycles is not None and duration is not None:
        raise RequestError(f"cycles = {cycles!r} and duration = {duration!r} were both given: give one of them.")
    if cycles is None and duration is None:
        cycles, duration = run.cycles, run.duration
    for name, value in (("cycles", cycles), ("duration", duration)):
        if value is not None and not 0.0 < value < np.inf:
            raise RequestError(f"{name}: a number above 0 is expected, not {value!r}.")
    count = len(members)
    durations, turns, starts = np.zeros(count), np.full(count, np.inf), np.zeros(count)
    mechanism, bearing = model.manifest.mechanism, model.manifest.bearing
    speed = mechanism.speed if mechanism is not None else bearing.ring_speed if bearing is not None else None
    speeds = np.abs(members.columns[speed]) if speed is not None else np.zeros(count)
    np.divide(clock.TURN, speeds, out=turns, where=speeds > 0.0)
    # where there is a run for everybody, in one go; the rules of `check_span`
    if 0.0 <= transient < math.inf and (duration is not None or np.all(np.isfinite(turns))):
        durations = np.full(count, float(duration)) if duration is not None else float(cycles or 0.0) * turns
        starts = transient * turns if transient > 0.0 else starts
        longest = np.minimum(MOST_TIME, MOST_TURNS * turns)
        if np.all((starts < durations * (1.0 - 1e-9)) & (durations <= longest)):
            return Span(durations=durations, turns=turns, starts=starts)
    durations, starts = np.zeros(count), np.zeros(count)
    for turn in np.unique(turns):
        which = np.flatnonzero(turns == turn)
        try:
            if duration is None and not np.isfinite(turn):
                raise RequestError("cycles: nothing turns in this model (its speed is zero). Give duration in seconds.")
            assert cycles is not None or duration is not None  # the manifest has one of the two
            length = float(duration) if duration is not None else float(cycles or 0.0) * float(turn)
            durations[which] = length
            starts[which] = check_span(length, float(turn), transient)
        except RequestError as fault:
            if len(which) == count:
                raise
            members.refused.update((int(member), str(fault)) for member in which)
    return Span(durations=durations, turns=turns, starts=starts)


def _render(result: EnsembleResult) -> Any:
    """Smallest, middle and largest value of each varied parameter and observable over the members."""
    count = len(next(iter(result.parameters.values())))
    statistic = result.statistics
    right = ("min", "median", "max")
    table = simple_table(
        f"{result.manifest.title}: {count} members",
        ("parameter or observable", *right, "unit"),
        right=right,
        caption=f"{len(result.failures)} without results; {statistic.threads} threads, rtol {statistic.rtol:g}, "
        f"{statistic.wall_time:.3g} s",
    )
    units = {info.name: info.unit for info in result.manifest.parameters}
    aliases = observable_aliases(channel_names(result.manifest))
    units |= {name: observable_unit(result.manifest, *aliases[name]) for name in result.observables}
    for name, values in (*result.parameters.items(), *result.observables.items()):
        known = values[np.isfinite(values)]
        cells = [f"{f(known):z.6g}" for f in (np.min, np.median, np.max)] if len(known) else ["", "", ""]
        table.add_row(name, *cells, units[name])
    return table


def observable_unit(manifest: Manifest, kind: str, channel: str) -> str:
    """SI unit of an observable."""
    if kind in ("peak_time", "min_time"):
        return "s"
    if kind == "peak_ball":
        return "1"
    if kind in LIFE:
        return "turns"
    units = {state.name: state.unit for state in manifest.states}
    return units.get(channel, "m" if channel.endswith("ball.deflection") else "N")
