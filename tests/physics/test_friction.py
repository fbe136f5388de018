"""Friction of joints, against closed forms of a wheel that runs down and of a slotted lever."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from coupled_scenes import Derived
from test_springs import TURN, lever

from ballpass.derive import derive, equations, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.reading.usual import usual_ranges
from ballpass.derive.scene.errors import SceneError
from ballpass.runtime import load

INERTIA, SPEED = 0.04, 50.0
WHEEL = f"""
[mechanism.driver]
joint = "A"
speed = "{SPEED} rad/s"

[mechanism.driver.torque]
law = "none"

[mechanism.frame.points]
A = "origin"

[mechanism.bodies.wheel]
mass = "2 kg"
inertia = "{INERTIA} kg*m^2"
center_of_mass = "origin"
points = {{ A = "origin" }}

[mechanism.joints.A]
type = "revolute"
bodies = ["frame", "wheel"]

[run]
duration = "3 s"
outputs = ["driver.*", "friction.*"]

[mechanism.friction.pin]
joint = "A"
"""
FRICTION = 'viscous = "0.02 N*m*s/rad"\ntorque = "0.8 N*m"\nsmoothing = "0.5 rad/s"\n'
PIN = """[mechanism.friction.pin]
joint = "B"
viscous = "0.4 N*m*s/rad"
torque = "30 N*m"
smoothing = "5 rad/s"

"""
SLOT = """[mechanism.guide_friction.slot]
joint = "S"
viscous = "60 N*s/m"
force = "250 N"
smoothing = "0.4 m/s"

"""


def changes(*added: str) -> tuple[tuple[str, str], ...]:
    return (("[mechanism.forces.cut]\n", "".join(added) + "[mechanism.forces.cut]\n"),)


def test_a_wheel_runs_down_by_viscous_friction_exponentially_and_by_coulomb_friction_in_a_straight_line(
    tmp_path: Path,
) -> None:
    """Of smoothed Coulomb friction sinh(speed / smoothing) decays exponentially: far above it, a straight line."""
    (tmp_path / "wheel.toml").write_text(WHEEL + FRICTION)
    model, speeds = load(generate(tmp_path / "wheel.toml", tmp_path / "wheel")), {}
    for name, without in (("viscous", "torque"), ("coulomb", "viscous")):
        run = model.simulate(rtol=1e-11, parameters={f"mechanism.friction.pin.{without}": 0.0})
        speeds[name] = run["driver.speed"]
    assert speeds["viscous"] == pytest.approx(SPEED * np.exp(-0.02 / INERTIA * run.t), rel=1e-9)
    slope = 0.8 / INERTIA
    straight = SPEED - slope * run.t
    moving = straight > 10.0
    assert speeds["coulomb"][moving] == pytest.approx(straight[moving], rel=1e-9)
    # of large arguments asinh(sinh(a) exp(b)) is taken apart
    logarithm = SPEED / 0.5 - math.log(2.0) - slope / 0.5 * run.t
    whole = 0.5 * np.logaddexp(logarithm, 0.5 * np.logaddexp(2.0 * logarithm, 0.0))
    assert speeds["coulomb"] == pytest.approx(whole, abs=1e-7)
    assert abs(speeds["coulomb"][-1]) < 1e-6


def test_the_drive_gives_what_the_friction_of_a_moving_hinge_and_a_moving_guide_loses(
    scene_text: Callable[..., str],
) -> None:
    """At every angle, at constant speed: rate times what resists it."""
    speed = 4.0 * math.pi
    rubbing, bare = (
        [derived.outputs(a / speed, np.zeros(8), {"cut": 0.0}) for a in TURN]
        for derived in (Derived(scene_from_text(scene_text("crank_shaper", *c), "s")) for c in (changes(PIN, SLOT), ()))
    )
    turning = lever(TURN, speed).angle_rate - speed
    pin = 0.08 * np.exp(1j * TURN)
    sliding = np.real(np.conj(pin + 0.2j) * 1j * speed * pin) / np.abs(pin + 0.2j)
    lost = turning * (0.4 * turning + 30.0 * np.tanh(turning / 5.0))
    lost += sliding * (60.0 * sliding + 250.0 * np.tanh(sliding / 0.4))
    added, push = (
        np.array([one[name] - other[name] for one, other in zip(rubbing, bare, strict=True)])
        for name in ("drive_torque", "reaction.O.x")
    )
    assert added * speed == pytest.approx(lost, rel=1e-9)
    assert np.max(np.abs(push)) > 1.0


def test_equations_name_friction(scene_text: Callable[..., str]) -> None:
    text = equations(derive(scene_from_text(scene_text("crank_shaper", *changes(PIN, SLOT)), "shaper")))
    assert "Friction torque of pin, against the rate [N·m]" in text
    assert "Friction force of slot, against the rate [N]" in text
    assert r"\tanh" in text


def test_coulomb_friction_that_turns_round_over_much_of_the_speed_is_unusual(scene_text: Callable[..., str]) -> None:
    scene = scene_from_text(scene_text("crank_shaper", *changes(PIN, SLOT)), "shaper")
    (found,) = (info for info in usual_ranges(scene) if "friction" in info.names[0])
    assert (found.names, found.of) == (("mechanism.friction.pin.smoothing",), "mechanism.driver.speed")
    assert found.most == 0.1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('smoothing = "5 rad/s"\n', ""), r'add smoothing = "1 rad/s"'),
        (('"5 rad/s"', '"0 rad/s"'), "the value is zero"),
        (('"30 N*m"', '"-30 N*m"'), "the value is negative"),
        (('viscous = "0.4 N*m*s/rad"\ntorque = "30 N*m"\nsmoothing = "5 rad/s"\n', ""), "neither viscous friction nor"),
        (('torque = "30 N*m"', "coefficient = 0.1"), "that reaction depends on the friction itself"),
        (('"B"', '"Q"'), "there is no such joint"),
        (('"B"', '"S"'), r"this joint is prismatic.*\[mechanism.guide_friction.pin\]"),
    ],
)
def test_friction_that_cannot_be_is_refused_with_a_remedy(
    scene_text: Callable[..., str], change: tuple[str, str], words: str
) -> None:
    assert change[0] in PIN
    with pytest.raises(SceneError) as caught:
        derive(scene_from_text(scene_text("crank_shaper", *changes(PIN.replace(*change))), "shaper"))
    assert caught.value.faults[0].line is not None
    assert re.search(words, str(caught.value), re.DOTALL)
