"""The derived bearing equations against the printed ones."""

from __future__ import annotations

import pytest
import sympy as sp
from scene_texts import PRESS, ROTOR

from ballpass.derive.lowering.functions import lower
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.system import System, derive


def symbol(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


def press(*changes: tuple[str, str]) -> System:
    text = PRESS
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return derive(scene_from_text(text, "punching_press"))


@pytest.fixture(scope="module")
def system() -> System:
    return press()


def test_equations_of_motion_equal_printed_eq_2(system: System) -> None:
    xi, yi, xo, yo, vxo, vyo = (symbol(n) for n in ("inner.x", "inner.y", "outer.x", "outer.y", "outer.vx", "outer.vy"))
    sum_x, sum_y = symbol("ball.sum_x"), symbol("ball.sum_y")  # F_x + F_cx, F_y + F_cy
    share = symbol("bearing.share")
    kp, cp = symbol("bearing.outer_ring.stiffness"), symbol("bearing.outer_ring.damping")
    r14x, r14y = system.reactions.joint_force["A"]
    mo, mei = symbol("bearing.outer_ring.mass"), symbol("bearing.m_ei")
    printed = sp.Matrix(
        [
            share * r14x - sum_x,
            share * r14y - sum_y,
            sum_x - cp * vxo - kp * xo,
            sum_y - cp * vyo - kp * yo,
        ]
    )
    assert (sp.Matrix(system.forcing) - printed).expand() == sp.zeros(4, 1)
    assert sp.Matrix(system.mass) == sp.diag(mei, mei, mo, mo)
    assert [s.symbol for s in system.states[:4]] == [xi, yi, xo, yo]
    default = {p.name: p.default for p in system.parameters}
    assert default["bearing.share"] == 0.5


def test_ball_geometry_equals_printed_eqs_6_and_11(system: System) -> None:
    xi, yi, xo, yo = (symbol(n) for n in ("inner.x", "inner.y", "outer.x", "outer.y"))
    vxi, vyi, vxo, vyo = (symbol(n) for n in ("inner.vx", "inner.vy", "outer.vx", "outer.vy"))
    ball = system.bearings[0].ball
    definitions = {d.symbol: d.expression for d in ball.definitions}
    c, s, omega_c = ball.cos, ball.sin, symbol("bearing.cage_speed")
    deflection = (xi - xo) * c + (yi - yo) * s - symbol("bearing.clearance") / 2
    rate = (vxi - vxo) * c - (xi - xo) * s * omega_c + (vyi - vyo) * s + (yi - yo) * c * omega_c
    assert sp.expand(definitions[ball.deflection] - deflection) == 0
    assert sp.expand(definitions[ball.deflection_rate] - rate) == 0


def test_sums_over_balls_equal_printed_eqs_8_and_9(system: System) -> None:
    ball = system.bearings[0].ball
    definitions = {d.symbol: d.expression for d in ball.definitions}
    for total, direction in zip(ball.sums, (ball.cos, ball.sin), strict=True):
        summand = total.expression.subs(ball.force, definitions[ball.force])
        assert sp.expand(summand - ball.elastic_force * direction - ball.damping_force * direction) == 0


def test_cage_turns_by_printed_eq_7(system: System) -> None:
    constants = {d.symbol.name: d.expression for d in system.constants}
    names = {d.symbol: d.expression for d in system.constants}
    rb, big_rb = symbol("bearing.inner_raceway_radius"), symbol("bearing.outer_raceway_radius")
    printed = (rb / (big_rb + rb)).subs(names)
    assert sp.simplify(constants["bearing.cage_ratio"] - printed) == 0


def test_equivalent_mass_equals_printed_eq_3(system: System) -> None:
    """With theta_1p = 0: m_i + m (l1 - lo1)/l1 + m_x/2; the other reading halves the crank."""
    l1 = symbol("mechanism.bodies.crank.points.B")
    lo1 = symbol("mechanism.bodies.crank.center_of_mass.distance")
    m1 = symbol("mechanism.bodies.crank.mass")
    ring, pin = (symbol(f"bearing.inner_ring.equivalent_mass.{n}") for n in ("ring", "crankpin"))
    straight = {symbol("mechanism.bodies.crank.center_of_mass.angle"): 0}
    for crank, share in (("whole", 1), ("half", sp.Rational(1, 2))):
        derived = press(('crank = "whole"', f'crank = "{crank}"'))
        value = next(d.expression for d in derived.constants if d.symbol.name == "bearing.m_ei")
        assert sp.simplify(value.subs(straight) - (ring + share * m1 * (l1 - lo1) / l1 + pin / 2)) == 0


def test_a_fixed_outer_ring_has_no_coordinates() -> None:
    derived = derive(scene_from_text(ROTOR, "varying_compliance"))
    assert [s.name for s in derived.states] == ["inner.x", "inner.y", "inner.vx", "inner.vy"]
    assert derived.mass.shape == (2, 2)
    assert not any("outer_ring" in p.name for p in derived.parameters)


def test_opposite_sums_have_the_number_of_balls_of_the_scene() -> None:
    for balls in (7, 8):
        derived = press(("balls = 8", f"balls = {balls}"))
        outputs = lower(derived)["outputs"]
        assert outputs.size1_out("ball_force") == balls
