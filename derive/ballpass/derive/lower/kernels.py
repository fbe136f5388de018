"""Kernels of the project's own stepper: a model's right-hand side cut where a step repeats itself.

In: the visitors of a lowering.  Out: small SX functions that `c_printer` writes as inline C, called by the C driver:

stage          (t, u, p, c) -> w            all that depends on time but not on the state: cage direction, load
stage_rate     (t, u, p, c) -> w, wt        the same with its time derivative
relative       (x, u, p, c, w) -> r         delta = r0 + r1 cos + r2 sin, delta_rate = r3 cos + r4 sin of a ball's angle
law            (delta, rate, p, c) -> F     force of one ball
law_slopes     (delta, rate, p, c) -> F, Fd, Fv      and its slopes by deflection and rate
law_numbers    (p, c) -> k                  the entries of p and c that the law of a ball needs
ball_force     (delta, rate, k) -> F        the law over these
ball_slopes    (delta, rate, k) -> F, Fd, Fv
angles         (t, u, p, c) -> a, at        arguments of sines and cosines in w, linear in time, and their rates
stage_turned   (C, S, t, u, p, c) -> w      w from cosines C and sines S of the angles
stage_rate_turned  (C, S, at, t, u, p, c) -> w, wt     the same with its time derivative
stage_slopes   (C, S, t, u, p, c) -> w, J    w and its derivatives by u, p, c, those that are not always zero
stage_moved    (J, u_d, p_d, c_d) -> w_d       w along a direction of u, p, c
ball_partials  (delta, rate, k) -> F, Fd, Fv, Fk      ball_slopes and the slopes by k
acceleration   (x, S, u, p, c, w) -> a      from the sums S = (sum F cos, sum F sin) over the balls
acceleration_jacobian  (x, S, G, u, p, c, w) -> A, B     da/dq, da/dv (row-major); G: sums of slopes times cos², cos
sin, sin²
acceleration_rate      (x, S, G, r, u, p, c, w, wt) -> at    partial time derivative at fixed state

The balls enter by one law: the driver loops over them, and the compiler makes SIMD lanes of the loop.  Text and compile
time do not depend on their number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import sympy as sp

from ballpass.derive.bearing.equations import CAGE_SPEED, Ball
from ballpass.derive.lower.visitor import Visitor
from ballpass.derive.system import System
from ballpass.derive.terms import TIME

Body = tuple[str, dict[str, ca.SX], dict[str, ca.SX], str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernel:
    """A function for the driver, with a line for people."""

    function: ca.Function
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernels:
    """Kernels of a model; `stage_size` entries of w, the first two of which are cosine and sine of the cage's angle.

    `law_numbers` counts the entries of k.  `angles` counts those of the functions `turned`, which evaluate w for many
    times close to each other: an angle that grows by little needs no sine of its own.  `tangents` are directional
    derivatives of the functions, for sensitivities; what is the same for all directions is in `shared_tangents` and
    `stage_slopes`, the latter of `stage_slopes_size` entries.
    """

    stage_size: int
    balls: int
    angles: int
    law_numbers: int
    stage_slopes_size: int
    functions: tuple[Kernel, ...]
    turned: tuple[Kernel, ...]
    tangents: tuple[Kernel, ...]
    shared_tangents: tuple[Kernel, ...]
    stage_slopes: Kernel


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
        laws = [k.function for k in functions if k.function.name() in ("law", "law_slopes")]
        numbers, (force, slopes) = gathered(laws, ("ball_force", "ball_slopes"), "law_numbers")
        angles, turned, stage_slopes, stage_moved = _turned(
            next(k.function for k in functions if k.function.name() == "stage")
        )
        return Kernels(
            stage_size=len(self._stage),
            balls=self._system.bearing.ball.count,
            angles=angles.function.size1_out(0),
            law_numbers=numbers.size1_out(0),
            stage_slopes_size=stage_slopes.function.size1_out(1),
            functions=(
                *functions,
                Kernel(function=numbers, description="Numbers that the force of a ball depends on"),
                Kernel(function=force, description="Force of one ball [N]"),
                Kernel(function=slopes, description="Force of one ball [N] and its slopes"),
                angles,
            ),
            turned=turned,
            tangents=(*tangents, stage_moved),
            shared_tangents=(_partials(slopes),),
            stage_slopes=stage_slopes,
        )


def gathered(
    functions: Sequence[ca.Function], names: Sequence[str], numbers_name: str
) -> tuple[ca.Function, tuple[ca.Function, ...]]:
    """The entries of p and c in functions of a ball's deflection and rate, and the functions over these entries, k.

    A compiler makes lanes of a loop over balls only where a selection needs no load: the numbers are gathered first.

    Parameters
    ----------
    functions : with arguments deflection, rate, p, c
    names : of the functions over the entries
    numbers_name : of the function (p, c) -> k
    """
    used: list[tuple[int, int]] = []
    for function in functions:
        for k in range(function.n_instructions()):
            if function.instruction_id(k) == ca.OP_INPUT:
                argument, entry = function.instruction_input(k)
                if argument > 1 and (argument, entry) not in used:
                    used.append((argument, entry))
    used.sort()
    first = functions[0]
    given = {first.name_in(k): ca.SX.sym(first.name_in(k), first.sparsity_in(k)) for k in range(2, first.n_in())}
    vectors = [*given.values()]
    # C has no arrays of length zero
    chosen = ca.vertcat(*(vectors[a - 2][e] for a, e in used)) if used else ca.SX(0.0)
    numbers = ca.Function(numbers_name, vectors, [ca.densify(chosen)], [*given], ["k"])
    entries = ca.SX.sym("k", max(len(used), 1))
    replaced = [ca.SX.zeros(v.numel()) for v in vectors]
    for place, (argument, entry) in enumerate(used):
        replaced[argument - 2][entry] = entries[place]
    delta, rate = ca.SX.sym("delta"), ca.SX.sym("rate")
    made = []
    for function, name in zip(functions, names, strict=True):
        results = ca.cse([ca.densify(r) for r in function.call([delta, rate, *replaced], True, False)])
        made.append(ca.Function(name, [delta, rate, entries], results, ["delta", "rate", "k"], function.name_out()))
    return numbers, tuple(made)


def _partials(slopes: ca.Function) -> Kernel:
    """The force of a ball, its slopes, and its derivatives by the numbers it depends on."""
    delta, rate, k = (ca.SX.sym(slopes.name_in(i), slopes.size1_in(i)) for i in range(3))
    results = [*slopes.call([delta, rate, k], True, False)]
    results.append(ca.densify(ca.jacobian(results[0], k)).T)
    made = ca.Function(
        "ball_partials", [delta, rate, k], ca.cse(results), ["delta", "rate", "k"], ["F", "Fd", "Fv", "Fk"]
    )
    return Kernel(function=made, description="Force of one ball [N], its slopes, and those by its numbers")


def _turned(stage: ca.Function) -> tuple[Kernel, tuple[Kernel, ...], Kernel, Kernel]:
    """The angles of a stage, the stage from their cosines and sines, its derivatives, and these along a direction.

    Sines and cosines whose arguments are linear in time are taken out; others stay where they are.
    """
    symbols = {stage.name_in(k): ca.SX.sym(stage.name_in(k), stage.sparsity_in(k)) for k in range(stage.n_in())}
    t = symbols["t"]
    angles: list[ca.SX] = []
    cosines: list[ca.SX] = []
    sines: list[ca.SX] = []
    work: dict[int, ca.SX] = {}
    w = ca.SX(stage.size1_out(0), 1)

    def place(angle: ca.SX) -> int | None:
        """Number of an angle; None where it is no linear function of time."""
        if not ca.depends_on(angle, t) or ca.depends_on(ca.jacobian(angle, t), t):
            return None
        for k, known in enumerate(angles):
            if ca.is_equal(known, angle, 4):
                return k
        angles.append(angle)
        cosines.append(ca.SX.sym(f"C{len(angles)}"))
        sines.append(ca.SX.sym(f"S{len(angles)}"))
        return len(angles) - 1

    for k in range(stage.n_instructions()):
        operation, out, take = stage.instruction_id(k), stage.instruction_output(k), stage.instruction_input(k)
        if operation == ca.OP_INPUT:
            work[out[0]] = [*symbols.values()][take[0]][take[1]]
        elif operation == ca.OP_OUTPUT:
            w[out[1]] = work[take[0]]
        elif operation == ca.OP_CONST:
            work[out[0]] = ca.SX(stage.instruction_constant(k))
        elif operation in (ca.OP_SIN, ca.OP_COS) and (number := place(work[take[0]])) is not None:
            work[out[0]] = (sines if operation == ca.OP_SIN else cosines)[number]
        elif len(take) == 1:
            work[out[0]] = ca.SX.unary(operation, work[take[0]])
        else:
            work[out[0]] = ca.SX.binary(operation, work[take[0]], work[take[1]])

    angle = ca.vertcat(*angles)
    rate = ca.jacobian(angle, t)
    cosine, sine, turning = ca.vertcat(*cosines), ca.vertcat(*sines), ca.SX.sym("at", len(angles))
    wt = ca.jtimes(w, ca.vertcat(t, cosine, sine), ca.vertcat(1.0, -sine * turning, cosine * turning))
    made = ca.Function("angles", [*symbols.values()], [ca.densify(angle), ca.densify(rate)], [*symbols], ["a", "at"])
    directions = {"C": cosine, "S": sine}
    results = ca.cse([ca.densify(w), ca.densify(wt)])
    takes = {**directions, **symbols}
    plain = ca.Function("stage_turned", [*takes.values()], ca.cse([ca.densify(w)]), [*takes], ["w"])
    takes = {**directions, "at": turning, **symbols}
    rated = ca.Function("stage_rate_turned", [*takes.values()], results, [*takes], ["w", "wt"])
    words = "from cosines and sines of its angles"
    # the angles move with inputs, parameters and constants as well
    moving = {name: symbols[name] for name in ("u", "p", "c")}
    seeds = ca.vertcat(*moving.values())
    by_angle = ca.jacobian(w, sine) @ ca.diag(cosine) - ca.jacobian(w, cosine) @ ca.diag(sine)
    slopes = ca.jacobian(w, seeds) + by_angle @ ca.jacobian(angle, seeds)
    entries: ca.SX = slopes.nz[:]
    takes = {**directions, **symbols}
    sloped = ca.Function("stage_slopes", [*takes.values()], ca.cse([ca.densify(w), entries]), [*takes], ["w", "J"])
    known = ca.SX.sym("J", entries.numel())
    along = {f"{name}_d": ca.SX.sym(f"{name}_d", moving[name].numel()) for name in moving}
    change = ca.densify(ca.SX(slopes.sparsity(), known) @ ca.vertcat(*along.values()))
    moved = ca.Function("stage_moved", [known, *along.values()], [change], ["J", *along], ["w_d"])
    return (
        Kernel(function=made, description="Angles of a stage and their rates"),
        (
            Kernel(function=plain, description=f"Stage variables {words}"),
            Kernel(function=rated, description=f"Stage variables and their time derivatives {words}"),
        ),
        Kernel(function=sloped, description=f"Stage variables {words}, and their derivatives by u, p, c"),
        Kernel(function=moved, description="Stage variables"),
    )


#: Directional derivatives for sensitivities: name, kernel, the arguments that move, and the results that are wanted.
_TANGENTS: tuple[tuple[str, str, tuple[str, ...], tuple[str, ...]], ...] = (
    ("stage_rate_tangent", "stage_rate", ("u", "p", "c"), ("w", "wt")),
    ("relative_tangent", "relative", ("x", "u", "p", "c", "w"), ("r",)),
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
