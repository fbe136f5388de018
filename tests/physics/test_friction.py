"""Friction of joints against closed forms of a wheel that runs down."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import generate
from ballpass.derive.reading.plausible_ranges import usual_ranges
from ballpass.derive.reading.read import scene_from_text
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
outputs = ["driver.*", "friction.*", "dissipated_power"]

[mechanism.friction.pin]
joint = "A"
"""
FRICTION = 'viscous = "0.02 N*m*s/rad"\ntorque = "0.8 N*m"\nsmoothing = "0.5 rad/s"\n'


@pytest.mark.long
def test_a_wheel_runs_down_by_viscous_friction_exponentially_and_by_coulomb_friction_in_a_straight_line(
    tmp_path: Path,
) -> None:
    """Of smoothed Coulomb friction sinh(speed / smoothing) decays exponentially: far above it, a straight line."""
    (tmp_path / "wheel.toml").write_text(WHEEL + FRICTION)
    model, speeds = load(generate(tmp_path / "wheel.toml", tmp_path / "wheel")), {}
    for name, without in (("viscous", "torque"), ("coulomb", "viscous")):
        run = model.simulate(rtol=1e-11, parameters={f"mechanism.friction.pin.{without}": 0.0})
        speeds[name] = run["driver.speed"]
        taken = {"viscous": 0.02 * speeds[name] ** 2, "coulomb": 0.8 * speeds[name] * np.tanh(speeds[name] / 0.5)}
        assert run["dissipated_power"] == pytest.approx(taken[name], rel=1e-12, abs=0.0)
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


def test_coulomb_friction_that_turns_round_over_much_of_the_speed_is_unusual(scene_text: Callable[..., str]) -> None:
    cut = "[mechanism.forces.cut]\n"
    pin = f'[mechanism.friction.pin]\njoint = "B"\ntorque = "30 N*m"\nsmoothing = "5 rad/s"\n\n{cut}'
    scene = scene_from_text(scene_text("crank_shaper", (cut, pin)), "shaper")
    (found,) = (info for info in usual_ranges(scene) if "friction" in info.names[0])
    assert (found.names, found.of) == (("mechanism.friction.pin.smoothing",), "mechanism.driver.speed")
    assert found.most == 0.1
