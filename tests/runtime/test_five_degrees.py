"""Statics of a ball bearing in five degrees of freedom, against printed rows, closed forms and invariants."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ballpass.runtime import RequestError
from ballpass.runtime.ratings import life
from ballpass.runtime.ratings.five_degrees import BallBearing, ball_statics, contact_forces

BALL, PITCH = 11.5e-3, 43.5e-3
STIFFNESS = 1.05491e10  # Hertz, 210 GPa, 0.3
CLEARANCES = (-10e-6, 0.0, 10e-6, 100e-6)


def bearing_of(clearance: float) -> BallBearing:
    """The bearing of the printed rows."""
    grooves = (0.52 * BALL, 0.53 * BALL)
    return BallBearing(
        balls=7,
        ball_diameter=BALL,
        pitch_diameter=PITCH,
        grooves=grooves,
        clearance=clearance,
        stiffness=STIFFNESS,
    )


#: Printed by another program (repository minzhun/ISO16281): clearance, force; δ_r, δ_a [um], tilt [mrad], L_10r.
PRINTED = (
    (0.0, (1000.0, 0.0, 0.0), (15.1101, 0.0, 0.0), 13163.019),
    (0.0, (0.0, 0.0, 1000.0), (0.0, 133.5381, 0.0), 2222.7318),
    (10e-6, (0.0, 0.0, 1000.0), (0.0, 149.1717, 0.0), 3115.8781),
    (10e-6, (1000.0, 0.0, 1000.0), (19.5923, 146.4603, 2.6872), 1630.5367),
)


@pytest.mark.parametrize(("clearance", "force", "displaced", "lasts"), PRINTED)
def test_displacements_and_lives_are_the_printed_ones(
    clearance: float, force: tuple[float, float, float], displaced: tuple[float, float, float], lasts: float
) -> None:
    found = ball_statics(bearing_of(clearance), force)
    radial, _, axial, _, tilt = found.displacement[0]
    for own, printed in zip((1e6 * radial, 1e6 * axial, 1e3 * tilt), displaced, strict=True):
        assert abs(own - printed) <= 3e-5 * printed + 5e-5  # half of the last digit
    equivalent = [life.equivalent_ball_load(found.ball_load[0].tolist(), turning=turns) for turns in (True, False)]
    turns = life.reference_life(life.ball_ratings(23.4e3, 7, BALL / PITCH), (equivalent[0], equivalent[1]))
    assert turns / 1e6 == pytest.approx(lasts, rel=2e-4, abs=0.0)


@pytest.mark.parametrize("clearance", CLEARANCES)
def test_stiffness_is_the_derivative_of_the_load_and_symmetric(clearance: float) -> None:
    bearing = bearing_of(clearance)
    place = ball_statics(bearing, (900.0, -400.0, 700.0), moment=(2.0, -1.0), ball_angle=0.3).displacement
    matrix = contact_forces(bearing, place, 0.3).stiffness[0]
    assert matrix == pytest.approx(matrix.T, rel=1e-12, abs=1e-9 * abs(matrix).max())
    for k, step in enumerate((1e-9, 1e-9, 1e-9, 1e-7, 1e-7)):
        change = np.zeros((1, 5))
        change[0, k] = step
        high, low = (contact_forces(bearing, place + sign * change, 0.3).load[0] for sign in (1.0, -1.0))
        column = (high - low) / (2.0 * step)
        assert column == pytest.approx(matrix[:, k], rel=1e-5, abs=1e-6 * abs(matrix[:, k]).max())


@pytest.mark.parametrize("clearance", CLEARANCES)
@pytest.mark.parametrize("tilt", [None, (0.0, 0.0), (1e-3, -2e-3)])
def test_the_balls_carry_every_load_from_any_side(clearance: float, tilt: tuple[float, float] | None) -> None:
    """Radial, axial and mixed loads over five decades: forces in balance, no ball pulls, moments as given."""
    random = np.random.default_rng(46)
    forces = random.normal(size=(300, 3)) * 10.0 ** random.uniform(-1.0, 4.0, size=(300, 1))
    forces[:50, 2], forces[50:100, :2], forces[100] = 0.0, 0.0, 0.0
    found = ball_statics(bearing_of(clearance), forces, tilt=tilt, ball_angle=random.uniform(0.0, 6.0, 300))
    size = np.linalg.norm(forces, axis=1) + found.ball_load.max(axis=1)
    assert np.all(np.abs(found.load[:, :3] - forces) <= 2e-9 * size[:, None])
    assert np.all(found.ball_load >= 0.0)
    if tilt is None:
        assert np.all(np.abs(found.load[:, 3:]) <= 2e-9 * PITCH * size[:, None])
    else:
        assert np.all(found.displacement[:, 3:] == tilt)


def test_a_central_axial_load_has_the_closed_form() -> None:
    """F = Z c_p δ^1.5 sin α, and the grooves' centres are apart by A + δ at the angle α."""
    bearing = bearing_of(10e-6)
    (angle,) = set(np.round(ball_statics(bearing, (0.0, 0.0, 1000.0)).contact_angle[0], 12).tolist())
    apart = 0.05 * BALL
    deflection = (apart - 5e-6) / math.cos(angle) - apart
    assert 7.0 * STIFFNESS * deflection**1.5 * math.sin(angle) == pytest.approx(1000.0, rel=1e-8)


def test_the_bearing_turned_or_mirrored_answers_turned_or_mirrored() -> None:
    bearing, turn = bearing_of(10e-6), 0.7
    cosine, sine = math.cos(turn), math.sin(turn)
    plain = ball_statics(bearing, (800.0, 300.0, 500.0), tilt=(1e-3, 2e-3))
    force = (800.0 * cosine - 300.0 * sine, 800.0 * sine + 300.0 * cosine, 500.0)
    tilt = (1e-3 * cosine - 2e-3 * sine, 1e-3 * sine + 2e-3 * cosine)
    turned = ball_statics(bearing, force, tilt=tilt, ball_angle=turn)
    assert turned.ball_load == pytest.approx(plain.ball_load, rel=1e-7, abs=1e-6)
    mirrored = ball_statics(bearing, (800.0, 300.0, -500.0), tilt=(-1e-3, -2e-3))
    assert mirrored.ball_load == pytest.approx(plain.ball_load, rel=1e-7, abs=1e-6)
    assert mirrored.contact_angle == pytest.approx(-plain.contact_angle, rel=1e-7)


def test_a_load_that_is_no_number_is_refused() -> None:
    with pytest.raises(RequestError, match="no equilibrium"):
        ball_statics(bearing_of(0.0), (math.nan, 0.0, 0.0))
