"""Lives with an axial force or a tilt: `ballpass life`, against statics, printed factors and the radial report."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.life.combined_load import CombinedLoad, ball_bearing
from ballpass.runtime.life.records import BearingStrength
from ballpass.runtime.ratings import life
from ballpass.runtime.ratings.five_degrees import ball_statics
from ballpass.runtime.ratings.of_bearing import ratings_of

SCENE = (Path(__file__).resolve().parents[2] / "scripts/validation/reference_life.toml").read_text(encoding="utf-8")
#: ISO 281:2007, Table 3, deep groove: F_a/(Z D_w²) [N/mm²], Y.
PRINTED_Y = ((0.172, 2.30), (0.345, 1.99), (0.689, 1.71), (1.03, 1.55), (2.07, 1.31), (6.89, 1.00))
TURNS = {"cycles": 18, "transient": 2}

Made = Callable[..., Model]


@pytest.fixture
def made(model_of: Callable[..., Model]) -> Made:
    """The bearing of the printed lives, 1000 N radially, with more keys."""
    return lambda keys, rest="": model_of(SCENE.replace("balls = 7", f"{keys}\nballs = 7") + rest, "reference_life")


def found(model: Model) -> tuple[BearingStrength, CombinedLoad]:
    (bearing,) = model.life(**TURNS).bearings
    assert bearing.combined is not None
    return bearing, bearing.combined


def test_with_next_to_no_axial_force_the_life_is_the_radial_one(made: Made) -> None:
    """12769.7 million turns by an independent program, the mean over the cage's angle."""
    bearing, combined = found(made('axial_force = "0.01 N"'))
    assert combined.life == pytest.approx(bearing.life, rel=2e-3)
    assert combined.life == pytest.approx(12769.7e6, rel=2e-3)
    assert combined.basic_life == pytest.approx(bearing.basic_life, rel=1e-3)
    assert combined.peak_force == pytest.approx(bearing.peak_force, rel=1e-3)


def test_a_load_that_turns_with_the_shaft_meets_one_place_of_the_inner_ring(make_model: Callable[..., Model]) -> None:
    """An unbalance without weight, in clearance: the life by statics is that of the motion's ball loads."""
    model = make_model("rotor", ("[bearing]\n", '[bearing]\naxial_force = "0.001 N"\n'))
    report = model.life(parameters={"loads.weight.force.y": 0.0}, cycles=40)
    (bearing,) = report.bearings
    assert bearing.combined is not None
    assert bearing.combined.life == pytest.approx(bearing.life, rel=5e-3)
    assert any("the minimum load" in words for words in report.beyond)


def test_an_axial_force_counts_for_the_minimum_load(make_model: Callable[..., Model]) -> None:
    report = make_model("rotor", ("[bearing]\n", '[bearing]\naxial_force = "200 N"\n')).life(cycles=22)
    assert not any("the minimum load" in words for words in report.beyond)


def test_the_life_is_that_of_the_statics_at_all_angles_of_the_cage(made: Made) -> None:
    model = made('axial_force = "1 kN"\nshoulder_height = "0.6 mm"')
    bearing, combined = found(model)
    info, values = model.manifest.bearings[0], model.numbers().values
    pitch = np.linspace(0.0, 2.0 * math.pi / 7.0, 200, endpoint=False)
    solved = ball_statics(ball_bearing(info, values), np.tile((1e3, 0.0, 1e3), (200, 1)), tilt=(0, 0), ball_angle=pitch)
    rings = [life.equivalent_ball_load(solved.ball_load.ravel().tolist(), turning=one) for one in (True, False)]
    ratings = ratings_of(info, values)
    expected = life.reference_life((ratings.inner_ball, ratings.outer_ball), (rings[0], rings[1]))
    assert combined.life == pytest.approx(expected, rel=3e-3)
    assert combined.peak_force == pytest.approx(solved.ball_load.max(), rel=1e-3)
    assert combined.contact_angle == pytest.approx(solved.contact_angle[solved.ball_load > 0.0].max(), rel=1e-3)
    assert bearing.rated_lives == (combined.basic_life, combined.life)
    # the heaviest ball is that of the statics: s_0 follows it, and so does the verdict
    assert bearing.static_safety == pytest.approx(5.0 * bearing.static_rating / (7.0 * combined.peak_force), rel=1e-9)
    (warned,) = (words for words in bearing.beyond if "shoulder" in words)
    assert f"{1e3 * combined.reach[0]:.3g} mm up its groove" in warned
    assert replace(combined, shoulder_height=2e-3).beyond == ""


def test_a_heavy_load_reaches_higher_by_half_its_ellipse(made: Made) -> None:
    """Under a radial load alone the contact's edge is at a/r from the bottom of the groove."""
    bearing, combined = found(made('axial_force = "0.01 N"'))
    for reach, ring, radius in zip(combined.reach, (bearing.inner, bearing.outer), (5.98e-3, 6.095e-3), strict=True):
        assert reach == pytest.approx(radius * (1.0 - math.cos(ring.major_axis / radius)), rel=2e-3)


def test_y_follows_the_printed_table() -> None:
    for ratio, printed in PRINTED_Y:
        angle = life.table_angle(ratio * 8 * 7.9375**2, 8, 7.9375e-3)
        assert life.axial_factors(angle, deep_groove=True)[1] == pytest.approx(printed, rel=0.03)  # e has two digits


def test_a_tilt_shortens_the_life_and_next_to_none_does_not(made: Made) -> None:
    words = '\n[bearing.alignment]\nmisalignment = "{} arcmin"\n'
    bearing, tilted = found(made("", words.format(40)))  # 10 preload the bearing a little: the life is longer
    assert (tilted.axial_force, tilted.factors, tilted.basic_life) == (0.0, None, None)
    assert tilted.life is not None
    assert bearing.life is not None
    assert tilted.life < 0.8 * bearing.life
    assert bearing.rated_lives == (bearing.basic_life, tilted.life)
    _, least = found(made("", words.format(0.01)))
    assert least.life == pytest.approx(bearing.life, rel=2e-3)


def test_a_duty_cycle_takes_the_life_with_axial_force(made: Made) -> None:
    duty = '\n[duty.on]\nshare = 0.5\n[duty.fast]\nshare = 0.5\nset.shaft.speed = "200 rpm"\n'
    report = made('axial_force = "1 kN"', duty).life(**TURNS)
    lives = [state.bearings[0].combined for state in report.states]
    assert lives[0] is not None
    assert report.duty[0].turns == pytest.approx(lives[0].life, rel=1e-2)
    assert "resist neither" in " ".join(str(report).split())


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('axial_force = "1 N"\ncontact_angle = "5 deg"', "the contact angle is given twice"),
        ('axial_force = "0 N"', "a value above zero"),
        ('axial_force = "1 N"\nelement = "cylindrical-roller"', "carries no axial force"),
    ],
)
def test_axial_forces_without_meaning_are_refused(keys: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        scene_from_text(SCENE.replace("balls = 7", f"{keys}\nballs = 7"), "reference_life")
