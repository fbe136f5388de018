"""Which ways to compute are tried for a named error, in what order, and what judges each.

In: a target, quantities, a stored trade of the scene or none.  Out: `Candidate` s from cheap to accurate.  With a trade
the first is the cheapest way that it promises the target of, a simpler model among them where that pays; behind it,
and where there is no trade, come the rungs of a ladder.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from ballpass.runtime.certify.ladder import LADDER, STIFF_LADDER, Way, first_rung
from ballpass.runtime.certify.quasi_static import NAME as QUASI_STATIC
from ballpass.runtime.certify.trade import FULL, Measured, Trade

#: What a trade promises must be this much below the target, where there is such a way.
SAFETY = 1.4

#: An estimate must be this much below the target where nothing was measured on the scene: then the difference alone
#: decides, which may be small by luck.
SAFETY_ALONE = 2.5

#: A simpler model that keeps the target by the trade may differ from a companion by so many targets: it also differs by
#: how the companion started, which was not in equilibrium.  More than that: this run is not like those measured.
DIFFERENT = 5.0

#: The median error of a companion from a trade is at most this part of the candidate's [1].
FINER = 0.25

#: Without a measured companion that fine: this much tighter in tolerance.
TIGHTER, TIGHTEST = 0.1, 1e-12

#: A simpler model is taken where it takes at most this part of the time of the cheapest full one [1].
PAYS = 0.8

#: Time of a companion from the ladder over that of the run, for the same turn, as long as nothing was measured: a rung
#: is a decade of tolerance, of methods of order four to eight.
RATE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A way to compute, and what judges it.

    Attributes
    ----------
    model : name of the model in the trade
    way : method and tolerance
    companion : method and tolerance of the full model that it is compared with
    rate : time of the companion over that of the candidate, for the same turn, as expected
    median, promised : errors of each quantity over the trade's ensemble, by name: median and 95 % point; empty where
        nothing was measured [1]
    reason : why it is tried, for people
    """

    model: str
    way: Way
    companion: Way
    rate: float
    median: Mapping[str, float]
    promised: Mapping[str, float]
    reason: str

    @property
    def simple(self) -> bool:
        """Whether it leaves a part of the full model out."""
        return self.model != FULL or self.way[0] == QUASI_STATIC

    @property
    def safety(self) -> float:
        """How much below the target an estimate must be [1]."""
        return 1.0 if self.promised else SAFETY_ALONE


def rungs(target: float, observables: Sequence[tuple[str, str]], *, stiff: bool) -> list[Candidate]:
    """The ladder from where it kept a target on the shipped scenes."""
    ladder = STIFF_LADDER if stiff else LADDER
    kind = "a stiff model" if stiff else "a model that is not stiff"
    return [
        Candidate(
            model=FULL,
            way=ladder[k],
            companion=ladder[k + 1],
            rate=RATE,
            median={},
            promised={},
            reason=f"the ladder for {kind}, as no trade of this scene was measured",
        )
        for k in range(first_rung(ladder, target / SAFETY_ALONE, observables), len(ladder) - 1)
    ]


def prefer(
    trade: Trade,
    target: float,
    of: Sequence[str],
    models: Collection[str] = (FULL,),
    *,
    quasi_static: bool = True,
) -> Candidate | None:
    """Cheapest way of a trade that keeps the target on all quantities, with a companion that is more accurate by far.

    None where the trade has no such way, or was not measured of these quantities.

    Parameters
    ----------
    models : names of the models that may be taken
    quasi_static : whether the quasi-static model may
    """
    if any(name not in trade.quantities for name in of):
        return None
    methods = ("stepper", QUASI_STATIC) if quasi_static else ("stepper",)
    ways = [
        one
        for one in trade.measured
        if one.configuration.model in models
        and not one.configuration.switch
        and one.configuration.method.startswith(methods)
        and one.failures == 0
    ]
    # with room for the companion's error where there is such a way, else without: the estimate has the last word
    fits = ([w for w in ways if all(room * w.promised[name] <= target for name in of)] for room in (SAFETY, 1.0))
    fit = next((found for found in fits if found), None)
    if fit is None:
        return None
    plain = min((one for one in fit if not _is_simple(one)), key=lambda m: m.time, default=None)
    chosen = min(fit, key=lambda m: m.time)
    reason = "the cheapest that the scene's trade allows"
    if _is_simple(chosen):
        if plain is not None and chosen.time > PAYS * plain.time:
            chosen = plain
        else:
            reason += _price(chosen, plain, of)
    companion, rate = _judge(trade, chosen, of)
    return Candidate(
        model=chosen.configuration.model,
        way=(chosen.configuration.method, chosen.configuration.rtol),
        median={name: chosen.median[name] for name in of},
        promised={name: chosen.promised[name] for name in of},
        reason=reason,
        companion=companion,
        rate=rate,
    )


def _is_simple(one: Measured) -> bool:
    return one.configuration.model != FULL or one.configuration.method == QUASI_STATIC


def _price(chosen: Measured, plain: Measured | None, of: Sequence[str]) -> str:
    """What a simplification costs and saves, for people."""
    name = "the quasi-static model" if chosen.configuration.model == FULL else chosen.configuration.model
    worst = max(chosen.promised[q] for q in of)
    saved = "no full one keeps the target" if plain is None else f"{chosen.time / plain.time:.2g} of a full one's time"
    return f", a simpler model ({name}: its error is within {100 * worst:.2g} % in 95 % of such runs, {saved})"


def _judge(trade: Trade, chosen: Measured, of: Sequence[str]) -> tuple[Way, float]:
    """The companion and its rate: the cheapest measured way that is far more accurate; else the method, tightened."""
    finer = [
        one
        for one in trade.measured
        if one.configuration.model == FULL
        and not one.configuration.switch
        and one.configuration.method.startswith("stepper")
        and one.failures == 0
        and all(one.median[name] <= FINER * chosen.median[name] for name in of)
    ]
    if finer:
        judge = min(finer, key=lambda m: m.time)
        return (judge.configuration.method, judge.configuration.rtol), judge.time / chosen.time
    method = chosen.configuration.method if chosen.configuration.method != QUASI_STATIC else LADDER[-1][0]
    return (method, max(TIGHTER * chosen.configuration.rtol, TIGHTEST)), RATE
