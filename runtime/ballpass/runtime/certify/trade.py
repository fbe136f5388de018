"""Errors and times of methods and tolerances, measured on a user's scene.

In: a model and quantities of interest.  Out: a `Trade`.

Every choice (method, tolerance, kinks located or not) integrates the same members: parameter sets around the user's,
because contact makes the error of a single run random.  The reference of a member is one method at a tight tolerance; a
second method gives its uncertainty, and no error below that is claimed.  Members are the outer loop and choices the
inner one, in another order for each member, so that other load on the machine affects all alike.  Times are those of
the integration alone, processor time where the system has it; medians are reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ballpass.runtime.certify.method_choice import MethodChoice, compared_quantities, stepper_run
from ballpass.runtime.certify.trade_report import PROMISED, Measured, Trade
from ballpass.runtime.contract.bounds import counts, outside, violations
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.method_registry import AUTO, CHOICE, METHODS, STEPPERS
from ballpass.runtime.contract.refused_scenes import refuse_still
from ballpass.runtime.contract.tableaus import RosenbrockTableau
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import neighbour
from ballpass.runtime.quantity.grammar import quantity_words
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.request.locating import LOCATED, has_kinks
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.show.progress import Progress, shown

#: The reference and the method that checks it.
REFERENCE = MethodChoice(method="stepper-rodas5p", rtol=1e-12, kinks=LOCATED)
SECOND = MethodChoice(method="stepper-dp54", rtol=1e-12, kinks=LOCATED)

#: Half the width of the interval that parameters are drawn from, relative to the user's value [1].
SPREAD = 0.005

#: Members of the ensemble.
MEMBERS = 40


def ways_of(model: LoadedModel) -> tuple[MethodChoice, ...]:
    """Methods and tolerances that are measured; those that locate kinks where the motion has some."""
    stepped = {
        name: range(-8, 0 if isinstance(METHODS.get(method), RosenbrockTableau) else -1)
        for name, method in STEPPERS.items()
        if method != AUTO[0]  # which the choice takes where it fits
    }
    located = {CHOICE: range(-10, -2), REFERENCE.method: range(-8, -2)} if has_kinks(model.manifest) else {}
    return (
        *(MethodChoice(method=method, rtol=10.0**decade) for method, decades in stepped.items() for decade in decades),
        *(
            MethodChoice(method=method, rtol=10.0**decade, kinks=LOCATED)
            for method, decades in located.items()
            for decade in decades
        ),
    )


def perturbed(
    model: LoadedModel, around: Mapping[str, float], count: int, spread: float = SPREAD, seed: int = 1
) -> list[dict[str, float]]:
    """Parameter sets around some numbers: every one that is not zero, drawn evenly from its neighbourhood.

    Numbers of bearings stay, and the times of a load's table: drawn one by one they would change places where the load
    is steep.  A number that is not allowed is mirrored at the user's, which may lie on its bound.
    """
    random = np.random.default_rng(seed)
    manifest = model.manifest
    times = {name for item in manifest.inputs for name in item.times}
    sets, whole = {}, counts(manifest)
    for info in manifest.parameters:
        middle = around[info.name]
        if middle == 0.0 or info.name in times:
            continue
        values = middle * (1.0 + spread * random.uniform(-1.0, 1.0, count))
        if info.name in whole:
            continue
        values = np.where(outside(info, values), 2.0 * middle - values, values)
        sets[info.name] = np.where(outside(info, values), middle, values)
    for bad, _ in violations(manifest, {name: sets.get(name, np.full(count, v)) for name, v in around.items()}):
        # two numbers that are too near each other for their member: it becomes the user's own
        for name, values in sets.items():
            values[bad] = around[name]
    return [{**around, **{name: float(values[k]) for name, values in sets.items()}} for k in range(count)]


def reference(run: Run, quantities: QuantityRun) -> tuple[np.ndarray, np.ndarray]:
    """Quantities by one method, and their relative differences to another; each of shape (quantities,).

    Raises
    ------
    SimulationError
        Either method could not finish.
    """
    values, second = (way.measure(quantities, run).values for way in (REFERENCE, SECOND))
    with np.errstate(divide="ignore", invalid="ignore"):
        return values, np.abs(second / values - 1.0)


def measure_trade(
    model: LoadedModel,
    of: Sequence[str] | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    members: int = MEMBERS,
    spread: float = SPREAD,
    ways: Sequence[MethodChoice] | None = None,
    progress: Progress = None,
) -> Trade:
    """Measure errors and times.

    Parameters
    ----------
    of : quantities, ``peak_ball_force``, ``rms:inner.y``, ...  Default: peak ball force, rms and range of the inner
        ring's motion
    parameters : overrides of parameters, SI; the members lie around them
    ways : default: `ways_of` the model
    progress : as for `Model.simulate`

    Raises
    ------
    RequestError
        A wrong request.
    SimulationError
        There is no reference of a member.
    """
    refuse_still("trade", integrated=model.manifest.integrated)
    compared = compared_quantities(model, of)
    names, quantities = tuple(item.name for item in compared), QuantityRun(model, compared)
    if members < 2:
        raise RequestError(f"members: at least 2 are needed for a 95 % point, not {members!r}.")
    ways = ways_of(model) if ways is None else ways
    true, doubt = np.empty((members, len(names))), np.empty((members, len(names)))
    errors = np.full((len(ways), members, len(names)), np.inf)
    times = np.full((len(ways), members), np.nan)
    order = np.random.default_rng(2)
    turns = 1.0
    user = model.numbers(parameters)
    around = dict(user.parameters)
    with shown("measuring", progress) as tell:
        for member, numbers in enumerate(perturbed(model, around, members, spread)):
            run = stepper_run(model, neighbour(model, user, numbers), Request())
            turns = run.span.cycles or 1.0
            true[member], doubt[member] = reference(run, quantities)
            for k in order.permutation(len(ways)):
                try:
                    done = ways[k].measure(quantities, run)
                except SimulationError:
                    continue  # infinitely wrong: quantiles of the method "higher" keep that
                with np.errstate(divide="ignore", invalid="ignore"):
                    errors[k, member] = np.abs(done.values / true[member] - 1.0)
                times[k, member] = done.seconds / turns
            if tell is not None:
                tell((member + 1) / members)
    known = np.quantile(doubt, PROMISED, axis=0)
    return Trade(
        scene=model.manifest.scene,
        title=model.manifest.title,
        quantities=names,
        values=dict(zip(names, np.median(true, axis=0).tolist(), strict=True)),
        uncertainty=dict(zip(names, known.tolist(), strict=True)),
        members=members,
        spread=spread,
        cycles=turns,
        measured=tuple(_summary(way, errors[k], times[k], known, names) for k, way in enumerate(ways)),
        meanings={item.name: quantity_words(model.manifest, item) for item in compared},
        units={item.name: item.unit for item in compared},
    )


def _summary(
    way: MethodChoice, errors: np.ndarray, times: np.ndarray, known: np.ndarray, names: Sequence[str]
) -> Measured:
    median, promised = np.quantile(errors, (0.5, PROMISED), axis=0, method="higher")
    failed = np.isnan(times)
    return Measured(
        way=way,
        time=float(np.nanmedian(times)) if not np.all(failed) else math.inf,
        median=dict(zip(names, np.maximum(median, known).tolist(), strict=True)),
        promised=dict(zip(names, np.maximum(promised, known).tolist(), strict=True)),
        failures=int(failed.sum()),
    )
