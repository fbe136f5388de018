"""From mathematics to functions: a `System` lowered to named CasADi functions.

In: a `System`.  Out: `Functions`, each with named inputs out of ``t, x, u, p, c`` (see `ballpass.runtime.contract`)
and named outputs.

Whatever depends on parameters only goes into ``constants(p) -> c``, evaluated once a run: the named constants of
the system first, then
the subexpressions the visitor found.  Derivatives are CasADi's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import casadi as ca
import sympy as sp

from ballpass.derive.bearing.equations import BearingModel
from ballpass.derive.lowering.jacobians import Described, group_functions, partials, tangent
from ballpass.derive.lowering.kernels import KernelBuilder, Kernels
from ballpass.derive.lowering.mass_matrix import accelerations
from ballpass.derive.lowering.visitor import Visitor
from ballpass.derive.system import System
from ballpass.derive.terms import TIME
from ballpass.derive.variables import Output
from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.manifest import VariableInfo
from ballpass.runtime.show.short import ShortRepr

#: What no compiled run calls.
_EQUATIONS = ("rhs", "mass_matrix")

#: A visitor for each ball of each bearing, by the bearing's prefix.
Balls = dict[str, list[Visitor]]

#: Quantities that are differentiated, by the name of the function that has them one below the other.
Groups = dict[str, tuple[Output, ...]]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoweredFunctions(ShortRepr):
    """Named functions in the order they are written, with a line for people each.

    `constants` are the vector c: named constants of the system, and subexpressions of parameters (``h1``, ``h2`` ...).
    `equations` and `jacobians` go to files of their own, read and compiled when one of them is first asked for: the
    stepper has the right-hand side in its kernels.  `groups` says which quantities are differentiated.
    """

    constants: tuple[VariableInfo, ...]
    functions: tuple[Described, ...]
    equations: tuple[Described, ...]
    jacobians: tuple[Described, ...]
    groups: Groups
    kernels: Kernels | None

    def __getitem__(self, name: str) -> ca.Function:
        for function, _ in (*self.functions, *self.equations, *self.jacobians):
            if function.name() == name:
                return function
        raise KeyError(name)


@typed
def lower(
    system: System, *, extra: Mapping[str, Mapping[str, sp.Expr]] | None = None, derivatives: bool = True
) -> LoweredFunctions:
    """Lower a system.

    Parameters
    ----------
    derivatives : whether `Functions.jacobians` are wanted
    extra : further functions, name -> output name -> expression over the system's symbols (used to check derivations)

    Examples
    --------
    >>> functions = lower(derive(read_scene("scenes/rotor.toml")))
    >>> functions["rhs"].name_in()  # of CasADi
    ['t', 'x', 'u', 'p', 'c']
    """
    return _Lowering(system).functions(extra or {}, derivatives=derivatives)


def operations(function: ca.Function) -> int:
    """Arithmetic operations of an SX function: its instructions without inputs, outputs and constants."""
    idle = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
    return sum(function.instruction_id(k) not in idle for k in range(function.n_instructions()))


def output_field(name: str) -> str:
    """CasADi name of an output: dots become underscores."""
    return name.replace(".", "_")


class _Lowering:
    """One pass over one system; holds the vectors and the constants found on the way."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.t = ca.SX.sym("t")
        self.x = ca.SX.sym("x", len(system.states))
        self.u = ca.SX.sym("u", len(system.inputs))
        self.p = ca.SX.sym("p", len(system.parameters))
        self._named = [ca.SX.sym(d.symbol.name) for d in system.constants]
        self._hoisted: dict[sp.Basic, ca.SX] = {}
        parameters = {p.symbol: self.p[k] for k, p in enumerate(system.parameters)}
        constants = dict(zip((d.symbol for d in system.constants), self._named, strict=True))
        definitions = {d.symbol: d.expression for d in system.definitions}
        # evaluates constants: parameters are free, constants are definitions, nothing is hoisted
        self.once = Visitor(parameters, definitions | {d.symbol: d.expression for d in system.constants})
        self._values = (
            {TIME: self.t}
            | {s.symbol: self.x[k] for k, s in enumerate(system.states)}
            | {i.symbol: self.u[k] for k, i in enumerate(system.inputs)}
            | parameters
            | constants
        )
        self._definitions = definitions
        self._late = system.late
        self._fixed = frozenset(parameters) | frozenset(constants)
        self.visit = Visitor(self._values, definitions, constant=self._fixed, hoist=self._hoist)

    def _hoist(self, expression: sp.Basic) -> ca.SX:
        if expression not in self._hoisted:
            self._hoisted[expression] = ca.SX.sym(f"h{len(self._hoisted) + 1}")
        return self._hoisted[expression]

    # the functions

    def functions(self, extra: Mapping[str, Mapping[str, sp.Expr]], *, derivatives: bool) -> LoweredFunctions:
        system, definitions = self.system, self._definitions
        bodies: list[tuple[str, dict[str, ca.SX], str]] = []
        balls = self._balls(self.visit)
        if system.coordinates:
            bodies.append(("rhs", {"xdot": self._rhs(balls)}, "time derivative of the states"))
            size = len(system.coordinates)
            mass = ca.vertcat(*(self.visit(entry) for entry in system.mass.T))
            bodies.append(
                ("mass_matrix", {"M": ca.reshape(mass, size, size)}, "mass matrix of the equations of motion")
            )
        if system.outputs:
            bodies.append(("outputs", self._outputs(balls), "outputs of the scene"))
        if system.bearings:
            turned = [self.visit(bearing.ball.cage.angle) for bearing in system.bearings]
            bodies.append(("cages", {"angles": ca.vertcat(*turned)}, "angle of ball 1 of each bearing [rad]"))
        windows = [s for s in system.switches if s.angle is not None]
        if windows:
            beyond = [s.angle - sp.Symbol(edge, real=True) for s in windows for edge in s.border.windows[0]]
            turning = [s.turning for s in windows for _ in s.border.windows[0]]
            results = {"distance": ca.vertcat(*map(self.visit, beyond)), "rate": ca.vertcat(*map(self.visit, turning))}
            bodies.append(("windows", results, "angles beyond the edges of windows [rad], and their rates"))
        if system.linkage is not None:
            coordinates = [self.visit(e) for point in system.linkage.points for e in (point.x, point.y)]
            # of the ideal linkage: joints without play
            closed = {c.position: ca.SX(0.0) for c in system.coordinates if c.kind == "displacement"}
            ideal = self.visit.child(closed, definitions) if system.linkage.play else self.visit
            margins = [ideal(m.expression) for m in system.linkage.margins]
            bodies += [
                ("geometry", {"points": ca.vertcat(*coordinates)}, "coordinates of all points and centres of mass [m]"),
                ("assembly", {"margins": ca.vertcat(*margins)}, "positive while each dyad can be assembled"),
            ]
            if system.linkage.play:
                played = ca.vertcat(*(self.visit(m.expression) for m in system.linkage.margins))
                bodies.append(("assembly_with_play", {"margins": played}, "the same where joints have play"))
        if system.reactions is not None:
            reactions, visit = system.reactions, self._moving(self.visit, balls)
            rows, columns = reactions.matrix.shape
            matrix = ca.SX(rows, columns)
            for (i, j), entry in sorted(reactions.matrix.todok().items()):
                matrix[i, j] = visit(entry)
            right = ca.vertcat(*(visit(e) for e in reactions.right_side))
            solution = ca.vertcat(*(visit(s) for s in reactions.unknowns))
            bodies.append(
                ("reaction_system", {"A": matrix, "b": right, "r": solution}, "Eq. (1): A r = b and its solution r")
            )
        for name, outputs in extra.items():
            bodies.append((name, {k: self.visit(e) for k, e in outputs.items()}, "asked for on the side"))

        builder = None  # no stepper where no coordinate moves
        if system.coordinates:
            builder = KernelBuilder(
                system,
                self.visit,
                values=self._values,
                definitions=definitions,
                constant=self._fixed,
                arguments={"t": self.t, "x": self.x, "u": self.u, "p": self.p},
            )
        # whatever is hoisted must be known before the vector of constants is closed
        contacts = [self._contact(bearing) for bearing in system.bearings]
        c, once = self._constants()
        arguments = {"t": self.t, "x": self.x, "u": self.u, "p": self.p, "c": c}
        made: list[Described] = [
            (ca.Function("constants", [self.p], [ca.cse(once)], ["p"], ["c"]), "derived constants, once a run"),
        ]
        slopes = ca.Function("constants_jac", [self.p], [ca.cse(ca.jacobian(once, self.p))], ["p"], ["c_p"])
        equations: list[Described] = [(slopes, "derivative of the constants by the parameters")]
        for name, (delta, rate, forces) in zip((b.names.prefix for b in system.bearings), contacts, strict=True):
            function = ca.Function(
                output_field(f"{name}contact"),
                [delta, rate, self.p, c],
                forces,
                ["delta", "delta_rate", "p", "c"],
                ["elastic_force", "damping_force"],
            )
            made.append((function, "elastic and damping force of one ball [N]"))
        for name, results, words in bodies:
            takes = {k: v for k, v in arguments.items() if k in ("u", "p", "c") or _uses(results, v)}
            called = name not in _EQUATIONS
            values = ca.cse([*results.values()]) if called else [*results.values()]
            function = ca.Function(name, [*takes.values()], values, [*takes], [*results])
            (made if called else equations).append((function, words))
            if name == "rhs":  # the choice of a method needs these two
                equations += partials(name, "xdot", results["xdot"], arguments, "xt")
        rhs = bodies[0][1]["xdot"] if system.coordinates else None
        groups, jacobians = self._jacobians(rhs, arguments) if derivatives else ({}, [])
        named = [
            VariableInfo(name=d.symbol.name, unit=d.unit, description=d.description, latex=d.latex)
            for d in system.constants
        ]
        found = [VariableInfo(name=f"h{k}", unit="", description=str(e)) for k, e in enumerate(self._hoisted, start=1)]
        return LoweredFunctions(
            constants=(*named, *found),
            functions=tuple(made),
            equations=tuple(equations),
            jacobians=tuple(jacobians),
            groups=groups,
            kernels=builder.kernels(c) if builder else None,
        )

    def _adding_nothing(self) -> Visitor:
        """A visitor that uses the constants there are and adds none: what it alone would hoist is computed in place."""
        plain = Visitor(self._values, self._definitions)
        return Visitor(
            self._values,
            self._definitions,
            constant=self._fixed,
            hoist=lambda e: self._hoisted[e] if e in self._hoisted else plain(e),
        )

    def _constants(self) -> tuple[ca.SX, ca.SX]:
        """The vector c of symbols, and its value as an expression of p."""
        symbols = ca.vertcat(*self._named, *self._hoisted.values())
        values = ca.vertcat(
            *(self.once(d.symbol) for d in self.system.constants), *(self.once(e) for e in self._hoisted)
        )
        return ca.SX(symbols), ca.SX(values)

    def _jacobians(self, rhs: ca.SX | None, arguments: Mapping[str, ca.SX]) -> tuple[Groups, list[Described]]:
        """Derivatives of the right-hand side and of every quantity, also of those that no run reports.

        They use the constants there are and add none.
        """
        system = self.system
        visit = self._adding_nothing()
        balls = self._balls(visit)
        made: list[Described] = []
        if rhs is not None:
            made += [*partials("rhs", "xdot", rhs, arguments, "upc"), tangent("rhs", "xdot", rhs, arguments)]
        values = [*zip(system.quantities, self._values_of(system.quantities, balls, visit), strict=True)]
        groups: Groups = {}
        for name, moving in (("ring_quantities", True), ("load_quantities", False)):
            chosen = [(q, v) for q, v in values if _uses({q.name: v}, self.x) == moving]
            if chosen:
                groups[name] = tuple(q for q, _ in chosen)
                made += group_functions(name, [v for _, v in chosen], arguments)
        if system.bearings:
            made += group_functions("static_forces", self._static_forces(visit), arguments)
        return groups, made

    def _static_forces(self, visit: Visitor) -> list[ca.SX]:
        """Net force along each coordinate with everything at rest: no damping force, no velocities."""
        at_rest = {c.velocity: sp.S.Zero for c in self.system.coordinates}
        undamped = {b.ball.force: b.ball.elastic_force for b in self.system.bearings}
        net = visit.child(self._sums(self._balls(visit, undamped)), self._late)
        return [net(force.subs(at_rest)) for force in self.system.forcing]

    def _balls(self, visit: Visitor, instead: Mapping[sp.Symbol, sp.Expr] | None = None) -> Balls:
        """A visitor for each ball, by its bearing's prefix: one sine and cosine of the cage's angle, angle addition for
        the rest.

        `instead` replaces definitions of the balls.
        """
        out: Balls = {}
        for bearing in self.system.bearings:
            ball = bearing.ball
            cage = visit(ball.cage.angle)
            sine, cosine = ca.sin(cage), ca.cos(cage)
            definitions = {d.symbol: d.expression for d in ball.definitions} | dict(instead or {})
            out[bearing.names.prefix] = []
            for j in range(ball.count):
                spacing = sp.Rational(2 * j, ball.count) * sp.pi
                c, s = float(sp.cos(spacing)), float(sp.sin(spacing))
                direction = {ball.cos: c * cosine - s * sine, ball.sin: s * cosine + c * sine}
                out[bearing.names.prefix].append(visit.child(direction, definitions))
        return out

    def _sums(self, balls: Balls) -> dict[sp.Symbol, ca.SX]:
        """Sums over the balls, Eqs. (8) and (9)."""
        totals = {}
        for bearing in self.system.bearings:
            for total in bearing.ball.sums:
                terms = [ball(total.expression) for ball in balls[bearing.names.prefix]]
                totals[total.symbol] = reduce(add, terms)
        return totals

    def _moving(self, visit: Visitor, balls: Balls) -> Visitor:
        """A visitor that knows the sums over the balls, and the accelerations where anything uses them."""
        sums = self._sums(balls)
        every = [one for o in self.system.outputs for one in (o, *o.parts)]
        used = {symbol for o in every for symbol in o.expression.free_symbols}
        if not self._late and used.isdisjoint(c.acceleration for c in self.system.coordinates):
            return visit.child(sums, {})
        found = accelerations(self.system, visit.child(sums, self._late)).value
        named = {c.acceleration: found[k] for k, c in enumerate(self.system.coordinates)}
        return visit.child({**sums, **named}, self._late)

    def _rhs(self, balls: Balls) -> ca.SX:
        """Velocities, then mass^-1 forcing."""
        visit = self.visit.child(self._sums(balls), self._late)
        return ca.vertcat(self.x[len(self.system.coordinates) :], accelerations(self.system, visit).value)

    def _outputs(self, balls: Balls) -> dict[str, ca.SX]:
        outputs = self.system.outputs
        names = (output_field(output.name) for output in outputs)
        return dict(zip(names, self._values_of(outputs, balls, self.visit), strict=True))

    def _values_of(self, outputs: Sequence[Output], balls: Balls, visit: Visitor) -> list[ca.SX]:
        """A number or a column with a row for each ball, for each output."""
        visit = self._moving(visit, balls)

        def value(output: Output) -> ca.SX:
            if not (output.per_ball or output.over_balls):
                return reduce(add, (value(part) for part in output.parts), visit(output.expression))
            each = [ball(output.expression) for ball in balls[output.balls_of]]
            return ca.vertcat(*each) if output.per_ball else reduce(add, each)

        return [value(output) for output in outputs]

    def _contact(self, bearing: BearingModel) -> tuple[ca.SX, ca.SX, list[ca.SX]]:
        """Elastic and damping force of one ball over deflection [m] and its rate [m/s]."""
        ball = bearing.ball
        delta, rate = ca.SX.sym("delta"), ca.SX.sym("delta_rate")
        definitions = {d.symbol: d.expression for d in ball.definitions}
        visit = self.visit.child({ball.deflection: delta, ball.deflection_rate: rate}, definitions)
        damping = visit(ball.damping_force) if ball.damping_force is not None else ca.SX(0.0)
        return delta, rate, [visit(ball.elastic_force), damping]


def _uses(results: Mapping[str, ca.SX], argument: ca.SX) -> bool:
    return any(ca.depends_on(r, argument) for r in results.values()) if argument.numel() else False
