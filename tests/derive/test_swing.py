"""Claims about the angles of bodies that carry bearings: whole turns are those of a fine sweep, or none are told."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive.lowering.functions import lower
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.system import derive

LEVER_BEARING = """[bearing]
joint = "O"
coupling = "two-way"
balls = 8
ball_diameter = "8 mm"
pitch_diameter = "34 mm"
clearance = "10 um"
[bearing.contact]
stiffness = "8e9 N/m^1.5"
[bearing.damping]
law = "none"
[bearing.outer_ring]
support = "fixed"

[run]
cycles = 1
outputs = ["inner.*"]
"""


@pytest.fixture(scope="module")
def turns(scene_text: Callable[..., str]) -> Callable[[float, float], float]:
    """Turns of the slotted lever in a turn of the crank of 80 mm, its pivot at a distance and angle from A."""
    text = scene_text("crank_shaper", ('["0 mm", "-200 mm"]', '["1 mm", "1 mm"]')).partition("[bearing]")[0]
    system = derive(scene_from_text(text + LEVER_BEARING, "shaper"))
    functions = lower(system, derivatives=False)
    place = next(k for k, c in enumerate(functions.constants) if c.name == "body.lever.turns")

    def found(distance: float, angle: float) -> float:
        where = {"x": distance * math.cos(angle), "y": distance * math.sin(angle)}
        p = [where.get(q.name[-1], q.default) if ".points.O." in q.name else q.default for q in system.parameters]
        return float(np.asarray(functions["constants"](p)).ravel()[place])

    return found


@pytest.mark.parametrize("distance", [0.2, 0.0805, 0.0802, 0.0795, 0.077, 0.04])
@pytest.mark.parametrize("angle", [0.0, math.radians(3.75), 2.0])
def test_turns_are_those_of_a_fine_sweep(turns: Callable[[float, float], float], distance: float, angle: float) -> None:
    crank = np.linspace(0.0, 2.0 * math.pi, 200_001)
    pin = 0.08 * np.exp(1j * crank) - distance * np.exp(1j * angle)
    swept = round(float(np.unwrap(np.angle(pin))[-1] - np.angle(pin[0])) / (2.0 * math.pi))
    told = turns(distance, angle)
    assert told in (swept, math.inf)
    if not 0.078 <= distance <= 0.082:
        assert told == swept


def test_a_lever_that_nobody_can_follow_has_no_turns(turns: Callable[[float, float], float]) -> None:
    assert turns(0.0799, math.radians(3.75)) == math.inf
