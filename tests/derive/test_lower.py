"""Lowering: constants are hoisted, a scene pays only for what it names."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from importlib import import_module
from types import ModuleType

import casadi as ca
import pytest
import sympy as sp

from ballpass import derive as derivation
from ballpass import runtime
from ballpass.derive import derive
from ballpass.derive.lowering.functions import lower, operations
from ballpass.derive.lowering.visitor import Visitor
from ballpass.derive.reading.read import scene_from_text


def test_elliptic_integrals_stay_out_of_the_step(scene_text: Callable[..., str]) -> None:
    """Contact from geometry costs nothing in the step: the right-hand side has the operations of a given stiffness."""
    geometry = """inner_groove_radius = "4.1275 mm"
outer_groove_radius = "4.206875 mm"
young_modulus = "207 GPa"
poisson_ratio = 0.3"""
    given = scene_from_text(scene_text("varying_compliance"), "varying_compliance")
    exact = scene_from_text(
        scene_text("varying_compliance", ('stiffness = "13.34e9 N/m^1.5"', geometry)), "varying_compliance"
    )
    counts = [operations(lower(derive(s))["rhs"]) for s in (given, exact)]
    assert counts[0] == counts[1]


def test_one_sine_and_cosine_pair_serves_all_balls(scene_text: Callable[..., str]) -> None:
    rhs = lower(derive(scene_from_text(scene_text("varying_compliance"), "varying_compliance")))["rhs"]
    kinds = [rhs.instruction_id(k) for k in range(rhs.n_instructions())]
    assert kinds.count(ca.OP_SIN) == 1
    assert kinds.count(ca.OP_COS) == 1


def test_fixed_outer_ring_and_missing_damping_cost_nothing(scene_text: Callable[..., str]) -> None:
    """No coordinate, no parameter, no operation for what the scene does not name."""
    base = scene_text("varying_compliance")
    damper = 'damping = "200 N*s/m"'
    bare = derive(scene_from_text(scene_text("varying_compliance", (damper, "")), "varying_compliance"))
    damped = derive(scene_from_text(base, "varying_compliance"))
    counts = [operations(lower(s)["rhs"]) for s in (bare, damped)]
    # one product and one sum for each of x and y
    assert counts[1] - counts[0] == 4
    assert {p.name for p in damped.parameters} - {p.name for p in bare.parameters} == {"bearing.inner_ring.damping"}


X, Y = sp.symbols("x y", real=True)


@pytest.mark.parametrize(
    "expression",
    [
        sp.Max(X, 0, Y),
        sp.Min(X, Y),
        sp.sign(X) * sp.Abs(Y),
        sp.Piecewise((X**2, sp.And(X > 0, Y > 0)), (Y, X < -1), (X - Y, True)),
        sp.sqrt(X**2 + 1) ** 3 / (Y**2 + 2) + sp.Rational(3, 7) * X - X / 3,
        sp.atan2(Y, X) + sp.exp(-X) - sp.log(Y**2 + 1) + sp.cbrt(X**2 + 1),
        (X**2 + 1) ** sp.Rational(-5, 2) - 1 / (Y**2 + 3) + sp.pi * sp.cos(X) * sp.sin(Y),
        X**5 - Y**3 + (X + 2) ** 2,
    ],
)
def test_visitor_agrees_with_sympy(expression: sp.Expr) -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("f", [x, y], [Visitor({X: x, Y: y}, {})(expression)])
    for a, b in ((1.3, -0.7), (-2.5, 0.4), (0.6, 1.9), (-0.2, -3.0)):
        exact = float(expression.subs({X: sp.Float(a, 30), Y: sp.Float(b, 30)}).evalf(20))
        assert float(function(a, b)) == pytest.approx(exact, rel=1e-14, abs=1e-15)


def test_visitor_names_what_it_does_not_know() -> None:
    with pytest.raises(TypeError, match="besselj"):
        Visitor({X: ca.SX.sym("x")}, {})(sp.besselj(0, X))
    with pytest.raises(TypeError, match="symbol y"):
        Visitor({X: ca.SX.sym("x")}, {})(X + Y)


def test_shared_expressions_are_lowered_once() -> None:
    """Sixty levels that each use the one below twice: 2^60 leaves as a tree, four operations a level as a DAG."""
    expression: sp.Expr = X
    for _ in range(60):
        expression = sp.sin(expression) + Y * sp.cos(expression)
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [Visitor({X: x, Y: ca.SX(0.5)}, {})(expression)])
    assert operations(function) == 4 * 60


def test_no_module_takes_the_place_of_a_public_name() -> None:
    for package in (derivation, runtime):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            import_module(found.name)
        assert not [name for name in package.__all__ if isinstance(getattr(package, name), ModuleType)]
