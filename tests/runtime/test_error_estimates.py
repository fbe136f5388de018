"""Estimates of `run --error` against the true errors, over shipped scenes, quantities and targets.

BALLPASS_ESTIMATES says how many sets of numbers each scene has; 8 take a quarter of an hour.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.certify.error_target import TargetMissed, meet_target
from ballpass.runtime.certify.method_choice import compared_quantities, stepper_run
from ballpass.runtime.certify.trade import REFERENCE, SECOND, perturbed
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.request.request import Request

COUNT = int(os.environ.get("BALLPASS_ESTIMATES", "1"))
SCENES = (
    *("punching_press", "punching_press_tangent", "punching_press_two_way", "four_bar", "crank_shaper"),
    *("offset_slider", "rotor", "varying_compliance"),
)
TARGETS = (0.1, 0.01, 1e-3, 1e-4, 1e-5)

#: Times that an error may be above its estimate.
FACTOR = 3.0


def estimates_of(model: Model, count: int, seed: int = 3) -> list[tuple[int, float, str, float, float, str]]:
    """Set of numbers, target, quantity, estimate, true error, and the way, where the truth is known well enough."""
    of = compared_quantities(model, None)
    found = []
    for number, numbers in enumerate(perturbed(model, dict(model.parameters), count, seed=seed)):
        run = stepper_run(model, model.numbers(numbers), Request())
        quantities = QuantityRun(model, of)
        true, second = (way.measure(quantities, run).values for way in (REFERENCE, SECOND))
        unknown = np.abs(second / true - 1.0)
        for target in TARGETS:
            try:
                met = meet_target(run, target, of)
            except TargetMissed:
                continue
            for item, truth, vague in zip(of, true.tolist(), unknown.tolist(), strict=True):
                error = abs(met.values[item.name] / truth - 1.0)
                if math.isfinite(error) and error > 10.0 * vague:
                    words = f"{met.method} {met.rtol:g} {met.kinks}"
                    found.append((number, target, item.name, met.estimates[item.name], error, words))
    return found


@pytest.mark.long
@pytest.mark.parametrize("scene", SCENES)
def test_estimates_are_not_far_below_true_errors(make_model: Callable[..., Model], scene: str) -> None:
    found = estimates_of(make_model(scene), COUNT)
    assert len(found) > 4
    assert [row for row in found if row[4] > FACTOR * row[3]] == []
