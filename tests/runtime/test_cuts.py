"""A cut more, at any time and however it moves with the parameters, changes no number: cuts say where panels end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from quick_cases import long_but

from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.quantity import layout, quantity_run
from ballpass.runtime.quantity.nodes import Edges, make_edges, with_passages

#: Of kinds that integrate, that search extremes between nodes, and that are taken at a moment.
SMOOTH = (
    *("rms:inner.y", "integral:drive_torque", "rms:drive_torque", "drive_work", "max:drive_torque"),
    *("peak_time:drive_torque", "value:inner.y@240deg"),
)
#: The same where the most loaded ball has corners, and how well the derivative by the speed is known [1].
#: No panel ends at corners of the places of a raceway.
CORNERED = {"mean:ball.force": 5e-6, "rms:ball.force": 5e-6, "min:ball.force": 5e-6, "life": 1e-4}
BY = {"bearing.clearance": 10.0, "mechanism.driver.speed": 2e-3}  # with how fast cuts move [s/unit]


@pytest.mark.parametrize("scene", long_but(["punching_press", "crank_shaper"], "punching_press"))
def test_a_cut_more_changes_no_value_and_no_derivative(
    make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch, scene: str
) -> None:
    model = make_model(scene)
    # the damping of the press is one-sided; where it has an infinite slope, its derivative has fewer digits
    cornered = CORNERED if scene != "punching_press" else {**CORNERED, "mean:ball.damping_force": 5e-6}
    drawn = np.random.default_rng(1)
    shares, moves = drawn.uniform(0.0, 1.0, 5), drawn.uniform(-1.0, 1.0, (5, len(BY))) * np.array(list(BY.values()))

    def more(*given: Any) -> Edges:
        edges = make_edges(*given)
        begin, end = edges.times[edges.first], edges.times[-1]
        order = np.argsort(shares)
        return with_passages(edges, (begin + shares * (end - begin))[order], moves[order, : edges.slopes.shape[1]])

    run: dict[str, Any] = {"cycles": 2, "transient": 1, "check": False}
    plain = model.sensitivity((*SMOOTH, *cornered), list(BY), **run)
    monkeypatch.setattr(layout, "make_edges", more)
    monkeypatch.setattr(quantity_run, "make_edges", more)
    cut = model.sensitivity((*SMOOTH, *cornered), list(BY), **run)
    for one, other in zip(plain.pairs, cut.pairs, strict=True):
        name = (one.quantity, one.parameter)
        assert other.value == pytest.approx(one.value, rel=1e-10, abs=0.0), name
        scale = max(abs(one.derivative), abs(one.value) / model.parameters[one.parameter])
        within = cornered.get(one.quantity, 1e-8)
        assert other.derivative == pytest.approx(one.derivative, abs=within * scale), name


def test_the_derivative_of_the_largest_damping_force_is_known_where_a_third_ball_comes_between_two(
    make_model: Callable[..., Model],
) -> None:
    """It was 1.1e-3 off: of three changes of rank between two places one was seen."""
    model = make_model("punching_press")
    (pair,) = model.sensitivity("mean:ball.damping_force", "mechanism.driver.speed", cycles=2, transient=1).pairs
    assert pair.check.verdict == Verdict.VERIFIED
    assert pair.derivative == pytest.approx(pair.check.value, rel=5e-5)
