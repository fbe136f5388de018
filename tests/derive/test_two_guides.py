"""The dyads with two guides, RPP and PRP, against closed forms; what of them is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from coupled_scenes import Derived
from linkages import evaluate, rapson_slide, scotch_yoke, yoke_on_rocker

from ballpass.derive.mechanism.linkage import check_assembly
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import LinkageError

#: Crank 50 mm at 600 rpm, yoke 2 kg; what the yoke pushes is the sine of the block's travel.
YOKE = """
[mechanism.driver]
joint = "A"
speed = "600 rpm"
[mechanism.frame.points]
A = "origin"
[mechanism.bodies.crank]
mass = "1 kg"
inertia = "0.001 kg*m^2"
center_of_mass = "origin"
points = { A = "origin", B = "50 mm" }
[mechanism.bodies.block]
mass = "0.1 kg"
center_of_mass = "origin"
points = { B = "origin" }
[mechanism.bodies.yoke]
mass = "2 kg"
center_of_mass = "origin"
points = { Y = "origin" }
[mechanism.joints.A]
type = "revolute"
bodies = ["frame", "crank"]
[mechanism.joints.B]
type = "revolute"
bodies = ["crank", "block"]
[mechanism.joints.S]
type = "prismatic"
bodies = ["yoke", "block"]
points = ["Y", "B"]
direction = "90 deg"
[mechanism.joints.G]
type = "prismatic"
bodies = ["frame", "yoke"]
points = ["A", "Y"]
direction = "0 deg"
[run]
outputs = ["*"]
"""


def test_a_scotch_yoke_has_the_torque_and_forces_of_its_sine() -> None:
    """x = r cos θ: torque ½ m r² ω² sin 2θ, force of the slot on the yoke −m r ω² cos θ."""
    derived = Derived(scene_from_text(YOKE, "yoke"))
    speed = 600 * 2 * math.pi / 60
    for degrees in (0.0, 45.0, 130.0, 250.0):
        angle = math.radians(degrees)
        found = derived.outputs(angle / speed, np.zeros(0), {})
        assert found["drive_torque"] == pytest.approx(0.5 * 2 * (0.05 * speed) ** 2 * math.sin(2 * angle), abs=1e-12)
        push = -2 * 0.05 * speed**2 * math.cos(angle)
        assert found["reaction.S.x"] == pytest.approx(push, abs=1e-10)  # of the block on the yoke
        crank = push + 0.1 * -0.05 * speed**2 * math.cos(angle)
        assert found["reaction.B.x"] == pytest.approx(-crank, abs=1e-10)
    assert found["reaction.S.y"] == pytest.approx(0.0, abs=1e-10)
    assert round(derived.outputs(math.radians(45) / speed, np.zeros(0), {})["drive_torque"], 4) == 9.8696


def test_dyads_are_found_in_any_order_of_joints() -> None:
    assert [(d.kind, d.bodies, d.joints) for d in yoke_on_rocker().linkage().dyads][1] == (
        "RPP",
        ("block", "yoke"),
        ("F", "S", "E"),
    )
    assert [(d.kind, d.bodies, d.joints) for d in rapson_slide().linkage().dyads][1] == (
        "PRP",
        ("ram", "block"),
        ("G", "F", "E"),
    )


@pytest.mark.parametrize("make", [scotch_yoke, yoke_on_rocker, rapson_slide])
def test_sliders_stay_on_their_guides(make) -> None:
    """The second point of each guide stays on the line through the first one."""
    machine = make()
    linkage = machine.linkage()
    for guide in (guide for placement in linkage.placements for guide in placement.guides):
        one, two = (linkage.motion(body, guide.joint.point(body)).position for body in guide.joint.bodies)
        sense = 1 if guide.slider == guide.joint.bodies[1] else -1
        (dx, dy), (nx, ny) = (two[0] - one[0], two[1] - one[1]), guide.normal
        across, along = dx * nx + dy * ny, dx * guide.direction[0] + dy * guide.direction[1] - sense * guide.travel
        apart = evaluate(machine, [across, along], np.linspace(0.0, 6.0, 50), linkage)
        assert np.max(np.abs(apart)) < 1e-15


def test_parallel_guides_are_refused() -> None:
    machine = scotch_yoke().with_values(mechanism__joints__S__direction=math.radians(7))
    with pytest.raises(LinkageError, match="cannot be assembled at joint S") as caught:
        check_assembly(machine.linkage(), machine.values)
    assert "squared sine of the angle between guides S and G" in caught.value.faults[0].given


def test_a_branch_of_two_guides_is_ahead_or_none() -> None:
    assert scotch_yoke().linkage().definitions == scotch_yoke("ahead").linkage().definitions
    with pytest.raises(LinkageError, match="joint S closes the RPP dyad of block and yoke") as caught:
        scotch_yoke("behind").linkage()
    (fault,) = caught.value.faults
    assert (fault.allowed, fault.remedy) == ("ahead or no branch", "say nothing: guides S and G meet at one place")
