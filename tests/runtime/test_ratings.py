"""Claims about ratings and lives: they are the printed values of standards and catalogues, and closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import BearingInfo, CatalogueInfo, DampingInfo
from ballpass.runtime.ratings import ellipse, groove_slip, life, load_ratings, mounted_clearance
from ballpass.runtime.ratings.of_bearing import ratings_of

BALL, PITCH, BALLS, GROOVES = 7.9375e-3, 33.5e-3, 8, (0.52, 0.53)  # 6204
MILLION = 1e6
RPM = math.pi / 30.0


def test_static_factors_by_exact_contact_are_those_of_iso_76() -> None:
    printed = {0.05: 15.7, 0.09: 16.5, 0.23: 13.2, 0.24: 13.0, 0.30: 11.6}
    for gamma, factor in printed.items():
        assert load_ratings.static_factor(gamma) == pytest.approx(factor, abs=0.05)
    # the whole table is printed to 0.1: no row is off by more than that rounding and 0.05 %
    rows = np.array(load_ratings.GAMMA[1:])
    chain = load_ratings.static_factor(rows)
    np.testing.assert_allclose(chain, load_ratings.STATIC_FACTORS[1:], rtol=5e-4, atol=0.05)


def test_dynamic_factors_are_those_of_iso_281() -> None:
    printed = {0.05: 46.7, 0.10: 55.5, 0.15: 59.3, 0.20: 59.9, 0.25: 58.6, 0.30: 56.0, 0.35: 52.4, 0.40: 48.4}
    for gamma, factor in printed.items():
        assert load_ratings.dynamic_factor(gamma) == pytest.approx(factor, abs=1e-9)
    between = np.linspace(0.01, 0.4, 99)
    expected = np.interp(between, load_ratings.GAMMA[1:], load_ratings.DYNAMIC_FACTORS)
    np.testing.assert_allclose(load_ratings.dynamic_factor(between), expected, rtol=1e-12)


def test_dynamic_factors_follow_lundberg_and_palmgren() -> None:
    """f_c is 0.957 times 39.9 γ^0.3 (1-γ)^1.39/(1+γ)^(1/3) (2r/(2r-D))^0.41 (1+T^(10/3))^-0.3, r = 0.52 D."""
    gamma = np.array(load_ratings.GAMMA[1:])
    ratio = load_ratings.ring_ratio(gamma, (0.52, 0.52), 1.04)
    formula = gamma**0.3 * (1 - gamma) ** 1.39 / (1 + gamma) ** (1 / 3) * 26.0**0.41 * (1 + ratio ** (10 / 3)) ** -0.3
    np.testing.assert_allclose(load_ratings.DYNAMIC_FACTORS, 0.9573 * 39.9 * formula, rtol=0, atol=0.055)  # to 0.1


@pytest.mark.parametrize(("kappa", "z", "factor"), [(1.0, 0.1, 2.4305), (4.0, 0.1, 7.2018), (0.5, 0.1, 0.52948)])
def test_life_factor_has_its_reference_values(kappa: float, z: float, factor: float) -> None:
    assert life.life_factor(kappa, z) == pytest.approx(factor, rel=2e-5)


def test_more_reliability_is_less_life() -> None:
    lives = [life.modified_life(100.0, 2.0, share) for share in (0.9, 0.95, 0.99)]
    assert lives == pytest.approx([200.0, 128.0, 50.0])
    with pytest.raises(RequestError, match=r"0\.5\. Allowed: 0\.9, 0\.95"):
        life.modified_life(100.0, 2.0, 0.5)


def test_life_factor_is_one_curve_between_its_bounds() -> None:
    for kappa in (0.4, 1.0, 4.0):  # the branches of the standard meet, above 4 nothing changes
        left, right = life.life_factor(np.array([kappa * (1 - 1e-9), kappa * (1 + 1e-9)]), 0.2)
        assert left == pytest.approx(right, rel=1e-4)
    assert life.life_factor(9.0, 0.1) == life.life_factor(4.0, 0.1)
    assert life.life_factor(4.0, 5.0) == pytest.approx(50.0)
    assert life.life_factor(1.0, 0.0) == pytest.approx(0.1)
    with pytest.raises(RequestError, match=r"0\.05 is below 0\.1"):
        life.life_factor(0.05, 0.1)


@pytest.mark.parametrize(
    ("rating", "load", "rpm", "turns", "hours"),
    [
        (55.3e3, 4e3, 1800, None, 24500),  # SKF catalogue, 6309
        (22.4e3, 3.2e3, 650, 343.0, 8795),  # a maker's example of a 6208
    ],
)
def test_basic_lives_are_those_of_catalogues(
    rating: float, load: float, rpm: float, turns: float | None, hours: float
) -> None:
    found = life.basic_life(rating, load)
    if turns is not None:
        assert found == pytest.approx(turns * MILLION, rel=1e-12)
    assert life.hours(found, rpm * RPM) == pytest.approx(hours, rel=2e-3)


def test_reference_viscosity_is_that_of_iso_281() -> None:
    """ν_1 of D_pw 65 mm: 45000 n^-0.83 D^-0.5 at 500 rpm, 4500 n^-0.5 D^-0.5 at 3000 rpm, in mm²/s."""
    assert life.reference_viscosity(500 * RPM, 0.065) == pytest.approx(32.1e-6, rel=2e-3)
    assert life.reference_viscosity(-3000 * RPM, 0.065) == pytest.approx(10.19e-6, rel=2e-3)
    assert life.viscosity_ratio(20e-6, 3000 * RPM, 0.065) == pytest.approx(20 / 10.19, rel=2e-3)


def ball_loads(force: float, angles: np.ndarray) -> np.ndarray:
    """Loads of balls of a bearing without clearance: Q = K (d cos φ)^1.5 with ΣQ cos φ = F [N]."""
    pressed = np.maximum(np.cos(angles), 0.0)
    return np.asarray(force * pressed**1.5 / np.sum(pressed**2.5))


def test_reference_life_of_a_6204_at_1000_newton() -> None:
    """Geometric mean of ball on the load's line and between two: 2461.8 million turns; L_10 is 2460.4."""
    ratings = life.ball_ratings(13.5e3, BALLS, BALL / PITCH, GROOVES)
    lives = []
    for shift in (0.0, math.pi / BALLS):
        loads = ball_loads(1000.0, 2.0 * math.pi * np.arange(BALLS) / BALLS + shift)
        equivalent = [life.equivalent_ball_load(loads, turning=turning) for turning in (True, False)]
        lives.append(life.reference_life(ratings, (equivalent[0], equivalent[1])))
    assert math.sqrt(lives[0] * lives[1]) == pytest.approx(2461.8 * MILLION, rel=5e-5)
    assert life.equivalent_load(13.5e3, life.basic_life(13.5e3, 977.0)) == pytest.approx(977.0)


@pytest.mark.parametrize("gamma", [0.1, 0.2369])
def test_ratings_of_balls_are_the_printed_formulas(gamma: float) -> None:
    inner, outer = 0.52, 0.53
    t = 1.044 * ((1 - gamma) / (1 + gamma)) ** 1.72 * (inner / outer * (2 * outer - 1) / (2 * inner - 1)) ** 0.41
    found = life.ball_ratings(13.5e3, 8, gamma, GROOVES)
    expected = (13.5e3 / (0.407 * 8) * (1 + t ** (10 / 3)) ** 0.3, 13.5e3 / (0.389 * 8) * (1 + t ** (-10 / 3)) ** 0.3)
    assert found == pytest.approx(expected, rel=1e-12)


def test_load_of_sectors_is_both_means_of_the_standard_in_their_limits() -> None:
    """Where the ring turns against the load all places bear the same, where it stands each bears one load; and both
    rings change places where the load turns with the shaft."""
    places = 2.0 * math.pi * (np.arange(360) + 0.5) / 360
    loads = np.maximum(np.cos(places), 0.0) ** 1.5 * 900.0
    turning = np.full(360, np.mean(loads**3))
    assert life.sector_ball_load(turning) == pytest.approx(life.equivalent_ball_load(loads, turning=True), rel=1e-10)
    assert life.sector_ball_load(loads**3) == pytest.approx(life.equivalent_ball_load(loads, turning=False), rel=1e-10)
    # the load at 2π k/360 in space is met by the place at k - j of a ring that has turned by j
    passes = np.array([[loads[(k - j) % 360] ** 3 for j in range(360)] for k in range(360)])
    in_ring = np.array([np.mean([passes[(k + j) % 360, j] for j in range(360)]) for k in range(360)])
    assert life.sector_ball_load(passes.mean(axis=1)) == pytest.approx(life.sector_ball_load(turning), rel=1e-10)
    assert life.sector_ball_load(in_ring) == pytest.approx(life.sector_ball_load(loads**3), rel=1e-10)


def press_load(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force of the crank on the frame of the ideal press over equal steps of a turn, by Newton and Euler [N]."""
    speed, crank, rod, m1, m2, m3, inertia, g = 500 * RPM, 6e-3, 0.1, 0.3567, 2.55, 16.7965, 7517.545e-6, 9.81
    wave = np.fft.fftfreq(len(angles), 1.0 / len(angles))

    def acceleration(x: np.ndarray) -> np.ndarray:
        return np.asarray(-(speed**2) * np.fft.ifft(wave**2 * np.fft.fft(x)).real)

    pin, high = crank * np.cos(angles), crank * np.sin(angles)
    low = high - np.sqrt(rod**2 - pin**2)
    punch = np.where((np.degrees(angles) >= 237.0) & (np.degrees(angles) < 267.0), 8964.8, 0.0)
    slider = m3 * (acceleration(low) + g) - punch
    vertical = m2 * (acceleration((high + low) / 2) + g) + slider
    swing = inertia * acceleration(np.arctan2(low - high, -pin))
    across = m2 * acceleration(pin / 2)  # without the guide's force, which the moments about the rod's middle give:
    guide = (swing - pin / 2 * (vertical + slider) + (high - low) / 2 * across) / (low - high)
    return -(across + guide), -vertical - m1 * g


def test_ideal_press_lasts_389_or_348_million_turns() -> None:
    """Quasi-static, no clearance, share 1/2, C = 13.5 kN: inner ring taken as turning, and by sectors."""
    angles = 2.0 * math.pi * (np.arange(720) + 0.5) / 720
    x, y = press_load(angles)
    at_240 = np.interp(np.radians(240.0), angles, x), np.interp(np.radians(240.0), angles, y)
    assert at_240 == pytest.approx((-267.174, 8486.976), rel=1e-3)
    force, direction = 0.5 * np.hypot(x, y), np.arctan2(y, x)

    def cubes(offset: np.ndarray) -> np.ndarray:
        """Q³ of a ball at an angle from a load of 1 N: Q = cos^1.5/Σcos^2.5 over all balls."""
        others = offset[..., None] + 2.0 * math.pi * np.arange(BALLS) / BALLS
        return np.maximum(np.cos(offset), 0.0) ** 4.5 / np.sum(np.maximum(np.cos(others), 0.0) ** 2.5, axis=-1) ** 3

    places = angles[::4, None]
    outer = life.sector_ball_load(np.mean(force**3 * cubes(places - direction), axis=1))
    inner = life.sector_ball_load(np.mean(force**3 * cubes(places + angles - direction), axis=1))
    turning = (np.mean(force**3) * np.mean(cubes(angles))) ** (1 / 3)
    ratings = life.ball_ratings(13.5e3, BALLS, BALL / PITCH, GROOVES)
    assert life.reference_life(ratings, (turning, outer)) == pytest.approx(389.1 * MILLION, rel=3e-3)
    assert life.reference_life(ratings, (inner, outer)) == pytest.approx(348.4 * MILLION, rel=3e-3)


@pytest.mark.parametrize(
    ("load", "mean", "printed"),
    [
        (lambda u: abs(math.sin(2 * math.pi * u)), (4 / (3 * math.pi)) ** (1 / 3), 0.751501),
        (lambda u: (1 - math.cos(2 * math.pi * u)) / 2, (5 / 16) ** (1 / 3), 0.678604),
        (lambda u: u, 0.25 ** (1 / 3), 0.629961),
    ],
)
def test_cubic_means_have_their_closed_forms(load: Callable[[float], float], mean: float, printed: float) -> None:
    places = (np.arange(20000) + 0.5) / 20000
    loads = [load(u) for u in places]
    assert mean == pytest.approx(printed, abs=5e-7)
    assert life.mean_load(loads, 3.0) == pytest.approx(mean, rel=1e-6)
    shares = np.full(20000, 1 / 20000)
    assert life.mean_load(loads, 3.0, shares) == pytest.approx(mean, rel=1e-6)


def test_pure_rolling_lines_balance_friction() -> None:
    c = groove_slip.PURE_ROLLING
    assert c == pytest.approx(0.347296, abs=5e-7)
    assert c**3 - 3 * c + 1 == pytest.approx(0.0, abs=1e-14)
    within = quad(lambda x: 1 - x * x, 0, c)[0]
    assert within == pytest.approx(quad(lambda x: 1 - x * x, c, 1)[0], rel=1e-12, abs=0.0)
    slip = groove_slip.creepage(np.array([0.0, c, -c, 1.0]) * 1e-3, 1e-3, BALL, 12.78e-3, 0.52 * BALL)
    assert slip[1:3] == pytest.approx(0.0, abs=1e-15)
    assert slip[0] < 0.0 < slip[3]


@pytest.mark.parametrize("ratio", [0.003, 0.02, 0.2, 0.9])
def test_ellipse_agrees_with_scipys_elliptic_integrals(ratio: float) -> None:
    def residual(kappa: float) -> float:
        m = 1.0 - kappa**-2
        return float((ellipk(m) / ellipe(m) - 1) / (kappa**2 - 1) - ratio / (1 + ratio))

    kappa = ellipse.ellipticity(ratio)
    assert kappa == pytest.approx(brentq(residual, 1.0 + 1e-9, 1e4, xtol=1e-13), rel=1e-9)
    second, excess = ellipse.elliptic_integrals(kappa)
    m = 1.0 - kappa**-2
    assert second == pytest.approx(ellipe(m), rel=1e-13, abs=0.0)
    assert excess == pytest.approx(ellipk(m) / ellipe(m) - 1, rel=1e-8)


def test_pressure_over_the_ellipse_carries_the_load() -> None:
    """A half ellipsoid holds 2/3 of its peak times area; a sphere on a plane has the textbook's radius."""
    ratio, curvature = ellipse.groove_curvatures(BALL, 12.78e-3, 0.52 * BALL)
    soft = ellipse.compliance((207e9, 0.3))
    kappa = ellipse.ellipticity(ratio)
    a, b = ellipse.semi_axes(500.0, kappa, curvature, soft)
    pressure = ellipse.peak_pressure(500.0, kappa, curvature, soft)
    assert pressure * 2 / 3 * math.pi * a * b == pytest.approx(500.0, rel=1e-12)
    assert ellipse.load_at_pressure(pressure, kappa, curvature, soft) == pytest.approx(500.0, rel=1e-12)
    radius = 5e-3
    circle = ellipse.semi_axes(500.0, 1.0, 2.0 / radius, soft)
    assert circle == pytest.approx([(0.75 * 500.0 * radius * soft) ** (1 / 3)] * 2, rel=1e-12, abs=0.0)


def test_fits_of_solid_steel_pass_on_their_ratio_of_diameters() -> None:
    """Ring and shaft of one steel: the raceway grows by I d/D; a thick housing likewise; Lamé."""
    assert mounted_clearance.inner_growth(10e-6, 20e-3, 25.6e-3) == pytest.approx(10e-6 * 20 / 25.6, rel=1e-12, abs=0.0)
    assert mounted_clearance.outer_shrinkage(10e-6, 47e-3, 41.4e-3) == pytest.approx(
        10e-6 * 41.4 / 47, rel=1e-12, abs=0.0
    )
    hollow = mounted_clearance.inner_growth(10e-6, 20e-3, 25.6e-3, shaft_bore=15e-3)
    assert 0.0 < hollow < 10e-6 * 20 / 25.6
    aluminium = mounted_clearance.outer_shrinkage(10e-6, 47e-3, 41.4e-3, housing=(70e9, 0.33))
    assert 0.0 < aluminium < 10e-6 * 41.4 / 47


def test_equal_warming_of_all_parts_keeps_the_clearance() -> None:
    assert mounted_clearance.thermal_reduction(20.0, 20.0, 20.0, BALL, PITCH) == pytest.approx(0.0, abs=1e-18)
    lost = mounted_clearance.thermal_reduction(10.0, 5.0, 0.0, BALL, PITCH)  # α 10 K D_pw
    assert lost == pytest.approx(11.5e-6 * 10 * PITCH, rel=1e-12, abs=0.0)


def test_ratings_that_a_scene_gives_stand_before_formulas() -> None:
    taken = CatalogueInfo(
        designation="6204", clearance_group="", clearance_least=None, clearance_most=None,
        dynamic_rating=13.5e3, static_rating=6.55e3, fatigue_limit=None,
    )  # fmt: skip
    bearing = BearingInfo(
        name="", prefix="", path="bearing", balls=BALLS, joint="", inner_body="", ring_speed="", outer_ring=False,
        damping=DampingInfo(law="none"), catalogue=taken,
    )  # fmt: skip
    values = {"bearing.ball_diameter": BALL, "bearing.pitch_diameter": PITCH}
    found = ratings_of(bearing, values)
    assert (found.dynamic, found.static, found.given) == (13.5e3, 6.55e3, ("dynamic_rating", "static_rating"))
    assert found.fatigue_limit == pytest.approx(6.55e3 / 22)
    assert (found.inner_ball, found.outer_ball) == pytest.approx(life.ball_ratings(13.5e3, BALLS, BALL / PITCH))
    grooves = {f"bearing.contact.{ring}_groove_radius": 0.54 * BALL for ring in ("inner", "outer")}
    wide = ratings_of(replace(bearing, catalogue=None), values | grooves)
    assert wide.dynamic < load_ratings.dynamic_rating(BALLS, BALL, PITCH)
    assert wide.static < load_ratings.static_rating(BALLS, BALL, PITCH)


def test_lives_are_differentiated_by_casadi() -> None:
    """d ln(L_10r)/d ln of ball diameter and groove radius agree with differences of the float's route."""

    def reference(ball: object, groove: object) -> object:
        grooves = (groove / ball, 0.53)  # type: ignore[operator]
        rating = load_ratings.dynamic_rating(BALLS, ball, PITCH, grooves)
        static = load_ratings.static_rating(BALLS, ball, PITCH, grooves)
        factor = life.life_factor(1.5, 0.3 * load_ratings.fatigue_limit(static, PITCH) / 1000.0)
        ratings = life.ball_ratings(rating, BALLS, ball / PITCH, grooves)  # type: ignore[operator]
        return factor * life.reference_life(ratings, (480.0, 500.0))

    at = (BALL, 0.521 * BALL)
    for kind in (ca.SX, ca.MX):
        symbols = kind.sym("ball"), kind.sym("groove")
        value = reference(*symbols)
        f = ca.Function("f", symbols, [value, ca.gradient(value, ca.vertcat(*symbols))])
        found, slope = f(*at)
        assert float(found) == pytest.approx(reference(*at), rel=1e-12)
        for k in range(2):
            step = 1e-5 * at[k]
            moved = [reference(*(x + s * step * (k == j) for j, x in enumerate(at))) for s in (-1, 1)]
            difference = (moved[1] - moved[0]) / (2 * step)  # type: ignore[operator]
            assert float(slope[k]) == pytest.approx(difference, rel=1e-6)
