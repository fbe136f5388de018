"""Hand formulas beside the model: bearings that swing, tilt of the rings, bending of the shaft."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.ratings import life
from ballpass.runtime.ratings.oscillation import oscillation
from ballpass.runtime.ratings.tilt import ARCMIN, SHAFT_MODULUS, free_tilt, shaft_slope

BALL, PITCH, GROOVES = 7.9375e-3, 33.5e-3, (0.52 * 7.9375e-3, 0.53 * 7.9375e-3)
GAMMA = BALL / PITCH
SIZES = ((0.1e-3, 12.78e-3), (0.14e-3, 20.72e-3))
ALIGNED = "[bearing.alignment]\nmisalignment = {!r}\n{}[bearing.damping]"


def test_a_swing_of_a_right_angle_to_both_sides_is_a_turn() -> None:
    known = {"dynamic_rating": 13.5e3, "exponent": 3.0, "balls": 8, "gamma": GAMMA, "contacts": SIZES}
    turning = oscillation(math.pi / 2.0, 1000.0, **known)  # type: ignore[arg-type]
    assert turning.load == pytest.approx(1000.0, rel=1e-12)
    assert turning.life == pytest.approx(life.basic_life(13.5e3, 1000.0), rel=1e-12)
    small = oscillation(math.radians(5.0), 1000.0, **known)  # type: ignore[arg-type]
    # a way of 20 degrees a swing: 18 swings wear as a turn
    assert small.life == pytest.approx(18.0 * turning.life, rel=1e-12)


def test_limits_of_a_swing_follow_from_the_way_of_the_balls() -> None:
    """At the critical amplitude a ball comes to where the next one stood; at the dither amplitude, as far as 2 b."""
    found = oscillation(0.1, 1.0, dynamic_rating=1.0, exponent=3.0, balls=8, gamma=GAMMA, contacts=SIZES)
    cage = (1.0 - GAMMA) / 2.0
    assert 2.0 * found.critical * min(cage, 1.0 - cage) == pytest.approx(2.0 * math.pi / 8, rel=1e-12, abs=0.0)
    ways = [2.0 * found.dither * share * radius for share, (_, radius) in zip((1.0 - cage, cage), SIZES, strict=True)]
    assert all(way >= 2.0 * half * (1.0 - 1e-12) for way, (half, _) in zip(ways, SIZES, strict=True))
    assert min(way / half for way, (half, _) in zip(ways, SIZES, strict=True)) == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("clearance", [5e-6, 20e-6])
def test_rings_tilt_freely_until_the_first_ball_touches(clearance: float) -> None:
    """Centres of the grooves as circles in space: nowhere farther apart than r_i + r_o - D_w, and so at one place."""
    tilt = free_tilt(BALL, PITCH, GROOVES, clearance)
    inner, outer = PITCH / 2 + GROOVES[0] - BALL / 2 - clearance / 4, PITCH / 2 - GROOVES[1] + BALL / 2 + clearance / 4
    around = np.linspace(0.0, 2.0 * np.pi, 721)
    # inner circle turned about z = 0, y; each ball joins the centres in its own axial plane
    x, y = inner * np.cos(around), inner * np.sin(around)
    turned = np.stack([x * math.cos(tilt), y, x * math.sin(tilt)])
    along = np.hypot(turned[0], turned[1])
    apart = np.hypot(along - outer, turned[2])
    limit = sum(GROOVES) - BALL
    assert np.max(apart) == pytest.approx(limit, rel=1e-9, abs=0.0)
    assert int(np.argmax(apart)) in (0, 360, 720)
    assert 2.0 * ARCMIN < tilt < 25.0 * ARCMIN  # catalogues of deep groove bearings: some arcminutes
    assert free_tilt(BALL, PITCH, GROOVES, -1e-6) == 0.0


def test_slope_of_the_shaft_is_that_of_the_bent_beam() -> None:
    """Moment over E I, integrated from the middle, where the shaft is level, to the support."""
    load, span, diameter = 700.0, 0.2, 0.02
    place = np.linspace(0.0, span / 2.0, 20001)  # from the support
    bent = load * place / (SHAFT_MODULUS * math.pi * diameter**4 / 64.0)
    assert shaft_slope(load, span, diameter) == pytest.approx(np.trapezoid(bent, place), rel=1e-8)


def test_a_tilt_beyond_the_clearance_is_a_warning(make_model: Callable[..., Model]) -> None:
    free = free_tilt(BALL, PITCH, GROOVES, 5e-6) / ARCMIN
    silent = make_model("rotor").life(cycles=3, transient=2)
    words = f"Misalignment and bending of the shaft are in no number here; the clearance leaves {free:.3g} arcmin free."
    assert words in " ".join(str(silent).split())
    assert not any("tilted" in words for words in silent.beyond)
    shaft = 'span = "200 mm"\nshaft_diameter = "20 mm"\n'
    within = make_model("rotor", ("[bearing.damping]", ALIGNED.format("2 arcmin", shaft))).life(cycles=3, transient=2)
    (bearing,) = within.bearings
    assert bearing.tilt is not None
    assert bearing.tilt.bending == pytest.approx(shaft_slope(bearing.equivalent_load, 0.2, 0.02), rel=1e-12, abs=0.0)
    assert bearing.tilt.beyond == ""
    beyond = make_model("rotor", ("[bearing.damping]", ALIGNED.format("20 arcmin", ""))).life(cycles=3, transient=2)
    assert any("tilted by 20 arcmin" in words for words in beyond.beyond)


def test_a_span_needs_the_shafts_diameter(scene_text: Callable[..., str]) -> None:
    text = scene_text("rotor", ("[bearing.damping]", ALIGNED.format("2 arcmin", 'span = "0.2 m"\n')))
    with pytest.raises(SceneError, match="shaft_diameter"):
        scene_from_text(text, "rotor")


@pytest.mark.long
def test_the_pin_of_the_press_swings_by_what_its_rod_does(make_model: Callable[..., Model]) -> None:
    """Rod of 100 mm on a crank of 6 mm: ±3.4398 degrees."""
    report = make_model("punching_press_hinges").life(cycles=4)
    pin = next(bearing for bearing in report.bearings if bearing.name == "pin")
    assert pin.oscillation is not None
    assert math.degrees(pin.oscillation.amplitude) == pytest.approx(3.4398, abs=0.05)
    assert pin.oscillation.amplitude < pin.oscillation.critical
    assert "By hand (Harris): it swings by ±3.4" in str(report)
    assert all(bearing.oscillation is None for bearing in report.bearings if bearing is not pin)
