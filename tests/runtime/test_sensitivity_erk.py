"""The stepper's derivatives against those of CasADi's erk, forward and backward: other steps, no jump term."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ballpass.runtime import Model, RequestError
from ballpass.runtime.certify.certificate import Verdict

# preload keeps every ball in contact; the run covers the start of the punch's window
PRELOADED = {"bearing.clearance": -60e-6, "mechanism.driver.start_angle": 4.05}
SPAN = {"cycles": 0.04, "transient": 0.0}
OF = ["rms:inner.y", "value:inner.vy@240deg", "max:ball.force", "mean:ball.force"]
WRT = ["mechanism.driver.speed", "mechanism.forces.punch.window.start", "bearing.contact.inner_groove_radius"]


@pytest.fixture(scope="module")
def model(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_tangent")


@pytest.mark.parametrize("direction", ["erk", "adjoint"])
def test_another_integrator_gives_the_same_derivatives(model: Model, direction: str) -> None:
    report = model.sensitivity(OF, WRT, parameters=PRELOADED, check=direction, **SPAN)  # type: ignore[arg-type]
    assert report.verdicts[Verdict.VERIFIED] == len(report.pairs)
    for pair in report.pairs:
        assert pair.check.value is not None
        # a derivative that is next to nothing is known to so much of the quantity
        least = 1e-8 * abs(pair.value / pair.parameter_value)
        assert pair.derivative == pytest.approx(pair.check.value, rel=1e-6, abs=least), (pair.quantity, pair.parameter)


def test_backward_and_forward_differentiate_the_same_steps(model: Model) -> None:
    """Adjoint and forward are derivatives of one discrete map: they agree to rounding."""
    ways = [
        model.sensitivity(OF, WRT, parameters=PRELOADED, method="erk", direction=direction, check=False, **SPAN)  # type: ignore[arg-type]
        for direction in ("forward", "adjoint")
    ]
    for forward, adjoint in zip(ways[0].pairs, ways[1].pairs, strict=True):
        assert forward.derivative == pytest.approx(adjoint.derivative, rel=1e-9)


def test_erk_is_no_second_route_to_itself(model: Model) -> None:
    with pytest.raises(RequestError, match="no second route"):
        model.sensitivity(OF, WRT, parameters=PRELOADED, method="erk", check="erk", **SPAN)  # type: ignore[arg-type]
