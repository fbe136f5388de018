"""Periodic states of a machine: shooting, multipliers and what they say, branches over a parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np

from ballpass.runtime.contract.defaults import BRANCH_RTOL, DERIVATIVE_RTOL
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.options import Option, TightRtol
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.report.short_words import short_words
from ballpass.runtime.show.progress import Progress, shown
from ballpass.runtime.show.short import ShortRepr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.ask.parameter_range import ParameterRange
    from ballpass.runtime.motion.contact_sequence import ContactSequence
    from ballpass.runtime.motion.continuation import BranchPoint, SteadyBranch
    from ballpass.runtime.motion.shooting import PeriodicState, Shooting
    from ballpass.runtime.solution.solution import Solution

#: Difference of the accelerations at one state, a period apart, that a period of few digits has [1].
SAME = 1e-3

#: A state repeats sooner where that changes it by less, in shares of the magnitudes [1].
REPEATS = 1e-6

#: Segments where one fails; kicks along the direction that doubles the period, in shares of the magnitudes.
SEGMENTS, KICKS = 8, (1e-3, 1e-2, 0.03, 0.1, 0.3)

Turns = Annotated[
    float | None,
    Option(
        words="Period of the equations, in turns of driver or shaft. Found from what turns if not given.",
        shown="N",
        above=0.0,
    ),
]
Repeats = Annotated[
    int, Option(words="Periods of the equations after which the state must be there again.", shown="N", least=1)
]
Segments = Annotated[
    int | None,
    Option(
        words="Segments of multiple shooting. One if not given, and eight where that does not converge.",
        shown="N",
        least=1,
        most=200,
    ),
]
Before = Annotated[
    float,
    Option(
        words="Turns to simulate before Newton's iteration begins, as whole periods: one at least, unless it is zero.",
        shown="N",
        least=0.0,
    ),
]
Over = Annotated[
    str | None,
    option_names.ranged(
        "Follow the state over a parameter, from the first end of the range to the second.",
        'bearing.clearance="5 um:15 um"',
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SteadyState(ShortRepr, Reported):
    """A state that repeats after a period, and what becomes of states beside it.

    Attributes
    ----------
    states, units, descriptions : names, SI units and what they are
    period : after which the state is there again [s]
    turns : the same in turns of driver or shaft, NaN where nothing turns [1]
    forcing : what happens in a period of the equations
    repeats : periods of the equations in it
    sooner : after so many of them it is there again; `repeats` where there is no such
    start : state that repeats, shape (states,)
    begin : its time, t = 0 or, where rows of a table change a value, behind the last one at the angle of the start [s]
    multipliers : eigenvalues of the derivative of the state after a period by that at the start, largest first
    resolution : size below which a multiplier is not known from zero
    contacts : which elements touch, in which order, within a period
    left : what a period changed before each iteration and after the last one, in shares of the states' magnitudes [1]
    segments : of multiple shooting
    integrated : periods that the iterations integrated
    difference : of the accelerations a period apart, at one state, relative to them [1]
    over : the range of the branches' parameter, None for none
    branches : of states over that parameter; that of `start` first, then those of twice the period
    notes : what was not found

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8
    >>> found = model.steady(parameters=pitch)
    >>> found.stable, found.turns, len(found.left) <= 6
    (True, 1.0, True)
    """

    states: tuple[str, ...]
    units: tuple[str, ...]
    descriptions: tuple[str, ...]
    period: float
    turns: float
    forcing: str
    repeats: int
    sooner: int
    start: np.ndarray
    begin: float
    multipliers: np.ndarray
    resolution: float
    contacts: ContactSequence
    left: tuple[float, ...]
    segments: int
    integrated: int
    difference: float
    over: ParameterRange | None
    branches: tuple[SteadyBranch, ...]
    notes: tuple[str, ...]

    @property
    def stable(self) -> bool:
        """Whether states beside it come back to it.

        Examples
        --------
        >>> model.steady(parameters={"bearing.pitch_diameter": 31.75e-3}).stable
        True
        """
        return bool(abs(self.multipliers[0]) < 1.0)

    @property
    def kind(self) -> str:
        """Stability in words: what kind of instability it is.

        Examples
        --------
        >>> model.steady(parameters={"bearing.pitch_diameter": 31.75e-3}).kind
        'stable'
        """
        from ballpass.runtime.motion.steady_report import kind_of

        return kind_of(self.multipliers)

    def _grows(self) -> str:
        largest = abs(self.multipliers[0])
        if largest <= self.resolution:
            return f"dies out: less than {self.resolution:.0e} of it is left"
        return f"becomes {largest:.4g} times as large"

    def _without_newton(self) -> str:
        """Periods that a transient takes to come as near, by the largest multiplier."""
        # runs come no nearer than their tolerance
        size, lessened = abs(self.multipliers[0]), max(self.left[-1], DERIVATIVE_RTOL) / self.left[0]
        periods = math.log(lessened) / math.log(size) if 0.0 < size < 1.0 and 0.0 < lessened < 1.0 else 0.0
        return f"; a transient takes {periods:.0f} periods to come as near" if periods > self.integrated else ""

    def _report(self) -> Report:
        from ballpass.runtime.motion import steady_report

        rows = [
            {"state": name, "unit": unit, "start": start}
            for name, unit, start in zip(self.states, self.units, self.start.tolist(), strict=True)
        ]
        turns = "" if math.isnan(self.turns) else f", {self.turns:.10g} turns"
        begin = f"{self.begin:.10g} s" if self.begin else "0"
        table = ReportTable.of(
            zip(rows, map(table_unit, self.units), self.descriptions, strict=True),
            {
                "state": lambda row: row[0]["state"],
                ">start": lambda row: f"{row[1][0] * row[0]['start']:z.10g}",
                "unit": lambda row: row[1][1],
                "~what": lambda row: short_words(row[2]),
            },
            title=f"State at t = {begin} that repeats after {self.period:.10g} s{turns}",
        )
        known = [m for m in self.multipliers.tolist() if abs(m) > self.resolution]
        lost = len(self.multipliers) - len(known)
        listed = ", ".join(steady_report.complex_words(m) for m in known if m.imag >= 0.0)
        listed += f"{', ' if known else ''}{lost} below {self.resolution:.0e}" if lost else ""
        parts: list[str | ReportTable] = [
            f"{self.kind[0].upper()}{self.kind[1:]}: in a period a small disturbance {self._grows()}.",
            f"In a period {self.forcing}.",
            table,
            f"Floquet multipliers, a factor of the disturbance a period for each direction: {listed}",
            steady_report.contact_words(self.contacts),
            f"After each of Newton's iterations a period changed the state by "
            f"{', '.join(f'{left:.1e}' for left in self.left)} of its magnitude; {self.integrated} periods integrated, "
            f"in {self.segments} segment{'s' if self.segments > 1 else ''}{self._without_newton()}",
        ]
        if self.sooner < self.repeats:
            parts.append(f"The state is there again after {self.sooner} of {self.repeats} periods already.")
        warnings = [*self.notes]
        if self.over is not None:
            parts.append(steady_report.branch_table(self.branches, self.over, self.resolution))
            for branch in self.branches:
                parts.append(steady_report.branch_words(branch))
                warnings += steady_report.grazing_warnings(branch, self.over)
        if self.difference > SAME:
            warnings.append(
                f"{self.turns:g} turns are no period of this machine: at one state the accelerations at both ends "
                f"differ by {rounded(100.0 * self.difference, 2)} %. Loads or rolling elements are elsewhere. "
                "Leave turns away."
            )
        facts = {
            **self._named("period", "turns", "forcing", "repeats", "sooner"),
            "states": rows,
            "multipliers": [steady_report.complex_facts(m) for m in self.multipliers.tolist()],
            **self._named("resolution", "stable", "kind"),
            "contacts": steady_report.contact_facts(self.contacts),
            **self._named("left", "segments", "integrated", "difference"),
            "over": self.over.name if self.over else None,
            "over_unit": self.over.unit if self.over else None,
            "units": {} if self.over is None else dict.fromkeys(("value", "between"), self.over.unit),
            "branches": [steady_report.branch_facts(branch) for branch in self.branches],
        }
        return Report(parts=parts, facts=facts, records=rows, index=("state",), warnings=warnings)


def _figures(_model: AnyModel, found: SteadyState, _parameters: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.branches import draw_branches, draw_multipliers

    yield "multipliers", draw_multipliers(found.multipliers, f"Multipliers: {found.kind.partition(':')[0]}")
    if found.over is not None:
        yield "branches", draw_branches(found.branches, found.over, found.states[0], found.units[0])


@Question(figures=_figures, requires="bearings")
def steady(
    model: AnyModel,
    turns: Turns = None,
    *,
    repeats: Repeats = 1,
    segments: Segments = None,
    transient: Before = 1.0,
    over: Over = None,
    parameters: Mapping[str, float] | None = None,
    rtol: TightRtol = None,
    keep: str | Path | None = None,
    progress: Progress = None,
) -> SteadyState:
    """Find a periodic state by shooting, and say by its multipliers whether it is stable.

    With `over` the state is followed over a parameter: folds, period doublings and Neimark-Sacker points are located,
    and branches of twice the period followed. Unstable states are found as well as stable ones.

    Parameters
    ----------
    parameters : overrides, SI
    keep : folder for what is computed, by which a call that was killed continues; what it kept is deleted at the end
    progress : as for `simulate`

    Raises
    ------
    RequestError
        A scene without states, one whose driver's motion is a state, or one in which what turns has no common period.
    SimulationError
        Newton's iteration does not converge, or the computation failed.

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8
    >>> found = model.steady(parameters=pitch)
    >>> found.states[0], found.start.shape
    ('inner.x', (8,))
    """
    from ballpass.runtime.ask.kept_parts import kept_parts
    from ballpass.runtime.ask.parameter_range import parameter_range
    from ballpass.runtime.contract.defaults import SENSITIVITY
    from ballpass.runtime.motion.contact_sequence import contact_sequence
    from ballpass.runtime.motion.forcing_period import common_period, forcing_period, refuse_free_driver, sampled_turns
    from ballpass.runtime.motion.shooting import Shooting
    from ballpass.runtime.request.locating import kinks_with_derivatives, stepper_for
    from ballpass.runtime.time.repetition import Repetition

    manifest = model.manifest
    # refused here where a scene has none
    _ = stepper_for(model, kinks_with_derivatives(None, manifest), derivatives=True)
    ends = None if over is None else parameter_range(manifest.parameters, "over", over)
    given = {**(parameters or {}), **({ends.name: ends.low} if ends else {})}
    numbers = model.numbers(given)
    refuse_free_driver(manifest, "steady")
    turn = model.period(given)
    with kept_parts(keep, model, given, ends, turns, transient) as parts, shown("shooting", progress) as tell:
        sample = partial(sampled_turns, model, turns=max(transient, 1.0))
        sampled = sample(given)
        if ends is None or turns is not None:
            period = forcing_period(model, numbers, sampled.t, sampled.x, turns)
        else:
            period = common_period(model, given, [ends], sample)
        length = period.time(numbers.values)
        shooting = Shooting(
            model=model,
            parameters=given,
            period=period,
            repeats=repeats,
            segments=segments or 1,
            magnitude=np.array(sampled.statistics.magnitudes),
            rtol=BRANCH_RTOL if rtol is None and ends is not None else rtol,
            over=ends.name if ends else "",
            parts=parts,
            progress=None if tell is None or ends else _of_any_number(tell),
        )
        # a plain period costs a tenth of one with derivatives, and leads most motions near to the state
        whole = max(math.floor(transient * turn / length + 1e-9), 1) if transient and math.isfinite(turn) else 0
        begin = np.array([numbers.values[name] for name in manifest.initial])
        if whole:
            begin = _run(model, given, whole * length, 1).x[-1]
        found, shooting = _solved(shooting, begin, fixed=segments is not None)
        sooner = _sooner(shooting, found)
        if sooner == 1 < repeats and repeats % 2 == 0:
            kicked = _kicked(shooting, found)
            found, sooner = (found, sooner) if kicked is None else (kicked, _sooner(shooting, kicked))
        branches, notes = ((), ()) if ends is None else _branches(shooting, found, ends, tell)
        contacts = contact_sequence(shooting, found.nodes)
    return SteadyState(
        states=tuple(info.name for info in manifest.states),
        units=tuple(info.unit for info in manifest.states),
        descriptions=tuple(info.description for info in manifest.states),
        period=repeats * length,
        turns=repeats * length / turn if math.isfinite(turn) else math.nan,
        forcing=period.words,
        repeats=repeats,
        sooner=sooner,
        start=found.nodes[0],
        begin=Repetition.of(manifest, numbers.values).alike_from,
        multipliers=found.multipliers,
        resolution=SENSITIVITY * sampled.statistics.rtol,
        contacts=contacts,
        left=found.left,
        segments=shooting.segments,
        integrated=found.periods,
        difference=period.difference,
        over=ends,
        branches=branches,
        notes=notes,
    )


def _run(
    model: AnyModel, parameters: Mapping[str, float], duration: float, parts: int, initial: np.ndarray | None = None
) -> Solution:
    """A run without outputs over turns that are alike, from the scene's start if no state there is given, sampled at
    the ends of equal parts."""
    from ballpass.runtime.request.start import state_at
    from ballpass.runtime.time.repetition import Repetition

    numbers = model.numbers(parameters)
    begin = Repetition.of(model.manifest, numbers.values).alike_from
    found: Solution = model.simulate(
        duration=duration if initial is not None else begin + duration,
        parameters=parameters,
        initial=None if initial is None else state_at(model, numbers, begin, initial),
        times=begin + np.linspace(0.0, duration, parts + 1),
        outputs=[],
        transient=0.0,
        progress=False,
    )
    return found


def _of_any_number(tell: Callable[[float], None]) -> Callable[[float], None]:
    """Progress of runs that follow each other: how many is not known, and each takes half of what is left."""
    finished, before = 0, 0.0

    def of_run(done: float) -> None:
        nonlocal finished, before
        finished, before = finished + (done < before), done
        tell(1.0 - 0.5 ** (finished + done))

    return of_run


def _nodes(shooting: Shooting, start: np.ndarray) -> np.ndarray:
    """States at the starts of the segments along a run, shape (segments, states)."""
    if shooting.segments == 1:
        return start[None, :]
    length = shooting.repeats * shooting.period.time(shooting.numbers().values)
    return np.asarray(_run(shooting.model, shooting.parameters, length, shooting.segments, start).x[:-1])


def _solved(shooting: Shooting, begin: np.ndarray, *, fixed: bool) -> tuple[PeriodicState, Shooting]:
    """The state, in more segments where one fails and none were asked for."""
    try:
        return shooting.solve(_nodes(shooting, begin)), shooting
    except SimulationError:
        if fixed:
            raise
    several = replace(shooting, segments=SEGMENTS)
    return several.solve(_nodes(several, begin)), several


def _sooner(shooting: Shooting, found: PeriodicState) -> int:
    """Periods of the equations after which the state is there again: a divisor of those that were asked for."""
    for periods in range(1, shooting.repeats):
        if shooting.repeats % periods == 0:
            part = replace(shooting, repeats=periods, segments=1)
            if part.residual(found.nodes[:1]).size < REPEATS:
                return periods
    return shooting.repeats


def _kicked(shooting: Shooting, found: PeriodicState) -> PeriodicState | None:
    """A state of twice the period beside an unstable one, sought along the direction that doubles it."""
    single = replace(shooting, repeats=1, segments=1)
    values, vectors = np.linalg.eig(single.residual(found.nodes[:1]).monodromy)
    flip = int(np.argmin(np.abs(values + np.abs(values))))
    if values[flip].real > -1.0:
        return None
    along = np.real(vectors[:, flip])
    along *= 1.0 / np.max(np.abs(along / shooting.magnitude))
    for kick in KICKS:
        try:
            other = shooting.solve(_nodes(shooting, found.nodes[0] + kick * along))
        except SimulationError:
            continue
        if _sooner(shooting, other) == shooting.repeats:
            return other
    return None


def _branches(
    shooting: Shooting, found: PeriodicState, over: ParameterRange, tell: Callable[[float], None] | None
) -> tuple[tuple[SteadyBranch, ...], tuple[str, ...]]:
    """The branch of a state, and those of twice the period at its doublings, each once."""
    from ballpass.runtime.motion.continuation import ENDS, MEETS, doubled, follow
    from ballpass.runtime.motion.steady_report import early_end

    ends = (over.low, over.high)
    first = follow(shooting, found, ends[0], ends, progress=tell)
    branches, notes = [first], []
    if first.ended != ENDS[0]:
        notes.append(early_end(first, over))
    left = [point for point in first.special if point.kind == "period doubling"]
    while left:
        point = left.pop(0)
        try:
            branch = doubled(shooting, point, ends)
        except SimulationError as error:
            notes.append(f"The branch of twice the period at {point.value:.6g} was not followed: {error}")
            continue
        branches.append(branch)
        if branch.ended == MEETS and left:  # at another doubling, from which it would be followed back

            def away(other: BranchPoint, last: BranchPoint = branch.points[-1]) -> float:
                shares = (other.nodes - last.nodes) / shooting.magnitude
                return float(np.hypot(np.linalg.norm(shares), (other.value - last.value) / (ends[1] - ends[0])))

            nearest = min((point, *left), key=away)
            left = [other for other in left if other is not nearest]
    return tuple(branches), tuple(notes)
