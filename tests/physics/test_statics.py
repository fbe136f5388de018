"""Static load distribution: closed forms, the Sjövall integral and Harris' table, and the 6204 at 1000 N."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive import derive
from ballpass.derive.lowering.functions import lower
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model

GIVEN = 'stiffness = "13.34e9 N/m^1.5"'
HERTZ = """inner_groove_radius = "4.1275 mm"
outer_groove_radius = "4.206875 mm"
young_modulus = "207 GPa"
poisson_ratio = 0.3"""


def equilibrium(model: Model, *, force: float, clearance: float, ball_angle: float) -> tuple[float, float]:
    """Displacement [m] of the inner ring along the load and largest ball force [N], by Newton's method."""
    parameters = {
        "load.force.x": force,
        "load.force.y": 0.0,
        "shaft.speed": 0.0,
        "bearing.clearance": clearance,
        "bearing.ball_angle": ball_angle,
    }
    x = np.array([clearance / 2 + 1.2 * (force / model.constants(parameters)["bearing.k_b"]) ** (2 / 3), 0.0, 0.0, 0.0])
    for _ in range(60):
        numbers = model.numbers(parameters)
        u = model.inputs_at(0.0, parameters)
        residual = model.function("rhs")(0.0, x, u, numbers.p, numbers.c).full().ravel()[2:]
        slope = model.jacobian("rhs", wrt="states", t=0.0, x=x, parameters=parameters)[2:, :2]
        step = np.linalg.lstsq(slope, -residual, rcond=1e-9)[0]
        x[:2] += step
        if np.abs(step).max() < 1e-16:
            break
    balls = model.evaluate(0.0, x, outputs=["ball.force"], parameters=parameters)["ball.force"]
    return float(x[0]), float(np.max(balls))


@pytest.fixture(scope="module")
def bearing_6204(make_model: Callable[..., Model]) -> Model:
    return make_model("varying_compliance", (GIVEN, HERTZ))


@pytest.mark.parametrize(
    ("clearance", "between", "displacement", "largest"),
    [
        (0.0, False, 15.8057e-6, 543.21),
        (0.0, True, 15.9145e-6, 487.38),
        (10e-6, False, 21.7348e-6, 591.81),
        (10e-6, True, 21.9984e-6, 518.56),
    ],
)
def test_6204_under_1000_newton(
    bearing_6204: Model, clearance: float, between: bool, displacement: float, largest: float
) -> None:
    found, ball = equilibrium(
        bearing_6204, force=1000.0, clearance=clearance, ball_angle=math.pi / 8 if between else 0.0
    )
    assert found == pytest.approx(displacement, abs=6e-11)
    assert ball == pytest.approx(largest, abs=6e-3)


@pytest.mark.parametrize(("between", "factor"), [(False, 4.345709), (True, 3.899026)])
def test_largest_ball_force_at_zero_clearance(bearing_6204: Model, between: bool, factor: float) -> None:
    """Z Q_max / F; with a ball on the load line it is 8/(1 + 2 cos^2.5 45 deg) in closed form."""
    _, ball = equilibrium(bearing_6204, force=500.0, clearance=0.0, ball_angle=math.pi / 8 if between else 0.0)
    assert 8 * ball / 500.0 == pytest.approx(factor, rel=2e-7)
    if not between:
        assert 8 * ball / 500.0 == pytest.approx(8 / (1 + 2 * math.cos(math.pi / 4) ** 2.5), rel=1e-10)


@pytest.mark.parametrize(("deflection", "growth"), [(2.0, 2 ** (2 / 3)), (10.0, 10 ** (2 / 3))])
def test_deflection_grows_with_load_to_the_two_thirds(bearing_6204: Model, deflection: float, growth: float) -> None:
    reference, _ = equilibrium(bearing_6204, force=100.0, clearance=0.0, ball_angle=0.1)
    loaded, _ = equilibrium(bearing_6204, force=100.0 * deflection, clearance=0.0, ball_angle=0.1)
    assert loaded / reference == pytest.approx(growth, rel=1e-10)


@pytest.mark.parametrize(
    ("epsilon", "integral", "tolerance"),
    [
        (0.5, 0.228828, 6e-7),
        *(pytest.param(*row, 6e-5, marks=pytest.mark.long) for row in ((0.2, 0.1590), (1.0, 0.2546), (2.5, 0.1339))),
    ],
)
def test_many_balls_give_the_radial_load_integral(
    scene_text: Callable[..., str], epsilon: float, integral: float, tolerance: float
) -> None:
    """J_r = F/(Z Q_max) of Harris' table for the load zone parameter epsilon, from 200 balls at a given displacement.

    epsilon = (1 - P_d/(2 delta_r))/2 with the ring's displacement delta_r: preload (P_d < 0) gives epsilon above
    one half.
    """
    text = scene_text(
        "varying_compliance",
        ("balls = 8", "balls = 200"),
        ('ball_diameter = "7.9375 mm"', 'ball_diameter = "0.4 mm"'),
        ("outputs = [", 'outputs = ["ring_force.*", '),
    )
    system = derive(scene_from_text(text, "varying_compliance"))
    functions = lower(system)
    displacement = 20e-6
    clearance = 2 * displacement * (1 - 2 * epsilon)
    p = [clearance if q.name == "bearing.clearance" else q.default for q in system.parameters]
    c = functions["constants"](p)
    phase = 0.003  # any offset of the balls: with so many, a Hertz law does not see it
    result = functions["outputs"](x=[displacement, 0, 0, 0], u=[phase], p=p, c=c)
    k_b = float(c[[k.name for k in functions.constants].index("bearing.k_b")])
    largest = k_b * (displacement - clearance / 2) ** 1.5
    assert float(result["ring_force_x"]) / (200 * largest) == pytest.approx(integral, abs=tolerance)
