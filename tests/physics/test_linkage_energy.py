"""Energy and virtual work: the drive torque by routes that know nothing of joint reactions."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from linkages import (
    DEGREE,
    Machine,
    crank_slider,
    evaluate,
    four_bar,
)
from scipy.optimize import brentq
from sympy.physics.mechanics import LagrangesMethod, Point, ReferenceFrame, RigidBody, dynamicsymbols

from ballpass.derive.mechanism.evaluator import Evaluator
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.reactions import Reactions

PUNCH = 8964.8
WINDOW = (237.0, 267.0)


@cache
def press() -> tuple[Machine, Linkage, Reactions, Evaluator]:
    machine = crank_slider().with_windows("punch")
    linkage = machine.linkage()
    reactions = machine.reactions(linkage)
    height = linkage.motion("slider", "C").position[1]
    run = Evaluator(linkage.definitions + reactions.definitions, [reactions.drive_torque, height])
    return machine, linkage, reactions, run


def torque_and_height(degrees: np.ndarray, gate: float) -> tuple[np.ndarray, np.ndarray]:
    machine, _, _, run = press()
    torque, height = run(machine.numbers(degrees * DEGREE, **{"gate.punch": gate}))
    return torque, height


def drive_work(gates: tuple[float, float, float]) -> float:
    """Integral of the drive torque over a turn [J]: Gauss–Legendre between the edges of the window."""
    edges = (0.0, *WINDOW, 360.0)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    work = 0.0
    for (start, end), gate in zip(pairwise(edges), gates, strict=True):
        half = 0.5 * (end - start)
        torque, _ = torque_and_height(start + half * (1 + nodes), gate)
        work += float(weights @ torque) * half * DEGREE
    return work


def test_drive_work_equals_punch_work():
    """Over a turn inertia and weight do no work: what the drive gives, the punch takes."""
    _, height = torque_and_height(np.array(WINDOW), 0.0)
    taken = PUNCH * (height[0] - height[1])
    assert taken == pytest.approx(9.0784, abs=5e-5)
    assert height[0] - height[1] == pytest.approx(1.0127e-3, abs=5e-8)
    assert drive_work((0.0, 1.0, 0.0)) == pytest.approx(taken, rel=1e-9)


def test_drive_work_is_zero_without_punch():
    torque, _ = torque_and_height(np.arange(360.0), 0.0)
    amplitude = np.max(np.abs(torque)) * 2 * np.pi
    assert abs(drive_work((0.0, 0.0, 0.0))) < 1e-9 * amplitude


# --- Lagrange's equations -----------------------------------------------------------------------------------------


def lagrange_torque(machine: Machine, angles: np.ndarray, chain: dict, constraints, solve_angles) -> np.ndarray:
    """Drive torque by Lagrange's equations with multipliers from sympy.physics.mechanics.

    The bodies' angles q are the coordinates, their loop closure the holonomic constraints.  The torque is the
    generalized force on q1, solved for together with the multipliers; q comes from `solve_angles`, its derivatives
    from the constraints.
    """
    time = dynamicsymbols._t
    q = dynamicsymbols(f"q1:{len(chain['bodies']) + 1}")
    frame, origin = ReferenceFrame("N"), Point("O")
    origin.set_vel(frame, 0)
    values = machine.values
    bodies, loads, potential = [], [], sp.S.Zero
    for k, name in enumerate(chain["bodies"]):
        body = machine.mechanism.body(name)
        axes = frame.orientnew(f"B{k}", "Axis", [chain["angle"](q, k), frame.z])
        x, y = chain["center"](q, k)
        center = origin.locatenew(f"C{k}", x * frame.x + y * frame.y)
        center.set_vel(frame, sp.diff(x, time) * frame.x + sp.diff(y, time) * frame.y)
        inertia = 0 if body.inertia is None else values[body.inertia.path]
        mass = values[body.mass.path]
        rigid = RigidBody(name, center, axes, mass, (inertia * (axes.z | axes.z), center))
        potential += mass * 9.81 * y
        bodies.append(rigid)
    for (x, y), (fx, fy) in chain["forces"](q):
        point = origin.locatenew(f"P{len(loads)}", x * frame.x + y * frame.y)
        point.set_vel(frame, sp.diff(x, time) * frame.x + sp.diff(y, time) * frame.y)
        loads.append((point, fx * frame.x + fy * frame.y))
    for k, torque in chain["torques"]:
        loads.append((bodies[k].frame, torque * frame.z))
    for k, rigid in enumerate(bodies):
        rigid.frame.set_ang_vel(frame, sp.diff(chain["angle"](q, k), time) * frame.z)
    kinetic = sum((b.kinetic_energy(frame) for b in bodies), sp.S.Zero)
    closure = constraints(q)
    method = LagrangesMethod(kinetic - potential, q, hol_coneqs=closure, forcelist=loads, frame=frame)
    method.form_lagranges_equations()

    u = [sp.diff(c, time) for c in q]
    plain = sp.symbols(f"p1:{len(q) + 1}"), sp.symbols(f"u1:{len(q) + 1}")
    names = dict(zip(u, plain[1], strict=True)) | dict(zip(q, plain[0], strict=True))
    n, m = len(q), len(closure)
    # The further columns of this mass matrix belong to the multipliers.
    mass = method.mass_matrix[:, :n].subs(names)
    forcing = method.forcing.subs(names)
    jacobian = sp.Matrix(closure).jacobian(q).subs(names)
    bias = sp.diff(sp.diff(sp.Matrix(closure), time), time).subs({sp.diff(c, time, 2): 0 for c in q}).subs(names)
    run = sp.lambdify([*plain[0], *plain[1]], [mass, forcing, jacobian, bias], modules="numpy", cse=True)

    torques = []
    speed = machine.speed()
    for angle in angles:
        where = solve_angles(angle)
        jac = np.array(run(*where, *([0.0] * n))[2], dtype=float)
        rates = np.concatenate([[speed], np.linalg.solve(jac[:, 1:], -jac[:, 0] * speed)])
        mass_n, forcing_n, jac, bias_n = (np.array(a, dtype=float) for a in run(*where, *rates))
        accelerations = np.concatenate([[0.0], np.linalg.solve(jac[:, 1:], -bias_n.ravel())])
        # mass q'' = forcing + J' lambda + (torque, 0, ...)
        unit = np.zeros((n, 1))
        unit[0] = 1.0
        system = np.hstack([unit, jac.T])
        assert system.shape == (n, m + 1)
        torques.append(np.linalg.solve(system, mass_n @ accelerations - forcing_n.ravel())[0])
    return np.array(torques)


def derived_torque(machine: Machine, angles: np.ndarray) -> np.ndarray:
    linkage = machine.linkage()
    reactions = machine.reactions(linkage)
    return evaluate(machine, [reactions.drive_torque], angles, linkage, reactions)[0]


def test_drive_torque_of_the_four_bar_equals_lagrange():
    machine = four_bar()
    angles = np.linspace(0.2, 6.2, 9)
    far = (0.2, 0.03)

    def center(q, k):
        c, s = sp.cos(q[k]), sp.sin(q[k])
        if k == 0:
            return 0.02 * c - 0.006 * s, 0.02 * s + 0.006 * c
        if k == 1:
            return 0.05 * sp.cos(q[0]) + 0.11 * sp.cos(q[1] + 0.3), 0.05 * sp.sin(q[0]) + 0.11 * sp.sin(q[1] + 0.3)
        return far[0] + 0.06 * c + 0.02 * s, far[1] + 0.06 * s - 0.02 * c

    def tool(q):
        c, s = sp.cos(q[1]), sp.sin(q[1])
        return 0.05 * sp.cos(q[0]) + 0.1 * c - 0.07 * s, 0.05 * sp.sin(q[0]) + 0.1 * s + 0.07 * c

    chain = {
        "bodies": ["crank", "coupler", "rocker"],
        "angle": lambda q, k: q[k],
        "center": center,
        "forces": lambda q: [(tool(q), (40.0, -65.0))],
        "torques": [(2, 1.3)],
    }

    def constraints(q):
        return [0.05 * f(q[0]) + 0.19 * f(q[1]) - far[i] - 0.13 * f(q[2]) for i, f in enumerate((sp.cos, sp.sin))]

    def solve_angles(angle):
        """Coupler angle by bisection: the rocker's length is 0.13 m; the joint lies left of the line from B to D."""
        pin = 0.05 * complex(math.cos(angle), math.sin(angle))
        line = complex(*far) - pin
        heading = math.atan2(line.imag, line.real)

        def excess(coupler):
            return abs(pin + 0.19 * complex(math.cos(coupler), math.sin(coupler)) - complex(*far)) - 0.13

        coupler = brentq(excess, heading, heading + math.pi, xtol=1e-15, rtol=1e-15)
        rocker = pin + 0.19 * complex(math.cos(coupler), math.sin(coupler)) - complex(*far)
        return angle, coupler, math.atan2(rocker.imag, rocker.real)

    expected = lagrange_torque(machine, angles, chain, constraints, solve_angles)
    assert derived_torque(machine, angles) == pytest.approx(expected, rel=1e-10)
