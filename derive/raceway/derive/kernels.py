"""Kernels of the project's own stepper: a model's right-hand side cut where a step repeats itself.

In: the visitors of a lowering.  Out: small SX functions that `c_printer` writes as inline C, called by the C driver:

stage          (t, u, p, c) -> w            all that depends on time but not on the state: cage direction, load
stage_rate     (t, u, p, c) -> w, wt        the same with its time derivative
relative       (x, u, p, c, w) -> r         delta = r0 + r1 cos + r2 sin, delta_rate = r3 cos + r4 sin of a ball's angle
law            (delta, rate, p, c) -> F     force of one ball
law_slopes     (delta, rate, p, c) -> F, Fd, Fv      and its slopes by deflection and rate
acceleration   (x, S, u, p, c, w) -> a      from the sums S = (sum F cos, sum F sin) over the balls
acceleration_jacobian  (x, S, G, u, p, c, w) -> A, B     da/dq, da/dv (row-major); G: sums of slopes times cos², cos
sin, sin²
acceleration_rate      (x, S, G, r, u, p, c, w, wt) -> at    partial time derivative at fixed state

The balls enter by one law: the driver loops over them, and the compiler makes SIMD lanes of the loop.  Text and compile
time do not depend on their number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import sympy as sp

from raceway.derive.bearing import CAGE_SPEED, Ball
from raceway.derive.system import System
from raceway.derive.terms import TIME
from raceway.derive.visitor import Visitor

Body = tuple[str, dict[str, ca.SX], dict[str, ca.SX], str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernel:
    """A function for the driver, with a line for people."""

    function: ca.Function
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernels:
    """Kernels of a model; `stage_size` entries of w, the first two of which are cosine and sine of the cage's angle.

    `tangents` are directional derivatives of the functions, for sensitivities.
    """

    stage_size: int
    balls: int
    functions: tuple[Kernel, ...]
    tangents: tuple[Kernel, ...]


class KernelBuilder:
    """Builds the kernels' expressions first, so that their constants join c; functions afterwards, when c is known.

    Parameters
    ----------
    system, visit : the system and the visitor of its run-time functions
    once_a_run : whether an expression depends on parameters only, and its SX among the derived constants
    """

    def __init__(
        self,
        system: System,
        visit: Visitor,
        *,
        values: dict[sp.Symbol, ca.SX],
        definitions: dict[sp.Symbol, sp.Expr],
        constant: frozenset[sp.Symbol],
        arguments: dict[str, ca.SX],
    ) -> None:
        assert system.bearing is not None
        self._system = system
        self._visit = visit
        self._arguments = arguments
        self._stage: dict[sp.Basic, ca.SX] = {}
        self._fixed: Callable[[sp.Basic], bool] = visit.is_constant
        timed = constant | {TIME} | {i.symbol for i in system.inputs}
        self._of_state = Visitor(values, definitions, constant=timed, hoist=self._hoist)
        self._bodies = self._build(system.bearing.ball)

    def _hoist(self, expression: sp.Basic) -> ca.SX:
        """A stage variable, unless the expression is a constant of the run."""
        if self._fixed(expression):
            return self._visit(expression)
        if expression not in self._stage:
            self._stage[expression] = ca.SX.sym(f"w{len(self._stage)}")
        return self._stage[expression]

    def _build(self, ball: Ball) -> list[Body]:
        system = self._system
        n = system.coordinates
        x = self._arguments["x"]
        for direction in (sp.cos(ball.cage_angle), sp.sin(ball.cage_angle)):
            self._hoist(direction)
        definitions = {d.symbol: d.expression for d in ball.definitions}

        relative = self._relative(ball, definitions)
        r = ca.SX.sym("r", 5)
        delta, rate = ca.SX.sym("delta"), ca.SX.sym("rate")
        law = self._visit.child(
            {ball.deflection: delta, ball.deflection_rate: rate},
            {k: v for k, v in definitions.items() if k not in (ball.deflection, ball.deflection_rate)},
        )
        force = sp.sympify(definitions[ball.force]).xreplace(
            {
                k: v
                for k, v in definitions.items()
                if k != ball.force and k not in (ball.deflection, ball.deflection_rate)
            }
        )
        slopes = [law(sp.diff(force, s)) for s in (ball.deflection, ball.deflection_rate)]

        sums = ca.SX.sym("S", 2)
        motion = self._of_state.child({s.symbol: sums[k] for k, s in enumerate(ball.sums)}, {})
        acceleration = ca.vertcat(*(motion(system.forcing[k] / system.mass[k, k]) for k in range(n)))
        # slopes of the sums by r: F cos and F sin by delta over cos², cos sin, sin², and by the rate likewise
        g = ca.SX.sym("G", 6)
        sums_r = ca.vertcat(
            ca.horzcat(0, g[0], g[1], g[3], g[4]),
            ca.horzcat(0, g[1], g[2], g[4], g[5]),
        )
        by_sums = ca.jacobian(acceleration, sums)
        by_state = ca.jacobian(acceleration, x) + by_sums @ sums_r @ ca.jacobian(relative, x)
        # the cage turns: d(cos) = -sin, d(sin) = cos for every ball at once
        turn = ca.vertcat(
            -r[1] * g[1] + r[2] * g[0] - r[3] * g[4] + r[4] * g[3] - sums[1],
            -r[1] * g[2] + r[2] * g[1] - r[3] * g[5] + r[4] * g[4] + sums[0],
        )
        w = ca.vertcat(*self._stage.values())
        wt = ca.SX.sym("wt", w.numel())
        cage_speed = self._visit(CAGE_SPEED)
        by_time = ca.jtimes(acceleration, w, wt) + by_sums @ turn * cage_speed
        stage = ca.vertcat(*(self._visit(e) for e in self._stage))
        t = self._arguments["t"]
        state = {k: self._arguments[k] for k in "upc"}
        tail = {**state, "w": w}
        return [
            (
                "stage",
                {"t": t, **state},
                {"w": stage},
                "Once per stage time: cage direction, loads, all else without the state",
            ),
            (
                "stage_rate",
                {"t": t, **state},
                {"w": stage, "wt": ca.jacobian(stage, t)},
                "Stage variables and their time derivatives",
            ),
            ("relative", {"x": x, **tail}, {"r": relative}, "delta = r0 + r1 cos + r2 sin, rate = r3 cos + r4 sin"),
            (
                "law",
                {"delta": delta, "rate": rate, "p": state["p"], "c": state["c"]},
                {"F": law(ball.force)},
                "Force of one ball [N]",
            ),
            (
                "law_slopes",
                {"delta": delta, "rate": rate, "p": state["p"], "c": state["c"]},
                {"F": law(ball.force), "Fd": slopes[0], "Fv": slopes[1]},
                "Force of one ball [N] and its slopes",
            ),
            (
                "acceleration",
                {"x": x, "S": sums, **tail},
                {"a": acceleration},
                "Accelerations from the sums over the balls",
            ),
            (
                "acceleration_jacobian",
                {"x": x, "S": sums, "G": g, **tail},
                {"A": by_state[:, :n].T, "B": by_state[:, n:].T},
                "Derivatives of the accelerations by positions and velocities, row-major",
            ),
            (
                "acceleration_rate",
                {"x": x, "S": sums, "G": g, "r": r, **tail, "wt": wt},
                {"at": by_time},
                "Partial time derivative of the accelerations at fixed state",
            ),
        ]

    def _relative(self, ball: Ball, definitions: dict[sp.Symbol, sp.Expr]) -> ca.SX:
        """Coefficients r of deflection and rate; both are linear in cosine and sine of the ball's angle."""
        rows: list[sp.Expr] = []
        for which, constant in ((ball.deflection, True), (ball.deflection_rate, False)):
            expression = sp.expand(definitions.get(which, sp.S.Zero))
            along, across = expression.coeff(ball.cos), expression.coeff(ball.sin)
            rest = sp.expand(expression - along * ball.cos - across * ball.sin)
            if rest.has(ball.cos, ball.sin) or (not constant and rest != 0):
                raise TypeError(f"{which} is not linear in the direction of the ball")
            rows += [rest, along, across] if constant else [along, across]
        return ca.vertcat(*(self._of_state(r) for r in rows))

    def kernels(self, c: ca.SX) -> Kernels:
        """The functions, once the vector of derived constants is complete."""
        functions = []
        for name, takes, gives, words in self._bodies:
            inputs = {**takes, **({"c": c} if "c" in takes else {})}
            results = [ca.densify(v) for v in gives.values()]
            function = ca.Function(name, [*inputs.values()], ca.cse(results), [*inputs], [*gives])
            functions.append(Kernel(function=function, description=words))
        assert self._system.bearing is not None
        tangents = tuple(
            _tangent(k, name, along, results)
            for name, kernel, along, results in _TANGENTS
            for k in functions
            if k.function.name() == kernel
        )
        return Kernels(
            stage_size=len(self._stage),
            balls=self._system.bearing.ball.count,
            functions=tuple(functions),
            tangents=tangents,
        )


#: Directional derivatives for sensitivities: name, kernel, the arguments that move, and the results that are wanted.
_TANGENTS: tuple[tuple[str, str, tuple[str, ...], tuple[str, ...]], ...] = (
    ("stage_tangent", "stage", ("u", "p", "c"), ("w",)),
    ("stage_rate_tangent", "stage_rate", ("u", "p", "c"), ("w", "wt")),
    ("relative_tangent", "relative", ("x", "u", "p", "c", "w"), ("r",)),
    # the slopes of the law are known where this is called: only its own parameters are left
    ("law_partial", "law", ("p", "c"), ("F",)),
    ("law_slopes_tangent", "law_slopes", ("delta", "rate", "p", "c"), ("Fd", "Fv")),
    ("acceleration_tangent", "acceleration", ("x", "S", "u", "p", "c", "w"), ("a",)),
    ("acceleration_jacobian_tangent", "acceleration_jacobian", ("x", "S", "G", "u", "p", "c", "w"), ("A", "B")),
    (
        "acceleration_rate_tangent",
        "acceleration_rate",
        ("x", "S", "G", "r", "u", "p", "c", "w", "wt"),
        ("at",),
    ),
)


def _tangent(kernel: Kernel, name: str, along: tuple[str, ...], results: tuple[str, ...]) -> Kernel:
    """Derivative of a kernel's results along a direction of some of its arguments, named ``x_d`` for ``x``."""
    function = kernel.function
    symbols = {
        function.name_in(k): ca.SX.sym(function.name_in(k), function.size1_in(k)) for k in range(function.n_in())
    }
    values = dict(zip(function.name_out(), function.call([*symbols.values()], True, False), strict=True))
    directions = {f"{k}_d": ca.SX.sym(f"{k}_d", symbols[k].numel()) for k in along}
    point, direction = ca.vertcat(*(symbols[k] for k in along)), ca.vertcat(*directions.values())
    moved = {f"{k}_d": ca.densify(ca.jtimes(ca.vec(values[k]), point, direction)) for k in results}
    made = ca.Function(
        name, [*symbols.values(), *directions.values()], ca.cse([*moved.values()]), [*symbols, *directions], [*moved]
    )
    return Kernel(function=made, description=f"Directional derivative of {function.name()}")
