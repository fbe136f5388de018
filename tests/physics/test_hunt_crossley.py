"""Claims about Hunt and Crossley's law: an impact of one ball has a first integral, which gives depth and rebound."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from scipy.optimize import brentq

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load

MASS, STIFFNESS, SPEED, FACTOR = 0.4, 8e9, 0.3, 0.9

#: One ring flies against ball 1; the other two of three balls are far away, nothing turns and nothing pulls.
IMPACT = f"""
[shaft]
speed = "0 rpm"
[load]
type = "constant"
force = ["0 N", "0 N"]
[bearing]
balls = 3
ball_diameter = "8 mm"
pitch_diameter = "33 mm"
clearance = "200 um"
[bearing.contact]
stiffness = "{STIFFNESS} N/m^1.5"
[bearing.damping]
law = "hunt-crossley"
DAMPING
[bearing.inner_ring]
mass = "{MASS} kg"
[bearing.outer_ring]
support = "fixed"
[bearing.initial]
inner = ["100 um", "0 um"]
inner_velocity = ["{SPEED} m/s", "0 m/s"]
[run]
duration = "0.6 ms"
outputs = ["inner.*", "ball.*"]
"""


def impact(folder: Path, damping: str) -> Model:
    return load(generate(scene_from_text(IMPACT.replace("DAMPING", damping), "impact"), folder / "impact"))


def left(speed: float, factor: float) -> float:
    """m v dv/(1 + alpha v) integrated from rest [J]."""
    return MASS * (speed / factor - math.log1p(factor * speed) / factor**2)


def rebound(factor: float) -> float:
    """Speed away from the ball."""
    bound = -(1.0 - 1e-12) / factor
    return -brentq(lambda v: left(v, factor) - left(SPEED, factor), max(bound, -SPEED), -1e-9, xtol=1e-15)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return impact(tmp_path_factory.mktemp("impact"), f'hysteresis = "{FACTOR} s/m"')


def test_depth_and_rebound_are_those_of_the_first_integral(model: Model) -> None:
    run = model.simulate(rtol=1e-11)
    depth = (2.5 * left(SPEED, FACTOR) / STIFFNESS) ** 0.4
    assert model.reduce(rtol=1e-11)["ball.deflection"].maximum == pytest.approx(depth, rel=1e-9, abs=0.0)
    assert run["inner.vx"][-1] == pytest.approx(-rebound(FACTOR), rel=1e-9)


@pytest.mark.long
def test_the_derivative_of_the_rebound_is_that_of_the_first_integral(model: Model) -> None:
    step = 1e-5
    slope = -(rebound(FACTOR + step) - rebound(FACTOR - step)) / (2 * step)
    found = model.sensitivities("bearing.damping.hysteresis", rtol=1e-10, sensitivity_rtol=1e-9)
    column = list(model.states).index("inner.vx")
    assert found.x[-1, column, 0] == pytest.approx(slope, rel=1e-6, abs=0.0)


@pytest.mark.long
def test_a_smoothed_contact_keeps_the_law(tmp_path: Path) -> None:
    """The first integral holds for any elastic force; a smoothed onset stores 3e-7 of the energy at first."""
    law = f'hysteresis = "{FACTOR} s/m"\n[bearing.contact]\nstiffness = "{STIFFNESS} N/m^1.5"\nsmoothing = "0.05 um"'
    text = IMPACT.replace(f'[bearing.contact]\nstiffness = "{STIFFNESS} N/m^1.5"\n', "").replace("DAMPING", law)
    smoothed = load(generate(scene_from_text(text, "smoothed"), tmp_path / "smoothed"))
    speed = smoothed.simulate(rtol=1e-10)["inner.vx"][-1]
    assert speed == pytest.approx(-rebound(FACTOR), rel=5e-7)


@pytest.mark.long
def test_lankarani_and_nikravesh_lose_what_restitution_says(tmp_path: Path) -> None:
    restitution = 0.98
    elastic = impact(tmp_path, f'restitution = {restitution}\nimpact_speed = "{SPEED} m/s"')
    assert elastic.constants()["bearing.c_b"] == pytest.approx(0.75 * (1 - restitution**2) / SPEED, rel=1e-14, abs=0.0)
    speed = elastic.simulate(rtol=1e-10)["inner.vx"][-1]
    # their factor is right to the first order of the loss
    assert 1 - (speed / SPEED) ** 2 == pytest.approx(1 - restitution**2, rel=0.05)
