"""Static load distribution over many balls: the radial integral of Stribeck and Sjövall, and Harris' table."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ballpass.derive import derive
from ballpass.derive.lowering.functions import lower
from ballpass.derive.reading.read import scene_from_text


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
