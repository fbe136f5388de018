"""Claims about waviness, spalls and slip with every drive, in both couplings, on whichever ring turns.

Accelerations against absolute coordinates are in `test_coupled_machines.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from ball_effects import taken
from comparison import drawn, power_imbalance
from coupled_scenes import EFFECTS, POWERS, RUN, SPALLS, TANGENT, UNDAMPED, Derived, bearing, with_bearings
from multibody import Multibody

from ballpass.derive import SceneError, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from ballpass.runtime.ask.vibration import order_spectrum

SCENES = Path(__file__).resolve().parents[2] / "scenes"
MOTOR = """[mechanism.driver.torque]
law = "asynchronous"
breakdown_torque = "40 N*m"
breakdown_slip = 0.2
synchronous_speed = "520 rpm"
[mechanism.driver.flywheel]
inertia = "0.2 kg*m^2"
"""
COASTING = '[mechanism.driver.torque]\nlaw = "none"\n[mechanism.driver.flywheel]\ninertia = "0.2 kg*m^2"\n'
SPEED = 'speed = "500 rpm"                       # [paper]; positive is counter-clockwise\n'
RUN_UP = 'table = { time = ["0 s", "6 s"], speed = ["300 rpm", "900 rpm"] }\n'
SPALL = """[bearing.defects.spall]
on = "outer"
angle = "283 deg"
chord = "1 mm"
profile = "path"
"""


@cache
def press(*bearings: str, drive: str = "", table: bool = False) -> str:
    """The paper's press with other bearings and another drive."""
    text = (SCENES / "punching_press.toml").read_text(encoding="utf-8").partition("[bearing]")[0]
    assert SPEED in text
    text = text.replace(SPEED, RUN_UP) if table else text
    return text.replace("[mechanism.frame.points]", f"{drive}[mechanism.frame.points]") + "".join(bearings) + RUN


ALL = EFFECTS + SPALLS


@pytest.mark.parametrize(
    "text",
    [
        press(bearing("A", elastic=True, count=2, effects=ALL)),
        press(bearing("A", "frame", effects=ALL), bearing("B", "rod", elastic=True, effects=ALL), drive=MOTOR),
    ],
    ids=["constant speed", "motor, outer ring on the crank"],
)
def test_powers_of_all_forces_are_the_change_of_the_kinetic_energy(text: str) -> None:
    """Balls that roll over waves and edges turn the rings; without that torque the balance misses by percents."""
    derived = Derived(with_bearings(text), further=POWERS)
    machine, rng = Multibody(derived.scene, derived.points()), np.random.default_rng(3)
    for _ in range(3):
        assert power_imbalance(derived, machine, *drawn(rng, derived, machine)) < 1e-10


def test_a_heavy_ring_in_a_light_linkage_feels_effects_as_one_coupled_one_way_does() -> None:
    """The same state, with effects and without: what they change of the rings' accelerations."""
    one_way = (SCENES / "punching_press.toml").read_text(encoding="utf-8").partition("[bearing]")
    common = bearing("A", elastic=True, effects=ALL).replace("bearings.at_A", "bearing")
    single = common.replace('coupling = "two-way"', "share = 1.0") + '[bearing.inner_ring]\nmass = "50 kg"\n'
    states = np.random.default_rng(8).uniform(-1, 1, (4, 8)) * np.repeat([3e-5, 0.1], 4)
    changed = []
    for text in (common, single):
        derived = [
            Derived(scene_from_text(one_way[0] + own + RUN, "press"))
            for own in (text, text.replace(EFFECTS.replace("[bearing.", "[bearing."), "").replace(SPALLS, ""))
        ]
        for one in derived:
            light = {f"mechanism.bodies.{body}.mass": 1e-9 for body in ("rod", "slider")}
            light |= {"mechanism.bodies.rod.inertia": 1e-12, "mechanism.bodies.crank.mass": 50.0}
            one.change({name: value for name, value in light.items() if name in one.values})
        rows = []
        for t, x in zip((0.011, 0.03, 0.07, 0.15), states, strict=True):
            rows.append([one.rhs(t, x, one.gates() | one.spall_gates(t))[4:] for one in derived])
        changed.append(np.array([wavy - plain for wavy, plain in rows]))
    assert np.max(np.abs(changed[1])) > 10.0
    assert changed[0] == pytest.approx(changed[1], rel=1e-6, abs=1e-6 * np.max(np.abs(changed[1])))
