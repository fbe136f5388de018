"""What dyads, forces and drives do to a machine, against absolute coordinates with multipliers (tests/machines).

The second implementation knows nothing of dyads, reactions in closed form or virtual work: ideal joints are
constraints, forces act between points, the driver turns freely under a torque.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache

import numpy as np
import pytest
from comparison import drawn, largest_difference, largest_imbalance, power_imbalance
from coupled_scenes import POWERS, RUN, Derived, linkage_text
from linkages import MACHINES
from multibody import Multibody
from parts import PARTS, TORQUES, Part, cases, shaper
from quick_cases import long_but

from ballpass.derive.drive.laws import LAWS as DRIVES
from ballpass.derive.mechanism.dyads import DYADS
from ballpass.derive.reading.read import scene_from_text

FREE = '[mechanism.driver.torque]\nlaw = "none"\n\n[mechanism.frame.points]'


def freely(text: str, driver: str = FREE) -> tuple[Derived, Multibody]:
    """The mechanism of a scene without its bearing, its driver's angle a coordinate where nothing else is said."""
    text = text.partition("[bearing]")[0].replace("[mechanism.frame.points]", driver, 1) + RUN
    derived = Derived(scene_from_text(text, "machine"), further=POWERS)
    return derived, Multibody(derived.scene, derived.points())


@cache
def idle() -> tuple[Derived, Multibody]:
    """The crank-shaper that forces are put on, without any."""
    return freely(shaper(""))


State = tuple[float, np.ndarray, dict[str, float]]


def states(derived: Derived, machine: Multibody, count: int) -> list[State]:
    """Random angles of several turns, and speeds either way."""
    rng = np.random.default_rng(14)
    return [drawn(rng, derived, machine) for _ in range(count)]


def check(derived: Derived, machine: Multibody, where: Iterable[State]) -> None:
    """Accelerations, reactions, torque and powers."""
    for state in where:
        assert largest_difference(derived, machine, *state) < 1e-10
        assert largest_imbalance(derived, machine, *state) < 1e-11
        assert power_imbalance(derived, machine, *state) < 1e-10


def test_every_dyad_and_each_of_its_branches_is_in_a_machine() -> None:
    found = {(dyad.kind, dyad.sign) for make in MACHINES.values() for dyad in make().linkage().dyads}
    missing = {(dyad.kind, sign) for dyad in DYADS for sign in (1, -1)[: len(dyad.branches)]} - found
    assert not missing, f"MACHINES of tests/machines/linkages.py has no machine with {missing}"


@pytest.mark.parametrize(
    "name",
    long_but(
        MACHINES, "four-bar", "crank-slider", "slotted lever", "six-bar with slider", "scotch yoke", "rapson's slide"
    ),
)
def test_linkages_move_and_react_as_in_absolute_coordinates(name: str) -> None:
    """At constant speed, where the drive's torque is a reaction; and turning freely."""
    machine = MACHINES[name]()
    driver = machine.mechanism.joint("A")
    if driver.bodies[0] != "frame":
        machine = machine.with_joint("A", bodies=driver.bodies[::-1], points=driver.points[::-1])
    drivers = ["[mechanism.frame.points]"]
    if not name.endswith(("behind", "left", "right")):  # once a machine
        drivers.append(FREE)
    for driver in drivers:
        pair = freely(linkage_text(machine), driver)
        check(*pair, states(*pair, 3))


@pytest.mark.parametrize("part", cases(part for part in PARTS if part.registry == "force"), ids=str)
def test_forces_act_as_between_points_in_absolute_coordinates(part: Part) -> None:
    """Where it acts, and where a stop, window or table leaves the machine alone."""
    derived, machine = freely(part.text)
    without, acting, idling = idle()[0], [], []
    for state in states(derived, machine, 16):
        alone = np.allclose(derived.rhs(*state), without.rhs(*state[:2], {}), rtol=1e-9, atol=0.0)
        (idling if alone else acting).append(state)
    assert acting
    check(derived, machine, [*acting[:4], *idling[:1]])


@pytest.mark.parametrize("law", long_but(DRIVES, "table", "asynchronous"))
def test_torques_of_drives_turn_the_machine(law: str) -> None:
    """With a flywheel on the driven body."""
    torque = f'[mechanism.driver.torque]\nlaw = "{law}"\n{TORQUES[law]}\n'
    wheel = '[mechanism.driver.flywheel]\ninertia = "0.02 kg*m^2"\n\n[mechanism.frame.points]'
    pair = freely(shaper(""), torque + wheel)
    check(*pair, states(*pair, 4))


def kloss(speed: float) -> float:
    slip = 1.0 - speed / 150.0
    return 2.0 * 9.0 / (slip / 0.2 + 0.2 / slip)


#: Torque over the speed, of the numbers in `parts.TORQUES`.
TORQUE: dict[str, Callable[[float], float]] = {
    "constant": lambda speed: 5.0,
    "linear": lambda speed: 8.0 - 0.04 * speed,
    "table": lambda speed: float(np.interp(speed, [0.0, 50.0, 200.0], [3.0, 4.0, -1.0])),
    "asynchronous": kloss,
    "none": lambda speed: 0.0,
}


@pytest.mark.parametrize("law", DRIVES)
def test_torques_are_those_of_data_sheets(law: str) -> None:
    """Straight lines, a table by NumPy's interpolation, Kloss's formula with its breakdown point at 120 rad/s."""
    assert law in TORQUE, "TORQUE needs the law's formula, written by hand"
    torque = f'[mechanism.driver.torque]\nlaw = "{law}"\n{TORQUES[law]}\n\n[mechanism.frame.points]'
    derived, _ = freely(shaper(""), torque)
    for speed in (*np.linspace(-35.0, 225.0, 14), 120.0):
        found = derived.outputs(0.0, np.array([0.3, speed]), {})["drive_torque"]
        assert found == pytest.approx(TORQUE[law](float(speed)), rel=1e-12, abs=0.0)
