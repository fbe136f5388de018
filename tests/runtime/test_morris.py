"""Elementary effects: closed forms through the same code, and the order of the inputs of a machine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats.qmc import Halton

from ballpass.runtime import Model, QuantityFunction
from ballpass.runtime.shares.elementary_effects import elementary_effects, moved


def test_effects_of_a_sum_and_of_a_product_are_those_of_closed_forms() -> None:
    """3 x - 2 y + u v + 0 w: effects 3, -2, of u those of v, which has mean 1/2 and deviation 1 / sqrt(12)."""

    def result(x: np.ndarray) -> np.ndarray:
        return np.asarray(3.0 * x[..., 0] - 2.0 * x[..., 1] + x[..., 2] * x[..., 3])

    shares = Halton(5, seed=np.random.default_rng(1)).random(2000)
    found = elementary_effects(shares, result(shares), result(moved(shares)), seed=1)
    assert [one.size for one in found] == pytest.approx([3.0, 2.0, 0.5, 0.5, 0.0], abs=0.01)
    assert [one.mean for one in found] == pytest.approx([3.0, -2.0, 0.5, 0.5, 0.0], abs=0.01)
    assert [one.deviation for one in found] == pytest.approx([0.0, 0.0, 12**-0.5, 12**-0.5, 0.0], abs=0.01)
    assert found[2].size_low < 0.5 < found[2].size_high


def test_members_without_results_leave_with_those_they_are_compared_with() -> None:
    shares = Halton(2, seed=np.random.default_rng(1)).random(100)
    base, other = 3.0 * shares[:, 0], 3.0 * moved(shares)[..., 0]
    base[:5], other[0, 5:10] = np.nan, np.nan
    found = elementary_effects(shares, base, other, seed=1)
    assert [one.rows for one in found] == [90, 95]
    assert found[0].size == pytest.approx(3.0)
    assert elementary_effects(shares, np.full(100, np.nan), other, seed=1)[0].rows == 0


def test_the_effect_of_clearance_is_the_change_over_its_range_and_inertia_has_none(
    make_model: Callable[..., Model],
) -> None:
    """At rest the ring sinks by half the clearance and what the contacts give way."""
    rotor = make_model("rotor")
    vary = ["loads.unbalance.eccentricity=10 mm:11 mm", "bearing.inner_ring.damping=400 N*s/m:600 N*s/m"]
    found = rotor.morris(
        [*vary, "bearing.clearance=2 um:10 um"], ["static_deflection", "static_peak_ball_force"], base=8, progress=False
    )
    assert found.members == 32
    assert [one.unit for one in found.quantities] == ["m", "N"]
    ends = QuantityFunction(rotor, "static_deflection", ["bearing.clearance"])([[2e-6], [10e-6]])
    effects = found.quantities[0].effects
    assert effects[2].mean == pytest.approx(ends[1] - ends[0], rel=0.05)
    assert effects[2].mean > 4e-6
    assert effects[1].size == 0.0
    assert found.report().parts[0].rows[0][0] == "bearing.clearance"
