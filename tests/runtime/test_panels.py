"""Panels of quadratures: fine enough where a function grows like the square root of time at a kink."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.quantity.cuts import crossings, rank_differences
from ballpass.runtime.quantity.nodes import Cause, Cuts
from ballpass.runtime.quantity.panels import GAUSS, cut_at, interpolated, nodes_of, whole_panels

KINK = 0.8


def one_interval(end: float) -> Cuts:
    """From zero on, without a cut between."""
    ends = {"cause": np.full(2, Cause.SCHEDULE), "angle": np.zeros(2, dtype=int), "slopes": np.zeros((2, 0))}
    return Cuts(times=np.array([0.0, end]), segment=np.zeros(1, dtype=int), first=0, **ends)


@pytest.mark.parametrize("short", [1e-2, 1e-4, 1e-8])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_short_step_at_a_kink_leaves_a_square_root_smooth(short: float, side: float) -> None:
    """Steps of a tenth, and one of `short` between them and a kink, where a square root begins: 2/3 x^(3/2)."""
    cuts, ends = one_interval(1.6), np.sort(np.append(KINK + side * (short + np.arange(8) / 10.0), KINK))
    nodes = nodes_of(cut_at(whole_panels(cuts), cuts, ends, ends == KINK), cuts)
    distance = np.maximum(side * (nodes.t - KINK), 0.0)
    assert np.sum(nodes.weight) == pytest.approx(1.6, rel=1e-14, abs=0.0)
    assert nodes.weight @ np.sqrt(distance) == pytest.approx(2.0 / 3.0 * 0.8**1.5, rel=1e-7)


@pytest.mark.parametrize(
    "roots",
    [
        (0.4, 0.6),  # none of the four nodes lies between them
        (0.01,),  # before the first node, as where a load has just begun
        (0.02, 0.5, 0.999),
    ],
)
def test_kinks_between_the_nodes_of_a_panel_are_found(roots: tuple[float, ...]) -> None:
    """Where a polynomial passes zero: twice between two nodes, or beyond the outer ones."""
    cuts = one_interval(2.0)
    panels = cut_at(whole_panels(cuts), cuts, np.array([1.0]), np.array([False]))
    signal = np.prod([panels.at(GAUSS)[0].ravel() * 2.0 - root for root in roots], axis=0)
    t, panel, values = interpolated(panels, cuts, signal.reshape(len(panels), len(GAUSS), 1))
    assert crossings(t, panel, values[:, 0]) == pytest.approx(roots, abs=1e-12)


def test_only_a_change_of_the_most_loaded_ball_is_a_kink() -> None:
    """Two loads that are equal at pi/4, where a third one is above both, and at 5 pi/4, where they are the largest."""
    t = np.linspace(0.0, 2.0 * np.pi, 400)
    segment = np.zeros(len(t), dtype=int)
    signals, counts = rank_differences(
        segment, np.stack([np.sin(t), np.cos(t), 0.9 - 0.3 * (t - np.pi / 4.0) ** 2], axis=1)
    )
    found = crossings(t, segment, *signals.T, counts=counts.T)
    assert np.min(np.abs(found - 1.25 * np.pi)) < 1e-6
    assert np.min(np.abs(found - 0.25 * np.pi)) > 0.1


@pytest.mark.long
def test_the_derivative_of_a_mean_is_known_where_balls_change_rank_twice(make_model: Callable[..., Model]) -> None:
    """Of the press's highest ball force over a tenth of a turn: corners of the damping, and two changes of rank within
    3 us.  A lost one is an error of 1e-5 or more."""
    model, names = make_model("punching_press"), ("mean:ball.force", "bearing.clearance")
    run: dict[str, Any] = {"cycles": 2.8, "transient": 2.7, "check": False}
    (loose,), (tight,) = (model.sensitivity(*names, rtol=rtol, **run).pairs for rtol in (1e-11, 1e-12))
    assert loose.derivative == pytest.approx(tight.derivative, rel=2e-6, abs=0.0)


@pytest.mark.long
def test_the_derivative_of_a_work_is_known_where_contacts_open(make_model: Callable[..., Model]) -> None:
    """Of the two-way press, whose torque's derivative has a square root at each end of a contact: within a part in
    100 000, and as far from that of ten times smaller tolerances as is stated."""
    model, names = make_model("punching_press_two_way"), ("drive_work", "bearing.clearance")
    (pair,) = model.sensitivity(*names).pairs
    (tight,) = model.sensitivity(*names, rtol=1e-12, sensitivity_rtol=1e-11, check=False).pairs
    assert pair.uncertainty is not None
    assert abs(pair.derivative - tight.derivative) <= pair.uncertainty < 1e-5 * abs(tight.derivative)
