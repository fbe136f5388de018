"""Are named errors kept, and are estimates near the truth?  Counted over many runs against a reference.

In: a model, quantities, targets.  Out: a `Calibration` for each target.  The members are parameter sets around the
model's, other ones than those that a trade is measured on.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ballpass.runtime.certify.error_target import Accuracy, Search, TargetMissed, meet_target
from ballpass.runtime.certify.prepared import prepare
from ballpass.runtime.certify.trade import FULL, SPREAD, TARGETS, Trade, make_reference, perturbed

if TYPE_CHECKING:
    from ballpass.runtime.model import Model

#: An estimate is near the true error when it is within this factor of it.
NEAR = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What came of one target.

    Attributes
    ----------
    target : relative error asked for [1]
    measured : whether a trade of the scene chose, else the ladder
    of : quantities; the error is that of the worst one
    runs : parameter sets
    missed : runs that were refused
    unknown : runs whose error is below what the reference knows, and counts for nothing
    within : part of the other runs whose true error is within the target [1]
    near : part of them whose estimate is within a factor of ten of the true error [1]
    time, total_time : medians of the chosen integration and of all that was integrated, of a cycle [s]
    share : median of the time of all else that was integrated over that of the chosen integration [1]
    ways : models, methods and tolerances that were chosen, and how often
    """

    target: float
    measured: bool
    of: tuple[str, ...]
    runs: int
    missed: int
    unknown: int
    within: float
    near: float
    time: float
    total_time: float
    share: float
    ways: tuple[tuple[tuple[str, str, float], int], ...]


def calibrate(
    model: Model,
    *groups: Sequence[str],
    targets: Sequence[float] = TARGETS,
    members: int = 200,
    spread: float = SPREAD,
    seed: int = 3,
    trades: Sequence[Trade | None] = (None,),
    simpler: Mapping[str, Model] | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Calibration]:
    """Ask for each target on every member, and compare with the reference.

    Parameters
    ----------
    groups : each a list of quantities that are asked for together
    trades : what chooses: a trade of the scene, or None for the ladder; each in turn
    simpler : models besides the full one that may be taken where the trade says so, by name

    Raises
    ------
    SimulationError
        There is no reference.
    """
    names = tuple(dict.fromkeys(name for group in groups for name in group))
    say = progress or (lambda _: None)
    others = {name: one for name, one in (simpler or {}).items() if name != FULL}
    sets = perturbed(model, members, spread, seed)
    reference = make_reference(model, sets, names, lambda f: say(0.5 * f))
    wishes = [(trade, tuple(group), target) for trade in trades for group in groups for target in targets]
    found: list[list[tuple[Accuracy, float, float]]] = [[] for _ in wishes]
    missed = [0] * len(wishes)
    turns = 1.0
    for member in range(members):
        numbers = {name: float(values[member]) for name, values in sets.items()}
        run = prepare(model, numbers)
        turns = run.cycles
        simple = {
            name: prepare(one, {path: value for path, value in numbers.items() if path in one.parameters})
            for name, one in others.items()
        }
        for k, (trade, of, target) in enumerate(wishes):
            columns = [names.index(name) for name in of]
            try:
                search = Search(run=run, simpler=simple.__getitem__)
                one = meet_target(run, target, of, trade, models=(FULL, *others), search=search)
            except TargetMissed:
                missed[k] += 1
                continue
            true = max(
                abs(one.values[name] / reference.values[member, column] - 1.0)
                for name, column in zip(of, columns, strict=True)
            )
            found[k].append((one, true, float(reference.doubt[member, columns].max())))
        say(0.5 + 0.5 * (member + 1) / members)
    return [
        _counted(target, of, members, missed[k], found[k], turns, measured=trade is not None)
        for k, (trade, of, target) in enumerate(wishes)
    ]


def _counted(
    target: float,
    names: tuple[str, ...],
    members: int,
    missed: int,
    found: Sequence[tuple[Accuracy, float, float]],
    turns: float,
    *,
    measured: bool,
) -> Calibration:
    known = [(one, true) for one, true, doubt in found if true > doubt]
    chosen = Counter((one.model, one.method, one.rtol) for one, _, _ in found)
    return Calibration(
        target=target,
        measured=measured,
        of=names,
        runs=members,
        missed=missed,
        unknown=len(found) - len(known),
        within=_part([true <= target for _, true in known]),
        near=_part([1.0 / NEAR <= one.estimate / true <= NEAR for one, true in known]),
        time=statistics.median(one.time for one, _, _ in found) / turns if found else 0.0,
        total_time=statistics.median(one.time + one.companion_time for one, _, _ in found) / turns if found else 0.0,
        share=statistics.median(one.companion_time / one.time for one, _, _ in found) if found else 0.0,
        ways=tuple(chosen.most_common()),
    )


def _part(answers: Sequence[bool]) -> float:
    return sum(answers) / len(answers) if answers else 1.0
