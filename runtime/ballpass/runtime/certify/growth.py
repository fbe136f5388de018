"""Growth of perturbations: how many digits of a run's numbers its tolerance determines.

In: a model, numbers, a request, or a table of members.  Out: a `Growth`, or the members whose numbers have no digits.

A run is repeated from a start whose positions are moved by the tolerance: ``rtol`` times their magnitudes.  A motion
that forgets its start gives the same numbers within some tolerances.  Where a number changes by more than four digits
bear, both are repeated with kinks located, for what a step loses across a kink looks like growth.  Where it still
changes, the tolerance decides about it, and only statistics mean something.  Nothing is linearised, so laws whose force
jumps are seen as others are.

Two runs may share an extreme by luck, or have it before errors have grown.  So the states at the end are compared as
well: where these part, the numbers of more moved starts decide.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ballpass.runtime.certify.method_choice import MethodChoice, stepper_run
from ballpass.runtime.contract.defaults import TOLERANCES
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.refused_scenes import refuse_still
from ballpass.runtime.many.ensemble import EnsembleResult
from ballpass.runtime.many.members import Table
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import channels_of, parse_quantity, quantities_of
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.quantity.registry import KINDS as KINDS_OF_QUANTITIES
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.run.locating import LOCATED, choose_kinks
from ballpass.runtime.run.reductions import channel_names
from ballpass.runtime.run.request import Request
from ballpass.runtime.run.resolve import Run, resolve
from ballpass.runtime.show.short import ShortRepr

#: Relative change of a number that four printed digits do not bear [1].
DIGITS = 5e-4

#: Changes below so many tolerances are those of steps, not of a perturbation that grows.
TOLERATED = 100.0

#: States that are apart by so much of their magnitudes at the end, from starts apart by a tolerance, have parted [1].
PARTED = 1e-3

#: Times that a number may be off by what four of its digits bear, where steps lose that: more is said [1].
LOST = 10.0

#: Looser runs are compared at this tolerance: what their steps lose is their error, not a growth [1].
LOOSEST = 1e-6

#: Tolerance of a second look at what a large change of the start leaves, or steps lose, over that of the first [1].
TIGHTER = 1e-2

#: Steps of that and of the first one, over those of a run [1].
TIGHTER_COSTS = 6

#: Change of a start that derivatives are to be good for [1].
TINY = 1e-10

#: Moved starts over which the numbers of an uncertain channel are spread.
STARTS = 20

#: The same of each member of an ensemble whose states part.
MEMBER_STARTS = 8

#: Quantities that are a size of a motion themselves: their digits are of their own size.
SIZES = ("rms", "std", "range")

#: What is compared of each channel.
KINDS = ("min", "max", "rms")

#: Observables that name a moment or a ball: they may jump from one peak to another as high.
PLACES = ("peak_time", "peak_ball", "min_time")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Growth(ShortRepr):
    """What a moved start changes.

    Attributes
    ----------
    moved : how far each position was moved at the start, in its magnitudes [1]
    changes : largest change of each channel's extremes, relative to the larger, and of its rms, relative to itself [1]
    uncertain : channels whose digits the tolerance does not bear
    parted : how far the states are apart at the end of the run, in their magnitudes [1]
    steps : of the run
    lost : of channels whose numbers errors of the steps put off by more than their digits: by how much [1]
    spread : by ("min", "max" or "rms", channel), where anything is uncertain or the states part: mean and standard
        deviation over `STARTS` moved starts
    asked : the same of the quantities that were asked for beside
    """

    moved: float
    changes: Mapping[str, float]
    uncertain: tuple[str, ...]
    parted: float = 0.0
    steps: int = 0
    lost: Mapping[str, float] = field(default_factory=dict)
    spread: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    asked: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def worst(self) -> float:
        """Largest of the changes [1]."""
        return max(self.changes.values(), default=0.0)

    @property
    def words(self) -> str:
        """A warning for people; empty where the digits stand."""
        if self.lost and not self.uncertain:
            return (
                f"errors of the steps put off {largest_first(self.lost)}: in "
                "this motion they grow, or add up, for a while. Take a tighter tolerance (--rtol 1e-8)."
            )
        if not self.uncertain and self.parted > PARTED:
            return (
                f"the motion amplifies small errors: from a start moved by {self.moved:g} of the motion the states are "
                f"{rounded(100.0 * self.parted, 2)} % of it apart at the end of the run. Extremes and rms keep their "
                "digits, samples of the motion do not: another tolerance gives other ones."
            )
        if not self.uncertain:
            return ""
        return (
            f"the motion amplifies small errors: a start moved by {self.moved:g} of the motion changes "
            f"{largest_first({name: self.changes[name] for name in self.uncertain})}. Single extremes of such a "
            "motion have no digits, and another tolerance gives other ones. Take statistics over many turns or many "
            "starts, or a shorter run."
        )


def largest_first(changes: Mapping[str, float]) -> str:
    """Channels by their changes, with that of the first, as "inner.vx by 3 %, and less inner.x, inner.y"."""
    worst, *others = sorted(changes, key=lambda name: -changes[name])
    return f"{worst} by {rounded(100.0 * changes[worst], 2)} %" + (f", and less {', '.join(others)}" if others else "")


def find_growth(
    model: LoadedModel, numbers: Numbers, request: Request, *, spread: bool = True, of: Sequence[str] = ()
) -> Growth:
    """Compare a run with one from a moved start, both by the project's own stepper.

    Parameters
    ----------
    spread : run more moved starts where digits are uncertain, for `Growth.spread`
    of : quantities for `Growth.asked`

    Raises
    ------
    RequestError
        A wrong request, a model without states, or no compiler for the stepper.
    SimulationError
        The computation failed.
    """
    refuse_still("growth", integrated=model.manifest.integrated)
    run = stepper_run(model, numbers, request)
    way = _way(run, request.kinks)
    moved = way.rtol * run.magnitude[: len(run.magnitude) // 2]
    found, plain = _compare(run, way, moved)
    if (found.uncertain or found.parted > PARTED) and way.kinks != LOCATED:
        way = replace(way, kinks=LOCATED)
        found, _ = _compare(run, way, moved)
        if run.rtol <= LOOSEST:  # of looser runs it is not known
            # where damping is light, what steps lose adds up, which no moved start shows
            tight = _numbers(run, replace(way, rtol=max(TIGHTER * way.rtol, TOLERANCES[0])))
            off = {name: _relative(plain[name], tight[name]) for name in found.changes if name not in found.uncertain}
            found = replace(found, lost={name: part for name, part in off.items() if part > LOST * DIGITS})
    return _spread(run, way, found, of) if (found.uncertain or found.parted > PARTED) and spread else found


def by_moved_start(run: Run, moved: np.ndarray, most: int) -> Growth:
    """Compare a run with one whose positions at the start are moved, shape (states / 2,) [m].

    Parameters
    ----------
    most : steps; runs of more are not repeated by a tighter tolerance

    Raises
    ------
    SimulationError
        The computation failed.
    """
    way = _way(run, None)
    found, _ = _compare(run, way, moved)
    # what steps lose over kinks shrinks with the tolerance as well, and needs no other library
    again = found.uncertain and TIGHTER_COSTS * found.steps <= most
    return _compare(run, replace(way, rtol=TIGHTER * way.rtol), moved)[0] if again else found


def _way(run: Run, kinks: str | None) -> MethodChoice:
    rtol = min(run.rtol, LOOSEST)
    return MethodChoice(method="stepper", rtol=rtol, kinks=choose_kinks(kinks, "stepper", run.model.manifest, rtol))


def refuse_growth(model: LoadedModel, numbers: Numbers, request: Request, quantities: Sequence[str]) -> None:
    """Refuse derivatives of a motion that amplifies a tiny change beyond meaning, before they are computed.

    Raises
    ------
    SimulationError
        A start moved by `TINY` changes an extreme of the motion by more than four digits bear.
    """
    found = find_growth(model, numbers, replace(request, rtol=TINY), spread=False)
    if found.uncertain:
        worst = max(found.uncertain, key=lambda name: found.changes[name])
        raise SimulationError(
            f"Derivatives of {', '.join(quantities)} mean nothing here: the motion is chaotic. A start moved by "
            f"{TINY:g} of the motion changes {worst} by {rounded(100.0 * found.changes[worst], 2)} % within the run, "
            f"a growth by {found.changes[worst] / TINY:.1g}. Ask for fewer turns (--cycles), another clearance or "
            "damping, or compare ensembles (simulate_many, ballpass sweep)."
        )


def _compare(run: Run, way: MethodChoice, moved: np.ndarray) -> tuple[Growth, dict[str, np.ndarray]]:
    """What a moved start changes, and the numbers of each channel from the start itself."""
    channels, quantities = _channels(run)

    def integrate(start: float | np.ndarray, before: float) -> tuple[np.ndarray, np.ndarray, int]:
        tell = run.progress
        moved = replace(run, progress=None if tell is None else lambda done: tell(before + 0.5 * done))
        found = way.measure(quantities, moved, start)
        assert found.end is not None  # channels are of the motion
        return found.values.reshape(-1, len(KINDS)), found.end, found.steps

    (one, end, steps), (other, other_end, _) = integrate(0.0, 0.0), integrate(moved, 0.5)
    tolerated = dict(zip(run.model.states, TOLERATED * way.rtol * run.magnitude, strict=True))
    changes, uncertain = {}, []
    for name, mine, its in zip(channels, one, other, strict=True):
        changes[name] = _relative(its, mine)
        if np.any(np.abs(its - mine) > np.maximum(DIGITS * _sizes(mine), tolerated.get(name, 0.0))):
            uncertain.append(name)
    parted = float(np.max(np.abs(other_end - end) / run.magnitude))
    found = Growth(moved=way.rtol, changes=changes, uncertain=tuple(uncertain), parted=parted, steps=steps)
    return found, dict(zip(channels, one, strict=True))


def _channels(run: Run, of: Sequence[str] = ()) -> tuple[list[str], QuantityRun]:
    """What is compared, and behind it other quantities."""
    channels = [name for name in channel_names(run.model.manifest) if not name.endswith("ball.deflection")]
    names = [*(f"{kind}:{name}" for name in channels for kind in KINDS), *of]
    return channels, QuantityRun(run.model, quantities_of(run.model, names))


def _numbers(run: Run, way: MethodChoice) -> dict[str, np.ndarray]:
    """The numbers of each channel."""
    channels, quantities = _channels(run)
    found = way.measure(quantities, replace(run, progress=None), 0.0).values
    return dict(zip(channels, found.reshape(-1, len(KINDS)), strict=True))


def _sizes(numbers: np.ndarray) -> np.ndarray:
    """What changes of a channel's numbers are measured by: an extreme may cross zero, an rms is printed by itself."""
    size = np.abs(numbers)
    return np.asarray(np.where(np.array(KINDS) == "rms", size, np.max(size, axis=-1, keepdims=True)))


def _relative(numbers: np.ndarray, others: np.ndarray) -> float:
    """Largest difference over the size of the number [1]."""
    sizes = _sizes(others)
    return float(np.max(np.abs(numbers - others)[sizes > 0.0] / sizes[sizes > 0.0], initial=0.0))


def _spread(run: Run, way: MethodChoice, found: Growth, of: Sequence[str]) -> Growth:
    """The same, with which numbers are uncertain and how much by more starts, moved by one tolerance, two, ..."""
    channels, quantities = _channels(run, of)
    names = [(kind, channel) for channel in channels for kind in KINDS]
    moved = way.rtol * run.magnitude[: len(run.magnitude) // 2]
    every = []
    for k in range(STARTS):
        every.append(way.measure(quantities, replace(run, progress=None), (k + 1) * moved).values)
        if run.progress is not None:
            run.progress((k + 1) / STARTS)
    mean, deviation = np.mean(every, axis=0), np.std(every, axis=0, ddof=1)
    # twice the deviation is what is printed behind +-
    changes = dict(found.changes)
    by_channel = (part[: len(names)].reshape(-1, len(KINDS)) for part in (mean, deviation))
    table = zip(channels, *by_channel, strict=True)
    for name, middle, apart in table:
        changes[name] = max(changes[name], _relative(middle + 2.0 * apart, middle))
    uncertain = tuple(name for name in channels if name in found.uncertain or changes[name] > DIGITS)
    pairs = list(zip(mean.tolist(), deviation.tolist(), strict=True))
    by_name = {item.name: pair for item, pair in zip(quantities.quantities, pairs, strict=True)}
    spread, asked = dict(zip(names, pairs, strict=False)), {name: by_name[name] for name in of}
    return replace(found, changes=changes, uncertain=uncertain, spread=spread, asked=asked)


def simulate_members(
    model: LoadedModel, table: Table, observables: str | Sequence[str], run: Callable[..., EnsembleResult]
) -> EnsembleResult:
    """Run an ensemble, and tell which observables of which members have no digits.

    Parameters
    ----------
    run : `simulate_many` of a table and observables, with all else given; takes `rtol`, `method`, `kinks`
    """
    manifest = model.manifest
    asked = [observables] if isinstance(observables, str) else list(observables)
    quantities = {name: parse_quantity(manifest, name) for name in asked}
    looked_at = {name: item for name, item in quantities.items() if not (item.kind in PLACES or _at_rest(item))}
    # a force that crosses zero has no digits of its size, but of its range
    ranges = {name: f"range:{item.channel}" for name, item in looked_at.items() if _has_range(model, item)}
    ends = {f"end:{name}": name for name in model.states} if looked_at else {}
    names = list(dict.fromkeys((*asked, *ranges.values(), *ends)))
    result = run(table, names)
    count = len(next(iter(result.parameters.values())))
    uncertain = {name: np.zeros(count, dtype=bool) for name in asked}
    rtol = min(result.statistics.rtol, LOOSEST)
    numbers = model.numbers(None)
    magnitude = resolve(model, numbers, Request()).magnitude
    size_of = dict(zip(model.states, magnitude.tolist(), strict=True))
    positions = dict(zip(manifest.initial[: len(magnitude) // 2], magnitude.tolist(), strict=False))
    left = np.setdiff1d(np.arange(count), [failure.member for failure in result.failures])
    ways: dict[str, object] = {}

    def starting(k: int) -> EnsembleResult:
        """Members that are left, from starts moved by so many tolerances."""
        rows = {name: values[left] for name, values in result.parameters.items()}
        starts = {name: rows.get(name, np.full(len(left), numbers.parameters[name])) for name in positions}
        return run({**rows, **{name: starts[name] + k * rtol * positions[name] for name in positions}}, names, **ways)

    def bearable(name: str, one: np.ndarray, spans: Mapping[str, np.ndarray]) -> np.ndarray:
        """Change of a number that four of its digits bear."""
        scale = np.abs(one)
        if name not in ranges:
            return np.asarray(DIGITS * scale)
        scale = np.fmax(scale, spans[ranges[name]])
        return np.asarray(np.fmax(DIGITS * scale, TOLERATED * rtol * size_of.get(looked_at[name].channel, 0.0)))

    for ways in ({}, {"rtol": rtol, "method": "stepper", "kinks": LOCATED}):
        if not (looked_at and len(left)) or result.interrupted:
            break
        again = starting(0) if ways else result
        other = starting(1) if not again.interrupted else again
        result = replace(result, interrupted=other.interrupted)
        one = {name: again[name] if ways else result[name][left] for name in names}
        for name in looked_at:
            # a run that fails from the moved start, or was interrupted, has no digits either
            bears = bearable(name, one[name], one)
            uncertain[name][left] = ~(np.abs(one[name] - other[name]) <= bears)
            # or steps over kinks lost more than the digits of the number that is given
            uncertain[name][left] |= np.abs(result[name][left] - one[name]) > LOST * bears
        # two runs may share a number by luck, or have it before errors have grown
        apart = [np.abs(one[end] - other[end]) > PARTED * size_of[name] for end, name in ends.items()]
        left = left[np.any([uncertain[name][left] for name in looked_at] + apart, axis=0)]
    if len(left) and looked_at and not result.interrupted:
        every = []
        for k in range(MEMBER_STARTS):
            every.append(starting(k))
            if every[-1].interrupted:
                return _marked(replace(result, interrupted=True), asked, uncertain)
        spans = {name: every[0][name] for name in ranges.values()}
        for name in looked_at:
            numbers_of_it = np.array([one[name] for one in every])
            spread = 2.0 * np.std(numbers_of_it, axis=0, ddof=1)
            uncertain[name][left] |= ~(spread <= bearable(name, np.mean(numbers_of_it, axis=0), spans))
    return _marked(result, asked, uncertain)


def _marked(result: EnsembleResult, asked: Sequence[str], uncertain: Mapping[str, np.ndarray]) -> EnsembleResult:
    return replace(result, observables={name: result[name] for name in asked}, uncertain=uncertain)


def _at_rest(quantity: Quantity) -> bool:
    return KINDS_OF_QUANTITIES[quantity.kind].at_rest is not None


def _has_range(model: LoadedModel, quantity: Quantity) -> bool:
    """Whether a quantity is in the unit of its channel and may cross zero, so that the channel's range is its size."""
    columns = channels_of(model.manifest)
    return quantity.kind not in SIZES and quantity.channel in columns and columns[quantity.channel][1] == quantity.unit
