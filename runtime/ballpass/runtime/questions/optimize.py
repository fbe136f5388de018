"""The least value of a quantity over parameters: bounds, constraints, several starts, kinks."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Cycles, Option, Transient
from ballpass.runtime.contract.units import printed_unit, ratio_unit, table_unit
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.progress import shown_steps
from ballpass.runtime.show.short import ShortRepr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.ask.limits import Limit
    from ballpass.runtime.ask.parameter_range import ParameterRange
    from ballpass.runtime.search.bundle import BundleMinimum

#: Candidates for each start beside the corners of the ranges; they run in lanes.  Values of a sweep over one range.
CANDIDATES, SWEPT = 8, 33

#: Runs with derivatives that a search takes, more or less: for what is said before it starts.
EACH = 20

#: Without effect is what changes the goal by a smaller share of it over its whole range, by all slopes seen [1].
NOTHING = 1e-9

#: Most tolerances: the corners of their box are all taken.  Of more ranges no corners are candidates.
MOST_TOLERANCES = 6

#: Starts are so far apart in one parameter or more, as a share of its range, where there are such [1].
APART = 0.2

#: A further point that is worse by more is warned of, as a share of the goal [1].
WORSE = 1e-3

#: A constraint, or a bound, is active within this share of its limit, or of the range [1].
ACTIVE = 1e-5

Goal = Annotated[
    str,
    Option(
        words="Quantity to make least, as `peak_ball_force`; with a minus in front to make it largest: `-life`.",
        shown="Q",
        names=option_names.goals,
    ),
]
Vary = Annotated[
    str | Sequence[str],
    option_names.ranged(
        "Parameter and its bounds; `:log` behind them for equal factors. May be repeated.",
        'bearing.clearance="0 um:40 um"',
    ),
]
Limits = Annotated[
    str | Sequence[str] | None,
    Option(
        words="Limit of another quantity. May be repeated.",
        shown='"Q <= VALUE"',
        example='"rms:inner.y <= 5 um"',
        names=option_names.limits,
    ),
]
Tolerance = Annotated[
    str | Sequence[str] | None,
    option_names.ranged(
        "Deviations of a parameter from its value: goal and limits are then the worst within all of them. May be "
        "repeated.",
        'bearing.clearance="-2 um:2 um"',
        deviations=True,
    ),
]
Search = Annotated[
    Literal["planes", "slsqp", "ipopt"],
    Option(
        words="Tangent planes of several points at once; or SLSQP or IPOPT, for smooth goals of many parameters, and "
        "planes from where it ends."
    ),
]
Starts = Annotated[
    int,
    Option(
        words="Most starts: over one range the least values of a sweep that lie between larger ones; else the best "
        "candidates that are apart, of eight for each and the corners of the bounds.",
        shown="N",
        least=1,
        most=100,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Optimum(ShortRepr, Reported):
    """The least value that was found, or the largest.

    Attributes
    ----------
    goal, unit : quantity and its unit
    largest : whether the largest value was asked for
    value : least value, or the largest [unit]
    vary : parameters and their bounds
    x : their values there, SI, shape (parameters,)
    bounds : "first", "second" or "" for each parameter: the end of its range that holds the optimum
    slopes : of the goal by the parameters there, SI; several rows at a kink or jump, one for each part that meets there
    kind : ``smooth``, ``kink`` where parts meet, or ``jump``: seen from both sides, and from nearer ones
    beside : values of the goal on both sides of a jump, else empty [unit]
    idle : parameters without effect on the goal
    limits : constraints
    verdicts : of the check of the slopes: parameter, verdict
    starts : where each search began and the value where it ended, SI: pairs of tuple and number
    kept : whether each of them ended where all limits are kept
    trace : values of the goal of the best search, in order [unit]
    converged : whether the search ended by itself
    tolerances : deviations within which all values are the worst; none for values without deviations
    worst : the deviations where the goal is worst, SI
    nominal : the goal without deviations [unit]
    further : the worst goal at points of the box that the search did not see; NaN without tolerances [unit]

    Examples
    --------
    >>> clearance = "bearing.clearance=5 um:15 um"
    >>> found = model.optimize("rms:inner.y", clearance, cycles=3, starts=1)
    >>> found.bounds, found.kinked
    (('first',), False)
    """

    goal: str
    unit: str
    largest: bool
    value: float
    vary: tuple[ParameterRange, ...]
    x: np.ndarray
    bounds: tuple[str, ...]
    slopes: np.ndarray
    kind: str
    beside: tuple[float, ...]
    idle: tuple[str, ...]
    limits: tuple[Limit, ...]
    verdicts: tuple[tuple[str, str], ...]
    starts: tuple[tuple[tuple[float, ...], float], ...]
    kept: tuple[bool, ...]
    trace: tuple[float, ...]
    converged: bool
    tolerances: tuple[ParameterRange, ...]
    worst: tuple[float, ...]
    nominal: float
    further: float

    @property
    def kinked(self) -> bool:
        """Whether smooth parts meet at the optimum, none of which is least there.

        Examples
        --------
        >>> clearance = "bearing.clearance=5 um:15 um"
        >>> model.optimize("rms:inner.y", clearance, cycles=3, starts=1).kinked
        False
        """
        return self.kind == "kink"

    @property
    def _most(self) -> str:
        return "largest" if self.largest else "least"

    def _report(self) -> Report:
        rows = [
            {
                "parameter": one.name,
                "unit": one.unit,
                "value": value,
                "bound": bound,
                "slopes": self.slopes[:, k].tolist(),
                "units": {"slopes": ratio_unit(self.unit, one.unit)},
            }
            for k, (one, value, bound) in enumerate(zip(self.vary, self.x.tolist(), self.bounds, strict=True))
        ]
        factor, unit = table_unit(self.unit)
        table = ReportTable.of(
            zip(self.vary, rows, strict=True),
            {
                "parameter": lambda row: row[0].name,
                ">value": lambda row: f"{row[1]['value'] / row[0].factor:.8g}",
                "unit": lambda row: printed_unit(row[0].shown_unit),
                "held by": lambda row: f"{row[1]['bound']} end" if row[1]["bound"] else "",
                f"slope [{unit} per that unit]": lambda row: ", ".join(
                    f"{factor * row[0].factor * slope:.5g}" for slope in row[1]["slopes"]
                ),
            },
            title=f"{self._most.capitalize()} {'worst ' if self.tolerances else ''}{self.goal}: "
            f"{factor * self.value:.9g} {unit}",
        )
        said = []
        if any(self.bounds):
            said.append(
                f"held by: the end of the given range at which the {self._most} value lies; beyond it, it is "
                f"{'larger' if self.largest else 'smaller'}"
            )
        for limit in self.limits:
            its, its_unit = table_unit(limit.unit)
            otherwise = "not kept" if limit.beyond > ACTIVE else "not active"
            multiplier = f"active, multiplier {limit.multiplier * factor / its:.4g} {unit}/({its_unit})"
            said.append(
                f"{limit.quantity} is {its * limit.value:.6g} {its_unit}, limit {its * limit.limit:.6g}: "
                + (multiplier if limit.active else otherwise)
            )
        if self.tolerances:
            from ballpass.runtime.certify.worst_values import FURTHER

            deviations = ", ".join(
                f"{one.name} {value / one.factor:+.6g} {printed_unit(one.shown_unit)}"
                for one, value in zip(self.tolerances, self.worst, strict=True)
            )
            said.append(
                f"Worst at {deviations}. Without deviations {self.goal} is {factor * self.nominal:.7g} {unit}; at "
                f"{FURTHER} more points of the tolerances it is at {'least' if self.largest else 'most'} "
                f"{factor * self.further:.7g} {unit}."
            )
        if self.kinked:
            said.append(
                f"A kink: {len(self.slopes)} smooth parts meet here, and the goal "
                f"{'falls' if self.largest else 'grows'} on each side. Slopes are those of the parts."
            )
        if self.kind == "jump":
            ends = " and ".join(f"{factor * value:.6g}" for value in self.beside)
            said.append(f"A jump: on its two sides, as near as a millionth of the range, the goal is {ends} {unit}.")
        if self.idle:
            said.append(f"Without effect on {self.goal}, so that any value is as good: {', '.join(self.idle)}.")
        checked = ", ".join(f"{name} {verdict}" for name, verdict in self.verdicts if name not in self.idle)
        if checked:
            beside = "" if self.kind == "smooth" else f"beside the {self.kind} "
            said.append(f"slopes {beside}by a second route: {checked}")
        ends = ", ".join(
            f"{factor * end:.7g}{'' if kept else ' (a limit not kept)'}"
            for (_, end), kept in zip(self.starts, self.kept, strict=True)
        )
        said.append(f"{len(self.starts)} start{'s' if len(self.starts) > 1 else ''} ended at {ends} {unit}")
        wrong = [name for name, verdict in self.verdicts if verdict == "disagrees"]
        broken = [one.quantity for one in self.limits if one.beyond > ACTIVE]
        fault = ""
        if wrong:
            fault = (
                f"Slopes by {', '.join(wrong)} disagree with the second route: this need not be the {self._most} value."
            )
        elif broken:
            fault = f"The search found no values within the bounds that keep the limit of {', '.join(broken)}."
        elif not self.converged:
            fault = "The search did not end by itself. Give more starts, narrower bounds, or another search: slsqp."
        warned = []
        if self.kind == "jump":
            warned.append(
                f"{self.goal} jumps at this point, and is another one a little beside it. Give a tolerance, of which "
                "the worst counts, or move the bounds off the jump."
            )
        worse = (self.value - self.further) if self.largest else (self.further - self.value)
        if worse > WORSE * abs(self.value):
            warned.append(
                f"{self.goal} is {factor * self.further:.6g} {unit} at a point within the tolerances at which the "
                "search did not evaluate it: worse than the value given. Give narrower tolerances."
            )
        facts = {
            **self._named("goal", "unit", "largest", "value"),
            "parameters": rows,
            **self._named("kinked", "kind", "beside", "idle"),
            "limits": [asdict(one) for one in self.limits],
            "verdicts": [list(pair) for pair in self.verdicts],
            "starts": [
                {"start": list(start), "end": end, "kept": kept}
                for (start, end), kept in zip(self.starts, self.kept, strict=True)
            ],
            **self._named("trace", "converged"),
            "tolerances": [
                {"parameter": one.name, "low": one.low, "high": one.high, "worst": value}
                for one, value in zip(self.tolerances, self.worst, strict=True)
            ],
            **self._named("nominal", "further"),
        }
        return Report(
            parts=(table, *said), facts=facts, records=rows, index=("parameter",), warnings=warned, fault=fault
        )


def _figures(_model: AnyModel, found: Optimum, _parameters: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.optimum import draw_trace

    yield "trace", draw_trace(found.goal, found.unit, found.trace, largest=found.largest)


def _best(found: Optimum) -> dict[str, float]:
    return dict(zip((one.name for one in found.vary), found.x.tolist(), strict=True))


@Question(stage="search", figures=_figures, needs="scipy", steady=_best)
def optimize(
    model: AnyModel,
    minimize: Goal,
    vary: Vary,
    cycles: Cycles = None,
    *,
    subject_to: Limits = None,
    tolerance: Tolerance = None,
    search: Search = "planes",
    starts: Starts = 3,
    transient: Transient = None,
    parameters: Mapping[str, float] | None = None,
    keep: str | Path | None = None,
    progress: Callable[[str, float], None] | bool | None = None,
) -> Optimum:
    """Find the least or largest value of a quantity over parameters, also where it has a kink.

    Peaks are the largest of many, so that their least value lies on a kink as a rule. The search works on tangent
    planes of several points at once; slopes are exact, and checked by a second route at the optimum.

    Parameters
    ----------
    parameters : overrides of other parameters, SI
    keep : folder for what is computed, by which a call that was killed continues; what it kept is deleted at the end
    progress : as for `simulate`, but a function is called with words as well: what the search takes, before it starts

    Raises
    ------
    RequestError
        Unknown names, wrong bounds or limits, or a law whose force jumps.
    SimulationError
        A run failed, or its motion is chaotic, so that nothing has a slope.

    Examples
    --------
    >>> clearance = "bearing.clearance=5 um:15 um"
    >>> found = model.optimize("rms:inner.y", clearance, cycles=3, starts=1)
    >>> f"{found.x[0]:.1e}"  # [m]
    '5.0e-06'
    """
    from scipy.stats.qmc import Halton

    from ballpass.runtime.ask.kept_parts import kept_parts
    from ballpass.runtime.ask.limits import read_limits
    from ballpass.runtime.ask.parameter_range import parameter_range
    from ballpass.runtime.certify.quantity_function import UnknownValueWarning
    from ballpass.runtime.certify.worst_values import WorstValues
    from ballpass.runtime.point.slopes import KinkWarning
    from ballpass.runtime.quantity.grammar import quantities_of
    from ballpass.runtime.search.bundle import BOX, minimize_by_planes, seen_from_both_sides
    from ballpass.runtime.search.interior_point import minimize_by_ipopt
    from ballpass.runtime.search.sequential_programs import minimize_by_slsqp

    ranges = tuple(parameter_range(model.manifest.parameters, "vary", text) for text in _texts(vary))
    box = tuple(
        parameter_range(model.manifest.parameters, "tolerance", text, deviations=True) for text in _texts(tolerance)
    )
    if len(box) > MOST_TOLERANCES:
        raise RequestError(
            f"tolerance: {len(box)} were given. Allowed: {MOST_TOLERANCES}. Leave out those that matter least (sobol)."
        )
    varied = [one.name for one in (*ranges, *box)]
    limits = read_limits(model.manifest, "subject_to", _texts(subject_to), model, parameters, varied)
    goal, largest = minimize.removeprefix("-"), minimize.startswith("-")
    worst = WorstValues(
        *(model, goal, limits, ranges, box),
        largest=largest,
        cycles=cycles,
        transient=transient,
        parameters=parameters,
    )
    count = len(ranges)
    shares = np.linspace(0.0, 1.0, SWEPT)[:, None]
    if count > 1:
        shares = Halton(count, scramble=False).random(CANDIDATES * starts + 1)[1:]  # the first is a corner
        if count <= MOST_TOLERANCES:
            shares = np.concatenate([shares, list(itertools.product((0.0, 1.0), repeat=count))])
    within = partial(minimize_by_planes, box=1.0 / (SWEPT - 1) if count == 1 else BOX)
    searches: dict[str, Callable[..., BundleMinimum]] = {"slsqp": minimize_by_slsqp, "ipopt": minimize_by_ipopt}
    minimized = searches.get(search, within)
    with (
        kept_parts(keep, model, *worst.decides) as parts,
        shown_steps("running candidates", progress) as tell,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", KinkWarning)  # the search is made for kinks
        warnings.simplefilter("ignore", UnknownValueWarning)  # a candidate without values is none
        if tell is not None:
            tell(f"{len(shares) * worst.runs} runs without derivatives", 0.0)
        merits = worst.candidates(shares, parts)
        begun = _valleys(shares, merits) if count == 1 else _apart(shares[np.argsort(merits, kind="stable")], starts)
        begun = begun[:starts]
        plane = cache(lambda share: worst.plane(np.array(share), parts))
        started = perf_counter()
        plane(tuple(begun[0]))
        runs = EACH * len(begun)
        found: list[tuple[np.ndarray, BundleMinimum]] = []
        words = f"some {runs} runs with derivatives, {max(runs * (perf_counter() - started), 0.1):.1g} s more or less"
        for start in begun:
            if tell is not None:
                tell(words, len(found) / (len(begun) + 1))
            found.append((start, minimized(lambda share: plane(tuple(share)), start)))
        least = min((one for _, one in found), key=lambda one: one.best.merit)
        least = seen_from_both_sides(lambda share: plane(tuple(share)), least)
        best, sizes = least.best, worst.sizes
        verdicts = worst.verdicts(least)
        deviations = worst.worst_deviations(best.x)
        nominal, further = float(best.values[0] * sizes[0]), math.nan
        if box:
            nominal, further = worst.without_deviations(best.x), worst.worst_of_further(best.x)
    idle = np.max([np.abs(plane.slopes[0]) for _, one in found for plane in one.trace], axis=0) < NOTHING
    slopes = [side.slopes[0] * sizes[0] / worst.by_share(best.x) for side in least.sides]
    return Optimum(
        goal=goal,
        unit=quantities_of(model, [goal])[0].unit,
        largest=largest,
        value=float(best.values[0] * sizes[0]),
        vary=ranges,
        x=worst.at(best.x),
        bounds=tuple(
            "first" if s < ACTIVE else "second" if s > 1.0 - ACTIVE else ""
            for s in np.where(idle, 0.5, best.x).tolist()
        ),
        slopes=np.array(slopes),
        kind=least.kind,
        beside=tuple(float(one.values[0] * sizes[0]) for one in least.sides) if least.kind == "jump" else (),
        idle=tuple(one.name for one, none in zip(ranges, idle.tolist(), strict=True) if none),
        limits=tuple(
            replace(
                one,
                value=float(one.limit + one.sign * best.values[k] * sizes[k]),
                active=bool(abs(best.values[k]) < ACTIVE),
                beyond=float(best.values[k]),
                multiplier=-float(one.sign * least.multipliers[k - 1] * sizes[0] / sizes[k]),
            )
            for k, one in enumerate(limits, start=1)
        ),
        verdicts=tuple(verdicts.items()),
        starts=tuple((tuple(worst.at(s).tolist()), float(one.best.values[0] * sizes[0])) for s, one in found),
        kept=tuple(bool(np.all(one.best.values[1:] <= ACTIVE)) for _, one in found),
        trace=tuple(float(one.values[0] * sizes[0]) for one in least.trace),
        converged=least.converged,
        tolerances=box,
        worst=deviations,
        nominal=nominal,
        further=further,
    )


def _valleys(points: np.ndarray, merits: np.ndarray) -> np.ndarray:
    """The points of a sweep that are less than those on both sides, the least first.

    Those are left out that would not be the least if they fell once more by what they lie below their neighbours.
    """
    before, behind = np.append(np.inf, merits[:-1]), np.append(merits[1:], np.inf)
    lowest = np.flatnonzero((merits < behind) & (merits <= before))
    beside = np.stack([before, behind])[:, lowest]
    above = np.max(np.where(np.isfinite(beside), beside, -np.inf), axis=0)
    could = 2.0 * merits[lowest] - np.where(np.isfinite(above), above, np.inf) <= np.min(merits)
    lowest = lowest[could]
    return np.asarray(points[lowest[np.argsort(merits[lowest], kind="stable")]])


def _apart(points: np.ndarray, count: int) -> np.ndarray:
    """The first points of which none is near another one, and the first others where there are too few."""
    chosen: list[int] = []
    for k, point in enumerate(points):
        if len(chosen) < count and all(np.max(np.abs(point - points[other])) >= APART for other in chosen):
            chosen.append(k)
    others = [k for k in range(len(points)) if k not in chosen]
    return points[[*chosen, *others][:count]]


def _texts(given: str | Sequence[str] | None) -> list[str]:
    return [given] if isinstance(given, str) else list(given or [])
