"""Which tolerances matter: shares of the inputs in the variance of quantities, and how many members keep limits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Cycles, Option, Transient
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.optimize import Limits
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.progress import Progress
from ballpass.runtime.show.short import ShortRepr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.shares.variance_shares import VarianceShare

#: Differences below this share of a value are rounding [1].
ROUNDING = 1e-12

#: Of a share whose interval is wider no digit is given [1].
UNKNOWN = 0.6

#: Quantiles in the report.
QUANTILES = (0.05, 0.5, 0.95)

Of = Annotated[str | Sequence[str] | None, option_names.quantity("Quantity, as `peak_ball_force`. May be repeated.")]
Spread = Annotated[
    str | Sequence[str],
    Option(
        words="Parameter and its distribution: bounds, with `:log` behind them for equal factors, or one of SciPy. "
        "May be repeated.",
        shown="PATH=DISTRIBUTION",
        example='bearing.clearance="norm:loc=10 um:scale=1 um"',
        names=option_names.distributions,
    ),
]
Samples = Annotated[
    int,
    Option(words="Base samples N, a power of two; there are N (inputs + 2) members.", shown="N", least=16, most=2**20),
]
WithIndices = Annotated[
    bool,
    Option(
        words="Compute the inputs' shares; without them there are N members, for limits and quantiles.",
        flags=("--indices/--no-indices",),
    ),
]
Seed = Annotated[int, Option(words="Seed of all random numbers.", shown="N", least=0, most=2**31)]


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptLimit:
    """How many members keep a limit.

    Attributes
    ----------
    words : the limit
    kept, members : members that keep it, and all that have a result
    share, low, high : their ratio, and its 95 % interval by Wilson

    Examples
    --------
    >>> clearance, limit = "bearing.clearance=5 um:15 um", "peak_ball_force <= 9 kN"
    >>> found = model.sobol(clearance, limit=limit, cycles=3, samples=32, indices=False)
    >>> found.limits[0].kept, found.limits[0].words
    (32, 'peak_ball_force <= 9000 N')
    """

    words: str
    kept: int
    members: int
    share: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpreadQuantity:
    """A quantity over the inputs.

    Attributes
    ----------
    name, unit : of the quantity
    mean, deviation, least, most : over the base members
    quantiles : at 5, 50 and 95 %
    shares : of the inputs in its variance, in their order; empty where none were asked for

    Examples
    --------
    >>> clearance = "bearing.clearance=5 um:15 um"
    >>> found = model.sobol(clearance, "rms:inner.y", cycles=3, samples=32, indices=False)
    >>> peak = found.quantities[0]
    >>> peak.least < peak.quantiles[1] < peak.most, peak.unit
    (True, 'm')
    """

    name: str
    unit: str
    mean: float
    deviation: float
    least: float
    most: float
    quantiles: tuple[float, ...]
    shares: tuple[VarianceShare, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class DrawnAnswer(ShortRepr, Reported):
    """What was drawn, and how many members have results.

    Attributes
    ----------
    inputs : parameters that vary
    distributions : of the inputs, in words
    seed, members : seed, members in all
    failed : members without results, and `fault` of the first
    infinite : quantities that are infinite in some members, in words
    """

    inputs: tuple[str, ...]
    distributions: tuple[str, ...]
    seed: int
    members: int
    failed: int
    fault: str
    infinite: tuple[str, ...]

    def _warnings(self) -> list[str]:
        from ballpass.runtime.shares.variance_shares import wilson

        if not self.failed:
            return [*self.infinite]
        low, high = (rounded(100.0 * end, 2) for end in wilson(self.failed, self.members))
        return [
            *self.infinite,
            f"{self.failed} of {self.members} members have no result ({low} to {high} %). They were left out with "
            "those that they are compared with: all numbers are of inputs that can be simulated. The first: "
            f"{self.fault}",
        ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SobolAnswer(DrawnAnswer):
    """Quantities over uncertain inputs.

    Attributes
    ----------
    inputs : parameters that vary
    distributions : of the inputs, in words
    quantities : spread and shares of each
    limits : how many members keep each
    samples, seed, members : base samples, seed, members in all
    failed : members without results, and `fault` of the first
    infinite : quantities that are infinite in some members, in words
    base : values of the inputs of the base members, shape (base members, inputs)
    values : of the quantities there, NaN for members without results, shape (base members, quantities)

    Examples
    --------
    >>> vary = ["bearing.clearance=5 um:15 um", "mechanism.bodies.slider.mass=16 kg:17 kg"]
    >>> found = model.sobol(vary, "peak_ball_force", cycles=3, samples=32)
    >>> found.members, found.quantities[0].shares[0].total > 0.9
    (128, True)
    """

    quantities: tuple[SpreadQuantity, ...]
    limits: tuple[KeptLimit, ...]
    samples: int
    base: np.ndarray
    values: np.ndarray

    def _report(self) -> Report:
        from ballpass.runtime.shares.drawn_members import fault_of
        from ballpass.runtime.shares.variance_shares import FEWEST

        parts: list[Any] = []
        rows = []
        for one in self.quantities:
            factor, unit = table_unit(one.unit)
            numbers = (one.mean, one.deviation, *one.quantiles, one.least, one.most)
            rows.append((one.name, *(rounded(factor * number) for number in numbers), unit))
        right = ("mean", "deviation", "5 %", "50 %", "95 %", "least", "most")
        heads = ("quantity", *right, "unit")
        parts.append(ReportTable(title=f"{self.members} members", heads=heads, rows=rows, right=right))
        records = []
        for one in self.quantities:
            borne = [share.borne for share in one.shares]
            ranked = sorted(zip(self.inputs, borne, strict=False), key=lambda pair: -pair[1].total)
            shares = ("total share", "first-order share")
            cells = [
                (name, _interval(s.total, s.total_low, s.total_high), _interval(s.first, s.first_low, s.first_high))
                for name, s in ranked
            ]
            if ranked:
                title = f"Shares in the variance of {one.name}, with 95 % intervals"
                caption = (
                    "Total: what is left of the variance where all other inputs are known. First-order: what it loses "
                    "where this one is known. Not known: the interval leaves no digit; take more samples."
                )
                parts.append(ReportTable(title=title, heads=("input", *shares), rows=cells, caption=caption))
            records += [{"quantity": one.name, "input": name, **asdict(s)} for name, s in ranked]
            if not _varies(np.array([one.least, one.most])):
                parts.append(f"{one.name} is the same in all members: no input has a share in its variance.")
        for limit in self.limits:
            parts.append(
                f"{limit.words}: kept by {limit.kept} of {limit.members} members, {100.0 * limit.share:.4g} % (95 % "
                f"interval {100.0 * limit.low:.4g} to {100.0 * limit.high:.4g} %)"
            )
        facts = {
            **self._named("inputs", "distributions"),
            "quantities": [asdict(one) for one in self.quantities],
            "limits": [asdict(one) | {"units": {"low": "1", "high": "1"}} for one in self.limits],
            **self._named("samples", "seed", "members", "failed"),
            "first_fault": self.fault,
        }
        known = all(share.rows >= FEWEST for one in self.quantities for share in one.shares)
        return Report(
            parts=tuple(parts),
            facts=facts,
            records=records,
            index=("quantity", "input"),
            warnings=self._warnings(),
            fault=fault_of(self.failed, self.members, known),
        )


def _interval(value: float, low: float, high: float) -> str:
    """A share with the digits that its interval bears: in the last one the interval is ten wide or less."""
    if not high - low <= UNKNOWN:
        return f"not known  ({low:.2f} to {high:.2f})"
    digits = int(np.clip(math.ceil(-math.log10(max(high - low, 1e-300))), 1, 3))
    return f"{value:.{digits}f}  ({low:.{digits + 1}f} to {high:.{digits + 1}f})"


def _figures(_model: AnyModel, found: SobolAnswer, _parameters: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.shares import draw_shares

    for k, one in enumerate(found.quantities):
        name = "sobol" if k == 0 else f"sobol_{k + 1}"
        yield name, draw_shares(one.name, one.unit, found.inputs, [s.borne for s in one.shares], found.values[:, k])


def _varies(values: np.ndarray) -> bool:
    """Whether values differ by more than rounding, or are unknown."""
    return not np.ptp(values) <= ROUNDING * np.max(np.abs(values))


def _check(values: Mapping[str, Any]) -> None:
    samples = values["samples"]
    if samples & (samples - 1):
        near = 2 ** round(math.log2(samples))
        raise RequestError(f"samples: {samples} is no power of two. Allowed: 16, 32, 64, ... Give {near}.")
    if not values["of"] and not values["limit"]:
        raise RequestError('of: no quantity was named. Give one (--of), or a limit of one (--limit "Q <= VALUE").')


@Question(figures=_figures, needs="scipy", check=_check)
def sobol(
    model: AnyModel,
    vary: Spread,
    of: Of = None,
    cycles: Cycles = None,
    *,
    limit: Limits = None,
    samples: Samples = 256,
    indices: WithIndices = True,
    seed: Seed = 1,
    transient: Transient = None,
    parameters: Mapping[str, float] | None = None,
    keep: str | Path | None = None,
    progress: Progress = None,
) -> SobolAnswer:
    """Find which uncertain inputs make a quantity vary, and how many members keep limits.

    Members are drawn from the distributions of the inputs, as points of a scrambled Sobol' sequence, and run in lanes.
    A member without a result is left out with those that it is compared with, and counted.

    Parameters
    ----------
    parameters : overrides of other parameters, SI
    keep : folder for members that were run, by which a killed call continues; what it kept is deleted at the end
    progress : as for `simulate`

    Raises
    ------
    RequestError
        Unknown names, wrong distributions or limits.

    Examples
    --------
    >>> clearance = "bearing.clearance=norm:loc=10 um:scale=1 um"
    >>> limit = "peak_ball_force <= 4.4 kN"
    >>> found = model.sobol(clearance, limit=limit, cycles=3, samples=64, indices=False)
    >>> found.members, 0.4 < found.limits[0].share < 0.7
    (64, True)
    """
    from scipy.stats.qmc import Sobol

    from ballpass.runtime.ask.limits import read_limits
    from ballpass.runtime.quantity.grammar import quantities_of
    from ballpass.runtime.shares.drawn_members import check_count, read_inputs, run_drawn, values_of
    from ballpass.runtime.shares.variance_shares import variance_shares, wilson

    inputs = read_inputs(model.manifest, "vary", vary)
    texts = [limit] if isinstance(limit, str) else list(limit or [])
    limits = read_limits(model.manifest, "limit", texts, model, parameters, tuple(inputs))
    names = [of] if isinstance(of, str) else list(of or [])
    names = list(dict.fromkeys([*names, *(one.quantity for one in limits)]))
    units = [one.unit for one in quantities_of(model, names)]
    count = len(inputs)
    check_count(samples * (count + 2))
    drawn = Sobol(2 * count, scramble=True, seed=np.random.default_rng(seed)).random(samples)
    a, b = values_of(inputs, drawn[:, :count]), values_of(inputs, drawn[:, count:])
    rows = [a]
    if indices:
        rows += [b, *(np.where(np.arange(count) == k, b, a) for k in range(count))]
    values, facts = run_drawn(
        *(model, inputs, np.concatenate(rows), names, seed, progress),
        cycles=cycles,
        transient=transient,
        parameters=parameters,
        keep=keep,
    )
    base = values[: 2 * samples] if indices else values
    quantities = []
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        known = base[np.isfinite(base[:, k]), k]
        known = known if len(known) else np.array([math.nan])
        blocks = values[:, k].reshape(-1, samples)
        quantities.append(
            SpreadQuantity(
                name=name,
                unit=unit,
                mean=float(np.mean(known)),
                deviation=float(np.std(known)),
                least=float(np.min(known)),
                most=float(np.max(known)),
                quantiles=tuple(np.quantile(known, QUANTILES).tolist()),
                shares=variance_shares(blocks[0], blocks[1], blocks[2:], seed) if indices and _varies(known) else (),
            )
        )
    kept = []
    for one in limits:
        column = base[:, names.index(one.quantity)]
        known = column[~np.isnan(column)]  # an infinite life is one
        hits = int(np.count_nonzero(known <= one.limit if one.upper else known >= one.limit))
        low, high = wilson(hits, len(known))
        factor, unit = table_unit(one.unit)
        words = f"{one.quantity} {'<=' if one.upper else '>='} {factor * one.limit:g} {unit}"
        share = hits / len(known) if len(known) else math.nan
        kept.append(KeptLimit(words=words, kept=hits, members=len(known), share=share, low=low, high=high))
    return SobolAnswer(
        **facts,
        quantities=tuple(quantities),
        limits=tuple(kept),
        samples=samples,
        base=np.concatenate(rows[:2]),
        values=base,
    )
