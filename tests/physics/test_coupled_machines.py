"""Claims about bearings coupled both ways, against a second implementation: absolute coordinates with multipliers."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from comparison import drawn, largest_difference, largest_imbalance
from coupled_scenes import (
    CHANGING_SLIP,
    EFFECTS,
    HUNT,
    LAGGING_LONG,
    ONE_SIDED,
    SPALLS,
    Derived,
    bearing,
    with_bearings,
)
from multibody import Multibody
from quick_cases import long_but
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.optimize import root

from ballpass.derive import generate
from ballpass.runtime import Model, load, read_manifest

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@cache
def text(name: str, *changes: tuple[str, str]) -> str:
    out = (SCENES / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in out, f"{old!r} is not in {name}"
        out = out.replace(old, new)
    return out


#: Ground is the shortest link: crank, coupler and rocker all go round.
DRAG_LINK = (
    ('D = ["120 mm", "0 mm"]', 'D = ["30 mm", "0 mm"]'),
    ('B = "30 mm"', 'B = "80 mm"'),
    ('C = "80 mm"', 'C = "110 mm"'),
)
#: The pivot lies within the crank's circle: the lever goes round.
WHITWORTH = (('"-200 mm"', '"-70 mm"'),)
OFF_CENTRE = (('{ distance = "0 mm", angle = "0 deg" }', '{ distance = "4 mm", angle = "50 deg" }'),)


FRAME_POINTS = "[mechanism.frame.points]"
MOTOR = """[mechanism.driver.torque]
law = "asynchronous"
breakdown_torque = "40 N*m"
breakdown_slip = 0.2
synchronous_speed = "520 rpm"

[mechanism.driver.flywheel]
inertia = "0.2 kg*m^2"

"""
#: Up, and down through zero, with what a flywheel takes.
SPEED = 'speed = "500 rpm"                       # [paper]; positive is counter-clockwise\n'
RUN_UP = """flywheel.inertia = "0.2 kg*m^2"
table = { time = ["0.1 s", "0.5 s", "1 s"], speed = ["100 rpm", "600 rpm", "-300 rpm"] }
"""


#: The crank tilts; its pin, its centre of mass and the end of a spring have places of their own.
TILTING = (
    (
        "[mechanism.bodies.crank]\n",
        '[mechanism.bodies.crank]\ntransverse_inertia = "900 kg*mm^2"\n'
        'positions = { B = "-12 mm", center_of_mass = "20 mm", P = "70 mm" }\n',
    ),
    ('points = { A = "origin", B = "6 mm" }', 'points = { A = "origin", B = "6 mm", P = ["3 mm", "15 mm"] }'),
    (FRAME_POINTS, f'{FRAME_POINTS}\nhook = ["150 mm", "80 mm"]'),
    (
        "[mechanism.driver]\n",
        '[mechanism.springs.it]\nbodies = ["frame", "crank"]\npoints = ["hook", "P"]\nstiffness = "2e5 N/m"\n'
        'free_length = "150 mm"\ndamping = "40 N*s/m"\npreload = "20 N"\n[mechanism.driver]\n',
    ),
)


def driven_by(drive: str) -> tuple[tuple[str, str], ...]:
    return ((FRAME_POINTS, drive + FRAME_POINTS),)


#: Scene, changes of it, bearings; no bearings: those of the scene.  Any others: test_random_machines.py.
CASES: dict[str, tuple[str, tuple[tuple[str, str], ...], tuple[str, ...]]] = {
    "two-way press": ("punching_press_two_way", (), ()),
    "press, bearings in all hinges": ("punching_press_hinges", (), ()),
    "press, roller on the crank pin": ("punching_press_roller", (), ()),
    "press, motor on the crank": ("punching_press_motor", (), ()),
    "toggle press": ("toggle_press", (), ()),
    "Andrews' squeezer": ("andrews", (), ()),
    "press, run-up": (
        "punching_press",
        (*OFF_CENTRE, (SPEED, RUN_UP)),
        (bearing("A", elastic=True, count=2), bearing("B", "rod")),
    ),
    "drag link": (
        "four_bar",
        (*DRAG_LINK, ('speed = "600 rpm"', 'speed = "-200 rpm"')),
        (
            bearing("A"),
            bearing("B", "crank", elastic=True),
            bearing("C", "rocker", elastic=True),
            bearing("D", "frame"),
        ),
    ),
    "press, effects": ("punching_press", (), (bearing("A", elastic=True, count=2, effects=EFFECTS + SPALLS),)),
    "press, effects, contact angle": (
        "punching_press",
        driven_by(MOTOR),
        (bearing("A", "frame", angle="25 deg", effects=EFFECTS + SPALLS), bearing("B", "rod", effects=EFFECTS)),
    ),
    "press, effects, outer ring on the crank": (
        "punching_press",
        (),
        (bearing("A", "frame", effects=EFFECTS + SPALLS), bearing("B", "rod", elastic=True, effects=EFFECTS + SPALLS)),
    ),
    "press, effects, run-up": (
        "punching_press",
        (*OFF_CENTRE, (SPEED, RUN_UP)),
        (bearing("A", elastic=True, effects=EFFECTS + SPALLS), bearing("B", "rod", effects=EFFECTS)),
    ),
    "press, crank that tilts in three bearings": (
        "punching_press",
        (*TILTING, *OFF_CENTRE),
        (
            bearing("A", elastic=True, count=2, position="30 mm"),
            bearing("A", position="90 mm", beside="second_", effects=EFFECTS),
            bearing("A", elastic=True, position="60 mm", beside="third_", offset='["3 um", "-4 um"]', angle="15 deg"),
            bearing("B", "rod"),
        ),
    ),
    "press, overhung crank that tilts, motor": (
        "punching_press",
        (*TILTING, *OFF_CENTRE, *driven_by(MOTOR)),
        (bearing("A", position="40 mm"), bearing("A", elastic=True, position="100 mm", beside="second_")),
    ),
    "press, effects, motor": (
        "punching_press",
        driven_by(MOTOR),
        (bearing("A", effects=SPALLS), bearing("B", "crank", count=2, effects=EFFECTS + SPALLS)),
    ),
    "press, slip that changes": (
        "punching_press",
        (),
        (
            bearing("A", "frame", effects=LAGGING_LONG + SPALLS),
            bearing("B", "rod", elastic=True, effects=LAGGING_LONG + SPALLS),
        ),
    ),
    "press, slip that changes, motor": (
        "punching_press",
        driven_by(MOTOR),
        (
            bearing("A", count=2, effects=LAGGING_LONG + SPALLS, angle="25 deg"),
            bearing("B", "crank", effects=CHANGING_SLIP.replace("0.07 s", "2 s")),
        ),
    ),
    "press, slip that changes, run-up": (
        "punching_press",
        (*OFF_CENTRE, (SPEED, RUN_UP)),
        (bearing("A", elastic=True, effects=LAGGING_LONG + SPALLS), bearing("B", "rod", effects=LAGGING_LONG)),
    ),
    "press, unlike bearings side by side": (
        "punching_press",
        driven_by(MOTOR),
        (
            bearing("A", count=2, clearance="14 um", law=ONE_SIDED, balls=7, stiffness=None),
            bearing("A", elastic=True, effects=EFFECTS + SPALLS, beside="second_"),
            bearing("B", "rod", elastic=True),
            bearing("B", "rod", balls=9, angle="15 deg", beside="second_"),
            bearing("B", "rod", elastic=True, law=HUNT, beside="third_"),
        ),
    ),
    "Whitworth": (
        "crank_shaper",
        WHITWORTH,
        (bearing("B", "crank", elastic=True), bearing("O", "frame", elastic=True)),
    ),
}


@cache
def pair(name: str) -> tuple[Derived, Multibody]:
    scene, changes, bearings = CASES[name]
    derived = Derived(with_bearings(text(scene, *changes), *bearings))
    return derived, Multibody(derived.scene, derived.points())


@pytest.mark.parametrize("name", long_but(CASES, "two-way press", "press, unlike bearings side by side"))
def test_accelerations_and_reactions_are_those_of_absolute_coordinates_with_multipliers(name: str) -> None:
    """Reactions and the drive's torque come out of the balances of the bodies, forces of the balls and housings out of
    deflections, a motor's torque out of its law: that both are equal is a free check."""
    derived, machine = pair(name)
    rng = np.random.default_rng(14)
    for _ in range(3):
        state = drawn(rng, derived, machine)
        assert largest_difference(derived, machine, *state) < 1e-10
        assert largest_imbalance(derived, machine, *state) < 1e-11


def test_a_run_up_loads_one_way_bearings_with_the_reaction_of_the_accelerated_linkage() -> None:
    derived = Derived(with_bearings(text("punching_press", (SPEED, RUN_UP))))
    ideal = replace(derived.scene, bearings=())
    machine, rng = Multibody(ideal, derived.points()), np.random.default_rng(5)
    loads = []
    for t in (0.05, 0.3, 0.7, 1.2):
        _, x, gates = drawn(rng, derived, machine)
        found, expected = derived.outputs(t, x, gates), machine.evaluate(t, np.array(machine.driver_at(t))).outputs
        largest = max(map(abs, expected.values()))
        assert {k: found[k] for k in expected} == pytest.approx(expected, rel=1e-10, abs=1e-10 * largest)
        assert found["load.x"] == pytest.approx(0.5 * expected["reaction.A.x"])
        assert found["driver.acceleration"] == pytest.approx(machine.acceleration, rel=1e-9)
        (ball,) = derived.ball_angles(t, x) - (1 - 7.9375 / 33.5) / 2 * machine.driver_at(t)[0]
        assert math.remainder(float(ball), 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
        loads.append(found["drive_torque"])
    assert len(set(loads)) == 4


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["press, bearings in all hinges", pytest.param("drag link", marks=pytest.mark.long), "Whitworth"]
)
def test_balls_roll_on_without_a_jump_over_several_turns(name: str) -> None:
    """Rods swing, couplers and levers turn: angles follow the integrated rate of pure rolling."""
    derived, machine = pair(name)
    times = np.linspace(0, 2.2 * 2 * math.pi / abs(machine.speed), 401)
    still = np.zeros(2 * len(derived.coordinates))
    found = np.array([derived.ball_angles(t, still) for t in times])
    rates = np.empty_like(found)
    for k, t in enumerate(times):
        _, v = machine.absolute(t, still)
        for j, one in enumerate(machine.bearings):
            bodies = (one.inner_body, machine.mechanism.joint(one.joint or "").other(one.inner_body))
            rates[k, j] = sum(w * (machine.row(b) @ v) for w, b in zip(machine.weights(one), bodies, strict=True))
    integrated = found[0] + cumulative_simpson(rates, x=times, axis=0, initial=0)
    assert np.max(np.abs(found - integrated)) < 1e-3


SMOOTH = ('law = "one-sided"', 'law = "tangent"'), ('ratio = "0.25e-5 s*mm^0.5"', 'ratio = "2.5e-5 s"')

#: Central differences of sixth order: neighbours and weights.
SIXTH_ORDER = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        ("punching_press_two_way", SMOOTH),
        pytest.param("punching_press_hinges", SMOOTH, marks=pytest.mark.long),
        pytest.param("punching_press_hinges", (*SMOOTH, *driven_by(MOTOR)), marks=pytest.mark.long),
    ],
)
def test_modes_are_those_of_absolute_coordinates_with_multipliers(
    scene: str, changes: tuple[tuple[str, str], ...], tmp_path: Path
) -> None:
    """Of the whole machine about its equilibrium, the accelerations of the second implementation differentiated."""
    derived = Derived(with_bearings(text(scene, *changes)))
    machine, size = Multibody(derived.scene, derived.points()), len(derived.coordinates)
    folder = generate(derived.scene, tmp_path / "model")
    found = Model(folder, read_manifest(folder), None).linearize()
    step = np.where([name == "driver.angle" for name in derived.coordinates], 1e-4, 2e-8)

    def accelerations(x: np.ndarray) -> np.ndarray:
        known = machine.evaluate(0.0, x).accelerations
        return np.array([known[name] for name in derived.coordinates])

    columns = [
        sum(w * (accelerations(found.x + k * h) - accelerations(found.x - k * h)) for k, w in SIXTH_ORDER) / np.sum(h)
        for h in np.diag(np.concatenate([step, np.full(size, 1e-2)]))
    ]
    values = np.linalg.eigvals(np.block([[np.zeros((size, size)), np.eye(size)], [np.array(columns).T]]))
    assert len(found.eigenvalues) == 2 * size
    for value in found.eigenvalues:
        assert np.min(np.abs(values - value)) < 1e-8 * abs(value)


FOUR_BAR_JOINTS = (("A", ""), ("B", "coupler"), ("C", "rocker"), ("D", ""))


def reactions(outputs: dict[str, float]) -> np.ndarray:
    return np.array([outputs[k] for k in sorted(outputs) if k.startswith("reaction") and not k.endswith("moment")])


def stiffer(machine: Multibody, decades: int) -> dict[str, float]:
    """Stiffness of all contacts up by decades, clearance down."""
    stiffness = {one.contact.stiffness.path: 8.6e9 * 10.0**decades for one in machine.bearings}
    return stiffness | {one.clearance.path: 1e-5 * 0.1**decades for one in machine.bearings}


@pytest.mark.parametrize(
    ("name", "joints", "time"),
    [
        ("punching_press", (("A", ""), ("B", "crank"), ("C", "slider")), 0.05),
        pytest.param("four_bar", FOUR_BAR_JOINTS, 0.033, marks=pytest.mark.long),
    ],
)
def test_carried_by_stiff_contacts_a_linkage_has_the_reactions_of_ideal_joints(
    name: str, joints: tuple[tuple[str, str], ...], time: float
) -> None:
    """Rings where they have no acceleration: the deflection, and with it the error, goes like stiffness^(-2/3)."""
    derived = Derived(with_bearings(text(name), *(bearing(*joint, count=2) for joint in joints)))
    machine = Multibody(derived.scene, derived.points())
    rigid = Multibody(replace(derived.scene, bearings=()), derived.points())
    gates = {gate: rigid.gate(gate, rigid.start + rigid.speed * time) for gate in derived.gates()}
    outputs = rigid.evaluate(time, np.zeros(0)).outputs
    ideal, size = reactions(outputs), len(derived.coordinates)
    errors = []
    for decades in range(5):
        changes = stiffer(machine, decades)
        derived.change(changes)
        guess = []
        for one in machine.bearings:
            joint = machine.mechanism.joint(one.joint or "")
            push = np.array([outputs[f"reaction.{joint.name}.{axis}"] for axis in "xy"])
            load = float(np.linalg.norm(push))
            deflection = (load / 2 / (2 * changes[one.contact.stiffness.path])) ** (2 / 3)
            shift = (deflection + changes[one.clearance.path] / 2) * push / load
            guess.append(-shift if one.inner_body == joint.bodies[0] else shift)

        def accelerations(microns: np.ndarray) -> np.ndarray:
            return derived.rhs(time, np.concatenate([microns * 1e-6, np.zeros(size)]), gates)[size:]

        found = root(accelerations, np.concatenate(guess) * 1e6, tol=1e-13)
        assert np.max(np.abs(found.fun)) < 1e-6
        state = np.concatenate([found.x * 1e-6, np.zeros(size)])
        errors.append(float(np.max(np.abs(reactions(derived.outputs(time, state, gates)) - ideal))))
    assert all(after < 0.3 * before for before, after in pairwise(errors))
    assert errors[0] < 1e-2 * np.max(np.abs(ideal))
    assert errors[-1] < 2e-6 * np.max(np.abs(ideal))


@pytest.mark.long
def test_runs_with_stiff_contacts_tend_to_the_reactions_of_ideal_joints(tmp_path: Path) -> None:
    window = 'window = { start = "70 deg", end = "190 deg" }\n'
    scene = with_bearings(text("four_bar", (window, "")), bearing("A"), bearing("C", "coupler"))
    model, derived = load(generate(scene, tmp_path / "model")), Derived(scene)
    machine, rigid = (Multibody(s, derived.points()) for s in (scene, replace(scene, bearings=())))
    times = np.linspace(0.05, 0.1, 101)
    names = [f"reaction.{joint}.{axis}" for joint in "ABCD" for axis in "xy"]
    ideal = np.array([[rigid.evaluate(t, np.zeros(0)).outputs[name] for name in names] for t in times])
    errors = []
    for decades in range(5):
        run = {"times": times, "transient": 0, "method": "stepper-rodas5p", "rtol": 1e-8, "outputs": names}
        # concentric: at rest under the load of t = 0 soft contacts start elsewhere than stiff ones
        start = np.zeros(len(model.states))
        solution = model.simulate(duration=0.1, parameters=stiffer(machine, decades), initial=start, **run)
        found = np.array([solution[name] for name in names]).T
        errors.append(float(np.max(np.abs(found - ideal)) / np.max(np.abs(ideal))))
    assert all(after < 0.4 * before for before, after in pairwise(errors))
    assert errors[-1] < 2e-6


@pytest.mark.long
@pytest.mark.parametrize("name", ["two-way press", "press, motor on the crank"])
def test_runs_are_those_of_absolute_coordinates(name: str, tmp_path: Path) -> None:
    """Constraints are met by their accelerations alone: over a short run they hold to rounding."""
    derived, machine = pair(name)
    model = load(generate(derived.scene, tmp_path / "model"))
    size, end = len(derived.coordinates), 2e-3
    x = derived.initial
    x[: size - (machine.motor is not None)] = 4e-6  # balls carry from the start
    q, v = machine.absolute(0.0, x)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[machine.size :], machine.move(*np.split(y, 2)).absolute])

    run = solve_ivp(rates, (0, end), np.concatenate([q, v]), method="DOP853", rtol=1e-11, atol=1e-16)
    found = model.simulate(duration=end, times=[end], initial=x, method="stepper-dop853", rtol=1e-10, outputs=[]).x[-1]
    reached = machine.state(*np.split(run.y[:, -1], 2))
    rings = size - (machine.motor is not None)
    for part in (slice(0, rings), slice(rings, size), slice(size, size + rings), slice(size + rings, 2 * size)):
        if found[part].size:
            assert np.max(np.abs(reached - found)[part]) < 1e-6 * np.max(np.abs(found[part]))
