"""Newton–Euler of linkages: the derived equations are the printed Eq. (1); their closed form agrees with LAPACK."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
import sympy as sp
from linkages import (
    DEGREE,
    GEARED,
    MACHINES,
    Machine,
    crank_slider,
    evaluate,
    four_bar,
    moving_guide,
    offset_slider,
    rapson_slide,
    scotch_yoke,
    shaper_with_ram,
    slotted_lever,
    yoke_on_rocker,
)

from ballpass.derive.mechanism.evaluator import Evaluator
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.reactions import Reactions
from ballpass.derive.scene.errors import LinkageError

STATES = 200


@cache
def derived(name: str, moments: tuple[str, ...] = ()) -> tuple[Machine, Linkage, Reactions]:
    machine = MACHINES[name]()
    linkage = machine.linkage()
    return machine, linkage, machine.reactions(linkage, moments=moments)


# --- Eq. (1) ------------------------------------------------------------------------------------------------------

# The printed frame: x right, y down, angles from +x towards +y.  Symbols as printed.
L1, L2, LO1, LO2, T1, T1P, T2 = sp.symbols("l1 l2 lo1 lo2 theta1 theta1p theta2", real=True)
M1, M2, M3, J1, J2, G, F = sp.symbols("m1 m2 m3 J1 J2 g F", real=True)
AX1, AY1, AX2, AY2, A, E1, E2 = sp.symbols("ax1 ay1 ax2 ay2 a epsilon1 epsilon2", real=True)

#: Sign of each derived row (crank, rod, slider: x, y, moment) as printed.
ROW_SIGNS = (-1, 1, 1, -1, 1, 1, -1, 1)
#: Sign of each derived column as printed: the printed R34 is the force of the frame on the slider.
COLUMN_SIGNS = (1, 1, 1, 1, -1, 1, 1, 1)


def printed_equation() -> tuple[sp.Matrix, sp.Matrix]:
    """Eq. (1) as it stands in the paper."""
    a1 = L1 * sp.sin(T1) - LO1 * sp.sin(T1 + T1P)
    a2 = L1 * sp.cos(T1) - LO1 * sp.cos(T1 + T1P)
    a3, a4 = LO1 * sp.sin(T1 + T1P), LO1 * sp.cos(T1 + T1P)
    a5, a6 = LO2 * sp.sin(T2), LO2 * sp.cos(T2)
    a7, a8 = (L2 - LO2) * sp.sin(T2), (L2 - LO2) * sp.cos(T2)
    matrix = sp.Matrix(
        [
            [-1, 0, 0, 0, 0, 1, 0, 0],
            [0, 1, 0, 0, 0, 0, -1, 0],
            [a1, a2, 0, 0, 0, a3, a4, 1],
            [1, 0, -1, 0, 0, 0, 0, 0],
            [0, -1, 0, 1, 0, 0, 0, 0],
            [a5, a6, a7, a8, 0, 0, 0, 0],
            [0, 0, 1, 0, -1, 0, 0, 0],
            [0, 0, 0, -1, 0, 0, 0, 0],
        ]
    )
    right_side = sp.Matrix(
        [
            -M1 * AX1,
            M1 * G - M1 * AY1,
            -J1 * E1,
            -M2 * AX2,
            M2 * G - M2 * AY2,
            -J2 * E2,
            0,
            M3 * G - F - M3 * A,
        ]
    )
    return matrix, right_side


def in_printed_symbols(expression: sp.Expr) -> sp.Expr:
    """The project's symbols (y up, counter-clockwise) in the printed ones (y down, clockwise)."""
    names = {
        "body.crank.cos": sp.cos(T1),
        "body.crank.sin": -sp.sin(T1),
        "body.rod.cos": sp.cos(T2),
        "body.rod.sin": -sp.sin(T2),
        "body.crank.angular_acceleration": -E1,
        "body.rod.angular_acceleration": -E2,
        "body.crank.center_of_mass.ax": AX1,
        "body.crank.center_of_mass.ay": -AY1,
        "body.rod.center_of_mass.ax": AX2,
        "body.rod.center_of_mass.ay": -AY2,
        # The guide points down, so its coordinate counts as the printed y.
        "joint.C.ax": A * sp.cos(3 * sp.pi / 2),
        "joint.C.ay": A * sp.sin(3 * sp.pi / 2),
        "joint.D.direction.x": sp.cos(3 * sp.pi / 2),
        "joint.D.direction.y": sp.sin(3 * sp.pi / 2),
        "mechanism.bodies.crank.points.B": L1,
        "mechanism.bodies.rod.points.C": L2,
        "mechanism.bodies.crank.center_of_mass.distance": LO1,
        "mechanism.bodies.crank.center_of_mass.angle": -T1P,
        "mechanism.bodies.rod.center_of_mass": LO2,
        "mechanism.bodies.crank.mass": M1,
        "mechanism.bodies.rod.mass": M2,
        "mechanism.bodies.slider.mass": M3,
        "mechanism.bodies.crank.inertia": J1,
        "mechanism.bodies.rod.inertia": J2,
        "mechanism.gravity": G,
        "mechanism.forces.punch.force.x": sp.S.Zero,
        "mechanism.forces.punch.force.y": F,
    }
    unknown = {s.name for s in expression.free_symbols} - set(names)
    assert not unknown
    return expression.subs({sp.Symbol(name, real=True): value for name, value in names.items()})


def test_derived_matrix_equals_printed_eq_1():
    _, linkage, reactions = derived("crank-slider")
    assert [u.name for u in reactions.unknowns] == [
        *("reaction.B.x", "reaction.B.y", "reaction.C.x", "reaction.C.y"),  # R12x R12y R23x R23y
        *("reaction.D.normal", "reaction.A.x", "reaction.A.y", "drive_torque"),  # R34x R14x R14y Md
    ]
    slider = {d.symbol.name: d.expression for d in linkage.definitions}
    along = sp.Symbol("joint.D.acceleration", real=True)
    assert slider["joint.C.ax"] == along * sp.Symbol("joint.D.direction.x", real=True)
    assert slider["joint.C.ay"] == along * sp.Symbol("joint.D.direction.y", real=True)
    matrix, right_side = printed_equation()
    assert reactions.matrix.shape == (8, 8)
    for i in range(8):
        for j in range(8):
            entry = ROW_SIGNS[i] * COLUMN_SIGNS[j] * in_printed_symbols(reactions.matrix[i, j])
            assert sp.simplify(sp.expand_trig(entry - matrix[i, j])) == 0, (i, j)
        assert sp.expand(ROW_SIGNS[i] * in_printed_symbols(reactions.right_side[i]) - right_side[i]) == 0, i


def loads_at(degrees: float) -> np.ndarray:
    machine, linkage, reactions = derived("crank-slider")
    results = [*reactions.joint_force["A"], reactions.drive_torque]
    return np.array(evaluate(machine, results, degrees * DEGREE, linkage, reactions), dtype=float)


def test_loads_of_the_punching_machine_at_240_deg():
    """Force of the crank on the frame and drive torque, against Eq. (1) as printed and the reference of the project.

    The reference values (-267.6, 8487.1) N and 26.90 N*m carry all their digits at 239.95 deg.  At 240 deg NumPy's
    solution of Eq. (1) as printed, with kinematics by hand in the printed frame, is 0.16 % away.
    """
    assert np.all(np.abs(loads_at(240.0) - [-267.174, 8486.976, 26.8597]) <= [5e-4, 5e-4, 5e-5])
    reference = np.array([-267.6, 8487.1, 26.90])
    assert np.all(np.abs(loads_at(239.95) - reference) <= [0.05, 0.05, 0.005])


# --- the solution -------------------------------------------------------------------------------------------------


def worst_difference_from_lapack(machine: Machine, moments: Sequence[str] = (), seed: int = 2) -> float:
    """Largest norm-wise relative difference of the closed form from LAPACK's solution at random states."""
    linkage = machine.linkage()
    reactions = machine.reactions(linkage, moments=moments)
    n = len(reactions.unknowns)
    assert reactions.matrix.shape == (n, n)
    random = np.random.default_rng(seed)
    angle, speed = random.uniform(0, 2 * np.pi, STATES), random.uniform(1, 100, STATES)
    results = [*reactions.matrix, *reactions.right_side, *reactions.unknowns]
    numbers = {**machine.numbers(angle), linkage.drive.speed: speed}
    rows = Evaluator(linkage.definitions + reactions.definitions, results)(numbers)
    values = np.array([np.broadcast_to(row, STATES) for row in rows], dtype=float).T
    worst = 0.0
    for row in values:
        solved = np.linalg.solve(row[: n * n].reshape(n, n), row[n * n : n * n + n])
        worst = max(worst, float(np.linalg.norm(row[-n:] - solved) / np.linalg.norm(solved)))
    return worst


CASES = {
    "guide moment": (offset_slider, ("D",)),
    "guide moment of a slider without inertia": (lambda: with_slider_inertia(crank_slider()), ("D",)),
    "l1/l2 = 0.95": (lambda: crank_slider(crank=0.095, rod=0.1), ()),
    "crank of 50 um": (lambda: crank_slider(crank=50e-6, rod=0.1), ()),
    "slotted lever near its dead centre": (lambda: slotted_lever(crank=0.107), ()),
    "shaper with ram": (shaper_with_ram, ()),
    "scotch yoke, guides 3 degrees apart": (
        lambda: scotch_yoke().with_values(mechanism__joints__S__direction=10 * DEGREE),
        ("G",),
    ),
    "yoke on a moving body": (yoke_on_rocker, ()),
    "rapson's slide": (rapson_slide, ("G",)),
    **{name: (make, ()) for name, make in GEARED.items()},
}


def with_slider_inertia(machine: Machine) -> Machine:
    """Give the slider the rod's moment of inertia: any number will do for a body that does not turn."""
    return machine.with_body("slider", inertia=machine.mechanism.body("rod").inertia)


@pytest.mark.parametrize("case", list(CASES))
def test_closed_form_equals_lapack(case):
    """Where it could lose digits; tests/conformance/test_machines.py compares the forces of every linkage."""
    make, moments = CASES[case]
    assert worst_difference_from_lapack(make(), moments) < 1e-12


# --- structure ----------------------------------------------------------------------------------------------------


def test_guide_moment_costs_a_row_only_where_it_is_asked_for():
    _, _, without = derived("offset slider")
    _, _, asked = derived("offset slider", ("D",))
    assert (without.matrix.shape, asked.matrix.shape) == ((8, 8), (9, 9))
    assert "D" not in without.joint_moment
    assert asked.joint_moment["D"].name == "reaction.D.moment"
    assert ("slider", "moment") not in without.rows
    assert ("slider", "moment") in asked.rows


def test_moving_guide_always_has_its_moment():
    machine = moving_guide()
    reactions = machine.reactions(machine.linkage())
    assert "G" in reactions.joint_moment
    assert reactions.matrix.shape == (15, 15)


# --- refusals -----------------------------------------------------------------------------------------------------


def test_guide_moment_of_a_slider_on_a_fixed_guide_needs_no_inertia():
    machine = crank_slider()
    reactions = machine.reactions(machine.linkage(), moments=("D",))
    assert reactions.matrix.shape == (9, 9)
    assert not any("inertia" in s.name for s in reactions.right_side[-1].free_symbols if "slider" in s.name)


def test_rod_without_inertia_is_refused():
    machine = four_bar().with_body("rocker", inertia=None)
    with pytest.raises(LinkageError, match=r"moment balance of rocker"):
        machine.reactions(machine.linkage())
