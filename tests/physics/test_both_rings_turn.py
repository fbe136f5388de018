"""Both rings of a bearing turn: kinematics in closed form, and the same statics seen from the outer ring."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model

TURN = 2.0 * math.pi
SCENE = """
[shaft]
speed = "1800 rpm"
outer_speed = "-700 rpm"

[load]
type = "harmonic"
mean = ["0 N", "0 N"]
amplitude = ["300 N", "300 N"]
frequency = "11 Hz"
phase = ["0 deg", "-90 deg"]

[bearing]
designation = "6204"
clearance = "5 um"
damping = { law = "tangent", ratio = "2.5e-5 s" }
inner_ring = { mass = "2 kg" }
outer_ring = { support = "fixed" }

[run]
cycles = 20
transient_cycles = 5
outputs = ["inner.*", "ball.*", "ring_force.*", "cage.*"]
"""


@pytest.fixture(scope="module")
def both(model_of: Callable[..., Model]) -> Model:
    return model_of(SCENE, "both_rings")


def test_the_cage_and_the_passes_are_those_of_rolling_between_two_rings(both: Model) -> None:
    """Cage (w_i (1 - g) + w_o (1 + g))/2; passes (w_i - w_o)(1 -+ g)/2, g = D_w/D_pw (Harris & Kotzalas, ch. 10)."""
    inner, outer, ratio = 1800 / 60 * TURN, -700 / 60 * TURN, 7.9375 / 33.5
    known = both.constants()
    cage = 0.5 * (inner * (1 - ratio) + outer * (1 + ratio))
    assert known["bearing.cage_speed"] == pytest.approx(cage, rel=1e-12)
    assert known["bearing.outer_pass_speed"] == pytest.approx(0.5 * (inner - outer) * (1 - ratio), rel=1e-12)
    assert known["bearing.inner_pass_speed"] == pytest.approx(-0.5 * (inner - outer) * (1 + ratio), rel=1e-12)
    assert known["bearing.ring_speed"] == pytest.approx(inner - outer, rel=1e-12)
    first, later = both.evaluate(0.0), both.evaluate(0.01)
    for ring, speed in (("outer", cage - outer), ("inner", cage - inner)):
        turned = later[f"cage.in_{ring}"] - first[f"cage.in_{ring}"] - 0.01 * speed
        assert math.remainder(turned, TURN) == pytest.approx(0.0, abs=1e-10)


def test_at_rest_it_is_the_bearing_seen_from_its_outer_ring(both: Model, model_of: Callable[..., Model]) -> None:
    """Axes that turn with the outer ring: that stands, the inner one turns at the difference, the load turns back."""
    seen = SCENE.replace('outer_speed = "-700 rpm"\n', "").replace('"1800 rpm"', '"2500 rpm"')
    # 11 Hz forward, from axes that turn by 700 rpm backward
    seen = seen.replace('"11 Hz"', f'"{11 + 700 / 60!r} Hz"')
    other = model_of(seen, "from_the_outer_ring")
    for time in (0.0, 0.0031, 0.0174):
        one, two = (model.static_equilibrium(time) for model in (both, other))
        assert one.ball_force == pytest.approx(two.ball_force, rel=1e-7, abs=1e-6 * np.max(two.ball_force))


@pytest.mark.long
def test_rings_of_unlike_speeds_have_a_life(both: Model) -> None:
    """The load turns against both rings; turns of one against the other are hours at the difference of speeds."""
    (bearing,) = both.life(cycles=60, transient=20).bearings
    hours = bearing.life / (2500.0 * 60.0)
    assert bearing.hours(bearing.life) == pytest.approx(hours, rel=1e-6)


@pytest.mark.long
def test_an_outer_ring_that_does_not_turn_is_none(model_of: Callable[..., Model]) -> None:
    standing = model_of(SCENE.replace('"-700 rpm"', '"0 rpm"'), "standing")
    without = model_of(SCENE.replace('outer_speed = "-700 rpm"\n', ""), "without")
    runs = [model.simulate(rtol=1e-10) for model in (standing, without)]
    for name in ("inner.x", "ring_force.y"):
        assert runs[0][name] == pytest.approx(runs[1][name], abs=1e-7 * np.ptp(runs[1][name]))


def test_the_inner_ring_must_turn() -> None:
    with pytest.raises(SceneError, match="the inner ring stands"):
        scene_from_text(SCENE.replace('"1800 rpm"', '"0 rpm"').replace("cycles = 20", 'duration = "1 s"'), "both_rings")
