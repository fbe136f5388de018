"""Invariants: what must hold whatever the numbers are."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hand_written_press import Machine
from replacements import (
    CLEARANCE,
    CRANK,
    FAST,
    OUTER,
    ROD,
    ROD_CENTER,
    ROTOR_LOAD,
    SPEED,
    START,
    TURN,
    TURNABLE,
    WINDOW,
)
from scipy.integrate import quad
from test_numbers import difference

from ballpass.runtime import Model

pytestmark = pytest.mark.extreme

Holds = Callable[..., None]
Press = Callable[..., Model]

#: Angles that turn with the scene.
ANGLES = (
    START, f"{WINDOW}.start", f"{WINDOW}.end", "bearing.ball_angle", "mechanism.gravity.direction",
    "mechanism.joints.D.direction", "mechanism.forces.punch.force.direction",
)  # fmt: skip


@pytest.mark.parametrize(
    ("oscillations", "clearance", "method", "rtol", "bound"),
    [
        (1000, -120e-6, "stepper-dop853", 1e-12, 1e-9),
        (1000, -10e-6, "stepper-dp54", 1e-9, 1e-3),
        pytest.param(100_000, -120e-6, "stepper-dop853", 1e-11, 1e-5),
        pytest.param(100_000, -10e-6, "stepper-dop853", 1e-10, 1e-2, marks=pytest.mark.long),
        pytest.param(100_000, -10e-6, "stepper-dp54", 1e-10, 1e-2, marks=pytest.mark.long),
    ],
)
def test_energy_of_an_undamped_ring(
    rotor: Press, holds: Holds, oscillations: int, clearance: float, method: str, rtol: float, bound: float
) -> None:
    """Energy of an undamped ring over contact oscillations; at -120 um all balls touch, at -10 um they come and go."""
    model = rotor((ROTOR_LOAD, 'type = "constant"\nforce = ["0 N", "0 N"]'))
    stiffness, mass, amplitude = 13.34e9, 0.5, 20e-6
    numbers = {
        "shaft.speed": 0.0, "bearing.inner_ring.damping": 0.0, "bearing.inner_ring.mass": mass, CLEARANCE: clearance,
    }  # fmt: skip
    start = np.array([amplitude, 0.3 * amplitude, 0.0, 0.0])
    angles = TURN * np.arange(8) / 8

    def total(x: np.ndarray) -> float:
        pressed = np.maximum(x[0] * np.cos(angles) + x[1] * np.sin(angles) - 0.5 * clearance, 0.0)
        return float(0.4 * stiffness * np.sum(pressed**2.5) + 0.5 * mass * (x[2] ** 2 + x[3] ** 2))

    def run(duration: float, samples: int) -> object:
        return model.simulate(
            duration=duration, parameters=numbers, initial=start, rtol=rtol, method=method,
            samples_per_cycle=samples, transient=0,
        )  # fmt: skip

    # the period is counted, not estimated: passages of x through zero upwards
    short = run(0.02, 20_000)["inner.x"]
    period = 0.02 / np.count_nonzero((short[:-1] < 0.0) & (short[1:] >= 0.0))
    solution = run(oscillations * period, 64)
    drift = max(abs(total(x) / total(start) - 1.0) for x in solution.x)
    holds(drift, bound, f"{solution.statistics.steps} steps")


@pytest.mark.parametrize(
    "numbers",
    [{}, FAST, {CRANK: 5.0, ROD: 83.0, ROD_CENTER: 41.0}, {CRANK: 0.09}],
    ids=["shipped press", "15 000 rpm", "crank of 5 m", "crank over rod 0.9"],
)
def test_work_of_the_drive(press: Press, holds: Holds, numbers: dict[str, float]) -> None:
    """Work of the drive over a turn equals that of the punch, over the work without signs."""
    model = press()
    solution = model.simulate(cycles=1, parameters=numbers, samples_per_cycle=7200, transient=0)
    linkage = Machine.of(model, numbers).linkage
    assert linkage is not None
    along = (linkage.punch * linkage.direction.conjugate()).real
    taken = -sum(along * (linkage.travel(last) - linkage.travel(first)) for first, last in linkage.windows)
    # Simpson's rule between the window's edges, which are samples: 20 of them to a degree
    torque, work = solution["drive_torque"], 0.0
    edges = np.unique(np.round(np.array([0.0, *np.degrees(linkage.windows).ravel(), 360.0]) * 20).astype(int))
    for a, b in pairwise(edges):
        # the sample at an edge shows what follows; what came before is the matrix of the hand-written press
        part = torque[a : b + 1].copy()
        punching = linkage.punching(linkage.start + TURN * (a + b) / 14400)
        part[-1] = linkage.solve(linkage.start + TURN * b / 7200, punching)[1]
        weights = np.ones(len(part))
        weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
        work += float(weights @ part) * TURN / 7200 / 3.0
    size = float(np.sum(np.abs(torque))) * TURN / 7200
    holds(abs(work - taken) / size, 1e-8, f"{taken:.5g} J a turn")


def _turn(model: Model, numbers: dict[str, float] | None = None) -> np.ndarray:
    return model.simulate(cycles=1, parameters=numbers or {}, rtol=1e-9, samples_per_cycle=500, transient=0).x


@pytest.mark.parametrize("degrees", [137.0, -200.0])
def test_turned_scene(press: Press, holds: Holds, degrees: float) -> None:
    """The whole scene turned: the motion turns with it."""
    model, angle = press("one-sided", *TURNABLE), math.radians(degrees)
    turned = _turn(model, {name: model.parameters[name] + angle for name in ANGLES})
    pairs = (turned[:, 0::2] + 1j * turned[:, 1::2]) * np.exp(-1j * angle)
    back = np.stack([pairs.real, pairs.imag], axis=2).reshape(turned.shape)
    holds(difference(back, _turn(model)), 1e-6)


def test_mirrored_scene(press: Press, holds: Holds) -> None:
    """The scene in a mirror that swaps left and right: clockwise rotation, x to -x."""
    model = press("one-sided", *TURNABLE)
    p = model.parameters
    numbers = {name: math.pi - p[name] for name in ANGLES}
    numbers[f"{WINDOW}.start"], numbers[f"{WINDOW}.end"] = numbers[f"{WINDOW}.end"], numbers[f"{WINDOW}.start"]
    numbers |= {SPEED: -p[SPEED], "mechanism.bodies.rod.center_of_mass.y": -p["mechanism.bodies.rod.center_of_mass.y"]}
    holds(difference(_turn(model, numbers) * np.array([-1.0, 1.0] * 4), _turn(model)), 1e-6)


#: Powers of length, mass and time of each unit.
POWERS: dict[str, tuple[float, float, float]] = {
    "m": (1, 0, 0), "kg": (0, 1, 0), "kg*m^2": (2, 1, 0), "N": (1, 1, -2), "Pa": (-1, 1, -2), "N/m": (0, 1, -2),
    "N*s/m": (0, 1, -1), "N*s/m^1.5": (-0.5, 1, -1), "s*m^0.5": (0.5, 0, 1), "m/s": (1, 0, -1), "m/s^2": (1, 0, -2),
    "rad/s": (0, 0, -1), "rad": (0, 0, 0), "1": (0, 0, 0),
}  # fmt: skip


@pytest.mark.parametrize(("length", "mass", "time"), [(4.0, 8.0, 2.0), (1000.0, 1e-3, 60.0)])
def test_other_units(press: Press, holds: Holds, length: float, mass: float, time: float) -> None:
    """Other units of length, mass and time: the same motion in them."""
    model = press("one-sided", *TURNABLE)
    numbers = {}
    for name in model.parameters:
        a, b, c = POWERS[model.parameters.info(name).unit]
        numbers[name] = model.parameters[name] * length**a * mass**b * time**c
    units = np.array([length] * 4 + [length / time] * 4)
    holds(difference(_turn(model, numbers) / units, _turn(model)), 1e-6)


@pytest.mark.parametrize(
    "numbers", [{}, {f"{OUTER}.mass": 1e4, CLEARANCE: 1e-3}], ids=["shipped press", "outer ring 10 t, clearance 1 mm"]
)
def test_momentum_over_a_turn(press: Press, holds: Holds, numbers: dict[str, float]) -> None:
    """Change of the rings' momentum over a turn equals the impulse of load, housing spring and damper."""
    model = press()
    begin = model.reduce(cycles=2, transient=0, parameters=numbers, rtol=1e-9)
    # the start of the third turn is the end of the second
    start = np.array(list(begin.end.values()))
    p, c = {**model.parameters, **numbers}, model.constants(numbers)
    ball = p["bearing.ball_angle"] + 2.0 * model.period(numbers) * c["bearing.cage_speed"]
    shifted = {**numbers, "bearing.ball_angle": ball % TURN}
    turn = model.reduce(cycles=1, transient=0, parameters=shifted, initial=start, rtol=1e-9)
    machine = Machine.of(model, numbers)
    linkage = machine.linkage
    assert linkage is not None
    impulse, size = np.zeros(2), np.zeros(2)
    for a, b in pairwise(machine.edges(0.0, model.period(numbers))):
        on = linkage.punching(linkage.start + linkage.speed * 0.5 * (a + b))
        for k, part in enumerate((np.real, np.imag)):
            value, _ = quad(
                lambda t, on=on, part=part: part(machine.force(t, on)), a, b, epsabs=0.0, epsrel=1e-11, limit=200
            )
            impulse[k] += value
            size[k] += abs(value)
    worst = 0.0
    for k, axis in enumerate("xy"):
        moved = turn.end[f"outer.{axis}"] - begin.end[f"outer.{axis}"]
        mean = turn[f"outer.{axis}"].mean * turn.duration
        taken = p[f"{OUTER}.stiffness"] * mean + p[f"{OUTER}.damping"] * moved
        gained = c["bearing.m_ei"] * (turn.end[f"inner.v{axis}"] - begin.end[f"inner.v{axis}"])
        gained += p[f"{OUTER}.mass"] * (turn.end[f"outer.v{axis}"] - begin.end[f"outer.v{axis}"])
        worst = max(worst, abs(impulse[k] - taken - gained) / size[k])
    holds(worst, 1e-6)


def test_pressed_ring_settles_in_equilibrium(rotor: Press, holds: Holds) -> None:
    """A ring pressed by a constant force comes to rest where SciPy's root balances the balls."""
    model = rotor()
    numbers = {
        "shaft.speed": 0.0, "bearing.inner_ring.damping": 2e4, "load.force.x": 700.0, "load.force.y": -300.0,
        CLEARANCE: 12e-6,
    }  # fmt: skip
    solution = model.simulate(duration=0.5, parameters=numbers, rtol=1e-10, samples_per_cycle=10, transient=0)
    end = Machine.of(model, numbers).equilibrium(0.0, False, solution.x[-1, :2])
    holds(float(np.max(np.abs(solution.x[-1, :2] - end)) / np.max(np.abs(end))), 1e-9)


@pytest.mark.parametrize(
    "method",
    ["stepper", "stepper-rodas4", "stepper-rodas5p", "stepper-dp54"],
)
def test_states_between_steps(press: Press, holds: Holds, method: str) -> None:
    """Differences of 200 000 samples a turn equal the rate of the hand-written press there, over its largest value."""
    model, count = press(), 200_000
    machine = Machine.of(model)
    linkage = machine.linkage
    assert linkage is not None
    solution = model.simulate(cycles=1, method=method, rtol=1e-9, samples_per_cycle=count, transient=0)
    x, h = solution.x, solution.t[1]
    on = [linkage.punching(linkage.speed * t) for t in solution.t]
    k = np.array([k for k in range(4000, count - 4000, 997) if on[k - 2] == on[k + 2]])
    rates = np.array([machine.rate(solution.t[j], x[j], on[j]) for j in k])
    slopes = (8.0 * (x[k + 1] - x[k - 1]) - (x[k + 2] - x[k - 2])) / (12.0 * h)
    holds(float(np.max(np.abs(slopes - rates) / np.max(np.abs(rates), axis=0))), 1e-3)
