"""Cases of invariants: what must hold whatever the numbers are."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import quad

from extremes.case import Case, Finding
from extremes.models import ROTOR_LOAD, Change, press, rotor
from extremes.physics import GIVEN_MASS, OUTER, SPEED, START, WINDOW, difference
from extremes.reference import TURN, Machine

GROUP = "Invariants"

#: The shipped press with everything that has a direction given by an angle.
TURNABLE: tuple[Change, ...] = (
    *GIVEN_MASS,
    ('gravity = "9.81 m/s^2" ', 'gravity = { magnitude = "9.81 m/s^2", direction = "270 deg" } #'),
    ('force = ["0 N", "8964.8 N"]', 'force = { magnitude = "8964.8 N", direction = "90 deg" }'),
    ('center_of_mass = "50 mm"  ', 'center_of_mass = ["38 mm", "7 mm"]  #'),
)
#: Angles that turn with the scene.
ANGLES = (
    START, f"{WINDOW}.start", f"{WINDOW}.end", "bearing.ball_angle", "mechanism.gravity.direction",
    "mechanism.joints.D.direction", "mechanism.forces.punch.force.direction",
)  # fmt: skip
NO_LOAD: Change = (ROTOR_LOAD, 'type = "constant"\nforce = ["0 N", "0 N"]')


#: Oscillations, words, clearance [m], method, tolerance and the drift that is allowed.  A step may err by rtol, and
#: where balls lose and find contact all steps err alike: the drift grows like rtol times steps.
ENERGY = (
    (1000, "all balls in contact", -120e-6, "stepper-dop853", 1e-12, 1e-9, True),
    (1000, "balls losing contact", -10e-6, "stepper-dp54", 1e-9, 1e-3, True),
    (100_000, "all balls in contact", -120e-6, "stepper-dop853", 1e-11, 1e-5, False),
    (100_000, "balls losing contact", -10e-6, "stepper-dop853", 1e-10, 1e-2, False),
    (100_000, "balls losing contact", -10e-6, "stepper-dp54", 1e-10, 1e-2, False),
)


def energy(oscillations: int, method: str, rtol: float, bound: float, clearance: float = -10e-6) -> Finding:
    """Drift of the energy of an undamped ring between its balls, over so many contact oscillations."""
    model = rotor(NO_LOAD)
    stiffness, mass, amplitude = 13.34e9, 0.5, 20e-6
    numbers = {
        "shaft.speed": 0.0, "bearing.inner_ring.damping": 0.0, "bearing.inner_ring.mass": mass,
        "bearing.clearance": clearance,
    }  # fmt: skip
    start = np.array([amplitude, 0.3 * amplitude, 0.0, 0.0])
    angles = TURN * np.arange(8) / 8

    def total(x: np.ndarray) -> float:
        pressed = np.maximum(x[0] * np.cos(angles) + x[1] * np.sin(angles) - 0.5 * clearance, 0.0)
        return float(0.4 * stiffness * np.sum(pressed**2.5) + 0.5 * mass * (x[2] ** 2 + x[3] ** 2))

    # counted, not estimated: passages of x through zero upwards
    short = model.simulate(
        duration=0.02,
        parameters=numbers,
        initial=start,
        rtol=rtol,
        method=method,
        samples_per_cycle=20_000,
        transient=0,
    )["inner.x"]
    period = 0.02 / np.count_nonzero((short[:-1] < 0.0) & (short[1:] >= 0.0))
    solution = model.simulate(
        duration=oscillations * period,
        parameters=numbers,
        initial=start,
        rtol=rtol,
        method=method,
        samples_per_cycle=64,
        transient=0,
    )
    drift = max(abs(total(x) / total(start) - 1.0) for x in solution.x)
    return Finding(status="done", error=drift, bound=bound, note=f"{solution.statistics.steps} steps")


def works(numbers: dict[str, float]) -> Finding:
    """Work of the drive over a turn and that of the punch, by quadrature of the outputs."""
    model = press()
    solution = model.simulate(cycles=1, parameters=numbers, samples_per_cycle=7200, transient=0)
    machine = Machine.of(model, numbers)
    linkage = machine.linkage
    assert linkage is not None
    taken = 0.0
    for first, last in linkage.windows:
        along = (linkage.punch * linkage.direction.conjugate()).real
        taken -= along * (linkage.travel(last) - linkage.travel(first))
    # Simpson's rule between the window's edges, which are samples: 20 of them to a degree
    torque, work = solution["drive_torque"], 0.0
    edges = np.unique(np.round(np.array([0.0, *np.degrees(linkage.windows).ravel(), 360.0]) * 20).astype(int))
    size = float(np.sum(np.abs(torque))) * TURN / 7200
    for a, b in pairwise(edges):
        # the sample at an edge shows what follows; what came before is the matrix of the hand-written press
        part = torque[a : b + 1].copy()
        part[-1] = linkage.solve(
            linkage.start + TURN * b / 7200, linkage.punching(linkage.start + TURN * (a + b) / 14400)
        )[1]
        weights = np.ones(len(part))
        weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
        work += float(weights @ part) * TURN / 7200 / 3.0
    return Finding(status="done", error=abs(work - taken) / size, bound=1e-8, note=f"{taken:.5g} J a turn")


def rotation(angle: float) -> Finding:
    """The whole scene turned: the motion turns with it."""
    model = press("one-sided", *TURNABLE)
    plain = model.simulate(cycles=1, rtol=1e-9, samples_per_cycle=500, transient=0)
    turned_numbers = {name: model.parameters[name] + angle for name in ANGLES}
    turned = model.simulate(cycles=1, parameters=turned_numbers, rtol=1e-9, samples_per_cycle=500, transient=0)
    back = turned.x.copy()
    for k in range(0, 8, 2):
        pair = (turned.x[:, k] + 1j * turned.x[:, k + 1]) * np.exp(-1j * angle)
        back[:, k], back[:, k + 1] = pair.real, pair.imag
    return Finding(status="done", error=difference(back, plain.x), bound=1e-6)


def mirror() -> Finding:
    """The scene in a mirror that swaps left and right: clockwise rotation, x to -x."""
    model = press("one-sided", *TURNABLE)
    p = model.parameters
    plain = model.simulate(cycles=1, rtol=1e-9, samples_per_cycle=500, transient=0)
    numbers = {name: math.pi - p[name] for name in ANGLES}
    numbers[f"{WINDOW}.start"], numbers[f"{WINDOW}.end"] = numbers[f"{WINDOW}.end"], numbers[f"{WINDOW}.start"]
    numbers |= {SPEED: -p[SPEED], "mechanism.bodies.rod.center_of_mass.y": -p["mechanism.bodies.rod.center_of_mass.y"]}
    seen = model.simulate(cycles=1, parameters=numbers, rtol=1e-9, samples_per_cycle=500, transient=0)
    signs = np.array([-1.0, 1.0] * 4)
    return Finding(status="done", error=difference(seen.x * signs, plain.x), bound=1e-6)


def scaling(length: float, mass: float, time: float) -> Finding:
    """Other units of length, mass and time: the same motion in them."""
    model = press("one-sided", *TURNABLE)
    powers: dict[str, tuple[float, float, float]] = {
        "m": (1, 0, 0),
        "kg": (0, 1, 0),
        "kg*m^2": (2, 1, 0),
        "N": (1, 1, -2),
        "Pa": (-1, 1, -2),
    }
    powers |= {"N/m": (0, 1, -2), "N*s/m": (0, 1, -1), "N*s/m^1.5": (-0.5, 1, -1), "s*m^0.5": (0.5, 0, 1)}
    powers |= {"m/s": (1, 0, -1), "m/s^2": (1, 0, -2), "rad/s": (0, 0, -1), "rad": (0, 0, 0), "1": (0, 0, 0)}
    numbers = {}
    for name in model.parameters:
        a, b, c = powers[model.parameters.info(name).unit]
        numbers[name] = model.parameters[name] * length**a * mass**b * time**c
    plain = model.simulate(cycles=1, rtol=1e-9, samples_per_cycle=500, transient=0)
    other = model.simulate(cycles=1, parameters=numbers, rtol=1e-9, samples_per_cycle=500, transient=0)
    units = np.array([length] * 4 + [length / time] * 4)
    return Finding(status="done", error=difference(other.x / units, plain.x), bound=1e-6)


def momentum(numbers: dict[str, float]) -> Finding:
    """Change of the rings' momentum over a turn: impulse of load, housing spring and damper."""
    model = press()
    begin = model.reduce(cycles=2, transient=0, parameters=numbers, rtol=1e-9)
    # the start of the third turn is the end of the second
    names = list(begin.end)
    start = np.array([begin.end[name] for name in names])
    p, c = {**model.parameters, **numbers}, model.constants(numbers)
    ball = p["bearing.ball_angle"] + 2.0 * model.period(numbers) * c["bearing.cage_speed"]
    shifted = {**numbers, "bearing.ball_angle": ball % TURN}
    turn = model.reduce(cycles=1, transient=0, parameters=shifted, initial=start, rtol=1e-9)
    machine = Machine.of(model, numbers)
    linkage = machine.linkage
    assert linkage is not None
    edges = machine.edges(0.0, model.period(numbers))
    worst = 0.0
    for k, axis in enumerate("xy"):
        impulse = size = 0.0
        for a, b in pairwise(edges):
            on = linkage.punching(linkage.start + linkage.speed * 0.5 * (a + b))
            value, _ = quad(
                lambda t, on=on, k=k: (lambda f: (f.real, f.imag)[k])(machine.force(t, on)),
                a,
                b,
                epsabs=0.0,
                epsrel=1e-11,
                limit=200,
            )
            impulse, size = impulse + value, size + abs(value)
        moved = turn.end[f"outer.{axis}"] - begin.end[f"outer.{axis}"]
        mean = turn[f"outer.{axis}"].mean * turn.duration
        taken = p[f"{OUTER}.stiffness"] * mean + p[f"{OUTER}.damping"] * moved
        gained = c["bearing.m_ei"] * (turn.end[f"inner.v{axis}"] - begin.end[f"inner.v{axis}"])
        gained += p[f"{OUTER}.mass"] * (turn.end[f"outer.v{axis}"] - begin.end[f"outer.v{axis}"])
        worst = max(worst, abs(impulse - taken - gained) / size)
    return Finding(status="done", error=worst, bound=1e-6)


def settles() -> Finding:
    """A ring pressed by a constant force comes to rest where the balls balance it."""
    model = rotor()
    numbers = {
        "shaft.speed": 0.0, "bearing.inner_ring.damping": 2e4, "load.force.x": 700.0, "load.force.y": -300.0,
        "bearing.clearance": 12e-6,
    }  # fmt: skip
    solution = model.simulate(duration=0.5, parameters=numbers, rtol=1e-10, samples_per_cycle=10, transient=0)
    machine = Machine.of(model, numbers)
    end = machine.equilibrium(0.0, False, solution.x[-1, :2])
    return Finding(
        status="done", error=float(np.max(np.abs(solution.x[-1, :2] - end)) / np.max(np.abs(end))), bound=1e-9
    )


def sampling(method: str, bound: float) -> Finding:
    """The same instants from a coarse and a fine grid of samples."""
    model = press()
    coarse, fine = (
        model.simulate(cycles=1, method=method, rtol=1e-8, samples_per_cycle=count, transient=0) for count in (16, 5600)
    )
    return Finding(status="done", error=difference(fine.x[:: 5600 // 16], coarse.x), bound=bound)


def dense(method: str) -> Finding:
    """States between steps satisfy the equations of motion: differences of samples against the rate there."""
    model = press()
    machine = Machine.of(model)
    linkage = machine.linkage
    assert linkage is not None
    count = 200_000
    solution = model.simulate(cycles=1, method=method, rtol=1e-9, samples_per_cycle=count, transient=0)
    h = solution.t[1]
    worst, size = 0.0, np.zeros(8)
    middles = np.arange(4000, count - 4000, 997)
    rates = []
    for k in middles:
        angle = linkage.speed * solution.t[k]
        rates.append(machine.rate(solution.t[k], solution.x[k], linkage.punching(angle)))
    size = np.max(np.abs(rates), axis=0)
    for k, rate in zip(middles, rates, strict=True):
        x = solution.x
        slope = (8.0 * (x[k + 1] - x[k - 1]) - (x[k + 2] - x[k - 2])) / (12.0 * h)
        near = [linkage.punching(linkage.speed * solution.t[k + i]) for i in (-2, 2)]
        if near[0] == near[1]:
            worst = max(worst, float(np.max(np.abs(slope - rate) / size)))
    return Finding(status="done", error=worst, bound=1e-3)


def cases() -> list[Case]:
    """All of this section."""
    big = {"mechanism.bodies.crank.points.B": 5.0, "mechanism.bodies.rod.points.C": 83.0,
           "mechanism.bodies.rod.center_of_mass": 41.0}  # fmt: skip
    table: list[tuple[str, str, str, Any, bool]] = [
        *(
            (
                f"energy over {count} oscillations, {words}",
                method,
                "energy, largest relative drift",
                partial(energy, count, method, rtol, bound, clearance),
                quick,
            )
            for count, words, clearance, method, rtol, bound, quick in ENERGY
        ),
        (
            "drive work, shipped press",
            "outputs",
            "work of the punch, over the work without signs",
            partial(works, {}),
            True,
        ),
        (
            "drive work at 60 000 rpm",
            "outputs",
            "work of the punch, over the work without signs",
            partial(works, {SPEED: 60_000 * TURN / 60.0}),
            True,
        ),
        (
            "drive work with a crank of 5 m",
            "outputs",
            "work of the punch, over the work without signs",
            partial(works, big),
            True,
        ),
        (
            "drive work with crank over rod 0.9",
            "outputs",
            "work of the punch, over the work without signs",
            partial(works, {"mechanism.bodies.crank.points.B": 0.09}),
            False,
        ),
        *(
            (
                f"scene turned by {degrees:g} deg",
                "stepper",
                "the motion turned",
                partial(rotation, math.radians(degrees)),
                degrees == 137.0,
            )
            for degrees in (90.0, 137.0, -200.0)
        ),
        ("scene in a mirror", "stepper", "the motion mirrored", mirror, True),
        (
            "length x 4, mass x 8, time x 2",
            "stepper",
            "the motion in the other units",
            partial(scaling, 4.0, 8.0, 2.0),
            True,
        ),
        (
            "length x 1000, mass x 1e-3, time x 60",
            "stepper",
            "the motion in the other units",
            partial(scaling, 1000.0, 1e-3, 60.0),
            False,
        ),
        (
            "momentum over a turn, shipped press",
            "reduce",
            "impulse of load and housing, relative",
            partial(momentum, {}),
            True,
        ),
        (
            "momentum over a turn, outer ring 10 t, clearance 1 mm",
            "reduce",
            "impulse of load and housing, relative",
            partial(momentum, {f"{OUTER}.mass": 1e4, "bearing.clearance": 1e-3}),
            False,
        ),
        ("ring pressed by a constant force", "stepper", "SciPy's root of the balance of forces", settles, True),
        ("16 and 5600 samples a turn", "stepper", "each other", partial(sampling, "stepper", 0.0), True),
        ("16 and 5600 samples a turn", "erk", "each other", partial(sampling, "erk", 1e-5), False),
        ("16 and 5600 samples a turn", "rosenbrock", "each other", partial(sampling, "rosenbrock", 1e-4), False),
        *(
            (
                (
                    "samples between steps",
                    method,
                    "rate of the hand-written press",
                    partial(dense, method),
                    method == "stepper",
                )
            )
            for method in ("stepper", "stepper-rodas4", "stepper-rodas5p", "stepper-dp54", "stepper-dop853")
        ),
    ]
    return [
        Case(
            group=GROUP,
            name=name,
            method=method,
            against=against,
            run=run,
            quick=quick,
            long=name.startswith("energy over 100000"),
        )
        for name, method, against, run, quick in table
    ]
