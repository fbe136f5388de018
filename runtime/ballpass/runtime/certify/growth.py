"""Growth of perturbations: whether a motion forgets a change of its start, or amplifies it.

In: a run, or a model, numbers and a request.  Out: a `Growth`.

A run is repeated from a start whose positions are moved.  A motion that forgets its start gives the same numbers within
some tolerances.  Nothing is linearised, so laws whose force jumps are seen as others are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ballpass.runtime.certify.method_choice import MethodChoice, stepper_run
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.refused_scenes import refuse_still
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.report.digits import TIGHTER
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.request.locating import choose_kinks
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.reductions import channel_names
from ballpass.runtime.show.short import ShortRepr

#: Relative change of a number that four printed digits do not bear [1].
DIGITS = 5e-4

#: Changes below so many tolerances are those of steps, not of a perturbation that grows.
TOLERATED = 100.0

#: Looser runs are compared at this tolerance: what their steps lose is their error, not a growth [1].
LOOSEST = 1e-6

#: Steps of a look at a tighter tolerance and of the first one, over those of a run [1].
TIGHTER_COSTS = 6

#: Change of a start that derivatives are to be good for [1].
TINY = 1e-10

#: What is compared of each channel.
KINDS = ("min", "max", "rms")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Growth(ShortRepr):
    """What a moved start changes.

    Attributes
    ----------
    moved : how far each position was moved at the start, in its magnitudes [1]
    changes : largest change of each channel's extremes, relative to the larger, and of its rms, relative to itself [1]
    uncertain : channels of which it changes four digits
    steps : of the run
    """

    moved: float
    changes: Mapping[str, float]
    uncertain: tuple[str, ...]
    steps: int

    @property
    def worst(self) -> float:
        """Largest of the changes [1]."""
        return max(self.changes.values(), default=0.0)


def find_growth(model: LoadedModel, numbers: Numbers, request: Request) -> Growth:
    """Compare a run with one whose start is moved by the tolerance.

    Raises
    ------
    RequestError
        A wrong request, a model without states, or no compiler for the stepper.
    SimulationError
        The computation failed.
    """
    refuse_still("growth", integrated=model.manifest.integrated)
    run = stepper_run(model, numbers, request)
    way = _way(run)
    return _compare(run, way, way.rtol * run.magnitude[: len(run.magnitude) // 2])


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
    way = _way(run)
    found = _compare(run, way, moved)
    # what steps lose over kinks shrinks with the tolerance as well, and needs no other library
    again = found.uncertain and TIGHTER_COSTS * found.steps <= most
    return _compare(run, replace(way, rtol=TIGHTER * way.rtol), moved) if again else found


def _way(run: Run) -> MethodChoice:
    rtol = min(run.rtol, LOOSEST)
    return MethodChoice(method="stepper", rtol=rtol, kinks=choose_kinks(None, "stepper", run.model.manifest, rtol))


def refuse_growth(model: LoadedModel, numbers: Numbers, request: Request, quantities: Sequence[str]) -> None:
    """Refuse derivatives of a motion that amplifies a tiny change beyond meaning, before they are computed.

    Raises
    ------
    SimulationError
        A start moved by `TINY` changes an extreme of the motion by more than four digits bear.
    """
    run = stepper_run(model, numbers, replace(request, rtol=TINY))
    found = _compare(run, _way(run), TINY * run.magnitude[: len(run.magnitude) // 2])
    if found.uncertain:
        worst = max(found.uncertain, key=lambda name: found.changes[name])
        raise SimulationError(
            f"Derivatives of {', '.join(quantities)} mean nothing here: the motion is chaotic. A start moved by "
            f"{TINY:g} of the motion changes {worst} by {rounded(100.0 * found.changes[worst], 2)} % within the run, "
            f"a growth by {found.changes[worst] / TINY:.1g}. Ask for fewer turns (--cycles), another clearance or "
            "damping, or compare ensembles (simulate_many, ballpass sweep)."
        )


def _compare(run: Run, way: MethodChoice, moved: np.ndarray) -> Growth:
    """What a moved start changes."""
    channels = [name for name in channel_names(run.model.manifest) if not name.endswith("ball.deflection")]
    names = [f"{kind}:{name}" for name in channels for kind in KINDS]
    quantities = QuantityRun(run.model, quantities_of(run.model, names))

    def integrate(start: float | np.ndarray, before: float) -> tuple[np.ndarray, int]:
        tell = run.progress
        moved = replace(run, progress=None if tell is None else lambda done: tell(before + 0.5 * done))
        found = way.measure(quantities, moved, start)
        return found.values.reshape(-1, len(KINDS)), found.steps

    (one, steps), (other, _) = integrate(0.0, 0.0), integrate(moved, 0.5)
    tolerated = dict(zip(run.model.states, TOLERATED * way.rtol * run.magnitude, strict=True))
    changes, uncertain = {}, []
    for name, mine, its in zip(channels, one, other, strict=True):
        changes[name] = _relative(its, mine)
        if np.any(np.abs(its - mine) > np.maximum(DIGITS * _sizes(mine), tolerated.get(name, 0.0))):
            uncertain.append(name)
    return Growth(moved=way.rtol, changes=changes, uncertain=tuple(uncertain), steps=steps)


def _sizes(numbers: np.ndarray) -> np.ndarray:
    """What changes of a channel's numbers are measured by: an extreme may cross zero, an rms is printed by itself."""
    size = np.abs(numbers)
    return np.asarray(np.where(np.array(KINDS) == "rms", size, np.max(size, axis=-1, keepdims=True)))


def _relative(numbers: np.ndarray, others: np.ndarray) -> float:
    """Largest difference over the size of the number [1]."""
    sizes = _sizes(others)
    return float(np.max(np.abs(numbers - others)[sizes > 0.0] / sizes[sizes > 0.0], initial=0.0))
