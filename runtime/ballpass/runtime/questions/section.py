"""A Poincaré section of a long run: states once a turn or a period, and the closed curve where they lie on one.

Of an engine, whose loads repeat after two turns, they are read once in two.

Where drive and cage have no common period, no state repeats.  In a motion that attracts, the state at one angle of the
driver is then a function of where the balls stand: a closed curve, which is fitted by a Fourier series.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from ballpass.runtime.contract.defaults import SECTION_RTOL
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Option, Rtol
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.questions.bifurcation import State
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.report.short_words import short_words
from ballpass.runtime.show.progress import Progress, shown
from ballpass.runtime.show.short import ShortRepr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.motion.invariant_curve import InvariantCurve
    from ballpass.runtime.motion.lyapunov import Exponent

#: Largest distance of points from a curve on which they lie, of any state, in shares of the points' spread.  A chaotic
#: press at a loaded angle comes as near as 0.08 [1].
ON_CURVE = 0.02

#: Most points that repeat and are not a curve: the 134 of the paper's press lie on one.
FEW = 16

#: Rounds of a curve, and moments at which what turns is sought.
PITCH, CAGE, MOMENTS = "ball pitch", "turn of the cage", 40

Section = Annotated[int, Option(words="Points.", shown="N", least=40, most=1_000_000)]
Dropped = Annotated[int, Option(words="Points at the start that do not count.", shown="N", least=0, most=1_000_000)]
Once = Annotated[
    Literal["turn", "period"],
    Option(
        words="A point is taken once a turn, or once in a period of the equations, as `bifurcation` reads them: where "
        "loads are constant, each time a ball passes."
    ),
]
At = Annotated[
    float | None,
    Option(
        words="Angle that driver or shaft has turned since t = 0 at each point; none if not given.",
        shown="ANGLE",
        example='"270 deg"',
        unit="deg",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PoincareSection(ShortRepr, Reported):
    """States of a long run, once a turn.

    Attributes
    ----------
    names, units, descriptions : of the states
    row : of the state that is shown
    angle : of driver or shaft since t = 0 [deg]
    states : points, shape (readings, states)
    turns : of driver or shaft from point to point: one, or as many as all loads repeat after; 0 for a period
    phase : where the balls stand at each point, in parts of `around` from 0 to 1, shape (readings,) [1]
    around : what a round of the curve is: a ball pitch, or a turn of the cage where balls differ
    period : turns after which points repeat, or points where one is taken in a period; 0 where they do not
    curve : fitted over `phase`; None where points repeat, or where more turns than one cage
    others : what turns at a rate of its own besides
    motion, every : name of the motion as `bifurcation` gives it, and the time between its readings in words
    exponent : largest Lyapunov exponent per reading, where the motion is named by it

    Examples
    --------
    >>> found = model.section(readings=100, settling=20, at=270.0)
    >>> found.states.shape, found.kind
    ((100, 8), 'on a closed curve')
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    descriptions: tuple[str, ...]
    row: int
    angle: float
    states: np.ndarray
    turns: int
    phase: np.ndarray
    around: str
    period: int
    curve: InvariantCurve | None
    others: tuple[str, ...]
    motion: str
    every: str
    exponent: Exponent | None

    @property
    def often(self) -> str:
        """How often a point is taken, in words.

        Examples
        --------
        >>> model.section(readings=40).often
        'one a turn'
        """
        return {0: f"one {self.every}", 1: "one a turn"}.get(self.turns, f"one in {self.turns} turns")

    @property
    def kind(self) -> str:
        """What the points are.

        Examples
        --------
        >>> model.section(readings=40, parameters={"bearing.pitch_diameter": 31.75e-3}).kind
        'repeats after 1 turn'
        """
        if self.period:
            return f"repeats after {self.period} {'turn' if self.turns else 'point'}{'' if self.period == 1 else 's'}"
        if not self.turns:
            return self.motion
        if self.curve is None:
            own = f"{' and '.join(self.others)} turn" + (
                " at rates of their own" if self.others[1:] else "s at its own rate"
            )
            return f"not named: {own if self.others else 'several cages turn'}"
        return "on a closed curve" if np.max(self.curve.missed) <= ON_CURVE else "on no smooth curve"

    def _report(self) -> Report:
        missed = self.curve.missed if self.curve is not None else np.full(len(self.names), math.nan)
        records: list[dict[str, Any]] = [
            {
                "state": name,
                "unit": unit,
                "least": float(column.min()),
                "largest": float(column.max()),
                "missed": float(share) if math.isfinite(share) else None,
            }
            for name, unit, column, share in zip(self.names, self.units, self.states.T, missed, strict=True)
        ]
        fitted = self.curve is not None
        off: dict[str, Callable[[Any], str]] = {">off curve": lambda row: f"{rounded(100.0 * row[0]['missed'], 2)} %"}
        table = ReportTable.of(
            zip(records, map(table_unit, self.units), self.descriptions, strict=True),
            {
                "state": lambda row: row[0]["state"],
                ">least": lambda row: f"{row[1][0] * row[0]['least']:z.6g}",
                ">largest": lambda row: f"{row[1][0] * row[0]['largest']:z.6g}",
                "unit": lambda row: row[1][1],
                **(off if fitted else {}),
                "~what": lambda row: short_words(row[2]),
            },
            title=f"{len(self.states)} points, {self.often}, at {self.angle:g} deg: {self.kind}",
        )
        grown = f"; largest exponent per reading {self.exponent.words}" if self.exponent else ""
        parts: list[str | ReportTable] = [table, f"Motion: {self.motion}, read {self.every}{grown}."]
        if self.curve is not None:
            drift = self.curve.drift
            around = f", so that they go round once in {self.turns / abs(drift):.4g} turns" if drift else ""
            harmonics = "1 harmonic" if self.curve.harmonics == 1 else f"{self.curve.harmonics} harmonics"
            parts.append(
                f"From point to point the rolling elements move by {drift:.6g} of a {self.around} beyond whole "
                f"ones{around}. The curve has {harmonics}, fitted to every second point; off curve: how far "
                "the others are from it, in shares of the points' spread."
            )
        if self.kind == "on a closed curve":
            parts.append(
                f"Within {100.0 * ON_CURVE:g} % the state follows the rolling elements. Few points of such a curve "
                "look like separate parts."
            )
        elif self.kind == "on no smooth curve":
            parts.append(
                "The motion is chaotic, not settled, or its curve is finer than these points resolve: its name is that "
                "of its Lyapunov exponent. Take more points, of which the exponent has as many, or another angle (at)."
            )
        facts = {
            **self._named("angle", "turns", "around", "others", "kind", "period", "motion", "every"),
            "exponent": self.exponent.mean if self.exponent else None,
            "exponent_half": self.exponent.half if self.exponent else None,
            "drift": self.curve.drift if self.curve is not None else None,
            "harmonics": self.curve.harmonics if self.curve is not None else None,
            "units": {"angle": "deg", "period": "turns", "points": "SI"},
            "states": records,
            "phase": self.phase.tolist(),
            "points": self.states.tolist(),
        }
        return Report(parts=parts, facts=facts, records=records, index=("state",))


def _figures(_model: AnyModel, found: PoincareSection, _parameters: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.section import draw_section

    curve = found.curve if found.kind == "on a closed curve" else None
    words = f"{len(found.states)} points, {found.often}, {found.angle:g} degrees after t = 0: {found.kind}."
    names = found.names, found.units, found.row
    yield "section", draw_section(found.states, found.phase, found.around if found.turns else "", *names, curve, words)


@Question(samples=True, figures=_figures, requires="bearings")
def section(
    model: AnyModel,
    of: State = None,
    *,
    readings: Section = 400,
    settling: Dropped = 50,
    at: At = None,
    once: Once = "turn",
    parameters: Mapping[str, float] | None = None,
    rtol: Rtol = None,
    progress: Progress = None,
) -> PoincareSection:
    """Take the Poincaré section of a long run, and fit the closed curve on which its points lie.

    A state is read once a turn, always at the same angle; of an engine whose loads repeat after two turns, once in two;
    or once in a period of the equations.
    Points that repeat belong to a periodic motion, points on a closed curve to a quasi-periodic one. The curve is a
    Fourier series over the place of the balls; every second point is left out of the fit and judges it.

    Parameters
    ----------
    parameters : overrides, SI
    progress : as for `simulate`

    Raises
    ------
    RequestError
        An unknown state, a scene without states, one in which nothing turns, one whose driver's motion is a state, or
        points once a period where none is as short as eight turns.
    IntegrationError
        The computation failed.

    Examples
    --------
    >>> found = model.section("inner.x", readings=100, settling=20, at=270.0)
    >>> bool(found.curve.missed.max() < 0.02)  # distance from it over the spread
    True
    """
    from ballpass.runtime.motion.forcing_period import own_phases, refuse_free_driver
    from ballpass.runtime.motion.invariant_curve import fit_curve
    from ballpass.runtime.motion.lyapunov import period_of
    from ballpass.runtime.motion.strobe import strobe_of
    from ballpass.runtime.request.ball_angles import ball_angles
    from ballpass.runtime.time.repetition import Repetition

    manifest = model.manifest
    given = parameters or {}
    numbers = model.numbers(given)
    repetition = Repetition.of(manifest, numbers.values)
    turn, turns, alike = repetition.turn, repetition.turns, repetition.alike_from
    refuse_free_driver(manifest, "section")
    strobe = strobe_of(model, given, (), "section")
    names = tuple(info.name for info in manifest.states)
    step, by_turns = turn * turns, once == "turn"
    if not by_turns:
        if strobe.period is None:
            raise RequestError("section: these equations have no period of eight turns or less. Allowed: once = turn.")
        step, turns = strobe.time(model, given), 0
    state = of or ("inner.y" if "inner.y" in names else names[0])
    angle = 0.0 if at is None else at
    times = alike + step * (settling + np.arange(1, readings + 1)) + turn * angle / 360.0
    begin, end = alike + step * settling, float(times[-1])
    every = np.union1d(times, strobe.sample_times(model, given, begin, end))
    with shown("taking points", progress):
        run = model.simulate(
            duration=end,
            times=every,
            parameters=given,
            rtol=SECTION_RTOL if rtol is None else rtol,
            outputs=[],
            transient=0.0,
            progress=False,
        )
    states = run.x[np.searchsorted(run.t, times)]
    magnitude = np.array(run.statistics.magnitudes)
    period = (turns or 1) * period_of(states, magnitude, FEW)
    phase, around, curve = np.zeros(readings), bearing_words(PITCH, manifest.bearings), None
    others: tuple[str, ...] = ()
    if by_turns and len(manifest.bearings) == 1:
        pick = np.linspace(0, readings - 1, MOMENTS).astype(int)
        others = tuple(own_phases(model, numbers, times[pick], states[pick], turns * turn))
        first = [float(ball_angles(model, numbers, t, x)[0][0]) for t, x in zip(times.tolist(), states, strict=True)]
        rounds = np.array(first) / math.tau
        phase = rounds * manifest.bearings[0].balls
        curve = None if period or others else fit_curve(phase, states)
        if curve is not None and np.max(curve.missed) > ON_CURVE:
            # where a ball differs, all balls are in their places again after a turn of the cage
            whole = fit_curve(rounds, states)
            if np.max(whole.missed) <= ON_CURVE:
                phase, around, curve = rounds, CAGE, whole
    follows = curve is not None and bool(np.max(curve.missed) <= ON_CURVE)
    follows = follows or bool(period_of(states, magnitude))  # a longer period than that of few points
    motion, grown = strobe.name_of(model, given, run, begin, rtol, follows=follows, readings=readings)
    return PoincareSection(
        names=names,
        units=tuple(info.unit for info in manifest.states),
        descriptions=tuple(info.description for info in manifest.states),
        row=names.index(state),
        angle=angle,
        states=states,
        turns=turns,
        phase=phase % 1.0,
        around=around,
        period=period,
        curve=curve,
        others=others,
        motion=motion,
        every=strobe.every,
        exponent=grown,
    )
