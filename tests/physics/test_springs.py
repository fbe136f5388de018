"""Springs and dampers on the crank-shaper, against closed forms of a slotted lever written here."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import derive, equations, read_scene
from ballpass.derive.features import cost, features
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
def shaper(make_model: Callable[..., Model]) -> Model:
    return make_model("crank_shaper", *changes(SPRING, TWIST), OUTPUTS)


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


def test_tension_is_preload_stiffness_and_damping_of_the_line_between_the_points(shaper: Model) -> None:
    closed = lever(TURN, shaper.parameters["mechanism.driver.speed"])
    assert along_turn(shaper, "spring.return.length") == pytest.approx(closed.length, rel=1e-12)
    tension = PRELOAD + K * (closed.length - FREE) + C * closed.length_rate
    assert along_turn(shaper, "spring.return.tension") == pytest.approx(tension, rel=1e-11)
    torque = 3.0 + 30.0 * (closed.angle - math.radians(80)) + 0.5 * closed.angle_rate
    assert along_turn(shaper, "torsion_spring.twist.torque") == pytest.approx(torque, rel=1e-11)


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


def test_drive_power_of_springs_is_the_rate_of_their_energy_and_the_loss_of_their_dampers(
    shaper: Model, bare: Model
) -> None:
    """At every angle, and over a turn, where the springs give back what they took: the damper's loss alone is left."""
    speed = shaper.parameters["mechanism.driver.speed"]
    closed = lever(TURN, speed)
    added = along_turn(shaper, "drive_torque") - along_turn(bare, "drive_torque")
    stored = (PRELOAD + K * (closed.length - FREE)) * closed.length_rate
    stored += (3.0 + 30.0 * (closed.angle - math.radians(80))) * closed.angle_rate
    lost = C * closed.length_rate**2 + 0.5 * closed.angle_rate**2
    assert added * speed == pytest.approx(stored + lost, rel=1e-9, abs=1e-9 * float(np.max(np.abs(stored))))
    assert np.mean(added) == pytest.approx(np.mean(lost) / speed, rel=1e-9)
    assert np.mean(lost) > 1.0


def test_generated_derivatives_of_the_drive_torque_are_those_of_the_closed_form(shaper: Model) -> None:
    speed = shaper.parameters["mechanism.driver.speed"]
    spring, twist = "mechanism.springs.return.", "mechanism.torsion_springs.twist."
    for crank in (0.3, 1.9, 4.4):
        at = lever(np.array([crank]), speed)
        excess, turned = at.length - FREE, at.angle - math.radians(80)
        expected = {
            spring + "stiffness": excess * at.length_rate,
            spring + "damping": at.length_rate**2,
            spring + "free_length": -K * at.length_rate,
            spring + "preload": at.length_rate,
            twist + "stiffness": turned * at.angle_rate,
            twist + "damping": at.angle_rate**2,
            twist + "free_angle": -30.0 * at.angle_rate,
        }
        found = shaper.jacobian("drive_torque", list(expected), t=crank / speed)
        assert np.ravel(found) * speed == pytest.approx(np.ravel(list(expected.values())), rel=1e-9)


def test_a_spring_between_moving_bodies_pulls_both(make_model: Callable[..., Model], bare: Model) -> None:
    """From the crankpin to the lever's tip; virtual work again."""
    inner = SPRING.replace('"frame", "lever"', '"crank", "lever"').replace('"hook", "tip"', '"B", "tip"')
    model = make_model("crank_shaper", *changes(inner))
    speed = model.parameters["mechanism.driver.speed"]
    pin = 0.08 * np.exp(1j * TURN)
    slot = pin + 0.2j  # the tip lies on the same line, 0.38 m from the pivot
    length, rate = 0.38 - np.abs(slot), -np.real(np.conj(slot) * 1j * speed * pin) / np.abs(slot)
    tension = PRELOAD + K * (length - FREE) + C * rate
    added = along_turn(model, "drive_torque") - along_turn(bare, "drive_torque")
    assert added * speed == pytest.approx(tension * rate, rel=1e-9, abs=1e-8 * float(np.max(np.abs(tension * rate))))


def test_equations_name_springs_and_a_damper_alone_has_no_spring(scene_text: Callable[..., str]) -> None:
    text = equations(derive(scene_from_text(scene_text("crank_shaper", *changes(SPRING, TWIST)), "shaper")))
    assert "Tension of return, spring and damper [N]" in text
    assert "Torque of twist, spring and damper [N·m]" in text
    only = SPRING.replace('stiffness = "2 N/mm"\nfree_length = "150 mm"\n', "").replace('preload = "20 N"\n', "")
    text = equations(derive(scene_from_text(scene_text("crank_shaper", *changes(only)), "shaper")))
    assert "mechanism.springs.return.damping" in text
    assert "free length" not in text


def test_springs_are_features_that_cost_the_linkage_alone(scene_text: Callable[..., str]) -> None:
    scene = scene_from_text(scene_text("crank_shaper", *changes(SPRING, TWIST), OUTPUTS), "shaper")
    names = [f.name for f in features(scene)]
    assert names[2:5] == ["force cut", "spring return", "torsion spring twist"]
    added = cost(scene).added
    for name in names[3:5]:
        assert added[name]["kernel.stage"] > 0
        assert added[name]["kernel.relative"] == added[name]["kernel.acceleration"] == 0


@pytest.mark.parametrize(
    ("change", "key", "remedy"),
    [
        (('"frame", "lever"', '"lever", "lever"'), "mechanism.springs.return.bodies", "name the other body"),
        (('"frame", "lever"', '"frame", "rod"'), "mechanism.springs.return.bodies", "rod"),
        (('"hook", "tip"', '"hook", "end"'), "mechanism.springs.return.points", "end"),
        (('free_length = "150 mm"\n', ""), "mechanism.springs.return.free_length", 'add free_length = "40 mm"'),
        (('stiffness = "2 N/mm"\n', ""), "mechanism.springs.return.free_length", "delete it"),
        (('"2 N/mm"', '"-2 N/mm"'), "mechanism.springs.return.stiffness", "positive"),
        (('"2 N/mm"', '"2 N*m"'), "mechanism.springs.return.stiffness", "N/m"),
    ],
)
def test_faults_of_springs_are_named(
    scene_text: Callable[..., str], change: tuple[str, str], key: str, remedy: str
) -> None:
    assert change[0] in SPRING
    with pytest.raises(SceneError) as caught:
        scene_from_text(scene_text("crank_shaper", *changes(SPRING.replace(*change))), "shaper")
    (fault,) = (f for f in caught.value.faults if f.key == key)
    assert remedy in fault.remedy


def test_a_spring_between_the_points_of_a_hinge_is_refused(scene_text: Callable[..., str]) -> None:
    hinged = SPRING.replace('["frame", "lever"]', '["crank", "block"]').replace('["hook", "tip"]', '["B", "B"]')
    scene = scene_from_text(scene_text("crank_shaper", *changes(hinged)), "shaper")
    with pytest.raises(SceneError, match=r"joint \w+ keeps the two points together"):
        derive(scene)


def test_a_spring_without_stiffness_and_damping_is_refused(scene_text: Callable[..., str]) -> None:
    nothing = '[mechanism.springs.return]\nbodies = ["frame", "lever"]\npoints = ["hook", "tip"]\npreload = "20 N"\n\n'
    with pytest.raises(SceneError, match="neither stiffness nor damping"):
        scene_from_text(scene_text("crank_shaper", *changes(nothing)), "shaper")


def test_scenes_without_springs_have_none_of_their_symbols() -> None:
    scene = read_scene(Path(__file__).resolve().parents[2] / "scenes/crank_shaper.toml")
    assert not [d for d in derive(scene).definitions if "spring" in d.symbol.name]
