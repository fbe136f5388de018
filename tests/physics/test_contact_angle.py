"""Claims about a contact angle: kinematics, forces from an energy, grooves, ratings, equivalent load."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scripts.validation.kinematics import kinematic_frequencies

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.quantity.characteristic import frequencies_of
from ballpass.runtime.ratings import life, load_ratings
from ballpass.runtime.ratings.of_bearing import contacts_of, ratings_of

OUTPUTS = ('"inner.ay", "ball.force", "load.*"]', '"ball.*", "ring_force.*", "contact.stiffness.*", "load.*"]')
ANGLE = 'designation = "6204"\ncontact_angle = "0 deg"'
MAKER = 'designation = "6204"\nball_diameter = "7.92 mm"\npitch_diameter = "34.55 mm"'


@pytest.fixture(scope="module")
def angled(make_model: Callable[..., Model]) -> Model:
    return make_model("rotor", ('designation = "6204"', ANGLE), OUTPUTS)


@pytest.fixture(scope="module")
def pushed(make_model: Callable[..., Model]) -> Model:
    """Angle by an axial displacement."""
    displaced = 'designation = "6204"\naxial_displacement = "0 um"'
    return make_model("rotor", ('designation = "6204"', displaced), OUTPUTS)


@pytest.mark.long
def test_zero_contact_angle_gives_the_bits_of_none(make_model: Callable[..., Model], angled: Model) -> None:
    plain = make_model("rotor", OUTPUTS)
    runs = [model.simulate(cycles=1, transient=0) for model in (plain, angled)]
    assert np.array_equal(runs[0].x, runs[1].x)
    values = [ratings_of(model.manifest.bearings[0], model.numbers().values) for model in (plain, angled)]
    assert values[0] == values[1]


@pytest.mark.parametrize("degrees", [8.0, 40.0])
def test_speeds_of_cage_and_balls_are_those_of_textbooks(angled: Model, degrees: float) -> None:
    """Harris & Kotzalas: f_c = (1 - gamma)/2, BPFO = Z f_c, BPFI = Z (1 + gamma)/2, BSF = D_pw/(2 D_w) (1 - gamma²)."""
    ball, pitch, cosine = 7.9375e-3, 33.5e-3, math.cos(math.radians(degrees))
    gamma = ball * cosine / pitch
    turn = angled.parameters["shaft.speed"] / (2.0 * math.pi)
    expected = [
        turn * (1.0 - gamma) / 2.0,
        8.0 * turn * (1.0 - gamma) / 2.0,
        8.0 * turn * (1.0 + gamma) / 2.0,
        turn * pitch / (2.0 * ball) * (1.0 - gamma**2),
    ]
    by_hand = kinematic_frequencies(8, ball, pitch, 2.0 * math.pi * turn, math.radians(degrees))
    angle = {"bearing.contact_angle": math.radians(degrees)}
    of_model = frequencies_of(angled.manifest.bearings[0], angled.numbers(angle).values)
    for found in (by_hand, of_model):
        lines = [found.cage, found.ball_pass_outer, found.ball_pass_inner, found.ball_spin]
        assert lines == pytest.approx(expected, rel=1e-13)
    assert by_hand.ball_pass_inner + by_hand.ball_pass_outer == pytest.approx(8.0 * turn, rel=1e-14)


def test_the_rings_force_is_the_slope_of_the_contacts_energy(angled: Model) -> None:
    """U = sum of 2/5 k_b delta^2.5: its differences along x and y, and its second ones."""
    numbers = {"bearing.contact_angle": math.radians(30.0), "bearing.clearance": -8e-6}
    stiffness = angled.constants(numbers)["bearing.k_b"]

    def energy(x: float, y: float) -> float:
        delta = angled.evaluate(1.3e-3, np.array([x, y, 0.0, 0.0]), ["ball.deflection"], numbers)["ball.deflection"]
        return float(0.4 * stiffness * np.sum(np.maximum(delta, 0.0) ** 2.5))

    x, y, step = 3e-6, -5e-6, 3e-8
    names = ["ring_force.x", "ring_force.y", "contact.stiffness.xx", "contact.stiffness.xy"]
    found = angled.evaluate(1.3e-3, np.array([x, y, 0.0, 0.0]), names, numbers)
    slopes = [
        (energy(x + step, y) - energy(x - step, y)) / (2.0 * step),
        (energy(x, y + step) - energy(x, y - step)) / (2.0 * step),
        (energy(x + step, y) - 2.0 * energy(x, y) + energy(x - step, y)) / step**2,
        (
            energy(x + step, y + step)
            - energy(x + step, y - step)
            - energy(x - step, y + step)
            + energy(x - step, y - step)
        )
        / (4.0 * step**2),
    ]
    assert [float(found[name]) for name in names] == pytest.approx(slopes, rel=1e-4)


def test_an_axial_displacement_turns_the_contacts_as_the_centres_of_the_grooves_move(pushed: Model) -> None:
    """Deflection against the distance of the centres of the grooves in space, and its slope along x."""
    displaced, clearance = 60e-6, 5e-6
    numbers = {"bearing.axial_displacement": displaced, "bearing.clearance": clearance}
    apart = 0.05 * 7.9375e-3
    length = math.hypot(apart - clearance / 2.0, displaced)
    at = np.array([0.0, 1e-8, 0.0, 0.0])
    time = 1e-3
    found = pushed.evaluate(time, at, ["ball.deflection"], numbers)["ball.deflection"]
    angle = 2.0 * np.pi * np.arange(8) / 8 + pushed.constants(numbers)["bearing.cage_speed"] * time
    exact = np.hypot(apart - clearance / 2.0 + 1e-8 * np.sin(angle), displaced) - apart
    assert found == pytest.approx(exact, abs=1e-14)
    known = pushed.constants(numbers)
    assert known["bearing.cos_contact_angle"] == pytest.approx((apart - clearance / 2.0) / length, rel=1e-13, abs=0.0)
    # a free ring finds its contact angle where the clearance is taken up: cos(alpha) = 1 - P_d/(2A)
    free = math.acos(1.0 - clearance / (2.0 * apart))
    touching = {**numbers, "bearing.axial_displacement": apart * math.sin(free)}
    assert pushed.constants(touching)["bearing.radial_gap"] == pytest.approx(0.0, abs=1e-15)


def test_a_displacement_that_does_not_take_up_the_clearance_is_no_preload(pushed: Model) -> None:
    """The free contact angle, cos = 1 - P_d/(2 A), is met at A sin of it.  Nothing said that less preloads nothing."""
    clearance, apart = 20e-6, 0.05 * pushed.parameters["bearing.ball_diameter"]
    taken_up = apart * math.sin(math.acos(1.0 - clearance / (2.0 * apart)))
    for displacement, said in ((0.99 * taken_up, True), (1.01 * taken_up, False)):
        numbers = {"bearing.clearance": clearance, "bearing.axial_displacement": displacement}
        words = " ".join(pushed.explain(numbers).limits)
        assert ("is not preloaded" in words) == said
        assert (f"touch from {1e6 * taken_up:.3g} µm on" in words) == said


def test_curvature_sums_and_pressures_follow_gamma(angled: Model) -> None:
    """Harris: D_w sum of rho = 4 - 1/f ± 2 gamma/(1 ∓ gamma), gamma with the cosine; C and Python alike."""
    numbers = {"bearing.contact_angle": math.radians(40.0)}
    known = angled.constants(numbers)
    gamma = 7.9375 / 33.5 * math.cos(math.radians(40.0))
    inner = (4.0 - 1.0 / 0.52 + 2.0 * gamma / (1.0 - gamma)) / 7.9375e-3
    outer = (4.0 - 1.0 / 0.53 - 2.0 * gamma / (1.0 + gamma)) / 7.9375e-3
    assert known["bearing.inner_curvature_sum"] == pytest.approx(inner, rel=1e-13)
    assert known["bearing.outer_curvature_sum"] == pytest.approx(outer, rel=1e-13)
    contacts = contacts_of(angled.manifest.bearings[0], angled.numbers(numbers).values)
    assert [contact.curvature_sum for contact in contacts] == pytest.approx([inner, outer], rel=1e-13)


def test_ratings_have_the_cosine_of_iso_76_and_iso_281(angled: Model) -> None:
    """C_r: cos^0.7 and f_c by gamma; C_0r: cosine; Q_ci of ISO 16281 has no cosine left where C_r is computed."""
    bearing = angled.manifest.bearings[0]
    angle = math.radians(25.0)
    found = ratings_of(bearing, angled.numbers({"bearing.contact_angle": angle}).values)
    gamma = 7.9375 / 33.5 * math.cos(angle)
    factor = 1.3 * load_ratings.dynamic_factor(gamma) * math.cos(angle) ** 0.7
    assert found.dynamic == pytest.approx(factor * 8.0 ** (2 / 3) * 7.9375**1.8, rel=1e-12)
    assert found.static == pytest.approx(
        load_ratings.static_factor(gamma) * 8.0 * 7.9375**2 * math.cos(angle), rel=1e-12
    )
    ratio = load_ratings.ring_ratio(gamma) ** (10 / 3)
    rated = found.dynamic / (0.407 * 8.0 * math.cos(angle) ** 0.7) * (1.0 + ratio) ** 0.3
    assert found.inner_ball == pytest.approx(rated, rel=1e-12)


#: ISO 281:2007, Table 3, single row, as catalogues print it: nominal angle [deg], X; and e, Y of deep groove bearings.
PRINTED_X = {10: 0.46, 15: 0.44, 20: 0.43, 25: 0.41, 30: 0.39, 35: 0.37, 40: 0.35, 45: 0.33}
PRINTED_Y = ((0.19, 2.30), (0.22, 1.99), (0.26, 1.71), (0.28, 1.55), (0.34, 1.31), (0.44, 1.00))
PRINTED_ANGULAR = ((20, 0.57, 1.00), (25, 0.68, 0.87), (30, 0.80, 0.76), (35, 0.95, 0.66), (40, 1.14, 0.57))


def test_factors_of_the_equivalent_load_are_those_of_the_printed_table() -> None:
    for degrees, printed in PRINTED_X.items():
        assert life.axial_factors(math.radians(degrees), deep_groove=False)[0] == pytest.approx(printed, abs=0.005)
    for degrees, e, printed in PRINTED_ANGULAR:  # the table is of nominal angles; Y e depends on X alone
        x, y, own = life.axial_factors(math.radians(degrees), deep_groove=False)
        assert y * own == pytest.approx(printed * e, rel=0.015)
        assert x + y * own == pytest.approx(1.0, rel=1e-12)
    for e, printed in PRINTED_Y:  # at the angle where the row's e holds, which is rounded, as is X in Y
        (x, most, _), (_, least, _) = (
            life.axial_factors(math.atan((e + end) / 1.05), deep_groove=True) for end in (-0.005, 0.005)
        )
        assert x == pytest.approx(0.56, abs=0.005)
        assert least * 0.985 < printed < most * 1.015


def test_life_combines_radial_and_axial_load(angled: Model) -> None:
    """P of a heavy radial load: X F_r + Y F_a with F_a = sin(alpha) times the sum of the ball forces."""
    numbers = {
        "bearing.contact_angle": math.radians(8.0),
        "bearing.clearance": -10e-6,
        "loads.weight.force.y": -500.0,
        "loads.unbalance.mass": 0.0,
    }
    found = angled.life(parameters=numbers, cycles=8, transient=6).states[0].bearings[0]
    static = angled.simulate(parameters=numbers, cycles=8, transient=6)
    total = np.mean(np.sum(np.atleast_2d(static["ball.force"]), axis=1))
    x, y, e = life.axial_factors(math.radians(8.0), deep_groove=True)
    axial = math.sin(math.radians(8.0)) * total
    assert axial > e * 500.0
    assert found.equivalent_load == pytest.approx(x * 500.0 + y * axial, rel=1e-3)


def test_a_makers_diameters_stand_over_those_of_the_table(make_model: Callable[..., Model]) -> None:
    model = make_model("rotor", ('designation = "6204"', MAKER))
    found = frequencies_of(model.manifest.bearings[0], model.numbers().values)
    assert found.ball_pass_outer / 50.0 == pytest.approx(4.0 * (1.0 - 7.92 / 34.55), rel=1e-12)
    # grooves follow the ball that is given
    assert model.parameters["bearing.contact.inner_groove_radius"] == pytest.approx(0.52 * 7.92e-3, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('contact_angle = "95 deg"', "out of its bounds"),
        ('contact_angle = "8 deg"\naxial_displacement = "10 um"', "given twice"),
        ('contact_angle = "8 mm"', "unit"),
    ],
)
def test_wrong_angles_are_refused(scene_text: Callable[..., str], keys: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        scene_from_text(scene_text("rotor", ('designation = "6204"', f'designation = "6204"\n{keys}')), "rotor")


def test_what_has_no_angle_refuses_one(scene_text: Callable[..., str]) -> None:
    given = scene_text("varying_compliance", ("balls = 8\n", 'balls = 8\naxial_displacement = "10 um"\n'))
    with pytest.raises(SceneError, match="the scene gives a stiffness"):
        scene_from_text(given, "varying_compliance")
    roller = scene_text("punching_press_roller", ("clearance =", 'contact_angle = "8 deg"\nclearance ='))
    with pytest.raises(SceneError, match="no contact angle"):
        scene_from_text(roller, "punching_press_roller")
