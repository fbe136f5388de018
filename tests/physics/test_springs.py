"""A spring that hardens on the crank-shaper, against the closed form of a slotted lever written here."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pytest

from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.runtime import Model, Solution, UnusualWarning
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.point.jacobian import rows_of, values_of_rows

SPRING = """[mechanism.springs.return]
bodies = ["frame", "lever"]
points = ["hook", "tip"]
stiffness = "2 N/mm"
free_length = "150 mm"
damping = "40 N*s/m"
preload = "20 N"

"""
TWIST = """[mechanism.torsion_springs.twist]
bodies = ["frame", "lever"]
stiffness = "30 N*m/rad"
free_angle = "80 deg"
damping = "0.5 N*m*s/rad"
preload = "3 N*m"

"""
HOOK = 0.25 + 0.18j
PLACE = '[mechanism.frame.points]\nhook = ["250 mm", "180 mm"]\n'
OUTPUTS = ('"body.*"]', '"body.*", "spring.*", "torsion_spring.*"]')
FREE_ANGLE = "mechanism.torsion_springs.twist.free_angle"
K, FREE, C, PRELOAD = 2000.0, 0.15, 40.0, 20.0
TURN = np.arange(256) * 2 * np.pi / 256


def changes(*added: str) -> tuple[tuple[str, str], ...]:
    return (
        ("[mechanism.frame.points]\n", PLACE),
        ("[mechanism.forces.cut]\n", "".join(added) + "[mechanism.forces.cut]\n"),
        ('force = ["1500 N", "0 N"]', 'force = ["0 N", "0 N"]'),
    )


@pytest.fixture(scope="module")
def bare(make_model: Callable[..., Model]) -> Model:
    return make_model("crank_shaper", *changes())


@dataclass
class Lever:
    """Length of the spring, angle of the lever and their rates at crank angles, in complex numbers."""

    length: np.ndarray
    length_rate: np.ndarray
    angle: np.ndarray
    angle_rate: np.ndarray


def lever(crank: np.ndarray, speed: float) -> Lever:
    pivot = -0.2j
    pin = 0.08 * np.exp(1j * crank)
    slot, slot_rate = pin - pivot, 1j * speed * pin
    angle_rate = np.imag(np.conj(slot) * slot_rate) / np.abs(slot) ** 2
    arm = 0.38 * slot / np.abs(slot)
    line = pivot + arm - HOOK
    length_rate = np.real(np.conj(line) * 1j * angle_rate * arm) / np.abs(line)
    return Lever(np.abs(line), length_rate, np.angle(slot), angle_rate)


def along_turn(model: Model, of: str, parameters: Mapping[str, float] | None = None) -> np.ndarray:
    numbers = model.numbers(parameters)
    speed = numbers.values["mechanism.driver.speed"]
    rows = rows_of(model, of)
    return np.array([values_of_rows(model, rows, point(model, numbers, a / speed, None))[0] for a in TURN])


@pytest.mark.long
def test_a_cubic_stiffness_hardens_a_spring_and_what_it_stores_comes_back(
    make_model: Callable[..., Model], bare: Model
) -> None:
    """Tension by the closed form at every angle; over a turn no work, for the force has a potential."""
    cubic = SPRING.replace("damping = ", 'cubic_stiffness = "3e5 N/m^3"\ndamping = ').replace('"40 N*s/m"', '"0 N*s/m"')
    twist = TWIST.replace("damping = ", 'cubic_stiffness = "-9 N*m/rad^3"\ndamping = ').replace('"0.5 N', '"0 N')
    model = make_model("crank_shaper", *changes(cubic, twist), OUTPUTS)
    closed = lever(TURN, model.parameters["mechanism.driver.speed"])
    excess, turned = closed.length - FREE, closed.angle - math.radians(80)
    tension = PRELOAD + K * excess + 3e5 * excess**3
    assert along_turn(model, "spring.return.tension") == pytest.approx(tension, rel=1e-11)
    assert float(np.max(np.abs(3e5 * excess**3))) > 0.1 * float(np.max(np.abs(tension)))
    torque = 3.0 + 30.0 * turned - 9.0 * turned**3
    assert along_turn(model, "torsion_spring.twist.torque") == pytest.approx(torque, rel=1e-11)
    added = along_turn(model, "drive_torque") - along_turn(bare, "drive_torque")
    assert abs(np.mean(added)) < 1e-9 * float(np.max(np.abs(added)))


def test_a_cubic_stiffness_goes_with_a_stiffness(scene_text: Callable[..., str]) -> None:
    alone = SPRING.replace('stiffness = "2 N/mm"\nfree_length = "150 mm"', 'cubic_stiffness = "3e5 N/m^3"')
    with pytest.raises(SceneError) as caught:
        scene_from_text(scene_text("crank_shaper", *changes(alone)), "shaper")
    assert [fault.key for fault in caught.value.faults] == ["mechanism.springs.return.cubic_stiffness"]


@pytest.mark.long
def test_a_torsion_spring_of_a_body_that_swings_does_not_jump(make_model: Callable[..., Model]) -> None:
    """The lever swings from 66 to 114 degrees, on either side of half a turn from some of these free angles."""
    model = make_model("crank_shaper", *changes(TWIST), (OUTPUTS[0], OUTPUTS[1].replace('"spring.*", ', "")))
    closed = lever(TURN, model.parameters["mechanism.driver.speed"])
    for free in np.radians([80.0, -80.0, -95.0, -112.0, 250.0]):
        excess = closed.angle - free
        excess -= 2.0 * np.pi * np.round(np.mean(excess) / (2.0 * np.pi))
        found = along_turn(model, "torsion_spring.twist.torque", {FREE_ANGLE: float(free)})
        assert found == pytest.approx(3.0 + 30.0 * excess + 0.5 * closed.angle_rate, rel=1e-11, abs=1e-11)


@pytest.mark.long
def test_a_torsion_spring_between_bodies_that_turn_warns_in_every_question(make_model: Callable[..., Model]) -> None:
    """Its torque jumps by stiffness times a turn, once a turn."""
    outputs = (OUTPUTS[0], OUTPUTS[1].replace('"spring.*", ', ""))
    model = make_model("crank_shaper", *changes(TWIST.replace("lever", "crank")), outputs)
    questions: tuple[Callable[[dict[str, float]], object], ...] = (
        lambda numbers: model.simulate(cycles=1.0, parameters=numbers),
        lambda numbers: model.sensitivity(
            "rms:inner.y", "bearing.clearance", cycles=1.0, transient=0, parameters=numbers
        ),
        lambda numbers: model.life(cycles=1.0, transient=0, parameters=numbers),
        lambda numbers: model.explain(numbers),
    )
    words = r"torsion_spring.twist.turns = 1: unusual. Usual is 0. .* the torque jumps"
    for degrees, ask in zip((81.0, 82.0, 83.0, 84.0), questions, strict=True):  # said once of the same numbers
        with pytest.warns(UnusualWarning, match=words):
            found = ask({FREE_ANGLE: math.radians(degrees)})
        if isinstance(found, Solution):
            torque = found["torsion_spring.twist.torque"]
            assert np.count_nonzero(np.abs(torque - np.roll(torque, 1)) > 30.0 * np.pi) == 1


GEARED = """[mechanism.driver]
joint = "A"
speed = "3 rad/s"
[mechanism.frame.points]
A = "origin"
B = "100 mm"
[mechanism.bodies.pinion]
mass = "0.5 kg"
inertia = "0.01 kg*m^2"
center_of_mass = "origin"
points = { A = "origin" }
[mechanism.bodies.wheel]
mass = "0.5 kg"
inertia = "0.01 kg*m^2"
center_of_mass = "origin"
points = { B = "origin" }
[mechanism.joints]
A = { type = "revolute", bodies = ["frame", "pinion"] }
B = { type = "revolute", bodies = ["frame", "wheel"] }
[mechanism.gears.pair]
bodies = ["pinion", "wheel"]
teeth = [20, 60]
[mechanism.torsion_springs.twist]
bodies = ["frame", "wheel"]
stiffness = "10 N*m/rad"
free_angle = "1 rad"
[run]
cycles = 3
"""


@pytest.mark.long
def test_a_torsion_spring_at_a_slow_wheel_jumps_half_a_turn_from_its_free_angle(
    model_of: Callable[..., Model],
) -> None:
    """One turn of the wheel in three of the driver: its jump was anywhere."""
    with pytest.warns(UnusualWarning, match="turns = -0.3333: unusual"):
        run = model_of(GEARED).simulate()
    excess = -run.t - 1.0
    np.testing.assert_allclose(
        run["torsion_spring.twist.torque"], 10.0 * (excess - 2.0 * np.pi * np.round(excess / (2.0 * np.pi))), atol=1e-9
    )
