"""Forces, drives and laws that cannot be: each fault is found in its line, and the message says what to do."""

from __future__ import annotations

import re

import pytest
from parts import FORCES, TORQUES, driven, press, shaper

from ballpass.derive import derive
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError

PISTON, STEADY = "forces PistonPressure AngleTable", "forces PistonPressure ConstantForce"
SPRING, PIN = "springs TwoPoints SpringDamper", "friction JointTurn Friction"
WALL, TABLE, WINDOW = "stops AlongDirection Stop", "forces PointForce AngleTable", "forces PointForce Windows"

#: A force of `FORCES`, what of its text is replaced and by what, words of the message.
WRONG = [
    (SPRING, '"frame", "lever"', '"lever", "lever"', r"springs\.it\.bodies.*name the other body"),
    (SPRING, '"frame", "lever"', '"frame", "rod"', r"springs\.it\.bodies.*rod"),
    (SPRING, '"hook", "tip"', '"hook", "end"', r"springs\.it\.points.*end"),
    (SPRING, 'free_length = "150 mm"\n', "", r'springs\.it\.free_length.*add free_length = "40 mm"'),
    (SPRING, 'stiffness = "2 N/mm"\n', "", r"springs\.it\.free_length.*delete the key"),
    (
        SPRING,
        'stiffness = "2 N/mm"\nfree_length = "150 mm"\ndamping = "40 N*s/m"\n',
        "",
        "neither stiffness nor damping",
    ),
    (SPRING, '"2 N/mm"', '"-2 N/mm"', r"springs\.it\.stiffness.*positive"),
    (SPRING, '"2 N/mm"', '"2 N*m"', r"springs\.it\.stiffness.*N/m"),
    (
        SPRING,
        'bodies = ["frame", "lever"]\npoints = ["hook", "tip"]',
        'bodies = ["crank", "block"]\npoints = ["B", "B"]',
        r"joint \w+ keeps the two points together",
    ),
    (WALL, 'stiffness = "2e5 N/m"\n', "", r"add stiffness = "),
    (WALL, 'free_distance = "50 mm"', 'free_length = "50 mm"', r"add free_distance = \"2 mm\""),
    (WALL, 'direction = "30 deg"\n', "", r"add free_length = \"40 mm\""),
    (WALL, '"2e5 N/m"', '"-2e5 N/m"', "the value is negative"),
    (WALL, '"3 s/m"', '"-3 s/m"', "the value is negative"),
    (WALL, 'hysteresis = "3 s/m"', 'damping = "30 N*s/m"', "unknown key"),
    (WALL, '"crank", "lever"', '"lever", "lever"', "both ends are on one body"),
    (WALL, '"A", "tip"', '"A", "top"', "has no point"),
    (PIN, 'smoothing = "5 rad/s"\n', "", r'add smoothing = "1 rad/s"'),
    (PIN, '"5 rad/s"', '"0 rad/s"', "the value is zero"),
    (PIN, '"30 N*m"', '"-30 N*m"', "the value is negative"),
    (PIN, 'viscous = "0.4 N*m*s/rad"\ntorque = "30 N*m"\nsmoothing = "5 rad/s"\n', "", "neither viscous nor torque"),
    (PIN, 'torque = "30 N*m"', "coefficient = 0.1", "that reaction depends on the friction itself"),
    (PIN, '"B"', '"Q"', "there is no such joint"),
    (PIN, '"B"', '"S"', r"this joint is prismatic.*\[mechanism.guide_friction.it\]"),
    (TABLE, '"30 deg", "190 deg"', '"-20 deg", "190 deg"', r"angle\.2.*does not increase"),
    (TABLE, '"190 deg"', '"345 deg"', r"angle\.3.*cover a whole turn"),
    (TABLE, ', "-60 N"', "", "differ in length"),
    (TABLE, ', force = ["100 N", "1200 N", "-60 N"]', "", r"table\.force.*missing"),
    (TABLE, 'direction = "10 deg"\n', "", r"it\.direction.*missing"),
    (TABLE, "table =", 'force = ["1 N", "2 N"]\ntable =', r"it\.force.*unknown key"),
    (TABLE, "table =", 'window = { start = "1 deg", end = "2 deg" }\ntable =', r"it\.table.*delete one of the two"),
    (PISTON, "pressure =", "force =", r"table\.pressure.*missing"),
    (PISTON, '"700 kPa"', '"700 N"', r"pressure\.2.*a pressure or an elastic modulus"),
    (PISTON, 'direction = "190 deg"\n', "", r"it\.direction.*missing"),
    (PISTON, '"16 mm"', '"-16 mm"', r"it\.bore.*negative"),
    (PISTON, "table =", 'pressure = "2 bar"\ntable =', r"it\.pressure.*unknown key"),
    (PISTON, 'bore = "16 mm"\n', "", r"table\.force.*missing"),
    (STEADY, 'pressure = "7 bar"\n', "", r"it\.pressure.*missing"),
    (STEADY, '"1.2 bar"', '"-1.2 bar"', r"it\.ambient.*negative"),
    (STEADY, "pressure =", 'force = ["1 N", "2 N"]\npressure =', r"it\.force.*unknown key"),
    (
        WINDOW,
        "window =",
        'table = { angle = ["0 deg", "9 deg"], force = ["0 N", "1 N"] }\nwindow =',
        r"it\.table.*delete one of the two",
    ),
]


def refused(text: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        derive(scene_from_text(text, "machine"))
    assert caught.value.faults[0].line is not None
    assert re.search(words, str(caught.value), re.DOTALL), str(caught.value)


@pytest.mark.parametrize(("force", "old", "new", "words"), WRONG)
def test_forces_that_cannot_be_are_refused_with_a_remedy(force: str, old: str, new: str, words: str) -> None:
    text = FORCES[force][0]
    assert old in text
    refused(shaper(text.replace(old, new)), words)


@pytest.mark.parametrize(
    ("law", "old", "new", "words"),
    [
        ("linear", 'stall_torque = "8 N*m"\n', "", "the torque is missing"),
        ("linear", '"200 rad/s"', '"-200 rad/s"', "the signs of torque"),
        (
            "linear",
            'stall_torque = "8 N*m"',
            'nominal_torque = "5 N*m"\nnominal_speed = "210 rad/s"',
            "does not lie between rest and the no-load speed",
        ),
        ("table", '"50 rad/s"', '"0 rad/s"', "the speed does not increase"),
        ("asynchronous", "breakdown_slip = 0.2", "breakdown_slip = 0", "the value is zero"),
        ("servo", "", "", "this is none of the choices"),
        ("none", "", 'torque = "5 N*m"', "unknown key"),
    ],
)
def test_torques_that_no_motor_has_are_refused(law: str, old: str, new: str, words: str) -> None:
    numbers = TORQUES.get(law, "")
    assert old in numbers
    refused(driven(law, numbers.replace(old, new) if old else new), words)


@pytest.mark.parametrize(
    ("numbers", "remedy"),
    [
        ("", 'add hysteresis = "0.2 s/m"'),
        ("restitution = 0.9", 'add impact_speed = "0.1 m/s"'),
        ('impact_speed = "0.1 m/s"', "add restitution = 0.8"),
        ('hysteresis = "1 s/m"\nrestitution = 0.9', "delete one of the two: delete hysteresis, or delete restitution"),
    ],
)
def test_the_factor_of_hunt_and_crossley_is_given_in_one_way(numbers: str, remedy: str) -> None:
    with pytest.raises(SceneError, match=r"hysteresis .* or restitution|this key is missing") as caught:
        scene_from_text(press("hunt-crossley", numbers), "press")
    assert [fault.remedy for fault in caught.value.faults] == [remedy]
