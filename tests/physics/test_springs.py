"""A spring that hardens on the crank-shaper, against the closed form of a slotted lever written here."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.runtime import Model
from ballpass.runtime.point.jacobian import quantity_values

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


def along_turn(model: Model, of: str) -> np.ndarray:
    numbers = model.numbers()
    speed = numbers.values["mechanism.driver.speed"]
    return np.array([quantity_values(model, numbers, of, t=a / speed, x=None)[0] for a in TURN])


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


def test_a_torsion_spring_that_jumps_is_said(make_model: Callable[..., Model]) -> None:
    """Counted in a finely sampled turn, in which the torque jumps by stiffness times a turn."""
    outputs = (OUTPUTS[0], OUTPUTS[1].replace('"spring.*", ', ""))
    model = make_model(
        "crank_shaper", *changes(TWIST, TWIST.replace("twist", "wound").replace("lever", "crank")), outputs
    )
    for free in (math.radians(80.0), math.radians(-95.0)):
        numbers = {"mechanism.torsion_springs.twist.free_angle": free}
        run, limits = model.simulate(cycles=1.0, parameters=numbers), model.explain(numbers).limits
        for name in ("twist", "wound"):
            torque = run[f"torsion_spring.{name}.torque"]
            jumps = np.count_nonzero(np.abs(torque - np.roll(torque, 1)) > 30.0 * np.pi)
            assert model.constants(numbers)[f"torsion_spring.{name}.jumps"] == jumps
            said = [words for words in limits if f"torsion_spring.{name}: its torque jumps" in words]
            assert len(said) == (jumps > 0) == (name == "wound" or free < 0.0)
