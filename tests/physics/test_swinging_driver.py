"""A driver that swings: the numbers of a pendulum in closed form, and those of a driver with the same speed and
acceleration at that instant."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from quick_cases import long_but
from typer.testing import CliRunner

from ballpass.derive import SceneError, derive
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.cli import app

AMPLITUDE, FREQUENCY, MEAN = math.radians(40.0), 1.5, math.radians(60.0)
RATE = 2.0 * math.pi * FREQUENCY

DRIVER = 'start_angle = "60 deg"\nswing = { amplitude = "40 deg", frequency = "1.5 Hz" }'

PENDULUM = f"""
[mechanism]
gravity = "9.81 m/s^2"
[mechanism.driver]
joint = "A"
{DRIVER}
[mechanism.frame.points]
A = "origin"
[mechanism.bodies.arm]
mass = "0.5 kg"
inertia = "0.01 kg*m^2"
center_of_mass = "200 mm"
points = {{ A = "origin" }}
[mechanism.joints.A]
type = "revolute"
bodies = ["frame", "arm"]
[run]
cycles = 2
transient_cycles = 0
"""

#: A double rocker: its driver swings by less than 42 deg about 60 deg.
ROCKERS = f"""
[mechanism]
gravity = "9.81 m/s^2"
[mechanism.driver]
joint = "A"
{DRIVER}
[mechanism.frame.points]
A = "origin"
D = ["100 mm", "0 mm"]
[mechanism.bodies.arm]
mass = "0.35 kg"
inertia = "120 kg*mm^2"
center_of_mass = "30 mm"
points = {{ A = "origin", B = "80 mm" }}
[mechanism.bodies.coupler]
mass = "0.4 kg"
inertia = "480 kg*mm^2"
center_of_mass = ["30 mm", "4 mm"]
points = {{ B = "origin", C = "60 mm" }}
[mechanism.bodies.rocker]
mass = "0.6 kg"
inertia = "520 kg*mm^2"
center_of_mass = "36 mm"
points = {{ D = "origin", C = "80 mm" }}
[mechanism.joints]
A = {{ type = "revolute", bodies = ["frame", "arm"] }}
B = {{ type = "revolute", bodies = ["arm", "coupler"] }}
C = {{ type = "revolute", bodies = ["coupler", "rocker"], branch = "left" }}
D = {{ type = "revolute", bodies = ["frame", "rocker"] }}
[run]
cycles = 1
transient_cycles = 0
outputs = ["reaction.*", "drive_torque", "drive_power", "driver.*", "kinetic_energy", "weight.energy"]
"""

BEARING = """
[bearing]
joint = "A"
coupling = "two-way"
balls = 8
ball_diameter = "8 mm"
pitch_diameter = "40 mm"
clearance = "10 um"
contact = { stiffness = "8e9 N/m^1.5" }
damping = { law = "tangent", ratio = "0.25e-5 s" }
outer_ring = { support = "elastic", mass = "0.5 kg", stiffness = "5e7 N/m", damping = "500 N*s/m" }
[run]
"""


def motion(time: float) -> tuple[float, float, float]:
    """Angle, speed and acceleration."""
    phase = RATE * time
    angle = MEAN + AMPLITUDE * math.sin(phase)
    return angle, AMPLITUDE * RATE * math.cos(phase), -AMPLITUDE * RATE**2 * math.sin(phase)


def torque(phase: np.ndarray, rate: float = RATE) -> np.ndarray:
    inertia, weight = 0.01 + 0.5 * 0.2**2, 0.5 * 9.81 * 0.2
    acceleration = -AMPLITUDE * rate**2 * np.sin(phase)
    return np.asarray(inertia * acceleration + weight * np.cos(MEAN + AMPLITUDE * np.sin(phase)))


def test_a_pendulum_swings_as_its_closed_form(model_of: Callable[..., Model]) -> None:
    model, phases = model_of(PENDULUM), np.linspace(0.0, 2.0 * math.pi, 100_001)
    run = model.simulate(samples_per_cycle=360)
    np.testing.assert_allclose(run["drive_torque"], torque(RATE * run.t), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run["driver.angle"], MEAN + AMPLITUDE * np.sin(RATE * run.t), atol=1e-14)
    names = ["max:drive_torque", "mean:drive_power", "value:drive_torque@90deg", "amplitude:driver.angle@1x"]
    found = {name: one.value for name, one in model.quantities(names).items()}
    assert found["max:drive_torque"] == pytest.approx(float(np.max(torque(phases))), rel=1e-9)
    assert abs(found["mean:drive_power"]) < 1e-12  # what gravity and inertia take they give back
    assert found["value:drive_torque@90deg"] == pytest.approx(float(torque(np.array(0.5 * math.pi))), rel=1e-12)
    assert found["amplitude:driver.angle@1x"] == pytest.approx(AMPLITUDE, rel=1e-9)
    (pair,) = model.sensitivity("max:drive_torque", ["mechanism.driver.swing.frequency"]).pairs
    step = 1e-4
    ends = [float(np.max(torque(phases, RATE + 2.0 * math.pi * way * step))) for way in (-1, 1)]
    assert pair.check.verdict.value == "verified"
    assert pair.derivative == pytest.approx((ends[1] - ends[0]) / (2.0 * step), rel=1e-5)
    with pytest.raises(RequestError, match="the driver swings and makes no turn"):
        model.quantities("drive_work")


@pytest.mark.parametrize("time", [0.0, 0.05, 0.31])
def test_reactions_are_those_of_a_driver_of_the_same_speed_and_acceleration(
    model_of: Callable[..., Model], time: float
) -> None:
    angle, speed, acceleration = motion(time)
    table = (
        f'start_angle = "{angle!r} rad"\n'
        f'table = {{ time = ["0 s", "1 s"], speed = ["{speed!r} rad/s", "{speed + acceleration!r} rad/s"] }}'
    )
    found, expected = model_of(ROCKERS).evaluate(time), model_of(ROCKERS.replace(DRIVER, table)).evaluate(0.0)
    assert set(expected) == set(found)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-12, abs=1e-13), name


def test_a_flywheel_and_the_power_of_the_drive_are_those_of_its_energy(model_of: Callable[..., Model]) -> None:
    model, step = model_of(ROCKERS.replace(DRIVER, f'{DRIVER}\nflywheel = {{ inertia = "0.002 kg*m^2" }}')), 1e-5
    for time in (0.1, 0.4):
        ends = [model.evaluate(time + way * step) for way in (-1, 1)]
        energy = [one["kinetic_energy"] + one["weight.energy"] for one in ends]
        assert model.evaluate(time)["drive_power"] == pytest.approx((energy[1] - energy[0]) / (2.0 * step), rel=1e-7)
    _, speed, _ = motion(0.0)
    still = model.evaluate(0.0)["kinetic_energy"] - model_of(ROCKERS).evaluate(0.0)["kinetic_energy"]
    assert still == pytest.approx(0.5 * 0.002 * speed**2, rel=1e-12)


def test_a_swing_beyond_where_the_linkage_locks_is_refused_at_its_phase(model_of: Callable[..., Model]) -> None:
    """The arm's pin is at most 140 mm from D: up to acos(-32/160), which is 101.54 deg."""
    model, most = model_of(ROCKERS), math.acos(-32.0 / 160.0) - MEAN
    amplitude = "mechanism.driver.swing.amplitude"
    model.simulate(parameters={amplitude: 0.9999 * most})
    phase = math.degrees(math.asin(1.0 / 1.1))
    with pytest.raises(RequestError, match=rf"(?s)phase of the swing 90\.00 deg .* to {phase:.2f}\d\d deg"):
        model.simulate(parameters={amplitude: 1.1 * most})


@pytest.mark.long
def test_the_balls_of_a_bearing_roll_to_and_fro(model_of: Callable[..., Model]) -> None:
    """The inner ring turns by the amplitude, the cage by its share of that."""
    model = model_of(ROCKERS.replace("[run]", BEARING).replace("outputs = [", 'outputs = ["*", '))
    share = 0.5 * (1.0 - 8.0 / 40.0)
    run = model.simulate(cycles=1, samples_per_cycle=360)
    turned = np.unwrap(run["cage.in_outer"], period=2.0 * math.pi)
    expected = share * AMPLITUDE * np.sin(RATE * run.t)
    np.testing.assert_allclose(turned - turned[0], expected, atol=1e-10)


@pytest.mark.long
def test_a_run_of_a_swing_leaves_out_few_periods_and_has_no_turns(
    model_of: Callable[..., Model], tmp_path: Path
) -> None:
    """It left out 50, though balls are where they were after one.  Angles are of its phase; a life has no turns."""
    text = ROCKERS.replace("[run]", BEARING).replace("cycles = 1\ntransient_cycles = 0\n", "")
    model = model_of(text)
    settings = model.run_settings
    assert settings.transient_cycles < 8.0
    assert settings.cycles == settings.transient_cycles + 10.0
    assert model.manifest.angle_words == "phase of the swing"
    (tmp_path / "swing.toml").write_text(text, encoding="utf-8")
    done = CliRunner().invoke(app, ["select", str(tmp_path / "swing.toml"), "--life", "1 h"])
    assert done.exit_code == 2
    assert "swings. Allowed: a bearing that turns, or static safety without --life" in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("swing =", 'speed = "1 rad/s"\nswing =', "the swing gives the driver's motion"),
        ('amplitude = "40 deg", ', "", "amplitude"),
        ('frequency = "1.5 Hz"', 'frequency = "0 Hz"', "frequency"),
    ],
)
def test_what_a_swing_does_not_go_with_is_refused(old: str, new: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        derive(scene_from_text(ROCKERS.replace(old, new), "wrong"))


def test_a_bearing_loaded_one_way_is_refused() -> None:
    one_way = BEARING.replace('coupling = "two-way"', 'share = 1.0\ninner_ring = { mass = "0.4 kg" }')
    with pytest.raises(SceneError, match="two-way"):
        derive(scene_from_text(ROCKERS.replace("[run]", one_way), "wrong"))


TWIST = """[mechanism.torsion_springs.twist]
bodies = ["frame", "arm"]
stiffness = "10 N*m/rad"
free_angle = "50 deg"
[mechanism.torsion_stops.limit]
bodies = ["arm", "frame"]
stiffness = "400 N*m/rad"
free_angle = "-120 deg"
"""


@pytest.mark.parametrize("amplitude", long_but([100.0, 150.0, 400.0], "400.0"))
def test_spring_and_balls_of_a_pendulum_follow_it_over_any_angle(
    model_of: Callable[..., Model], amplitude: float
) -> None:
    """From 137.8 deg on, where the mean of the directions turns round, both lost a turn.  The stop limits the arm at
    120 deg; the cage turns by its share."""
    text = PENDULUM.replace("[run]", TWIST + BEARING + 'outputs = ["*"]')
    model, most = model_of(text), math.radians(amplitude)
    run = model.simulate(
        parameters={"mechanism.driver.swing.amplitude": most}, cycles=1, transient=0, samples_per_cycle=720
    )
    turned = most * np.sin(RATE * run.t)
    np.testing.assert_allclose(
        run["torsion_spring.twist.torque"], 10.0 * (MEAN + turned - math.radians(50.0)), rtol=1e-12
    )
    deep = MEAN + turned - math.radians(120.0)
    np.testing.assert_allclose(run["torsion_stop.limit.torque"], 400.0 * np.maximum(deep, 0.0), rtol=1e-9, atol=1e-9)
    rolled = np.unwrap(run["cage.in_outer"], period=2.0 * math.pi)
    np.testing.assert_allclose(rolled - rolled[0], 0.5 * (1.0 - 8.0 / 40.0) * turned, atol=1e-10)


#: A crank-rocker: its driver can turn round.
CRANKED = (
    ROCKERS.replace('["100 mm", "0 mm"]', '["120 mm", "0 mm"]').replace("60 mm", "100 mm").replace('B = "80', 'B = "30')
)


@pytest.mark.long
@pytest.mark.parametrize("driver", [DRIVER, DRIVER.replace('"40 deg"', '"500 deg"')])
def test_springs_of_a_crank_rocker_follow_its_bodies_over_any_angle(
    model_of: Callable[..., Model], driver: str
) -> None:
    """The angles of all bodies, unwrapped; the mean of each over a period is within half a turn of the free angle."""
    free = {"arm": -2.0, "coupler": 4.0, "rocker": -0.7}  # the rocker's mean is half a turn from there, nearly
    springs = "".join(
        f'[mechanism.torsion_springs.{body}]\nbodies = ["frame", "{body}"]\nstiffness = "1 N*m/rad"\n'
        f'free_angle = "{angle} rad"\n'
        for body, angle in free.items()
    )
    text = CRANKED.replace(DRIVER, driver).replace("[run]", f"{springs}[run]")
    run = model_of(text.replace("outputs = [", 'outputs = ["body.*", "torsion_spring.*", ')).simulate(
        samples_per_cycle=2880
    )
    for body, angle in free.items():
        excess = np.unwrap(run[f"body.{body}.angle"]) - angle
        excess -= 2.0 * math.pi * np.round(np.mean(excess[:-1]) / (2.0 * math.pi))
        np.testing.assert_allclose(run[f"torsion_spring.{body}.torque"], excess, atol=1e-10)


@pytest.mark.long
def test_a_spring_in_a_linkage_that_cannot_turn_round_follows_its_bodies(model_of: Callable[..., Model]) -> None:
    """With a table to and fro within the driver's range; the equations of the same machine whose driver swings."""
    springs = """[mechanism.torsion_springs.at_rocker]
bodies = ["frame", "rocker"]
stiffness = "1 N*m/rad"
free_angle = "80 deg"
[mechanism.torsion_springs.at_arm]
bodies = ["arm", "frame"]
stiffness = "1 N*m/rad"
free_angle = "-60 deg"
[mechanism.torsion_stops.at_coupler]
bodies = ["frame", "coupler"]
stiffness = "300 N*m/rad"
free_angle = "-130 deg"
[run]
"""
    table = (
        'start_angle = "60 deg"\nrange = { start = "20 deg", end = "100 deg" }\n'
        'table = { time = ["0 s", "0.2 s", "0.6 s", "0.8 s"], speed = ["0 rad/s", "3 rad/s", "-3 rad/s", "0 rad/s"] }'
    )
    text = ROCKERS.replace("[run]", springs).replace("outputs = [", 'outputs = ["body.*", "torsion_*", ')
    run = model_of(
        text.replace(DRIVER, table).replace("cycles = 1\ntransient_cycles = 0", 'duration = "0.8 s"')
    ).simulate()
    assert np.ptp(run["body.arm.angle"]) > 0.5
    rocker = np.unwrap(run["body.rocker.angle"])
    np.testing.assert_allclose(run["torsion_spring.at_rocker.torque"], rocker - math.radians(80.0), atol=1e-12)
    np.testing.assert_allclose(run["torsion_spring.at_arm.torque"], MEAN - run["body.arm.angle"], atol=1e-12)
    # the mean over the range counts: that of the coupler over all angles of the linkage is half a turn further
    clear = -math.radians(130.0) - run["body.coupler.angle"]
    np.testing.assert_allclose(run["torsion_stop.at_coupler.compression"], clear, atol=1e-12)


@pytest.mark.long
def test_balls_in_a_linkage_that_cannot_turn_round_roll_with_its_bodies(model_of: Callable[..., Model]) -> None:
    """In the hinge of the rocker: the cage turns by its share of the rocker's angle."""
    text = ROCKERS.replace("[run]", BEARING.replace('joint = "A"', 'joint = "D"')).replace(
        DRIVER, 'start_angle = "60 deg"\nspeed = "2 rad/s"'
    )
    run = model_of(text.replace('"driver.*", ', '"body.*", "cage.*", ')).simulate(duration=0.2)
    rocker, cage = (np.unwrap(run[name]) for name in ("body.rocker.angle", "cage.in_outer"))
    assert np.ptp(rocker) > 0.1
    np.testing.assert_allclose(cage - cage[0], 0.4 * (rocker - rocker[0]), atol=1e-6)  # the rocker moves in its play
