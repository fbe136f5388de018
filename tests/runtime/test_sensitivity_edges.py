"""Sensitivities where loads switch at times that move with a parameter, and where a ball only touches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.run.directions import Chain

# preload keeps every ball in contact: nothing but the punch's window makes a derivative jump
PRELOADED = {"bearing.clearance": -60e-6, "mechanism.driver.start_angle": 4.0}
MOVING = ["mechanism.forces.punch.window.start", "mechanism.forces.punch.window.end", "mechanism.driver.speed"]
QUANTITIES = ["rms:inner.vy", "value:inner.y@300deg", "mean:inner.y"]


@pytest.fixture(scope="module")
def model(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_tangent")


def test_derivatives_by_window_and_speed_are_verified(model: Model) -> None:
    report = model.sensitivity(QUANTITIES, MOVING, 0.4, transient=0.0, parameters=PRELOADED)
    assert report.verdicts[Verdict.VERIFIED] == len(report.pairs)
    for pair in report.pairs:
        assert pair.check.value is not None
        assert pair.derivative == pytest.approx(pair.check.value, rel=1e-5, abs=0.0)


@pytest.mark.long
def test_without_the_jump_term_they_disagree(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver is told that no edge moves; everything else stays."""
    monkeypatch.setattr(Chain, "breakpoint", lambda self, time: np.zeros(len(self.names)))
    report = model.sensitivity(QUANTITIES, MOVING, 0.4, transient=0.0, parameters=PRELOADED)
    assert report.verdicts[Verdict.DISAGREES] == len(report.pairs)


def test_the_peak_of_a_load_at_the_edge_of_its_window_moves_with_it(model: Model) -> None:
    """The reaction is largest when the punch strikes: its derivative by the window's start is its own slope there."""
    report = model.sensitivity("max:reaction.A.y", MOVING[0], 1.0, transient=0.0, check=False)
    (peak,) = report.quantities
    assert peak.time is not None
    assert "at an edge" in peak.notes[0]
    speed, later = model.parameters["mechanism.driver.speed"], 1e-6
    values = [model.evaluate(peak.time + later * k, outputs=["reaction.A.y"])["reaction.A.y"] for k in (1, 2)]
    slope = (float(values[1]) - float(values[0])) / (later * speed)
    assert report["max:reaction.A.y", MOVING[0]].derivative == pytest.approx(slope, rel=1e-3)


@pytest.mark.long
def test_where_a_ball_only_touches_derivatives_are_right(make_model: Callable[..., Model]) -> None:
    """Preload is relieved behind the load: at one clearance balls are just relieved in passing."""
    model = make_model("varying_compliance")
    deflection = "min:ball.deflection[1]"

    def least(clearance: float) -> float:
        numbers = {"bearing.inner_ring.damping": 4e5, "bearing.clearance": clearance}
        return model.quantities(deflection, 3.0, transient=0.3, parameters=numbers)[deflection].value

    touching = brentq(least, -20e-6, -0.1e-6, xtol=1e-12)
    assert abs(least(touching)) < 1e-11
    numbers = {"bearing.inner_ring.damping": 4e5, "bearing.clearance": touching}
    asked = ["max:ball.force", "rms:inner.y", "range:inner.y", "mean:inner.x", "end:inner.y"]
    by = ["load.force.x", "bearing.clearance", "shaft.speed"]
    report = model.sensitivity(asked, by, 3.0, transient=0.3, parameters=numbers)
    assert len(report.grazing) > 0
    assert report.verdicts[Verdict.VERIFIED] == len(report.pairs)
