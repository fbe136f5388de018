"""Kernels of the project's own stepper: a model's right-hand side cut where a step repeats itself.

In: the visitors of a lowering.  Out: small SX functions that `c_printer` writes as inline C, called by the C driver:

stage          (t, u, p, c) -> w            all that depends on time but not on the state: cages' directions, loads
stage_rate     (t, u, p, c) -> w, wt        the same with its time derivative
relative       (x, u, p, c, w) -> r         of every bearing, see `ball_kernels`
angles         (t, u, p, c) -> a, at        arguments of sines and cosines in w, linear in time, and their rates
stage_turned   (C, S, t, u, p, c) -> w      w from cosines C and sines S of the angles
stage_rate_turned  (C, S, at, t, u, p, c) -> w, wt     the same with its time derivative
stage_slopes   (C, S, t, u, p, c) -> w, J    w and its derivatives by t, u, p, c, those that are not always zero
stage_moved    (J, t_d, u_d, p_d, c_d) -> w_d  w along a direction of t, u, p, c
acceleration   (x, S, r, u, p, c, w) -> a      from the sums S over the balls of every bearing
acceleration_jacobian  (x, S, G, r, u, p, c, w) -> A, B     da/dq, da/dv (row-major); G: sums of the slopes' rows
acceleration_rate      (x, S, G, r, u, p, c, w, wt) -> at    partial time derivative at fixed state
passes         (t, x, u, p, c) -> a         of each bearing: angle of ball 1 as the outer and the inner ring see it

The balls enter by the kernels of `ball_kernels`, one set for alike bearings: the driver loops over these, the compiler
makes SIMD lanes of the loop over balls.  Text and compile time do not depend on their number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import casadi as ca
import sympy as sp
from sympy.utilities.iterables import sift

from ballpass.derive.lowering.ball_kernels import BallBuilder, BallKernels, arguments_of, moved_along
from ballpass.derive.lowering.mass_matrix import accelerations
from ballpass.derive.lowering.visitor import Visitor
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
    """Kernels of a model.

    Attributes
    ----------
    stage_size, relative_size : entries of w and r
    angles : entries of the angles of `turned`, which evaluate w for many times close to each other: an angle that
        grows by little needs no sine of its own
    slopes : entries of G
    functions : of a single time, and of a single state
    turned : stages from the cosines and sines of their angles
    tangents : directional derivatives of the functions, for sensitivities
    stage_slopes : what these share for the stages, of `stage_slopes_size` entries
    bearings : kernels of the balls
    structures : numbers of the bearings whose kernels are the same, and of those that share them with no other
    windows : (t, x, u, p, c) -> g, rate of the windows of angles that are functions of the state, -> these angles and
        edges, and -> J, derivatives of the angles by the states (row-major); none without
    stops : (t, x, u, p, c) -> g, rate of the stops, and -> J, derivatives of g by the states (row-major); none without
    """

    stage_size: int
    relative_size: int
    angles: int
    slopes: int
    stage_slopes_size: int
    functions: tuple[Kernel, ...]
    turned: tuple[Kernel, ...]
    tangents: tuple[Kernel, ...]
    stage_slopes: Kernel
    bearings: tuple[BallKernels, ...]
    structures: tuple[tuple[int, ...], ...]
    windows: tuple[Kernel, ...] = ()
    stops: tuple[Kernel, ...] = ()

    def __getitem__(self, name: str) -> Kernel:
        for kernel in (*self.functions, *self.turned, *self.tangents):
            if kernel.function.name() == name:
                return kernel
        raise KeyError(name)


class KernelBuilder:
    """Builds the kernels' expressions first, so that their constants join c; functions afterwards, when c is known.

    Parameters
    ----------
    visit : visitor of run-time functions
    constant : symbols that do not change during a run
    arguments : symbols of t, x, u, p, by name
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
        self._system = system
        self._visit = visit
        self._arguments = arguments
        self._stage: dict[sp.Basic, ca.SX] = {}
        timed = constant | {TIME} | {i.symbol for i in system.inputs}
        self._definitions = definitions
        self._of_state = Visitor(values, definitions, constant=timed, hoist=self._hoist)
        steady = Visitor(values, definitions, constant=timed - {TIME})
        states = [s.symbol for s in system.states]

        def of_all(hoist: Callable[[sp.Expr], ca.SX], leaves: dict[sp.Symbol, ca.SX]) -> Visitor:
            return Visitor({**values, **leaves}, definitions, constant=timed | frozenset(states), hoist=hoist)

        self._balls = [
            BallBuilder(bearing, visit, self._of_state, of_all, lambda e: not steady.is_constant(e), states)
            for bearing in system.bearings
        ]
        self._windows = [
            [*map(visit, (s.function, s.rate, s.angle, *(sp.Symbol(e, real=True) for e in s.border.windows[0])))]
            for s in system.switches
            if s.angle is not None
        ]
        self._stops = [[visit(e) for e in (s.function, s.rate)] for s in system.switches if s.angle is None]
        self._bodies = self._build()

    def _hoist(self, expression: sp.Basic) -> ca.SX:
        """A stage variable, unless the expression is a constant of the run."""
        if self._visit.is_constant(expression):
            return self._visit(expression)
        if isinstance(expression, sp.Mul) and len(self._system.bearings) > 1:
            fixed, (moving, *more) = sift(expression.args, self._visit.is_constant, binary=True)
            if fixed and not more and moving.is_Symbol:  # a load that bearings share is one stage variable
                return self._visit(sp.Mul(*fixed)) * self._hoist(moving)
        if expression not in self._stage:
            self._stage[expression] = ca.SX.sym(f"w{len(self._stage)}")
        return self._stage[expression]

    def _build(self) -> list[Body]:
        system = self._system
        n, x, t = len(system.coordinates), self._arguments["x"], self._arguments["t"]
        bearings = system.bearings
        rings = ca.vertcat(*(b.relative for b in self._balls))
        counts = [len(b.ball.sums) for b in bearings]
        sums = ca.SX.sym("S", sum(counts))
        known = {s.symbol: sums[k] for k, s in enumerate(s for b in bearings for s in b.ball.sums)}
        shared = self._shared()
        held = ca.SX.sym("r", rings.numel() + len(shared))
        known |= {symbol: held[rings.numel() + k] for k, symbol in enumerate(shared)}
        definitions = {k: v for k, v in self._definitions.items() if k not in known} if shared else system.late
        found = accelerations(system, self._of_state.child(known, definitions))
        balance = found.residual
        relative = ca.vertcat(rings, *(self._of_state(symbol) for symbol in shared))
        g = ca.SX.sym("G", sum(b.slopes for b in self._balls))
        parts = [
            ca.vertsplit(v, [*accumulate(sizes, initial=0)])
            for v, sizes in (
                (sums, counts),
                (g, [b.slopes for b in self._balls]),
                (held[: rings.numel()], [b.relative.numel() for b in self._balls]),
            )
        ]
        by_rings = ca.diagcat(*(b.by_relative(*of) for b, *of in zip(self._balls, *parts, strict=True)))
        by_sums = ca.jacobian(balance, sums)
        by_relative = ca.jacobian(balance, held) + by_sums @ ca.horzcat(by_rings, ca.SX(by_rings.size1(), len(shared)))
        by_state = found.solve(ca.jacobian(balance, x) + by_relative @ ca.jacobian(relative, x))
        own_rate = ca.vertcat(*(b.by_time(totals) for b, totals in zip(self._balls, parts[1], strict=True)))
        w = ca.vertcat(*self._stage.values())
        wt = ca.SX.sym("wt", w.numel())
        # along one direction: the matrices above would cost four times as many operations
        moved = ca.jtimes(relative, w, wt)
        own_rate += by_rings @ moved[: rings.numel()]
        by_time = found.solve(ca.jtimes(balance, ca.vertcat(w, held, sums), ca.vertcat(wt, moved, own_rate)))
        stage = ca.vertcat(*(self._visit(e) for e in self._stage))
        state = {k: self._arguments[k] for k in "up"} | {"c": ca.SX(0, 1)}
        tail = {**state, "w": w}
        seen = [self._visit(angle) for b in bearings for angle in (b.ball.cage.in_outer, b.ball.cage.in_inner)]
        return [
            (
                "stage",
                {"t": t, **state},
                {"w": stage},
                "Once per stage time: cages' directions, loads, all else without the state",
            ),
            (
                "stage_rate",
                {"t": t, **state},
                {"w": stage, "wt": ca.jacobian(stage, t)},
                "Stage variables and their time derivatives",
            ),
            (
                "relative",
                {"x": x, **tail},
                {"r": relative},
                "Of each bearing: delta = r0 + r1 cos + r2 sin, rate = r3 cos + r4 sin, cos and sin of the cage; then "
                "what accelerations need of the same",
            ),
            (
                "acceleration",
                {"x": x, "S": sums, "r": held, **tail},
                {"a": found.value},
                "Accelerations from the sums over the balls",
            ),
            (
                "acceleration_jacobian",
                {"x": x, "S": sums, "G": g, "r": held, **tail},
                {"A": by_state[:, :n].T, "B": by_state[:, n:].T},
                "Derivatives of the accelerations by positions and velocities, row-major",
            ),
            (
                "acceleration_rate",
                {"x": x, "S": sums, "G": g, "r": held, **tail, "wt": wt},
                {"at": by_time},
                "Partial time derivative of the accelerations at fixed state",
            ),
            (
                "passes",
                {"t": t, "x": x, **state},
                {"a": ca.vertcat(*seen)},
                "Of each bearing: angle of ball 1 as the outer and the inner ring see it",
            ),
        ]

    def _shared(self) -> list[sp.Symbol]:
        """Definitions of the state that both the relative motion of the rings and the accelerations use."""
        if not self._system.late:
            return []
        states = {s.symbol for s in self._system.states}

        def used(expressions: Iterable[sp.Expr]) -> set[sp.Symbol]:
            found: set[sp.Symbol] = set()
            waiting = [sp.sympify(e) for e in expressions]
            while waiting:
                for symbol in waiting.pop().free_symbols - found:
                    found.add(symbol)
                    if symbol in self._definitions:
                        waiting.append(sp.sympify(self._definitions[symbol]))
            return found

        balls = [b.ball for b in self._system.bearings]
        moving = used(
            e for ball in balls for e in (ball.cage.angle, ball.cage.rate, ball.cage.ring_rate) if e is not None
        )
        both = moving & used([*self._system.mass, *self._system.forcing])
        return [s for s in self._definitions if s in both and used([s]) & states]

    def kernels(self, c: ca.SX) -> Kernels:
        """The functions, once the vector of derived constants is complete."""
        functions = [
            _kernel(name, {**takes, **({"c": c} if "c" in takes else {})}, gives, words)
            for name, takes, gives, words in self._bodies
        ]
        named = {k.function.name(): k for k in functions}
        windows = self._of_switches("windows", self._windows, c)
        w = ca.vertcat(*self._stage.values())
        bearings = tuple(ball.kernels(c, self._arguments["p"], w) for ball in self._balls)
        angles, turned, stage_slopes, stage_moved = _turned(named["stage"].function)
        return Kernels(
            stage_size=len(self._stage),
            relative_size=named["relative"].function.size1_out(0),
            angles=angles.function.size1_out(0),
            slopes=sum(b.slopes for b in bearings),
            stage_slopes_size=stage_slopes.function.size1_out(1),
            functions=(*functions, angles, _needed(named["stage"].function, named["relative"].function, bearings)),
            turned=turned,
            tangents=(
                *(_tangent(named[name]) for name in _TANGENTS),
                stage_moved,
                *(_tangent(kernel, ["g"]) for kernel in windows[:1]),
            ),
            stage_slopes=stage_slopes,
            bearings=bearings,
            structures=self._structures(bearings),
            windows=windows,
            stops=self._of_switches("stops", self._stops, c),
        )

    def _structures(self, bearings: Sequence[BallKernels]) -> tuple[tuple[int, ...], ...]:
        found: dict[tuple[object, ...], list[int]] = {}
        for k, (scene, kernels) in enumerate(zip(self._system.scene.bearings, bearings, strict=True)):
            found.setdefault((scene.element, *kernels.structure), []).append(k)
        return tuple(map(tuple, found.values()))

    def _of_switches(self, name: str, rows: Sequence[Sequence[ca.SX]], c: ca.SX) -> tuple[Kernel, ...]:
        """Functions and rates of the rows, of windows angles and edges, and derivatives by the states; none of none."""
        if not rows:
            return ()
        takes = {**{k: self._arguments[k] for k in "txup"}, "c": c}
        g, rate, *window = (ca.vertcat(*column) for column in zip(*rows, strict=True))
        found = [_kernel(name, takes, {"g": g, "rate": rate}, f"Switching functions of {name}, and their rates")]
        moving, words = g, "switching functions"
        if window:
            moving, words = window[0], "angles"
            edges = dict(zip(("angle", "start", "end"), window, strict=True))
            found.append(_kernel("window_edges", takes, edges, "Angles of windows, and their edges"))
        slopes, words = ca.vec(ca.jacobian(moving, takes["x"]).T), f"Derivatives of the {words} of {name} by the states"
        return (*found, _kernel(f"{name}_by_state", takes, {"J": slopes}, words))


def _kernel(name: str, takes: Mapping[str, ca.SX], gives: Mapping[str, ca.SX], words: str) -> Kernel:
    """A kernel with dense results that share their common subexpressions."""
    results = ca.cse([ca.densify(ca.SX(value)) for value in gives.values()])
    return Kernel(function=ca.Function(name, [*takes.values()], results, [*takes], [*gives]), description=words)


def _needed(stage: ca.Function, relative: ca.Function, bearings: tuple[BallKernels, ...]) -> Kernel:
    """``cage``: the stage variables that deflections need; the other entries of w are zero."""
    arguments = arguments_of(stage)
    w = stage(*arguments.values())
    rows, columns = relative.jac_sparsity(0, relative.name_in().index("w")).get_triplet()
    deflecting = sum(bearing.relative for bearing in bearings)
    needed = {column for row, column in zip(rows, columns, strict=True) if row < deflecting}
    for bearing in bearings:
        needed |= {place for kind, place in bearing.taken if kind == "w"}
    kept = ca.vertcat(*(w[k] if k in needed else ca.SX(0.0) for k in range(w.numel())))
    return _kernel("cage", arguments, {"w": kept}, "Stage of deflections")


def _turned(stage: ca.Function) -> tuple[Kernel, tuple[Kernel, ...], Kernel, Kernel]:
    """The angles of a stage, the stage from their cosines and sines, its derivatives, and these along a direction.

    Sines and cosines whose arguments are linear in time are taken out; others stay where they are.
    """
    symbols = arguments_of(stage)
    t = symbols["t"]
    angles: list[ca.SX] = []
    cosines: list[ca.SX] = []
    sines: list[ca.SX] = []
    work: dict[int, ca.SX] = {}
    w = ca.SX(stage.size1_out(0), 1)

    def place(angle: ca.SX) -> int | None:
        """Number of an angle; None where it is no linear function of time."""
        taken = ca.vertcat(*cosines, *sines)  # of which the angle of a body that swings is a function, as of time
        if not ca.depends_on(angle, t) or ca.depends_on(ca.jacobian(angle, t), t) or ca.depends_on(angle, taken):
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
    words = "from cosines and sines of its angles"
    takes = {"C": cosine, "S": sine, **symbols}
    # the angles move with inputs, parameters and constants as well
    moving = {name: symbols[name] for name in ("t", "u", "p", "c")}
    seeds = ca.vertcat(*moving.values())
    by_angle = ca.jacobian(w, sine) @ ca.diag(cosine) - ca.jacobian(w, cosine) @ ca.diag(sine)
    slopes = ca.jacobian(w, seeds) + by_angle @ ca.jacobian(angle, seeds)
    entries: ca.SX = slopes.nz[:]
    known = ca.SX.sym("J", entries.numel())
    along = {f"{name}_d": ca.SX.sym(f"{name}_d", moving[name].numel()) for name in moving}
    change = ca.SX(slopes.sparsity(), known) @ ca.vertcat(*along.values())
    rated = f"Stage variables and their time derivatives {words}"
    sloped = f"Stage variables {words}, and their derivatives by t, u, p, c"
    return (
        _kernel("angles", symbols, {"a": angle, "at": rate}, "Angles of a stage and their rates"),
        (
            _kernel("stage_turned", takes, {"w": w}, f"Stage variables {words}"),
            _kernel("stage_rate_turned", {"C": cosine, "S": sine, "at": turning, **symbols}, {"w": w, "wt": wt}, rated),
        ),
        _kernel("stage_slopes", takes, {"w": w, "J": entries}, sloped),
        _kernel("stage_moved", {"J": known, **along}, {"w_d": change}, "Stage variables"),
    )


#: Kernels with directional derivatives, for sensitivities.
_TANGENTS = ("stage_rate", "relative", "acceleration", "acceleration_jacobian", "acceleration_rate")


def _tangent(kernel: Kernel, results: Sequence[str] = ()) -> Kernel:
    """Derivative of a kernel's results, or of some, along a direction of its arguments, named ``x_d`` for ``x``."""
    function = kernel.function
    given, name = arguments_of(function), function.name()
    values = dict(zip(function.name_out(), function.call([*given.values()], True, False), strict=True))
    made = moved_along(f"{name}_tangent", given, {k: values[k] for k in results or values})
    return Kernel(function=made, description=f"Directional derivative of {name}")
