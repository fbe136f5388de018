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

import casadi as ca
import sympy as sp

from ballpass.derive.bearing.equations import Ball
from ballpass.derive.bearing.load_harmonics import coefficients_of
from ballpass.derive.lower.jacobians import Described, Group, group_functions, partials, tangent
from ballpass.derive.lower.kernels import KernelBuilder, Kernels
from ballpass.derive.lower.switch_kernels import SwitchKernels, switch_kernels
from ballpass.derive.lower.visitor import Visitor
from ballpass.derive.system import System
from ballpass.derive.terms import TIME
from ballpass.derive.variables import Output


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """Entry of the vector c: a named constant of the system, or a subexpression of parameters (name ``h1``, ``h2``
    ...)."""

    name: str
    unit: str
    description: str
    latex: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Functions:
    """Named functions in the order they are written, with a line for people each.

    `jacobians` go to files of their own, read and compiled when a derivative is first asked for; `groups` says which
    quantities they differentiate.  `switches` are None where the laws have no kinks.
    """

    constants: tuple[Constant, ...]
    functions: tuple[Described, ...]
    jacobians: tuple[Described, ...]
    groups: tuple[Group, ...]
    kernels: Kernels | None
    switches: SwitchKernels | None

    def __getitem__(self, name: str) -> ca.Function:
        for function, _ in (*self.functions, *self.jacobians):
            if function.name() == name:
                return function
        raise KeyError(name)


def lower(system: System, *, extra: Mapping[str, Mapping[str, sp.Expr]] | None = None) -> Functions:
    """Lower a system.

    Parameters
    ----------
    extra : further functions, name -> output name -> expression over the system's symbols (used to check derivations)
    """
    return _Lowering(system).functions(extra or {})


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
        series = system.load_series
        self._coefficients = {k.symbol: ca.SX.sym(k.symbol.name) for k in series.coefficients} if series else {}
        constants = dict(zip((d.symbol for d in system.constants), self._named, strict=True)) | self._coefficients
        definitions = {d.symbol: d.expression for d in system.definitions}
        # evaluates constants: parameters are free, constants are definitions, nothing is hoisted
        self.once = Visitor(
            parameters | self._coefficients, definitions | {d.symbol: d.expression for d in system.constants}
        )
        self._values = (
            {TIME: self.t}
            | {s.symbol: self.x[k] for k, s in enumerate(system.states)}
            | {i.symbol: self.u[k] for k, i in enumerate(system.inputs)}
            | parameters
            | constants
        )
        self._definitions = definitions
        self._fixed = frozenset(parameters) | frozenset(constants)
        self.visit = Visitor(self._values, definitions, constant=self._fixed, hoist=self._hoist)

    def _hoist(self, expression: sp.Basic) -> ca.SX:
        if expression not in self._hoisted:
            self._hoisted[expression] = ca.SX.sym(f"h{len(self._hoisted) + 1}")
        return self._hoisted[expression]

    # the functions

    def functions(self, extra: Mapping[str, Mapping[str, sp.Expr]]) -> Functions:
        system = self.system
        bodies: list[tuple[str, dict[str, ca.SX], str]] = []
        balls = self._balls(system.bearing.ball, self.visit) if system.bearing else None
        if system.states:
            bodies.append(("rhs", {"xdot": self._rhs(balls)}, "time derivative of the states"))
        if system.outputs:
            bodies.append(("outputs", self._outputs(balls), "outputs of the scene"))
        if system.linkage is not None:
            coordinates = [self.visit(e) for point in system.linkage.points for e in (point.x, point.y)]
            margins = [self.visit(m.expression) for m in system.linkage.margins]
            bodies += [
                ("geometry", {"points": ca.vertcat(*coordinates)}, "coordinates of all points and centres of mass [m]"),
                ("assembly", {"margins": ca.vertcat(*margins)}, "positive while each dyad can be assembled"),
            ]
        if system.reactions is not None:
            reactions = system.reactions
            rows, columns = reactions.matrix.shape
            matrix = ca.SX(rows, columns)
            for (i, j), entry in sorted(reactions.matrix.todok().items()):
                matrix[i, j] = self.visit(entry)
            right = ca.vertcat(*(self.visit(e) for e in reactions.right_side))
            solution = ca.vertcat(*(self.visit(s) for s in reactions.unknowns))
            bodies.append(
                ("reaction_system", {"A": matrix, "b": right, "r": solution}, "Eq. (1): A r = b and its solution r")
            )
        for name, outputs in extra.items():
            bodies.append((name, {k: self.visit(e) for k, e in outputs.items()}, "asked for on the side"))

        builder = self._kernel_builder() if system.states else None
        c, once = self._constants()
        arguments = {"t": self.t, "x": self.x, "u": self.u, "p": self.p, "c": c}
        made: list[Described] = [
            (self._function_of_p("constants", once, "c"), "derived constants, once a run"),
            (
                self._function_of_p("constants_jac", once, "c_p", differentiated=True),
                "derivative of the constants by the parameters",
            ),
        ]
        if system.bearing is not None:
            made.append((self._contact(c), "elastic and damping force of one ball [N]"))
        for name, results, words in bodies:
            takes = {k: v for k, v in arguments.items() if k in ("u", "p", "c") or _uses(results, v)}
            made.append((ca.Function(name, [*takes.values()], [*results.values()], [*takes], [*results]), words))
            if name == "rhs":  # the choice of a method needs these two
                made += partials(name, "xdot", results["xdot"], arguments, "xt")
        rhs = bodies[0][1]["xdot"] if system.states else None
        groups, jacobians = self._jacobians(rhs, arguments)
        named = [
            Constant(name=d.symbol.name, unit=d.unit, description=d.description, latex=d.latex)
            for d in system.constants
        ]
        found = [Constant(name=f"h{k + 1}", unit="", description=str(e), latex="") for k, e in enumerate(self._hoisted)]
        kernels = builder.kernels(c) if builder else None
        return Functions(
            constants=(*named, *found, *self._series_constants()),
            functions=tuple(made),
            jacobians=tuple(jacobians),
            groups=tuple(groups),
            kernels=kernels,
            switches=self._switches(c, kernels) if kernels is not None else None,
        )

    def _switches(self, c: ca.SX, kernels: Kernels) -> SwitchKernels | None:
        assert self.system.bearing is not None
        numbers = next(k.function for k in kernels.functions if k.function.name() == "law_numbers")
        return switch_kernels(self.system.bearing.ball, self._adding_nothing(), self.p, c, numbers)

    def _adding_nothing(self) -> Visitor:
        """A visitor that uses the constants there are and adds none: what it alone would hoist is computed in place."""
        plain = Visitor(self._values, self._definitions)
        return Visitor(
            self._values,
            self._definitions,
            constant=self._fixed,
            hoist=lambda e: self._hoisted[e] if e in self._hoisted else plain(e),
        )

    def _kernel_builder(self) -> KernelBuilder:
        return KernelBuilder(
            self.system,
            self.visit,
            values=self._values,
            definitions=self._definitions,
            constant=self._fixed,
            arguments={"t": self.t, "x": self.x, "u": self.u, "p": self.p, "c": ca.SX(0, 1)},
        )

    def _constants(self) -> tuple[ca.SX, ca.SX]:
        """The vector c of symbols, and its value as an expression of p."""
        symbols = ca.vertcat(*self._named, *self._hoisted.values(), *self._coefficients.values())
        values = ca.vertcat(
            *(self.once(d.symbol) for d in self.system.constants),
            *(self.once(e) for e in self._hoisted),
            *self._coefficients.values(),
        )
        return ca.SX(symbols), ca.SX(values)

    def _function_of_p(self, name: str, once: ca.SX, result: str, *, differentiated: bool = False) -> ca.Function:
        """The constants, or their derivative, by the parameters; a load series' coefficients by loops of their own."""
        series = self.system.load_series
        if series is None:
            value = ca.jacobian(once, self.p) if differentiated else once
            return ca.Function(name, [self.p], [value], ["p"], [result])
        parameters = {p.symbol: self.p[k] for k, p in enumerate(self.system.parameters)}
        given = self._definitions | {d.symbol: d.expression for d in self.system.constants}
        del given[series.angle]
        coefficients = coefficients_of(series, parameters, self.p, given, differentiated=False)
        k, p = ca.vertcat(*self._coefficients.values()), ca.MX.sym("p", self.p.numel())
        if not differentiated:
            rest = ca.Function("constants_of", [self.p, k], [once])
            return ca.Function(name, [p], [rest(p, coefficients(p))], ["p"], [result])
        slopes = coefficients_of(series, parameters, self.p, given, differentiated=True)
        parts = ca.Function("constants_by", [self.p, k], [ca.jacobian(once, self.p), ca.jacobian(once, k)])
        by_p, by_k = parts(p, coefficients(p))
        return ca.Function(name, [p], [by_p + ca.mtimes(by_k, slopes(p))], ["p"], [result])

    def _series_constants(self) -> list[Constant]:
        series = self.system.load_series
        return [
            Constant(name=k.symbol.name, unit="N", description=k.description, latex=k.latex)
            for k in (series.coefficients if series else ())
        ]

    def _jacobians(self, rhs: ca.SX | None, arguments: Mapping[str, ca.SX]) -> tuple[list[Group], list[Described]]:
        """Derivatives of the right-hand side and of every quantity, also of those that no run reports.

        They use the constants there are and add none.
        """
        system = self.system
        visit = self._adding_nothing()
        balls = self._balls(system.bearing.ball, visit) if system.bearing else None
        made: list[Described] = []
        if rhs is not None:
            made += [*partials("rhs", "xdot", rhs, arguments, "upc"), tangent("rhs", "xdot", rhs, arguments)]
        values = [*zip(system.quantities, self._values_of(system.quantities, balls, visit), strict=True)]
        groups = []
        for name, moving in (("ring_quantities", True), ("load_quantities", False)):
            chosen = [(q, v) for q, v in values if _uses({q.name: v}, self.x) == moving]
            if chosen:
                groups.append(Group(name=name, outputs=tuple(q for q, _ in chosen)))
                made += group_functions(name, [v for _, v in chosen], arguments)
        if system.bearing is not None:
            made += group_functions("static_forces", self._static_forces(system.bearing.ball, visit), arguments)
        return groups, made

    def _static_forces(self, ball: Ball, visit: Visitor) -> list[ca.SX]:
        """Net force along each coordinate with everything at rest: no damping force, no velocities."""
        balls = self._balls(ball, visit, {ball.force: ball.elastic_force})
        net = visit.child(self._sums(balls), {})
        at_rest = {state.symbol: sp.S.Zero for state in self.system.states[self.system.coordinates :]}
        return [net(force.subs(at_rest)) for force in self.system.forcing]

    def _balls(self, ball: Ball, visit: Visitor, instead: Mapping[sp.Symbol, sp.Expr] | None = None) -> list[Visitor]:
        """A visitor for each ball: one sine and cosine of the cage's angle, angle addition for the rest.

        `instead` replaces definitions of the ball.
        """
        cage = visit(ball.cage_angle)
        sine, cosine = ca.sin(cage), ca.cos(cage)
        definitions = {d.symbol: d.expression for d in ball.definitions} | dict(instead or {})
        out = []
        for j in range(ball.count):
            spacing = sp.Rational(2 * j, ball.count) * sp.pi
            c, s = float(sp.cos(spacing)), float(sp.sin(spacing))
            out.append(visit.child({ball.cos: c * cosine - s * sine, ball.sin: s * cosine + c * sine}, definitions))
        return out

    def _sums(self, balls: list[Visitor]) -> dict[sp.Symbol, ca.SX]:
        """Sums over the balls, Eqs. (8) and (9)."""
        assert self.system.bearing is not None
        totals = {}
        for total in self.system.bearing.ball.sums:
            terms = [ball(total.expression) for ball in balls]
            value = terms[0]
            for term in terms[1:]:
                value = value + term
            totals[total.symbol] = value
        return totals

    def _rhs(self, balls: list[Visitor] | None) -> ca.SX:
        """Velocities, then mass^-1 forcing."""
        system = self.system
        assert balls is not None
        visit = self.visit.child(self._sums(balls), {})
        if not system.mass.is_diagonal():
            raise TypeError("the mass matrix of the rings is expected to be diagonal")
        n = system.coordinates
        accelerations = [visit(system.forcing[k] / system.mass[k, k]) for k in range(n)]
        return ca.vertcat(self.x[n:], *accelerations)

    def _outputs(self, balls: list[Visitor] | None) -> dict[str, ca.SX]:
        outputs = self.system.outputs
        names = (output_field(output.name) for output in outputs)
        return dict(zip(names, self._values_of(outputs, balls, self.visit), strict=True))

    def _values_of(self, outputs: Sequence[Output], balls: list[Visitor] | None, visit: Visitor) -> list[ca.SX]:
        """A number or a column with a row for each ball, for each output."""
        visit = visit.child(self._sums(balls), {}) if balls else visit
        out = []
        for output in outputs:
            if output.per_ball:
                assert balls is not None
                out.append(ca.vertcat(*(ball(output.expression) for ball in balls)))
            else:
                out.append(visit(output.expression))
        return out

    def _contact(self, c: ca.SX) -> ca.Function:
        """Elastic and damping force of one ball as functions of deflection [m] and its rate [m/s]."""
        assert self.system.bearing is not None
        ball = self.system.bearing.ball
        delta, rate = ca.SX.sym("delta"), ca.SX.sym("delta_rate")
        definitions = {d.symbol: d.expression for d in ball.definitions}
        visit = self.visit.child({ball.deflection: delta, ball.deflection_rate: rate}, definitions)
        elastic = visit(ball.elastic_force)
        damping = visit(ball.damping_force) if ball.damping_force is not None else ca.SX(0.0)
        return ca.Function(
            "contact",
            [delta, rate, self.p, c],
            [elastic, damping],
            ["delta", "delta_rate", "p", "c"],
            ["elastic_force", "damping_force"],
        )


def _uses(results: Mapping[str, ca.SX], argument: ca.SX) -> bool:
    return any(ca.depends_on(r, argument) for r in results.values()) if argument.numel() else False
