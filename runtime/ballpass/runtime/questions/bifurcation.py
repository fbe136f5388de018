"""What kind of motion there is over a parameter: stroboscopic values up and down, and the largest Lyapunov exponent.

Over two parameters: a map of kinds and exponents, each point from the scene's start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ballpass.runtime.contract.defaults import EXPONENT_RTOL, SECTION_RTOL
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Option, Rtol
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.progress import Progress, shown
from ballpass.runtime.show.short import ShortRepr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.ask.kept_parts import Arrays, KeptParts
    from ballpass.runtime.ask.parameter_range import ParameterRange
    from ballpass.runtime.motion.lyapunov import Exponent
    from ballpass.runtime.motion.motion_map import MotionMap
    from ballpass.runtime.motion.strobe import Strobe
    from ballpass.runtime.request.start import RunEnd
    from ballpass.runtime.solution.solution import Solution

#: Both directions agree where their readings' means do, in shares of the magnitudes [1].
SAME = 1e-2

#: Longest delay of an interrupt [s].
PATIENCE = 0.2

#: Periods of a motion that repeats whose multipliers are taken.
PERIODS = 3

Vary = Annotated[
    str | Sequence[str],
    option_names.ranged(
        "Parameter and its values; `:log` behind them for equal factors. Given twice: a map over both.",
        'bearing.clearance="5 um:40 um:80"',
        counted=True,
    ),
]
State = Annotated[
    str | None,
    Option(
        words="State that is shown; the inner ring along y if none is given.",
        shown="STATE",
        names=option_names.states,
    ),
]
Readings = Annotated[
    int, Option(words="Stroboscopic readings that are kept at each value.", shown="N", least=20, most=100_000)
]
Settling = Annotated[int, Option(words="Readings at each value that do not count.", shown="N", least=0, most=1_000_000)]
WithExponent = Annotated[
    bool,
    Option(words="Compute the largest Lyapunov exponent.", flags=("--exponent/--no-exponent",)),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionAt:
    """The motion at one value.

    Attributes
    ----------
    value : of the parameter, SI
    states : readings, shape (readings, states)
    exponent : largest Lyapunov exponent per reading; None where none was asked for
    kind : ``periodic n``, ``quasi-periodic``, ``chaotic`` or ``undecided``
    open : what would decide an undecided one; "" for others
    """

    value: float
    states: np.ndarray
    exponent: Exponent | None
    kind: str
    open: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Bifurcation(ShortRepr, Reported):
    """Motions over a parameter, each begun where the one at the value before ended.

    Attributes
    ----------
    vary : the parameter and its range
    state, unit : that is shown
    row : of that state
    every : time between readings, in words
    up, down : motions in the order of the values, from the first end on and from the second end on
    apart : values at which the two directions differ: several motions exist, or one has not settled

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8: a turn is a period
    >>> values = "bearing.clearance=5 um:10 um:2"
    >>> found = model.bifurcation(values, parameters=pitch, readings=20, exponent=False)
    >>> [motion.kind for motion in found.up]
    ['periodic 1', 'periodic 1']
    """

    vary: ParameterRange
    state: str
    unit: str
    row: int
    every: str
    up: tuple[MotionAt, ...]
    down: tuple[MotionAt, ...]
    apart: tuple[float, ...]

    def _report(self) -> Report:
        from ballpass.runtime.motion.lyapunov import EXPONENT_WORDS

        unit, factor = printed_unit(self.vary.shown_unit), self.vary.factor
        rows = []
        for name, motions in (("up", self.up), ("down", self.down)):
            for kind, group in groupby(motions, key=lambda motion: motion.kind):
                members = list(group)
                ends = f"{members[0].value / factor:.6g} to {members[-1].value / factor:.6g}"
                ends = ends if len(members) > 1 else f"{members[0].value / factor:.6g}"
                rows.append((name, ends, kind, _span([m.exponent for m in members if m.exponent is not None])))
        shown = 4 if self.up[0].exponent is not None else 3
        table = ReportTable(
            title=f"Motion over {self.vary.name}, read {self.every}",
            heads=("direction", f"values, {unit}", "motion", "largest exponent per reading")[:shown],
            rows=[row[:shown] for row in rows],
        )
        said = []
        if shown == 4:
            said.append(EXPONENT_WORDS)
        if self.apart:
            found = ", ".join(f"{value / factor:.6g}" for value in self.apart[:8])
            more = f" and {len(self.apart) - 8} more" if len(self.apart) > 8 else ""
            said.append(f"Up and down differ at {found}{more} {unit}: several motions, or one not settled.")
        for words, group in groupby(sorted((*self.up, *self.down), key=lambda one: one.open), key=lambda one: one.open):
            if words:
                places = sorted({one.value / factor for one in group})
                listed = ", ".join(f"{value:.6g}" for value in places[:8])
                more = f" and {len(places) - 8} more" if places[8:] else ""
                said.append(
                    f"Undecided at {listed}{more} {unit}. What decides: {words}; or ballpass section, which sees "
                    "whether states lie on a curve."
                )
        said.append("Regions hold at the values themselves, whose distance limits where one ends.")
        records = [
            {
                "direction": name,
                "value": motion.value,
                "kind": motion.kind,
                "open": motion.open,
                "exponent": motion.exponent.mean if motion.exponent else None,
                "exponent_half": motion.exponent.half if motion.exponent else None,
                "readings": motion.states[:, self.row].tolist(),
            }
            for name, motions in (("up", self.up), ("down", self.down))
            for motion in motions
        ]
        facts = {
            "vary": self.vary.name,
            "vary_unit": self.vary.unit,
            "units": dict.fromkeys(("value", "apart"), self.vary.unit),
            **self._named("state", "unit", "every", "apart"),
            "motions": records,
        }
        return Report(parts=(table, *said), facts=facts, records=records, index=("direction", "value"))


def _span(exponents: list[Exponent]) -> str:
    if not exponents:
        return ""
    if len(exponents) == 1:
        return exponents[0].words
    means = [one.mean for one in exponents]
    return f"{min(means):.3g} to {max(means):.3g}, ± {max(one.half for one in exponents):.2g} at most"


def _figures(_model: AnyModel, found: Bifurcation | MotionMap, _: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.bifurcation import draw_bifurcation
    from ballpass.runtime.plot.motion_map import draw_map

    if isinstance(found, Bifurcation):
        yield "bifurcation", draw_bifurcation(found.vary, found.state, found.unit, found.row, found.up, found.down)
    else:
        yield "bifurcation", draw_map(found.vary, found.kinds, found.exponent if found.exponents else None)


def _files(found: Bifurcation | MotionMap) -> Mapping[str, bytes]:
    return {} if isinstance(found, Bifurcation) else {"bifurcation.nc": found.netcdf()}


@Question(figures=_figures, files=_files, needs="scipy", requires="bearings")
def bifurcation(
    model: AnyModel,
    vary: Vary,
    of: State = None,
    *,
    readings: Readings = 60,
    settling: Settling = 40,
    exponent: WithExponent = True,
    parameters: Mapping[str, float] | None = None,
    rtol: Rtol = None,
    keep: str | Path | None = None,
    client: Any = None,
    progress: Progress = None,
) -> Bifurcation | MotionMap:
    """Separate periodic from chaotic motion over a parameter, upwards and downwards.

    Each value begins where the motion at the value before ended, so that motions that exist side by side show as a
    difference between up and down. States are read once in a period of the equations, or once a turn where that is
    longer than eight turns.

    Over two parameters the answer is a map: the points are independent of each other, each from the scene's start.

    Parameters
    ----------
    parameters : overrides, SI
    keep : folder for what is computed, by which a call that was killed continues; what it kept is deleted at the end
    client : of `dask.distributed`, whose workers take points of a map; else threads do
    progress : as for `simulate`

    Raises
    ------
    RequestError
        A wrong range or state, a scene in which nothing turns, one whose driver's motion is a state, a map without a
        common period, or with `exponent` a law whose force jumps.
    IntegrationError
        The computation failed.

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8: a turn is a period
    >>> values = "bearing.clearance=9 um:10 um:2"
    >>> found = model.bifurcation(values, parameters=pitch, readings=20)
    >>> [motion.exponent.high < 0.0 for motion in found.up]
    [True, True]
    """
    from ballpass.runtime.ask.kept_parts import kept_parts
    from ballpass.runtime.ask.parameter_range import parameter_range
    from ballpass.runtime.motion.forcing_period import refuse_free_driver
    from ballpass.runtime.motion.strobe import strobe_of
    from ballpass.runtime.request.locating import refuse_jumps

    manifest = model.manifest
    if exponent:
        refuse_jumps(manifest, "bifurcation with an exponent")
    texts = [vary] if isinstance(vary, str) else list(vary)
    ranges = [parameter_range(manifest.parameters, "vary", text, counted=True) for text in texts]
    if len({one.name for one in ranges}) != len(ranges) or len(ranges) not in (1, 2):
        raise RequestError(
            f"vary: {', '.join(one.name for one in ranges)} were given. Allowed: one parameter, or two that differ."
        )
    if len(ranges) == 2 and of is not None:
        raise RequestError(f"of: a map shows no state, and {of} was given. Allowed: one parameter with it. Omit it.")
    if len(ranges) == 1 and client is not None:
        raise RequestError(
            "client: over one parameter each value begins where the one before ended, which no cluster shortens. "
            "Allowed: two parameters. Omit it."
        )
    model.numbers(parameters)  # refuses what is no mapping, or names no parameter
    overrides = dict(parameters or {})
    refuse_free_driver(manifest, "bifurcation")
    strobe = strobe_of(model, overrides, ranges, "bifurcation")
    decides = (readings, settling, exponent, rtol, overrides)
    if len(ranges) == 2:
        with kept_parts(keep, model, "map", *ranges, *decides) as parts, shown("following motions", progress) as tell:
            return _map(model, ranges, strobe, overrides, (readings, settling, rtol, exponent), parts, client, tell)
    with kept_parts(keep, model, ranges[0], *decides) as parts, shown("following motions", progress) as tell:
        return _followed(model, ranges[0], of, strobe, overrides, (readings, settling, rtol, exponent), parts, tell)


def _map(
    model: AnyModel,
    ranges: Sequence[ParameterRange],
    strobe: Strobe,
    overrides: Mapping[str, float],
    asked: tuple[int, int, float | None, bool],
    parts: KeptParts,
    client: Any,
    tell: Callable[[float], None] | None,
) -> MotionMap:
    """Motions over a plane."""
    from ballpass.runtime.motion.map_blocks import motions_in_blocks
    from ballpass.runtime.motion.map_points import MapRequest
    from ballpass.runtime.motion.motion_map import MotionMap
    from ballpass.runtime.time.repetition import Repetition

    first, second = ranges
    readings, settling, rtol, exponent = asked
    if strobe.period is None:
        raise RequestError(
            "bifurcation: a map needs readings after which the equations are the same, and here they are none within "
            "eight turns. Allowed: diameters and speeds whose ratios are fractions of small numbers, as "
            'bearing.pitch_diameter="31.75 mm" of a 6204, over the whole plane; or one parameter: one --vary.'
        )
    table = {name: np.full(first.count * second.count, value) for name, value in overrides.items()}
    table[first.name] = np.repeat(first.values, second.count)
    table[second.name] = np.tile(second.values, first.count)
    corners = [{name: float(all_[k]) for name, all_ in table.items()} for k in (0, second.count - 1, -second.count, -1)]
    begin = max(Repetition.of(model.manifest, model.numbers(corner).values).alike_from for corner in corners)
    if begin > 0.0:
        raise RequestError(
            f"bifurcation: turns are alike from {begin:.6g} s on, and points of a map begin at t = 0. Allowed: "
            "tables over time that end there; or one parameter: one --vary."
        )
    found = motions_in_blocks(
        model,
        table,
        MapRequest(period=strobe.period, readings=readings, settling=settling, rtol=rtol, exponent=exponent),
        parts,
        client,
        tell,
    )
    return MotionMap(
        vary=(first, second), title=model.manifest.title, every=strobe.every, motions=found, exponents=exponent
    )


def _followed(
    model: AnyModel,
    chosen: ParameterRange,
    of: str | None,
    strobe: Strobe,
    overrides: Mapping[str, float],
    asked: tuple[int, int, float | None, bool],
    parts: KeptParts,
    tell: Callable[[float], None] | None,
) -> Bifurcation:
    """Motions over one parameter, upwards and downwards."""
    from ballpass.runtime.motion.lyapunov import kind_of_motion, largest_exponent

    manifest, (readings, settling, rtol, exponent) = model.manifest, asked
    names = [info.name for info in manifest.states]
    state = of or ("inner.y" if "inner.y" in names else names[0])
    stopped, done = Event(), [0]

    def each() -> None:
        if stopped.is_set():
            raise KeyboardInterrupt

    with ThreadPoolExecutor(2) as pool:

        def motion(given: Mapping[str, float], begin: np.ndarray | None, dropped: int) -> Arrays:
            step = strobe.time(model, given)
            return parts.once(
                np.array([given[chosen.name], dropped, *([] if begin is None else begin)]),
                partial(_motion, model, given, step, begin, readings, dropped, rtol, exponent, each),
            )

        def sweep(order: np.ndarray) -> tuple[MotionAt, ...]:
            found, start = [], None
            for value in order.tolist():
                given = {**overrides, chosen.name: value}
                states, flows, magnitude = motion(given, start, settling)
                drifts = strobe.drifts(model, given)
                grown = largest_exponent(flows, states, magnitude, drifts) if exponent else None
                if grown is None or not grown.chaotic:
                    settled = strobe.settled(model, given, states, magnitude, parts)
                    if settled is not None:  # readings that come to a periodic state are taken from there
                        states, flows, magnitude = motion(given, settled[1], 0)
                        grown = largest_exponent(flows, states, magnitude, drifts) if exponent else None
                kind, undecided = kind_of_motion(states, magnitude, grown, drifts, forced=strobe.period is not None)
                found.append(MotionAt(value=value, states=states, exponent=grown, kind=kind, open=undecided))
                start = states[-1]
                done[0] += 1
                if tell is not None:
                    tell(done[0] / (2 * chosen.count))
            return tuple(found)

        directions = [pool.submit(sweep, values) for values in (chosen.values, chosen.values[::-1])]
        pending = set(directions)
        try:
            while pending:  # with a limit, so that an interrupt ends the wait on every system
                finished, pending = wait(pending, timeout=PATIENCE, return_when=FIRST_COMPLETED)
                for one in finished:
                    one.result()
            up, down = (one.result() for one in directions)
        except BaseException:
            stopped.set()  # the pool waits for its threads
            raise
    scale = np.max(np.abs(np.concatenate([motion.states for motion in up])), axis=0) + 1e-300
    apart = tuple(
        one.value
        for one, other in zip(up, down[::-1], strict=True)
        if (one.kind != other.kind and "undecided" not in (one.kind, other.kind))
        or (one.kind != "chaotic" and np.max(np.abs(one.states.mean(0) - other.states.mean(0)) / scale) > SAME)
    )
    return Bifurcation(
        vary=chosen,
        state=state,
        unit=manifest.states[names.index(state)].unit,
        row=names.index(state),
        every=strobe.every,
        up=up,
        down=down,
        apart=apart,
    )


def _motion(
    model: AnyModel,
    parameters: Mapping[str, float],
    step: float,
    start: np.ndarray | None,
    readings: int,
    settling: int,
    rtol: float | None,
    exponent: bool,
    each: Callable[[], None],
) -> Arrays:
    """The motion from a state on: readings, derivatives of readings by those before, if any, and magnitudes."""
    from ballpass.runtime.motion.lyapunov import period_of, strobe_with_tangents
    from ballpass.runtime.request.start import state_at
    from ballpass.runtime.time.repetition import Repetition

    numbers = model.numbers(parameters)
    begin = Repetition.of(model.manifest, numbers.values).alike_from

    def read(count: int, initial: RunEnd | None, first: float, default: float) -> Solution:
        run: Solution = model.simulate(
            duration=count * step if initial is not None else first + count * step,
            times=first + step * np.arange(1, count + 1),
            parameters=parameters,
            initial=initial,
            rtol=default if rtol is None else rtol,
            outputs=[],
            transient=0.0,
            progress=lambda _done: each(),
        )
        return run

    count = max(settling, 1) if exponent else settling + readings
    run = read(count, None if start is None else state_at(model, numbers, begin, start), begin, SECTION_RTOL)
    magnitude = np.array(run.statistics.magnitudes)
    if not exponent:
        return run.x[settling:], np.zeros(0), magnitude
    tight = EXPONENT_RTOL if rtol is None else rtol
    after = read(readings, run.end, begin + count * step, tight)
    few = PERIODS * period_of(after.x, magnitude)
    begin_again, count = (after.end, few) if 0 < few < readings else (run.end, readings)
    states, flows = strobe_with_tangents(model, numbers, begin_again, step, count, magnitude, tight, each)
    return after.x if count == few else states, flows, magnitude
