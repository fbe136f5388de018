"""Lowering: three evaluators of one system agree, constants are hoisted, a scene pays only for what it names."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from importlib import import_module
from types import ModuleType

import casadi as ca
import numpy as np
import pytest
import sympy as sp

from ballpass import derive as derivation
from ballpass import runtime
from ballpass.derive import derive
from ballpass.derive.lowering.functions import lower, operations
from ballpass.derive.lowering.visitor import Visitor
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.system import System
from ballpass.derive.terms import TIME
from ballpass.runtime import Model

SCENES = ("punching_press", "punching_press_tangent", "offset_slider", "four_bar", "crank_shaper", "varying_compliance")


def by_sympy(
    system: System, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, dict[str, sp.Expr]]:
    """Right-hand side from the definitions in 40 digits: substitution, elliptic integrals by mpmath, no CasADi."""
    digits = 40

    def number(value: float) -> sp.Float:
        return sp.Float(sp.Rational(value), digits)

    known: dict[sp.Symbol, sp.Expr] = {TIME: number(t)}
    for named, values in ((system.states, x), (system.inputs, u), (system.parameters, p)):
        known |= {n.symbol: number(v) for n, v in zip(named, values, strict=True)}
    for definition in (*system.constants, *system.definitions):
        known[definition.symbol] = sp.sympify(definition.expression).xreplace(known).evalf(digits)
    (bearing,) = system.bearings
    ball = bearing.ball
    cage = ball.cage_angle.xreplace(known).evalf(digits)
    totals = {s.symbol: sp.Float(0, digits) for s in ball.sums}
    for j in range(ball.count):
        theta = cage + 2 * sp.pi * j / ball.count
        one = known | {ball.cos: sp.cos(theta).evalf(digits), ball.sin: sp.sin(theta).evalf(digits)}
        for definition in ball.definitions:
            one[definition.symbol] = sp.sympify(definition.expression).xreplace(one).evalf(digits)
        for s in ball.sums:
            totals[s.symbol] += s.expression.xreplace(one).evalf(digits)
    known |= totals
    n = len(system.coordinates)
    acceleration = [(system.forcing[k] / system.mass[k, k]).xreplace(known).evalf(digits) for k in range(n)]
    return np.array([*x[n:], *(float(a) for a in acceleration)]), known


def random_point(system: System, seed: int) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    n = len(system.coordinates)
    x = np.concatenate([rng.uniform(-2e-5, 2e-5, n), rng.uniform(-0.05, 0.05, n)])
    u = np.array([rng.integers(0, 2) if i.kind == "gate" else rng.uniform(0, 6.28) for i in system.inputs], dtype=float)
    p = np.array([q.default for q in system.parameters]) * rng.uniform(0.98, 1.02, len(system.parameters))
    return rng.uniform(0, 0.01), x, u, p


@pytest.mark.parametrize("name", SCENES)
def test_sympy_virtual_machine_and_compiled_c_agree(
    name: str, make_model: Callable[..., Model], scene_text: Callable[..., str]
) -> None:
    system = derive(scene_from_text(scene_text(name), name))
    functions = lower(system)
    model = make_model(name)
    assert model.compiled
    for seed in range(6):
        t, x, u, p = random_point(system, seed)
        exact, _ = by_sympy(system, t, x, u, p)
        c = functions["constants"](p)
        virtual = functions["rhs"](t=t, x=x, u=u, p=p, c=c)["xdot"].full().ravel()
        compiled_c = model.function("constants")(p)
        compiled = model.function("rhs")(t=t, x=x, u=u, p=p, c=compiled_c)["xdot"].full().ravel()
        # balls cancel each other in the sums: rounding is relative to the largest force, not to the sum
        scale = np.abs(exact).max()
        assert np.abs(virtual - exact).max() <= 1e-13 * scale
        assert np.abs(compiled - exact).max() <= 1e-13 * scale


@pytest.mark.parametrize("name", SCENES)
def test_jacobians_agree_with_differences(
    name: str, make_model: Callable[..., Model], scene_text: Callable[..., str]
) -> None:
    """Central differences at states kicked away from symmetry; tangent damping is left out at its kink."""
    system = derive(scene_from_text(scene_text(name), name))
    functions = lower(system)
    t, x, u, p = random_point(system, 3)
    rhs = functions["rhs"]

    def value(t: float, x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return rhs(t=t, x=x, u=u, p=p, c=functions["constants"](p))["xdot"].full().ravel()

    c = functions["constants"](p)
    jac = {k: functions[f"rhs_jac_{k}"](t=t, x=x, u=u, p=p, c=c)[f"xdot_{k}"].full() for k in "xtpc"}
    for k in range(len(x)):
        h = 1e-6 * max(abs(x[k]), 1e-7)
        step = np.eye(len(x))[k] * h
        difference = (value(t, x + step, p) - value(t, x - step, p)) / (2 * h)
        assert np.abs(jac["x"][:, k] - difference).max() <= 1e-5 * max(np.abs(difference).max(), 1.0)
    difference = (value(t + 1e-8, x, p) - value(t - 1e-8, x, p)) / 2e-8
    assert np.abs(jac["t"][:, 0] - difference).max() <= 1e-5 * max(np.abs(difference).max(), 1e3)
    total = jac["p"] + jac["c"] @ functions["constants_jac"](p).full()
    for k in range(len(p)):
        h = 1e-6 * max(abs(p[k]), 1e-7)
        step = np.eye(len(p))[k] * h
        difference = (value(t, x, p + step) - value(t, x, p - step)) / (2 * h)
        assert np.abs(total[:, k] - difference).max() <= 3e-5 * max(np.abs(difference).max(), 1e-3 / h), (
            system.parameters[k]
        )


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


def test_outputs_nobody_asked_for_are_not_generated(scene_text: Callable[..., str]) -> None:
    text = scene_text("punching_press")
    start = text.index("outputs = [")
    few = text[:start] + 'outputs = ["inner.x"]\n'
    functions = lower(derive(scene_from_text(few, "punching_press")))
    assert operations(functions["outputs"]) == 0
    everything = lower(derive(scene_from_text(text, "punching_press")))
    assert operations(everything["outputs"]) > 100
    assert operations(everything["rhs"]) == operations(functions["rhs"])


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
