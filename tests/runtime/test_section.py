"""Poincaré sections: curves that are known, points that repeat, a curve that predicts another run, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError
from ballpass.runtime.motion.invariant_curve import fit_curve
from ballpass.runtime.questions.section import ON_CURVE


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_tangent")


def test_a_curve_that_is_known_is_found_and_noise_is_none() -> None:
    phase = np.arange(300) * (math.sqrt(5.0) - 1.0) / 2.0
    angle = 2.0 * np.pi * phase
    points = np.column_stack([np.exp(np.sin(angle)), np.cos(3.0 * angle) + 0.2 * np.sin(5.0 * angle)])
    curve = fit_curve(phase, points)
    other = np.array([0.123, 0.77])
    assert curve(other)[:, 0] == pytest.approx(np.exp(np.sin(2.0 * np.pi * other)), abs=1e-6)
    assert np.max(curve.missed) < 1e-6
    assert curve.drift == pytest.approx((math.sqrt(5.0) - 1.0) / 2.0 - 1.0, abs=1e-12)
    noise = np.random.default_rng(2).normal(size=(300, 1))
    assert fit_curve(phase, noise).missed[0] > 0.9


def test_at_bottom_dead_centre_the_press_of_the_paper_lies_on_a_curve_that_another_run_meets(press: Model) -> None:
    found = press.section(at=270.0, readings=200, settling=30)
    assert (found.kind, found.motion) == ("on a closed curve", "periodic 134")
    assert found.curve is not None
    # balls that pass the outer ring in a turn: 8 times 409/1072
    assert found.curve.drift == pytest.approx(8.0 * 409.0 / 1072.0 - 3.0, abs=1e-9)
    start = np.array([0.0, -5e-6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    times = press.period() * (np.arange(40, 60) + 0.75)
    run = press.simulate(duration=float(times[-1]), times=times, initial=start, outputs=[], transient=0.0)
    met = found.curve((np.arange(40, 60) + 0.75) * 8.0 * 409.0 / 1072.0)
    assert np.max(np.sqrt(np.mean((met - run.x) ** 2, axis=0)) / found.states.std(axis=0)) < 2.0 * ON_CURVE
    assert "19.14 turns" in str(found)


def test_points_of_a_press_whose_turn_is_a_period_repeat(press: Model) -> None:
    found = press.section(parameters={"bearing.pitch_diameter": 31.75e-3}, readings=40)
    assert found.kind == "repeats after 1 turn"
    assert found.curve is None
    assert "repeats after 1 turn" in str(found)


@pytest.mark.parametrize(("speed", "name"), [(900.0, "periodic 1"), (1965.0, "periodic 2")])
def test_a_motion_has_the_name_that_bifurcation_gives_it(rotor: Model, speed: float, name: str) -> None:
    """Read each ball pitch it repeats; read once a turn, its points lie on a curve or on none."""
    found = rotor.section(parameters={"shaft.speed": speed * math.tau / 60.0})
    values = f"shaft.speed={speed} rpm:{speed + 0.01} rpm:2"
    diagram = rotor.bifurcation(values, settling=1000, readings=20, exponent=False)
    assert (found.motion, found.every) == (diagram.up[0].kind, diagram.every)
    assert found.motion == name
    assert f"Motion: {name}, read each time" in " ".join(str(found).split())
    # points once a period are the readings of the diagram
    points = rotor.section(once="period", settling=1000, readings=40, parameters={"shaft.speed": speed * math.tau / 60})
    count = int(name.split()[1])
    assert (points.kind, points.period) == (f"repeats after {count} point{'s' if count > 1 else ''}", count)
    for state in diagram.up[0].states[-count:]:
        assert np.min(np.max(np.abs(points.states - state) / [1e-6, 1e-6, 1e-3, 1e-3], axis=1)) < 1e-2


@pytest.mark.long
def test_a_motion_of_two_periods_has_one_name(make_model: Callable[..., Model]) -> None:
    model = make_model("rotor")
    for pitch, name in ((33.5e-3, "periodic 134"), (31.4159265e-3, "quasi-periodic")):
        given = {"bearing.pitch_diameter": pitch}
        found = model.section(parameters=given)
        diagram = model.bifurcation("bearing.clearance=0 um:10 um:2", parameters=given)
        assert {one.kind for one in (*diagram.up, *diagram.down)} == {name}
        assert (found.motion, found.every) == (name, diagram.every)


@pytest.mark.long
def test_a_chaotic_motion_has_one_name(make_model: Callable[..., Model]) -> None:
    """Its states say nothing: the exponent of readings behind them does, as in a bifurcation diagram."""
    model = make_model("punching_press_tangent")
    given = {"bearing.pitch_diameter": 31.75e-3, "bearing.clearance": 30e-6}
    found = model.section(parameters=given)
    diagram = model.bifurcation("bearing.clearance=29.99 um:30 um:2", parameters=given, readings=40, settling=10)
    assert found.motion == diagram.up[-1].kind == "chaotic"
    assert found.exponent is not None
    assert found.exponent.mean == pytest.approx(diagram.up[-1].exponent.mean, abs=0.3)
    assert f"largest exponent per reading {found.exponent.words}" in " ".join(str(found).split())
    points = model.section(parameters=given, once="period")  # a period is a turn here
    assert np.array_equal(points.states, found.states)
    assert points.kind == "chaotic"


@pytest.mark.long
def test_readings_of_a_section_decide_what_sixty_leave_open(make_model: Callable[..., Model]) -> None:
    """A rotor under its weight with 40 um of clearance: a disturbance grows by 0.18 a reading, and scatters."""
    model = make_model("varying_compliance")
    given = {"shaft.speed": 3750 * math.tau / 60, "bearing.clearance": 40e-6}
    few = model.section(parameters=given, once="period", readings=60, settling=300)
    found = model.section(parameters=given, once="period", readings=1000, settling=300)
    assert few.kind == "undecided"
    assert found.kind == "chaotic"
    assert found.exponent is not None
    assert found.exponent.half < 0.04
    # drive and cage have no common period
    with pytest.raises(RequestError, match="once = turn"):
        make_model("rotor").section(once="period", parameters={"bearing.pitch_diameter": 31.4159265e-3})


@pytest.mark.long
def test_chaotic_points_are_on_no_curve_at_any_load(press: Model) -> None:
    for angle in (0.0, 270.0):
        found = press.section(at=angle, readings=200, parameters={"bearing.clearance": 40e-6})
        assert found.kind == "on no smooth curve"
        assert "Lyapunov" in str(found)


@pytest.mark.long
def test_what_has_no_section_is_refused(press: Model, make_model: Callable[..., Model]) -> None:
    with pytest.raises(RequestError, match=r"inner\.y"):
        press.section("inner.z")
    with pytest.raises(RequestError, match="driver's motion is a state"):
        make_model("punching_press_motor").section()


@pytest.mark.long
def test_where_a_ball_differs_the_curve_is_over_a_turn_of_the_cage_and_a_load_at_its_own_rate_leaves_none(
    make_model: Callable[..., Model],
) -> None:
    load = """[loads.harmonic]
type = "harmonic"
mean = ["0 N", "0 N"]
amplitude = ["0 N", "0 N"]
frequency = "37 Hz"
phase = "0 deg"

[bearing.ball_deviation]
3 = "1 um"

[bearing]
"""
    rotor = make_model("rotor", ("[bearing]\n", load))
    found = rotor.section(readings=1600, settling=60)
    assert (found.kind, found.around) == ("on a closed curve", "turn of the cage")
    assert found.curve is not None
    times = rotor.period() * np.arange(60, 90)
    start = np.array([1e-6, -4e-6, 0.0, 0.0])
    run = rotor.simulate(duration=float(times[-1]), times=times, initial=start, outputs=[], transient=0.0)
    turned = rotor.numbers().values["bearing.cage_ratio"] * np.arange(60, 90)
    assert np.max(np.abs(found.curve(turned) - run.x) / found.states.std(axis=0)) < ON_CURVE
    other = rotor.section(readings=40, settling=5, parameters={"loads.harmonic.amplitude.x": 5.0})
    assert other.kind == "not named: loads.harmonic.angular_frequency turns at its own rate"
    # of 50 Hz it repeats with the shaft
    even = {"loads.harmonic.amplitude.x": 5.0, "loads.harmonic.frequency": 50.0}
    assert rotor.section(readings=40, settling=5, parameters=even).curve is not None


@pytest.mark.long
def test_points_of_an_engine_are_taken_once_in_two_turns(make_model: Callable[..., Model]) -> None:
    engine = make_model("engine")
    found = engine.section(readings=1600, settling=60)
    assert found.kind == "on a closed curve"
    assert "1600 points, one in 2 turns" in str(found)
    times = engine.period() * 2.0 * np.arange(61, 64)
    run = engine.simulate(duration=float(times[-1]), times=times, outputs=[], transient=0.0, rtol=1e-8)
    assert np.max(np.abs(found.states[:3] - run.x) / found.states.std(axis=0)) < 1e-3
