"""The least value of a quantity over parameters: bounds, constraints, several starts, kinks."""

from __future__ import annotations

import itertools
import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np

from ballpass.runtime.contract.defaults import OPTIMUM_RTOL
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Cycles, Option, Transient
from ballpass.runtime.contract.units import QuantityError, parse_quantity
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.progress import Progress, shown
from ballpass.runtime.show.short import ShortRepr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.ask.parameter_range import ParameterRange

#: Candidates of which each start is the best; they run in lanes.
CANDIDATES = 8

#: Distance from a kink at which its slopes are verified, in shares of the range [1].
BESIDE = 5e-3

#: Slopes of the search and of the check agree within this share [1].
AGREES = 1e-3

#: Most tolerances; points within their box, beside its corners, of which the worst is taken; further ones that check.
MOST_TOLERANCES, WITHIN, FURTHER = 6, 15, 256

#: A further point that is worse by more is warned of, as a share of the goal [1].
WORSE = 1e-3

#: A constraint, or a bound, is active within this share of its limit, or of the range [1].
ACTIVE = 1e-5

Goal = Annotated[str, Option(words="Quantity to make least, as `peak_ball_force`.", shown="Q")]
Vary = Annotated[
    str | Sequence[str],
    Option(
        words="Parameter and its bounds; `:log` behind them for equal factors. May be repeated.",
        shown="PATH=A:B",
        example='bearing.clearance="0 um:40 um"',
    ),
]
Limits = Annotated[
    str | Sequence[str] | None,
    Option(words="Limit of another quantity. May be repeated.", shown='"Q <= VALUE"', example='"rms:inner.y <= 5 um"'),
]
Tolerance = Annotated[
    str | Sequence[str] | None,
    Option(
        words="Deviations of a parameter from its value: goal and limits are then the worst within all of them. May be "
        "repeated.",
        shown="PATH=A:B",
        example='bearing.clearance="-2 um:2 um"',
    ),
]
Starts = Annotated[int, Option(words="Starts, each the best of eight candidates.", shown="N", least=1, most=100)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A constraint on a quantity.

    Attributes
    ----------
    quantity, unit : its name and unit
    upper : whether the quantity must stay below
    limit : [unit]
    value : at the optimum [unit]
    active : whether it holds the optimum
    multiplier : change of the goal by that of the limit [goal's unit / unit]
    """

    quantity: str
    unit: str
    upper: bool
    limit: float
    value: float = float("nan")
    active: bool = False
    multiplier: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Optimum(ShortRepr, Reported):
    """The least value that was found.

    Attributes
    ----------
    goal, unit : quantity and its unit
    value : least value [unit]
    vary : parameters and their bounds
    x : their values there, SI, shape (parameters,)
    bounds : "first", "second" or "" for each parameter: the end of its range that holds the optimum
    slopes : of the goal by the parameters there, SI; several rows at a kink, one for each smooth part that meets there
    limits : constraints
    verdicts : of the check of the slopes: parameter, verdict
    starts : where each search began and the value where it ended, SI: pairs of tuple and number
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
    value: float
    vary: tuple[ParameterRange, ...]
    x: np.ndarray
    bounds: tuple[str, ...]
    slopes: np.ndarray
    limits: tuple[Limit, ...]
    verdicts: tuple[tuple[str, str], ...]
    starts: tuple[tuple[tuple[float, ...], float], ...]
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
        return len(self.slopes) > 1

    def _report(self) -> Report:
        rows = [
            {
                "parameter": one.name,
                "unit": one.unit,
                "value": value,
                "bound": bound,
                "slopes": self.slopes[:, k].tolist(),
            }
            for k, (one, value, bound) in enumerate(zip(self.vary, self.x.tolist(), self.bounds, strict=True))
        ]
        table = ReportTable(
            title=f"Least {'worst ' if self.tolerances else ''}{self.goal}: {self.value:.9g} {self.unit}",
            heads=("parameter", "value", "unit", "held by", f"slope [{self.unit} per SI unit]"),
            rows=[
                (
                    one.name,
                    f"{value / one.factor:.8g}",
                    one.shown_unit,
                    f"{bound} end" if bound else "",
                    ", ".join(f"{slope:.5g}" for slope in self.slopes[:, k]),
                )
                for k, (one, value, bound) in enumerate(zip(self.vary, self.x.tolist(), self.bounds, strict=True))
            ],
            right=("value",),
        )
        said = [
            f"{limit.quantity} is {limit.value:.6g} {limit.unit}, limit {limit.limit:.6g}: "
            + (
                f"active, multiplier {limit.multiplier:.4g} {self.unit}/({limit.unit})"
                if limit.active
                else "not active"
            )
            for limit in self.limits
        ]
        if self.tolerances:
            deviations = ", ".join(
                f"{one.name} {value / one.factor:+.6g} {one.shown_unit}"
                for one, value in zip(self.tolerances, self.worst, strict=True)
            )
            said.append(
                f"Worst at {deviations}. Without deviations {self.goal} is {self.nominal:.7g} {self.unit}; at "
                f"{FURTHER} more points of the tolerances it is at most {self.further:.7g} {self.unit}."
            )
        if self.kinked:
            said.append(
                f"A kink: {len(self.slopes)} smooth parts meet here, and the goal grows on each side. Slopes are those "
                "of the parts."
            )
        checked = ", ".join(f"{name} {verdict}" for name, verdict in self.verdicts)
        said.append(f"slopes {'beside the kink ' if self.kinked else ''}by a second route: {checked}")
        ends = ", ".join(f"{end:.7g}" for _, end in self.starts)
        said.append(f"{len(self.starts)} start{'s' if len(self.starts) > 1 else ''} ended at {ends} {self.unit}")
        wrong = [name for name, verdict in self.verdicts if verdict == "disagrees"]
        broken = [one.quantity for one in self.limits if _over(one) > ACTIVE]
        fault = ""
        if wrong:
            fault = f"Slopes by {', '.join(wrong)} disagree with the second route: this need not be the least value."
        elif broken:
            fault = f"No values within the bounds keep the limit of {', '.join(broken)}."
        elif not self.converged:
            fault = "The search did not end by itself. Give more starts or narrower bounds."
        warned = []
        if self.further > self.value + WORSE * abs(self.value):
            warned.append(
                f"{self.goal} is {self.further:.6g} {self.unit} at a point within the tolerances at which the search "
                "did not evaluate it: the worst is larger than the value given. Give narrower tolerances."
            )
        facts = {
            "goal": self.goal,
            "unit": self.unit,
            "value": self.value,
            "parameters": rows,
            "kinked": self.kinked,
            "limits": [asdict(one) for one in self.limits],
            "verdicts": [list(pair) for pair in self.verdicts],
            "starts": [{"start": list(start), "end": end} for start, end in self.starts],
            "trace": list(self.trace),
            "converged": self.converged,
            "tolerances": [
                {"parameter": one.name, "low": one.low, "high": one.high, "worst": value}
                for one, value in zip(self.tolerances, self.worst, strict=True)
            ],
            "nominal": self.nominal,
            "further": self.further,
        }
        return Report(
            parts=(table, *said), facts=facts, records=rows, index=("parameter",), warnings=warned, fault=fault
        )


def _over(limit: Limit) -> float:
    """How far a quantity is beyond its limit, as a share of it [1]."""
    beyond = (limit.value - limit.limit) * (1.0 if limit.upper else -1.0)
    return beyond / max(abs(limit.limit), 1e-300)


def read_limit(model: AnyModel, text: str) -> Limit:
    """A constraint from text such as ``rms:inner.y <= 5 um``.

    Raises
    ------
    RequestError
        Another form, an unknown quantity, or a wrong unit.
    """
    from ballpass.runtime.quantity.grammar import quantities_of

    match = re.fullmatch(r"\s*(.+?)\s*(<=|>=)\s*(.+?)\s*", text)
    if match is None:
        raise RequestError(f'subject_to: {text!r:.80} is no limit. Allowed: "Q <= VALUE" or "Q >= VALUE".')
    name, sign, written = match.groups()
    unit = quantities_of(model, [name])[0].unit
    try:
        value = parse_quantity(written, unit) if unit not in ("", "1") else float(written)
    except (QuantityError, ValueError) as error:
        raise RequestError(f"subject_to {name}: {error}") from None
    return Limit(quantity=name, unit=unit, upper=sign == "<=", limit=value)


def _figures(_model: AnyModel, found: Optimum, _parameters: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.optimum import draw_trace

    yield "trace", draw_trace(found.goal, found.unit, found.trace)


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
    starts: Starts = 3,
    transient: Transient = None,
    parameters: Mapping[str, float] | None = None,
    keep: str | Path | None = None,
    progress: Progress = None,
) -> Optimum:
    """Find the least value of a quantity over parameters, also where it has a kink.

    Peaks are the largest of many, so that their least value lies on a kink as a rule. The search works on tangent
    planes of several points at once; slopes are exact, and checked by a second route at the optimum.

    Parameters
    ----------
    parameters : overrides of other parameters, SI
    keep : folder for what is computed, by which a call that was killed continues; deleted at the end
    progress : as for `simulate`

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

    from ballpass.runtime.ask.bundle import Plane, minimize_by_planes
    from ballpass.runtime.ask.kept_parts import kept_parts
    from ballpass.runtime.ask.parameter_range import parameter_range
    from ballpass.runtime.certify.quantity_function import QuantityFunction
    from ballpass.runtime.point.slopes import KinkWarning
    from ballpass.runtime.quantity.grammar import quantities_of

    ranges = tuple(parameter_range(model.manifest, "vary", text) for text in _texts(vary))
    box = tuple(parameter_range(model.manifest, "tolerance", text, deviations=True) for text in _texts(tolerance))
    if len(box) > MOST_TOLERANCES:
        raise RequestError(
            f"tolerance: {len(box)} were given. Allowed: {MOST_TOLERANCES}. Leave out those that matter least (sobol)."
        )
    limits = [read_limit(model, text) for text in _texts(subject_to)]
    names = list(dict.fromkeys([minimize, *(one.quantity for one in limits)]))
    count = len(ranges)
    every = list(dict.fromkeys(one.name for one in (*ranges, *box)))
    lanes, exact = (
        QuantityFunction(
            model, names, every, cycles, transient=transient, parameters=parameters, rtol=OPTIMUM_RTOL, kinks=kinks
        )
        for kinks in (None, "located")
    )
    deviations = _deviations(every, box)
    columns = [0, *(names.index(one.quantity) for one in limits)]
    signs = np.array([1.0, *(1.0 if one.upper else -1.0 for one in limits)])
    offsets = np.array([0.0, *(one.limit for one in limits)])
    shares = Halton(count, scramble=False).random(CANDIDATES * starts + 1)[1:]  # the first is a corner

    def rows_at(share: np.ndarray) -> np.ndarray:
        """Values of all parameters with each deviation, the first with none."""
        x = exact.start.copy()
        x[:count] = [one.at(float(s)) for one, s in zip(ranges, share, strict=True)]
        found: np.ndarray = x + deviations
        return found

    with (
        kept_parts(keep, model, names, every, cycles, transient, parameters, OPTIMUM_RTOL, deviations) as parts,
        shown("searching", progress) as tell,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", KinkWarning)  # the search is made for kinks
        (first,) = parts.once(shares, lambda: (lanes(np.array([rows_at(share) for share in shares])),))
        scaled = signs * (first[..., columns] - offsets)
        sizes = np.array([float(np.median(np.abs(first[..., 0]))), *(abs(one.limit) for one in limits)])
        sizes = np.maximum(sizes, 1e-300)

        def worst_at(share: np.ndarray) -> np.ndarray:
            """The deviation with the worst value of goal and each limit."""
            if len(deviations) == 1:
                return np.zeros(len(columns), dtype=int)
            found: np.ndarray = np.argmax(signs * lanes(rows_at(share))[:, columns], axis=0)
            return found

        def exactly(share: np.ndarray) -> tuple[np.ndarray, ...]:
            which = worst_at(share)
            rows, place = np.unique(which, return_inverse=True)
            x = rows_at(share)[rows]
            return exact(x)[place, columns], exact.jacobian(x)[place, columns, :count], which

        def evaluate(share: np.ndarray) -> Plane:
            values, slopes, _ = parts.once(share, lambda: exactly(share))
            by_share = np.array([one.slope(float(s)) for one, s in zip(ranges, share, strict=True)])
            size = (signs / sizes)[:, None]
            return Plane(x=share, values=signs * (values - offsets) / sizes, slopes=size * slopes * by_share)

        merits = [
            Plane(x=s, values=v, slopes=v).merit for s, v in zip(shares, (scaled / sizes).max(axis=1), strict=True)
        ]
        found = []
        for block in range(starts):
            at = CANDIDATES * block + int(np.argmin(merits[CANDIDATES * block : CANDIDATES * (block + 1)]))
            found.append((shares[at], minimize_by_planes(evaluate, shares[at])))
            if tell is not None:
                tell((block + 1) / (starts + 1))
        _, least = min(found, key=lambda pair: pair[1].best.merit)
        best = least.best
        sides = least.sides if len(least.sides) > 1 else (best,)
        verdicts: dict[str, str] = {}
        for side in sides:
            away = side.x - best.x
            there = best.x if len(sides) == 1 else best.x + BESIDE * away / max(float(np.max(np.abs(away))), 1e-300)
            there = np.clip(there, 0.0, 1.0)
            row = rows_at(there)[worst_at(there)[0]]
            taken = exact.jacobian(row)[0]
            for pair in exact.certify(row, progress=False).pairs:
                if pair.quantity != minimize or pair.parameter not in every[:count]:
                    continue
                slope = float(taken[every.index(pair.parameter)])
                agrees = abs(slope - pair.by_steps) <= AGREES * abs(slope)
                if verdicts.get(pair.parameter) != "disagrees":
                    verdicts[pair.parameter] = pair.check.verdict.value if agrees else "disagrees"
        rows = rows_at(best.x)
        worst = deviations[worst_at(best.x)[0]]
        nominal, further = float(best.values[0] * sizes[0]), math.nan
        if box:
            spread = Halton(len(box), scramble=False).random(FURTHER + WITHIN + 1)[WITHIN + 1 :]
            nominal = float(exact(rows[0])[0])
            further = float(np.max(lanes(rows[0] + _placed(every, box, spread))[:, 0]))
    size = sizes[0]
    by_share = np.array([one.slope(float(s)) for one, s in zip(ranges, best.x, strict=True)])
    return Optimum(
        goal=minimize,
        unit=quantities_of(model, [minimize])[0].unit,
        value=float(best.values[0] * size),
        vary=ranges,
        x=rows[0, :count],
        bounds=tuple("first" if s < ACTIVE else "second" if s > 1.0 - ACTIVE else "" for s in best.x.tolist()),
        slopes=np.array([side.slopes[0] * size / by_share for side in sides]),
        limits=tuple(
            replace(
                one,
                value=float(one.limit + signs[k] * best.values[k] * sizes[k]),
                active=bool(abs(best.values[k]) < ACTIVE),
                multiplier=-float(signs[k] * least.multipliers[k - 1] * size / sizes[k]),
            )
            for k, one in enumerate(limits, start=1)
        ),
        verdicts=tuple(verdicts.items()),
        starts=tuple((tuple(rows_at(s)[0, :count].tolist()), float(one.best.values[0] * size)) for s, one in found),
        trace=tuple(float(one.values[0] * size) for one in least.trace),
        converged=least.converged,
        tolerances=box,
        worst=tuple(float(worst[every.index(one.name)]) for one in box),
        nominal=nominal,
        further=further,
    )


def _texts(given: str | Sequence[str] | None) -> list[str]:
    return [given] if isinstance(given, str) else list(given or [])


def _deviations(names: Sequence[str], box: Sequence[ParameterRange]) -> np.ndarray:
    """Deviations of all parameters: none, the corners of the box, and points within, shape (points, parameters)."""
    from scipy.stats.qmc import Halton

    if not box:
        return np.zeros((1, len(names)))
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=len(box))))
    within = Halton(len(box), scramble=False).random(WITHIN + 1)[1:]
    return np.concatenate([np.zeros((1, len(names))), _placed(names, box, np.concatenate([corners, within]))])


def _placed(names: Sequence[str], box: Sequence[ParameterRange], shares: np.ndarray) -> np.ndarray:
    """Deviations of all parameters from shares of the box."""
    found = np.zeros((len(shares), len(names)))
    for one, column in zip(box, shares.T, strict=True):
        found[:, names.index(one.name)] = one.low + column * (one.high - one.low)
    return found
