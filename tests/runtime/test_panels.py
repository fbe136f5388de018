"""Panels of quadratures: fine enough where a function grows like the square root of time at a kink."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.quantity.nodes import Edges, place
from ballpass.runtime.quantity.panels import panels_between, plan_of

KINK = 0.8


@pytest.mark.parametrize("short", [1e-2, 1e-4, 1e-8])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_short_step_at_a_kink_leaves_a_square_root_smooth(short: float, side: float) -> None:
    """Steps of a tenth, and one of `short` between them and a kink, where a square root begins: 2/3 x^(3/2)."""
    edges = Edges(times=np.array([0.0, 1.6]), slopes=np.zeros((2, 0)), segment=np.zeros(1, dtype=int), first=0)
    cuts = np.sort(np.append(KINK + side * (short + np.arange(8) / 10.0), KINK))
    nodes = place(plan_of(panels_between(edges, cuts, cuts == KINK), edges), edges)
    distance = np.maximum(side * (nodes.t - KINK), 0.0)
    assert np.sum(nodes.weight) == pytest.approx(1.6, rel=1e-14)
    assert nodes.weight @ np.sqrt(distance) == pytest.approx(2.0 / 3.0 * 0.8**1.5, rel=1e-7)


@pytest.mark.long
def test_the_derivative_of_a_work_is_known_where_contacts_open(make_model: Callable[..., Model]) -> None:
    """Of the two-way press, whose torque's derivative has a square root at each end of a contact: within a part in
    100 000, and as far from that of ten times smaller tolerances as is stated."""
    model, names = make_model("punching_press_two_way"), ("drive_work", "bearing.clearance")
    (pair,) = model.sensitivity(*names).pairs
    (tight,) = model.sensitivity(*names, rtol=1e-12, sensitivity_rtol=1e-11, check=False).pairs
    assert pair.uncertainty is not None
    assert abs(pair.derivative - tight.derivative) <= pair.uncertainty < 1e-5 * abs(tight.derivative)
