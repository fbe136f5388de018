"""Stops: a wheel that bounces between two, against closed forms; a press that closes on one."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from test_friction import INERTIA, WHEEL

from ballpass.derive import derive, equations, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load

SPEED, STIFFNESS, UP, DOWN = 2.0, 4e4, math.radians(30.0), math.radians(-40.0)
CONTACT = math.pi * math.sqrt(INERTIA / STIFFNESS)
STOPS = f"""[mechanism.torsion_stops.up]
bodies = ["wheel", "frame"]
stiffness = "{STIFFNESS} N*m/rad"
free_angle = "-30 deg"
hysteresis = "0 s/rad"

[mechanism.torsion_stops.down]
bodies = ["frame", "wheel"]
stiffness = "{STIFFNESS} N*m/rad"
free_angle = "-40 deg"
"""
OF_UP = "mechanism.torsion_stops.up."
WALL = """[mechanism.stops.wall]
bodies = ["crank", "lever"]
points = ["A", "tip"]
direction = "30 deg"
stiffness = "2e5 N/m"
free_distance = "50 mm"
hysteresis = "3 s/m"

"""
CUT = "[mechanism.forces.cut]\n"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Model:
    folder = tmp_path_factory.mktemp("wheel")
    text = WHEEL.partition("[mechanism.friction")[0]
    text = text.replace('friction.*"', 'torsion_stop.*", "total_energy", "dissipated_power"') + STOPS
    (folder / "wheel.toml").write_text(text)
    return load(generate(folder / "wheel.toml", folder / "model"))


def bouncing(time: np.ndarray) -> np.ndarray:
    """Angle of the wheel from its start at zero: even flights, and half periods of a mass on a spring."""
    flight, depth = (UP - DOWN) / SPEED, SPEED * CONTACT / math.pi
    ahead = (time + (0.0 - DOWN) / SPEED) % (2.0 * (flight + CONTACT))
    back = ahead - flight - CONTACT
    away = np.where(back < 0.0, ahead, back)
    angle = np.where(away < flight, SPEED * away, SPEED * flight + depth * np.sin((away - flight) / CONTACT * math.pi))
    return np.where(back < 0.0, DOWN + angle, UP - angle)


def test_a_wheel_bounces_between_stops_in_half_periods_and_keeps_its_energy(wheel: Model) -> None:
    run = wheel.simulate(rtol=1e-12, parameters={"mechanism.driver.speed": SPEED}, samples_per_cycle=400)
    assert run.statistics.located == 10
    assert run["driver.angle"] == pytest.approx(bouncing(run.t), abs=1e-9)
    pressed = [np.maximum(run[f"torsion_stop.{name}.compression"], 0.0) for name in ("up", "down")]
    energy = 0.5 * INERTIA * run["driver.speed"] ** 2 + 0.5 * STIFFNESS * (pressed[0] ** 2 + pressed[1] ** 2)
    assert energy == pytest.approx(0.5 * INERTIA * SPEED**2, rel=1e-9)
    assert np.min([run["torsion_stop.up.torque"], run["torsion_stop.down.torque"]]) == 0.0


def test_hysteresis_takes_the_energy_of_hunt_and_crossley(wheel: Model) -> None:
    """Restitution e at speed v: alpha v (1 + e) = ln((1 + alpha v)/(1 - alpha e v)), whatever the force's exponent."""
    run = wheel.simulate(
        rtol=1e-11, duration=0.4, parameters={"mechanism.driver.speed": SPEED, OF_UP + "hysteresis": 0.2}
    )
    back, loss = -run["driver.speed"][-1] / SPEED, 0.2 * SPEED
    assert 0.7 < back < 0.9
    assert loss * (1.0 + back) == pytest.approx(math.log((1.0 + loss) / (1.0 - loss * back)), rel=1e-9)
    values = {"mechanism.driver.speed": SPEED, OF_UP + "hysteresis": 0.2}
    options = {"rtol": 1e-11, "duration": 0.4, "transient": 0, "parameters": values}
    taken = wheel.quantities(["integral:dissipated_power"], **options)["integral:dissipated_power"].value
    assert taken == pytest.approx(0.5 * INERTIA * SPEED**2 * (1.0 - back**2), rel=1e-7)
    assert run["total_energy"][0] - run["total_energy"][-1] == pytest.approx(taken, rel=1e-7)


@pytest.mark.long
def test_derivatives_of_a_bounce_are_those_of_its_closed_form(wheel: Model) -> None:
    """Behind the bounce the angle is 2 up - v (t - contact); steps over the kink have no digit of its derivatives."""
    speed = {"mechanism.driver.speed": SPEED}
    names = [OF_UP + "stiffness", OF_UP + "free_angle", "mechanism.bodies.wheel.inertia"]
    slopes = wheel.sensitivities(names, rtol=1e-10, duration=0.5, parameters=speed)
    half = SPEED * CONTACT / 2.0
    assert slopes.x[-1, 0] == pytest.approx([-half / STIFFNESS, -2.0, half / INERTIA], rel=1e-5, abs=0.0)
    found = wheel.sensitivity("rms:torsion_stop.up.torque", names, duration=0.5, parameters=speed)
    assert {pair.check.verdict.value for pair in found.pairs} == {"verified"}


def test_stops_are_met_at_loose_tolerances_and_an_error_can_be_named(wheel: Model) -> None:
    speed = {"mechanism.driver.speed": SPEED}
    assert wheel.simulate(rtol=1e-5, parameters=speed).statistics.located == 10
    run = wheel.simulate(error=1e-6, of="max:driver.angle", parameters=speed)
    assert run.reductions is not None
    highest = run.reductions.channels["driver.angle"].maximum
    assert highest == pytest.approx(UP + SPEED * CONTACT / math.pi, rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", ["punching_press", pytest.param("punching_press_two_way", marks=pytest.mark.extreme)])
def test_a_press_that_closes_on_a_stop_gains_from_steps_that_end_there(
    make_model: Callable[..., Model], name: str
) -> None:
    """One-way the stop is met at an instant that the drive alone decides, two-way at one that the motion does."""
    stop = """[mechanism.stops.bottom]
bodies = ["frame", "slider"]
points = ["A", "C"]
direction = "90 deg"
stiffness = "2e7 N/m"
free_distance = "-103 mm"
hysteresis = "0.5 s/m"

"""
    asked = ("outputs = [", 'outputs = ["stop.*", ')
    model = make_model(name, ("[mechanism.bodies.crank]", stop + "[mechanism.bodies.crank]"), asked)
    exact = model.simulate(rtol=1e-12, cycles=1.0, method="stepper-dop853").x
    errors = {}
    for kinks in ("located", "stepped-over"):
        run = model.simulate(rtol=1e-8, cycles=1.0, method="stepper-dp54", kinks=kinks)
        errors[kinks] = np.max(np.max(np.abs(run.x - exact), axis=0) / np.max(np.abs(exact), axis=0))
    assert errors["located"] < 1e-5
    assert errors["located"] < 0.1 * errors["stepped-over"]
    of_stop = [f"mechanism.stops.bottom.{key}" for key in ("stiffness", "free_distance", "hysteresis")]
    for quantity in ("mean:stop.bottom.force", "max:ball.force"):
        found = model.sensitivity(quantity, of_stop, cycles=1.0, transient=0.0)
        assert {pair.check.verdict.value for pair in found.pairs} == {"verified"}
        assert len(found.grazing) < 20
    if name == "punching_press":  # the slider leaves the stop faster than that expands: its force has a corner there
        strong, count = {"mechanism.stops.bottom.hysteresis": 50.0}, 400_000
        run = model.simulate(1.0, parameters=strong, samples_per_cycle=count, outputs=["stop.bottom.force"])
        force = run["stop.bottom.force"]
        assert np.any((force == 0.0) & (run.t > run.t[np.argmax(force)]))
        found = model.quantities("mean:stop.bottom.force", cycles=1.0, transient=0.0, parameters=strong)
        expected = np.trapezoid(force, run.t) / run.t[-1]
        assert found["mean:stop.bottom.force"].value == pytest.approx(expected, rel=1e-9, abs=0.0)


def test_equations_and_events_name_stops(scene_text: Callable[..., str]) -> None:
    system = derive(scene_from_text(scene_text("crank_shaper", (CUT, WALL + CUT)), "shaper"))
    assert "Force of the stop wall [N]" in equations(system)
    (event,) = [event for event in system.events if "stop" in event.name]
    assert (event.kind, event.changes) == ("state", "the slope of `stop.wall.force`")
    assert ("stop.wall.force", "kinked") in [(name, word.value) for name, word in system.smoothness]
