"""The RPR dyad against what textbooks say of a quick return; what of it is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from linkages import DRIVE, Machine, evaluate, shaper_with_ram, slotted_lever

from ballpass.derive import read_scene
from ballpass.derive.mechanism.linkage import derive_linkage
from ballpass.derive.scene.errors import LinkageError

SCENE = Path(__file__).resolve().parents[2] / "scenes/crank_shaper.toml"


@pytest.mark.parametrize("guide_on_block", [False, True])
def test_branch_is_ahead_or_behind_along_the_guide(guide_on_block: bool) -> None:
    for branch, side in (("ahead", 1), ("behind", -1)):
        machine = slotted_lever(branch, guide_on_block=guide_on_block)
        linkage = machine.linkage()
        direction = sp.Symbol("mechanism.joints.S.direction", real=True)
        tx, ty = linkage.poses["lever"].rotate((sp.cos(direction), sp.sin(direction)))
        (x0, y0), (x1, y1) = (linkage.motion(b, p).position for b, p in (("lever", "O"), ("block", "B")))
        order = -1 if guide_on_block else 1  # from the hinge of the guide's body to the other one
        (along,) = evaluate(machine, [order * ((x1 - x0) * tx + (y1 - y0) * ty)], np.linspace(0, 6, 61), linkage)
        assert np.all(side * along > 0)


def test_dyads_are_found_in_a_shaper_with_ram() -> None:
    linkage = shaper_with_ram().linkage()
    assert [(d.kind, d.joints) for d in linkage.dyads] == [("RPR", ("O", "S", "B")), ("RRP", ("E", "C", "G"))]


def test_shipped_shaper_has_the_quick_return_of_its_lengths() -> None:
    """Crank 80 mm, pivots 200 mm apart: the lever swings by 2 asin(0.4); its strokes are as 180 ± 2 asin(0.4) deg."""
    scene = read_scene(SCENE)
    assert scene.mechanism is not None
    machine = Machine(mechanism=scene.mechanism, values={q.path: q.value for q in scene.quantities})
    linkage = derive_linkage(scene.mechanism, DRIVE)
    lever = linkage.poses["lever"]
    swing = math.asin(80 / 200)
    crank = np.linspace(0.0, 2 * np.pi, 360001)
    cos, sin, rate = evaluate(machine, [lever.cos, lever.sin, lever.rate], crank, linkage)
    angle = np.arctan2(sin, cos)
    assert np.max(angle) - math.pi / 2 == pytest.approx(swing, abs=1e-9)
    assert math.pi / 2 - np.min(angle) == pytest.approx(swing, abs=1e-9)
    assert np.mean(rate > 0) == pytest.approx((math.pi + 2 * swing) / (2 * math.pi), abs=1e-5)


def test_missing_branch_is_refused() -> None:
    with pytest.raises(
        LinkageError, match="joint S closes the RPR dyad of lever and block and has no branch"
    ) as caught:
        slotted_lever().with_joint("S", branch=None).linkage()
    (fault,) = caught.value.faults
    assert fault.allowed == "ahead or behind"
    with pytest.raises(LinkageError, match="branch of another dyad"):
        slotted_lever().with_joint("S", branch="left").linkage()
