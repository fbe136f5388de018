"""Claims about refined peaks: what the run's own dense output finds by another way, and what is not smooth."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from raceway.runtime import Model
from raceway.runtime.summary import summarize

ModelMaker = Callable[..., Model]


@pytest.mark.parametrize("name", ["punching_press", "punching_press_tangent"])
@pytest.mark.parametrize("output", ["ball.force", "ball.elastic_force"])
def test_refined_peak_equals_that_of_the_reduction_at_equal_tolerance(
    make_model: ModelMaker, name: str, output: str
) -> None:
    """The driver searches its steps' polynomials, `refine_peak` grids from sampled states."""
    model = make_model(name)
    peak = model.refine_peak(model.simulate(3, transient=1, rtol=1e-9, outputs=[output]).steady(), output)
    reduced = model.reduce(3, transient=1, rtol=1e-9)[output]
    assert peak.value == pytest.approx(reduced.maximum, rel=1e-8)
    assert peak.time == pytest.approx(reduced.maximum_time, abs=1e-8)
    assert peak.ball == reduced.maximum_ball


def test_summary_tells_the_peak_that_the_reduction_finds(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    found = summarize(model, model.simulate(3, transient=1))["peak_ball_force"]
    assert found["total"] == pytest.approx(model.reduce(3, transient=1)["ball.force"].maximum, rel=2e-6)


def test_a_few_samples_find_the_peak_that_many_find(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    few, many = (
        model.refine_peak(model.simulate(2, transient=0, rtol=1e-9, samples_per_cycle=n), "ball.force")
        for n in (500, 7001)
    )
    assert few.sampled < many.value * (1.0 - 1e-4)
    assert few.value == pytest.approx(many.value, rel=1e-8)


def test_a_load_that_jumps_peaks_at_the_edge_itself(make_model: ModelMaker) -> None:
    """The reaction's limit at the window's end, reached from within; where the reaction falls there is no parabola."""
    model = make_model("punching_press")
    solution = model.simulate(1, transient=0, samples_per_cycle=307, outputs=["reaction.A.y"])
    peak = model.refine_peak(solution, "reaction.A.y")
    turn = model.period()
    edge = next(t for t in model.breakpoints(0.0, turn) if abs(t - peak.time) < turn / 307)
    sides = [model.evaluate(edge + s * turn, outputs=["reaction.A.y"])["reaction.A.y"] for s in (-1e-11, 1e-11)]
    assert peak.value == pytest.approx(max(float(side) for side in sides), rel=1e-8)
    assert math.isclose(peak.time, edge, abs_tol=1e-9)
