"""Strength and life of bearings: against runs asked for one by one, closed forms and SciPy's integrals."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from ballpass.runtime import Model
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import DutyInfo, LubricationInfo
from ballpass.runtime.life.report import _oscillation
from ballpass.runtime.life.wear import LoadSamples, wear_field
from ballpass.runtime.questions.life import life_figures
from ballpass.runtime.ratings import groove_slip, life
from ballpass.runtime.ratings.of_bearing import RacewayContact, contacts_of, ratings_of
from ballpass.runtime.ratings.wear import depth_of_pass


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press")


@pytest.mark.long
def test_a_report_is_what_its_quantities_give_one_by_one(press: Model) -> None:
    report = press.life()
    (state,), (bearing,) = report.states, report.bearings
    assert state.turns == pytest.approx(128)
    assert state.settled
    assert not report.unsettled
    table = {"bearing.clearance": [press.parameters["bearing.clearance"]]}
    names = ["life", "max:ball.force", "peak_ball:ball.force"]
    found = press.simulate_many(table, names, cycles=130, transient=2)
    assert bearing.life == pytest.approx(float(found["life"][0]), rel=1e-4)
    assert bearing.peak_force == pytest.approx(float(found["max:ball.force"][0]), rel=1e-4)
    # ISO 76: 4200 MPa at the ring that is worse off under C_0r
    highest = max(bearing.inner.peak_pressure, bearing.outer.peak_pressure)
    assert bearing.static_safety == pytest.approx((4.2e9 / highest) ** 3, rel=1e-9)
    # both raceways share the damage
    assert sum(bearing.inner.damage) + sum(bearing.outer.damage) == pytest.approx(1.0)
    # the resultant of eight balls and the load on the ring are one force, but for the ring's own inertia
    steady = press.simulate(cycles=22).steady()
    load = np.hypot(steady["reaction.A.x"], steady["reaction.A.y"]) / 2.0
    assert bearing.equivalent_load == pytest.approx(float(np.mean(load**3)) ** (1 / 3), rel=0.05)
    assert bearing.basic_life == pytest.approx(1e6 * (bearing.dynamic_rating / bearing.equivalent_load) ** 3)
    assert bearing.hours(bearing.life) == pytest.approx(bearing.life / (500 * 60))
    assert max(map(len, str(report).splitlines())) <= 80
    assert repr(report).startswith("LifeReport(punching_press: 242")


@pytest.mark.long
def test_the_pressure_of_a_four_stroke_engine_is_drawn_over_both_turns(make_model: Callable[..., Model]) -> None:
    """Whichever turn the run begins with, the gas force of the other one is in the picture."""
    model = make_model("engine")
    figure = dict(life_figures(model, model.life(cycles=8), {}))["pressure"]
    (mesh,) = figure.axes[0].collections
    pressure = mesh.get_array()
    edges = np.linspace(*figure.axes[0].get_xlim(), pressure.shape[1] + 1)
    assert edges[-1] - edges[0] == pytest.approx(720.0, rel=1e-3)
    top = int(np.argmax(np.max(pressure, axis=0)))
    assert 90.0 < edges[top] % 720.0 < 120.0  # the gas force is highest at 105 degrees of the first turn


def test_too_few_turns_are_told(press: Model) -> None:
    report = press.life(cycles=22)
    assert "20 steady turns, not settled" in report.unsettled[0]
    assert report.unsettled[0].split(".")[0] in " ".join(str(report).split())


def test_states_of_a_duty_cycle_add_up_by_time(press: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    slow = (("mechanism.driver.speed", 30.0), ("mechanism.forces.punch.force.y", 4000.0))
    states = (
        DutyInfo(name="work", share=0.2, parameters=()),
        DutyInfo(name="slow", share=0.5, parameters=slow),
        DutyInfo(name="stop", share=0.3, parameters=(("mechanism.driver.speed", 0.0),)),
    )
    single = [press.life(cycles=6, parameters=dict(state.parameters)).bearings[0] for state in states[:2]]
    monkeypatch.setattr(press, "manifest", replace(press.manifest, duty=states))
    (found,) = press.life(cycles=6).duty
    damage = [
        state.share / bearing.hours(bearing.life or 0.0) for state, bearing in zip(states[:2], single, strict=True)
    ]
    assert found.hours == pytest.approx(1.0 / sum(damage), rel=1e-12)
    assert found.damage == pytest.approx({"work": damage[0] / sum(damage), "slow": damage[1] / sum(damage), "stop": 0})
    # Miner over shares of the turns says the same
    turned = [state.share * abs(bearing.speed) for state, bearing in zip(states[:2], single, strict=True)]
    shares = [each / sum(turned) for each in turned]
    by_turns = 1.0 / sum(share / (bearing.life or 0.0) for share, bearing in zip(shares, single, strict=True))
    assert found.turns == pytest.approx(by_turns, rel=1e-12)


def test_film_and_dirt_change_the_life(press: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    clean = press.life(cycles=6).bearings[0]
    film = LubricationInfo(viscosity_ratio=None, viscosity=30e-6, contamination=0.5)
    bearing = replace(press.manifest.bearings[0], lubrication=film)
    monkeypatch.setattr(press, "manifest", replace(press.manifest, bearings=(bearing,)))
    found = press.life(cycles=6).bearings[0]
    ratio = 30e-6 / (1e-6 * 45000.0 * 500.0**-0.83 * 33.5**-0.5)
    assert found.viscosity_ratio == pytest.approx(ratio)
    assert clean.life is not None
    load = clean.dynamic_rating * (1e6 / clean.life) ** (1 / 3)
    factor = life.life_factor(ratio, 0.5 * clean.fatigue_limit / load)
    assert found.modified_life == pytest.approx(factor * clean.life)
    assert clean.modified_life is None


def test_a_scene_without_bearing_is_refused(press: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(press, "manifest", replace(press.manifest, bearings=()))
    with pytest.raises(RequestError, match="no bearing"):
        press.life(cycles=4)


@pytest.mark.long
def test_a_bearing_that_swings_has_no_life_and_the_others_have(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press_hinges")
    report = model.life(cycles=4)
    lives = {bearing.name: bearing.life for bearing in report.bearings}
    assert lives["pin"] is None
    assert lives["main"] is not None
    assert lives["big_end"] is not None
    assert "fretting" in str(report)
    rows = report.to_pandas()
    assert np.isnan(rows.loc[("", "pin"), ["life", "hours"]].to_numpy(dtype=float)).all()
    assert rows.loc[("", "main"), "life"] == report.bearings[0].life
    with pytest.raises(RequestError, match="swings"):
        model.simulate_many({"mechanism.gravity": [9.81]}, ["pin.life"], cycles=2, transient=1)
    with pytest.raises(RequestError, match="swings"):
        model.sensitivity(of="pin.life", wrt="mechanism.gravity", cycles=2, transient=1)


def contact(model: Model) -> RacewayContact:
    return contacts_of(model.manifest.bearings[0], model.numbers({}).values)[0]


def test_contacts_at_an_angle_are_nearer_to_the_middle_of_a_bearing_that_swings(press: Model) -> None:
    """A swing of the dither amplitude moves the shorter-moved contact by its length; radii were 1/cos(angle) of it."""
    info, angle, load = press.manifest.bearings[0], np.radians(40.0), 2000.0
    cosines = {"bearing.contact_angle": angle, "bearing.cos_contact_angle": np.cos(angle)}
    values = {**press.numbers().values, **cosines}
    time = np.linspace(0.0, 1.0, 101)
    still = {"time": time, "crank": time, "force": np.full((101, 8), load), "resultant": np.full(101, load)}
    samples = LoadSamples(**still, in_outer=0.1 * np.sin(time), in_inner=-0.1 * np.sin(time))
    found = _oscillation(info, values, ratings_of(info, values), samples, load, load)
    assert found is not None
    ball, pitch = values["bearing.ball_diameter"], values["bearing.pitch_diameter"]
    share, ways = ball * np.cos(angle) / pitch, []
    for sign, ring in zip((1.0, -1.0), contacts_of(info, values), strict=True):
        # to and fro, while the cage moves by half of (1 -+ gamma) against the ring
        way = 2.0 * found.dither * 0.5 * (1.0 + sign * share) * (pitch / 2.0) * (1.0 - sign * share)
        ways.append(way / (2.0 * ring.semi_axes(load)[1]))
    assert min(ways) == pytest.approx(1.0, rel=1e-12)


def test_a_pass_wears_off_what_pressure_and_slip_give(press: Model) -> None:
    ring, load = contact(press), 2000.0
    across, along = ring.semi_axes(load)
    top = float(ring.peak_pressure(load))
    assert top == pytest.approx(1.5 * load / (np.pi * across * along))
    for share in (0.0, 0.2, 0.6, 0.9):
        half = along * np.sqrt(1.0 - share**2)
        pressed = quad(lambda y, s=share: top * np.sqrt(max(1.0 - s**2 - (y / along) ** 2, 0.0)), -half, half)[0]
        slip = groove_slip.creepage(share * across, across, ring.ball_diameter, ring.raceway_radius, ring.groove_radius)
        assert depth_of_pass(share * across, load, ring) == pytest.approx(pressed * abs(slip), rel=1e-6)
    rolling = groove_slip.PURE_ROLLING * across
    assert depth_of_pass(rolling, load, ring) == pytest.approx(0.0, abs=1e-9 * depth_of_pass(0.0, load, ring))


@pytest.mark.long
def test_wear_of_a_long_run_with_few_samples_is_that_of_a_short_one(make_model: Callable[..., Model]) -> None:
    """Under a load that stands; samples more than half a turn of the balls apart gave a third, or less."""
    model = make_model("varying_compliance", ("samples_per_cycle = 2000", "samples_per_cycle = 16"))
    short, long = (model.life(cycles=cycles, transient=2).bearings[0] for cycles in (66, 2500))
    for ring in ("inner", "outer"):
        assert getattr(long, ring).wear[0] / getattr(short, ring).wear[0] == pytest.approx(1.0, rel=0.1)


def test_wear_of_an_even_load_is_that_of_a_pass_times_the_passes(press: Model) -> None:
    ring, load, speed, balls = contact(press), 500.0, -7.3, 8
    time = np.linspace(0.0, 40.0, 40001)
    angle = (speed * time) % (2.0 * np.pi)
    force = np.full((len(time), balls), load)
    samples = LoadSamples(time=time, crank=angle, force=force, resultant=0.0 * time, in_outer=angle, in_inner=angle)
    across, rate = wear_field(samples, angle, ring)
    expected = balls * abs(speed) / (2.0 * np.pi) * depth_of_pass(0.0, load, ring)
    np.testing.assert_allclose(rate[:, 0], expected, rtol=3e-3)
    assert across[-1] == pytest.approx(ring.semi_axes(load)[0])
    np.testing.assert_array_equal(rate[:, -1], 0.0)


THREE_LOADS = """
[shaft]
speed = "600 rpm"
[load]
type = "constant"
force = ["0 lbf", "-650 lbf"]
[bearing]
designation = "6308"
dynamic_rating = "7700 lbf"
damping = { law = "tangent", ratio = "2e-5 s" }
inner_ring = { mass = "5 kg", damping = "3000 N*s/m" }
outer_ring = { support = "fixed" }
[duty.half_an_hour]
share = 0.5
[duty.ten_minutes]
share = 0.16666666666666667
set.load.force.y = "-750 lbf"
[duty.twenty_minutes]
share = 0.33333333333333333
set.load.force.y = "-250 lbf"
"""


@pytest.mark.long
def test_a_duty_cycle_has_the_mean_load_and_basic_life_of_a_textbook(model_of: Callable[..., Model]) -> None:
    """650, 750 and 250 lbf for 30, 10 and 20 minutes of an hour: 597.05 lbf, and (7700/597.05)^3 million turns."""
    stated = THREE_LOADS + '[run]\nreliability = "95 %"\n'
    report = model_of(stated, "three_loads").life(cycles=60, transient=40)
    (found,) = report.duty
    pound = 4.4482216152605
    assert found.mean_load == pytest.approx(597.053 * pound, rel=1e-4)
    assert found.basic_turns == pytest.approx(2145.03e6, rel=3e-4)
    assert found.basic_hours == pytest.approx(59584.0, rel=3e-4)
    (row,) = re.findall(r"basic L_5, mean load P_m \d+ N +(\d+) +(\d+)", str(report))
    assert [float(cell) for cell in row] == pytest.approx([0.64 * 2145.03, 0.64 * 59584.0], rel=1e-3)  # a_1 of ISO 281
    with pytest.raises(RequestError, match=r"0\.92"):
        model_of(THREE_LOADS, "three_loads").life(cycles=60, transient=40, reliability=0.92)
