"""Kernels of a bearing's balls: from the rings' relative motion and a ball's direction to force, sums and slopes.

In: the generic ball, and visitors of a lowering.  Out: `BallKernels`, small SX functions over

    co, si   direction of the ball
    r        delta = r0 + r1 co + r2 si - e,  d(delta)/dt = r3 co + r4 si - de/dt,  e: what effects take (own_terms);
             r5, r6: cosine and sine of the cage's angle; where rings do not turn evenly, behind these what e needs of
             the state, as the speed of the rings and the cosine and sine of the inner one's angle.  Where deflection
             or rate is no such sum, r0 to r4 are zero, and all that these need of the state is behind r6
    k        numbers of the ball: entries of p, c and w, which the C driver gathers once

Each gives *rows*, summands over the balls; the C driver loops over balls (lanes), adds the rows up, and knows counts
only:

forces    -> S            F co, F si; F e' where effects turn bodies (own_terms)
slopes    -> S, G         and the slopes of S: Fd cc, Fd cs, Fd ss, Fv cc, Fv cs, Fv ss; with effects the rows that
                          time alone moves; or, where rings do not turn evenly or deflections are no such sum, all
                          derivatives one by one
partials  -> S, G, ...    and the derivatives of S by the ball's angle, by r0 and by k
moved     (..., along directions of co, si, r, k) -> derivative of G
sums_moved  (sums of the rows of partials, along directions of r, angle, k) -> derivative of S
contact   -> force, elastic force, damping force, deflection
switches  -> g, dg/dt     switching functions of the law; the rate where there is one
held_forces, held_slopes  (..., b): the law with its sides held by borders b (see bearing/switching.py)
member_forces, member_slopes  the first two for ensembles: of opposite balls together where `paired`
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import sympy as sp

from ballpass.derive.bearing.equations import BearingModel
from ballpass.derive.lowering.ring_motion_slopes import RELATIVE, RINGS, relative_motion, ring_motion_slopes
from ballpass.derive.lowering.visitor import Visitor

#: Rows of `contact`.
CONTACT = ("force", "elastic_force", "damping_force", "deflection")


@dataclass(frozen=True, slots=True, kw_only=True)
class BallKernels:
    """Kernels of one bearing.

    Attributes
    ----------
    prefix : of the bearing's names
    balls : their number
    over_numbers : functions over (co, si, r, k), by name
    taken : entries of k: ``p``, ``c`` or ``w``, and the place there
    paired : whether the sums of members take a ball and the one opposite together
    sums, slopes, partials : rows of S, and behind them
    relative : entries of r
    """

    prefix: str
    balls: int
    over_numbers: dict[str, ca.Function]
    taken: tuple[tuple[str, int], ...]
    paired: bool
    sums: int
    slopes: int
    partials: int
    relative: int

    @property
    def numbers(self) -> int:
        """Entries of k; C has no arrays of length zero."""
        return max(len(self.taken), 1)

    @property
    def structure(self) -> tuple[object, ...]:
        """What bearings have in common whose kernels are written once."""
        kinds = tuple(kind for kind, _ in self.taken)
        return (self.balls, self.relative, kinds, *(f"{n} {f.serialize()}" for n, f in self.over_numbers.items()))


class BallBuilder:
    """Builds the expressions of a bearing's balls first, so that their constants join c; functions afterwards.

    Parameters
    ----------
    bearing : the bearing
    visit : visitor of run-time functions, which hoists constants
    of_state : visitor that hoists what depends on time alone into stage variables
    of_all : the same with a callback for what does not depend on the ball, and with other values of the states
    moves : whether an expression depends on time or state
    states : symbols of the states
    """

    def __init__(
        self,
        bearing: BearingModel,
        visit: Visitor,
        of_state: Visitor,
        of_all: Callable[[Callable[[sp.Expr], ca.SX], dict[sp.Symbol, ca.SX]], Visitor],
        moves: Callable[[sp.Expr], bool],
        states: Sequence[sp.Symbol],
    ) -> None:
        self.bearing, self._visit, self._of_state, self._moves = bearing, visit, of_state, moves
        self.co, self.si, self.r = ca.SX.sym("co"), ca.SX.sym("si"), ca.SX.sym("r", RINGS)
        self._definitions = {d.symbol: d.expression for d in bearing.ball.definitions}
        self._further: dict[sp.Expr, ca.SX] = {}
        own = bearing.ball.own
        # what all balls have alike may be named among the definitions of one
        self._named = of_state.child({}, self._definitions)
        affine = self._affine()
        #: whether slopes are taken one by one
        self.general = affine is None or (own is not None and own.slope is not None)
        leaves = {symbol: ca.SX.sym(symbol.name) for symbol in states}
        self._of_ball = of_all(self._hoist, leaves) if self.general else of_state
        cage = [sp.cos(bearing.ball.cage.angle), sp.sin(bearing.ball.cage.angle)]
        rings = ca.vertcat(*map(of_state, affine or [sp.S.Zero] * RINGS), *map(of_state, cage))
        co, si, r = self.co, self.si, self.r
        self._rows = self._ball(None if affine is None else relative_motion(r, co, si), co, si)
        # opposite balls share their direction, and the products with it
        opposite = bearing.ball.count % 2 == 0 and not self.general
        self._opposite = self._ball(relative_motion(r, -co, -si), -co, -si) if opposite else None
        motion = self._motion(self._rows)
        self._further |= {s: leaf for s, leaf in leaves.items() if self.general and ca.depends_on(motion, leaf)}
        self.relative = ca.vertcat(rings, *(self._named(e) for e in self._further))
        entries = [None, *ca.vertsplit(r[1:]), *[None] * (RELATIVE - RINGS), *self._further.values()]
        #: entries of r that move a ball, not only decide between cases; None for others, and for the cage's direction
        self._moving = [
            entry
            if entry is not None and _is_smooth_in(motion, entry) and any(_is_smooth_in(e, s) for s in ca.symvar(e))
            else None
            for entry, e in zip(entries, ca.vertsplit(self.relative), strict=True)
        ]

    @staticmethod
    def _motion(at: dict[str, ca.SX]) -> ca.SX:
        """Deflection, its rate, and the weights of the force."""
        return ca.vertcat(at["delta"], at["rate"], at["weights"])

    def _hoist(self, expression: sp.Expr) -> ca.SX:
        """Entry of r behind the cage's direction, for what depends on time or state but not on the ball."""
        if not self._moves(expression):
            return self._named(expression)
        if expression not in self._further:
            self._further[expression] = ca.SX.sym(f"z{len(self._further)}")
        return self._further[expression]

    def _affine(self) -> list[sp.Expr] | None:
        """Coefficients of deflection and rate, without what effects take; None where these are not linear in the
        direction of the ball, or the part that no direction changes is no constant of a run.
        """
        ball = self.bearing.ball
        own = {ball.own.deflection: 0, ball.own.rate: 0} if ball.own is not None else {}
        rows: list[sp.Expr] = []
        for which, constant in ((ball.deflection, True), (ball.deflection_rate, False)):
            expression = sp.expand(sp.sympify(self._definitions.get(which, sp.S.Zero)).subs(own))
            along, across = expression.coeff(ball.cos), expression.coeff(ball.sin)
            rest = sp.expand(expression - along * ball.cos - across * ball.sin)
            if rest.has(ball.cos, ball.sin) or (self._moves(rest) if constant else rest != 0):
                return None
            rows += [rest, along, across] if constant else [along, across]
        return rows

    def _ball(self, rings: tuple[ca.SX, ca.SX] | None, co: ca.SX, si: ca.SX) -> dict[str, ca.SX]:
        """Force, slopes and all that rows are made of, at a direction.

        Parameters
        ----------
        rings : deflection and its rate without what effects take; None takes them from their definitions
        """
        ball, nothing = self.bearing.ball, ca.SX(0.0)
        at = self._of_ball.child({ball.cos: co, ball.sin: si}, self._definitions)
        inner = (ball.deflection, ball.deflection_rate)
        delta, rate = rings or (at(self._definitions.get(s, sp.S.Zero)) for s in inner)
        taken = [nothing] * 3
        if rings is not None and ball.own is not None:
            # their expressions: where all balls are alike these are hoisted whole
            third = ball.own.slope if ball.own.acceleration is None else ball.own.acceleration
            taken = [at(self._definitions[s]) for s in (ball.own.deflection, ball.own.rate, third)]
            delta, rate = delta - taken[0], rate - taken[1]
        rest = {k: v for k, v in self._definitions.items() if k not in inner}
        law = self._visit.child({ball.deflection: delta, ball.deflection_rate: rate}, rest)
        force = sp.sympify(rest[ball.force]).xreplace({k: v for k, v in rest.items() if k != ball.force})
        held = self._visit.child(
            {ball.deflection: delta, ball.deflection_rate: rate}
            | {s.border: ca.SX.sym(s.border.name) for s in ball.switching.switches},
            {},
        )
        by = [sp.diff(force, s) for s in inner]
        held_force = ball.switching.force
        return {
            "delta": delta,
            "rate": rate,
            "weights": ca.vertcat(*(at(self._definitions.get(w, w)) for w in ball.weights)),
            "own_rate": taken[1],
            "own_acceleration": taken[2],
            "F": law(ball.force),
            "Fd": law(by[0]),
            "Fv": law(by[1]),
            "elastic": law(ball.elastic_force),
            "damping": law(ball.damping_force) if ball.damping_force is not None else nothing,
            "g": ca.vertcat(*(law(s.function) for s in ball.switching.switches)),
            "g_rate": ca.vertcat(*(nothing if s.of_rate else rate for s in ball.switching.switches)),
            "b": ca.vertcat(*(held(s.border) for s in ball.switching.switches)),
            "held": held(held_force),
            "held_d": held(sp.diff(held_force, inner[0])),
            "held_v": held(sp.diff(held_force, inner[1])),
        }

    def _slopes(self, at: dict[str, ca.SX], co: ca.SX, si: ca.SX, by_delta: ca.SX, by_rate: ca.SX) -> list[ca.SX]:
        """Rows of G of a ball in a direction."""
        if self.general:
            return self._every_slope(at, by_delta, by_rate)
        rows = ca.vertsplit(ring_motion_slopes().summands(co, si, by_delta, by_rate))
        if self.bearing.ball.own is not None:
            moved = -(by_delta * at["own_rate"] + by_rate * at["own_acceleration"])
            rows += [moved * co, moved * si]
        return rows

    @staticmethod
    def _sums(at: dict[str, ca.SX], force: str) -> list[ca.SX]:
        """Rows of S."""
        return [at[force] * weight for weight in ca.vertsplit(at["weights"])]

    def _every_slope(self, at: dict[str, ca.SX], by_delta: ca.SX, by_rate: ca.SX) -> list[ca.SX]:
        """Derivatives of the rows of S by the moving entries of r, one after the other, then by the ball's angle.

        Forces are those at hand, or those with held sides, whose slopes these are.
        """
        force = at["F"] if by_delta is at["Fd"] else at["held"]
        motion, direction = self._motion(at), ca.vertcat(self.co, self.si)
        changes = [ca.jacobian(motion, entry) for entry in self._moving if entry is not None]
        changes.append(ca.jtimes(motion, direction, ca.vertcat(-self.si, self.co)))
        rows = []
        for change in changes:
            moved = by_delta * change[0] + by_rate * change[1]
            rows += ca.vertsplit(moved * at["weights"] + force * change[2:])
        return rows

    def by_relative(self, sums: ca.SX, totals: ca.SX, r: ca.SX) -> ca.SX:
        """d(S)/d(r) from the sums and the totals of the slopes' rows."""
        if not self.general:
            return ring_motion_slopes().by_relative(sums, totals, r)
        count = sums.numel()
        *columns, turn = ca.horzsplit(ca.reshape(totals, count, totals.numel() // count))
        moving = iter(columns)
        by_r = ca.horzcat(*(ca.SX(count, 1) if entry is None else next(moving) for entry in self._moving))
        by_r[:, RINGS], by_r[:, RINGS + 1] = -r[RINGS + 1] * turn, r[RINGS] * turn
        return by_r

    def by_time(self, totals: ca.SX) -> ca.SX:
        """Time derivative of S at fixed state and r: what effects take while rings turn evenly."""
        evenly = self.bearing.ball.own is not None and not self.general
        return totals[6:8] if evenly else ca.SX(len(self.bearing.ball.sums), 1)

    @property
    def slopes(self) -> int:
        """Entries of G."""
        if self.general:
            return len(self.bearing.ball.sums) * (sum(entry is not None for entry in self._moving) + 1)
        return 6 if self.bearing.ball.own is None else 8

    def kernels(self, c: ca.SX, p: ca.SX, w: ca.SX) -> BallKernels:
        """The functions, once the vectors of constants and stage variables are complete."""
        co, si, at = self.co, self.si, self._rows
        sums = self._sums(at, "F")
        slopes = self._slopes(at, co, si, at["Fd"], at["Fv"])
        # the kernels of balls that stand in no effect's way take the rings' motion alone
        turned = [ca.SX.sym("turned", RELATIVE - RINGS)] if self.general else []
        takes = {"co": co, "si": si, "r": ca.vertcat(self.r, *turned, *self._further.values())}
        whole = {"p": p, "c": c, "w": w}

        def made(name: str, rows: Sequence[ca.SX], extra: dict[str, ca.SX] | None = None) -> ca.Function:
            inputs = {**takes, **(extra or {}), **whole}
            rows = ca.cse([ca.densify(ca.vertcat(*rows))])
            return ca.Function(name, [*inputs.values()], rows, [*inputs], ["rows"])

        own = {
            "forces": made("forces", sums),
            "slopes": made("slopes", [*sums, *slopes]),
            "contact": made("contact", [at["F"], at["elastic"], at["damping"], at["delta"]]),
        }
        both, joint = sums, slopes
        if self._opposite is not None:
            # each ball's rows and then their sum, as single runs add them up: the same bits
            to = self._opposite
            both = [one + other for one, other in zip(sums, self._sums(to, "F"), strict=True)]
            behind = self._slopes(to, -co, -si, to["Fd"], to["Fv"])
            joint = [one + other for one, other in zip(slopes, behind, strict=True)]
        own["member_forces"] = made("member_forces", both)
        own["member_slopes"] = made("member_slopes", [*both, *joint])
        border = {"b": at["b"]}
        if at["b"].numel():
            held = self._sums(at, "held")
            own["switches"] = made("switches", [at["g"], at["g_rate"]])
            own["held_forces"] = made("held_forces", held, border)
            behind = self._slopes(at, co, si, at["held_d"], at["held_v"])
            own["held_slopes"] = made("held_slopes", [*held, *behind], border)
        over_numbers, taken = _over_numbers(own, len(takes))
        numbers = max(len(taken), 1)
        over_numbers["partials"] = _partials("partials", over_numbers["forces"], over_numbers["slopes"])
        over_numbers["moved"] = _moved("moved", over_numbers["slopes"], slice(len(sums), None), "G")
        if at["b"].numel():
            over_numbers["held_partials"] = _partials(
                "held_partials", over_numbers["held_forces"], over_numbers["held_slopes"]
            )
            functions = slice(at["g"].numel())
            over_numbers["switches_moved"] = _moved("switches_moved", over_numbers["switches"], functions, "g")
        partials = over_numbers["partials"].size1_out(0)
        over_numbers["sums_moved"] = self._sums_moved(partials, numbers, len(sums), len(slopes))
        return BallKernels(
            prefix=self.bearing.names.prefix,
            balls=self.bearing.ball.count,
            over_numbers=over_numbers,
            taken=taken,
            paired=self._opposite is not None,
            sums=len(sums),
            slopes=len(slopes),
            partials=partials - len(sums),
            relative=self.relative.numel(),
        )

    def _sums_moved(self, rows: int, numbers: int, sums: int, slopes: int) -> ca.Function:
        """Derivative of S along directions, from the sums of the rows of `partials`."""
        relative = self.relative.numel()
        total, r_d, a_d, k_d = (
            ca.SX.sym(n, m) for n, m in (("T", rows), ("r_d", relative), ("a_d", 1), ("k_d", numbers))
        )
        s, g = total[:sums], total[sums : sums + slopes]
        angled, by_r0 = (total[sums * k + slopes : sums * (k + 1) + slopes] for k in (1, 2))
        by_k = ca.reshape(total[3 * sums + slopes :], sums, numbers)
        by_r = self.by_relative(s, g, ca.SX(relative, 1)) @ ca.vertcat(r_d[:RINGS], 0.0, 0.0, r_d[RELATIVE:])
        moved = by_r + by_r0 * r_d[0] + angled * a_d + by_k @ k_d
        takes = {"T": total, "r_d": r_d, "a_d": a_d, "k_d": k_d}
        return ca.Function("sums_moved", [*takes.values()], [ca.densify(moved)], [*takes], ["S_d"])


def _is_smooth_in(value: ca.SX, symbol: ca.SX) -> bool:
    """Whether a derivative is not zero everywhere."""
    return bool(ca.sparsify(ca.jacobian(value, symbol)).nnz())


def _partials(name: str, forces: ca.Function, slopes: ca.Function) -> ca.Function:
    """The rows of `slopes`, and derivatives of those of `forces` by the ball's angle, by r0 and by k."""
    given = arguments_of(forces)
    sums = forces(*given.values())
    angled = ca.jtimes(sums, ca.vertcat(given["co"], given["si"]), ca.vertcat(-given["si"], given["co"]))
    by_r0, by_k = ca.jacobian(sums, given["r"])[:, 0], ca.jacobian(sums, given["k"])
    rows = ca.cse([ca.densify(ca.vertcat(slopes(*given.values()), angled, by_r0, ca.vec(by_k)))])
    return ca.Function(name, [*given.values()], rows, [*given], ["rows"])


def _moved(name: str, of: ca.Function, rows: slice, result: str) -> ca.Function:
    """Derivative of rows of a function's first result along a direction of all its arguments."""
    given = arguments_of(of)
    return moved_along(name, given, {result: of.call([*given.values()], True, False)[0][rows]})


def moved_along(name: str, given: Mapping[str, ca.SX], values: Mapping[str, ca.SX]) -> ca.Function:
    """Derivatives of values along a direction of all that is given, named ``x_d`` for ``x``."""
    along = {f"{n}_d": ca.SX.sym(f"{n}_d", v.numel()) for n, v in given.items()}
    point, direction = ca.vertcat(*given.values()), ca.vertcat(*along.values())
    moved = ca.cse([ca.densify(ca.jtimes(ca.vec(value), point, direction)) for value in values.values()])
    names = [f"{n}_d" for n in values]
    return ca.Function(name, [*given.values(), *along.values()], moved, [*given, *along], names)


def arguments_of(function: ca.Function) -> dict[str, ca.SX]:
    """Symbols of a function's arguments, by their names."""
    return dict(zip(function.name_in(), function.sx_in(), strict=True))


def _over_numbers(
    functions: dict[str, ca.Function], kept: int
) -> tuple[dict[str, ca.Function], tuple[tuple[str, int], ...]]:
    """The functions over k, the entries of p, c and w that any of them uses; and these entries.

    A compiler makes lanes of a loop over balls only where a selection needs no load: the numbers are gathered first.

    Parameters
    ----------
    kept : arguments in front that stay; borders behind them stay as well
    """
    used: set[tuple[str, int]] = set()
    for function in functions.values():
        for k in range(function.n_instructions()):
            if function.instruction_id(k) == ca.OP_INPUT:
                argument, entry = function.instruction_input(k)
                if function.name_in(argument) in "pcw":
                    used.add((function.name_in(argument), entry))
    order = sorted(used, key=lambda pair: ("pcw".index(pair[0]), pair[1]))
    first = next(iter(functions.values()))
    whole = {n: ca.SX.sym(n, first.size1_in(n)) for n in "pcw"}
    entries = ca.SX.sym("k", max(len(order), 1))
    replaced = {n: ca.SX.zeros(v.numel()) for n, v in whole.items()}
    for place, (n, e) in enumerate(order):
        replaced[n][e] = entries[place]
    made = {}
    for name, function in functions.items():
        names = [n for n in function.name_in() if n not in "pcw"]
        given = {n: ca.SX.sym(n, function.size1_in(n)) for n in names}
        rows = function.call([*given.values(), *replaced.values()], True, False)
        takes = {**{n: given[n] for n in names[:kept]}, "k": entries, **{n: given[n] for n in names[kept:]}}
        results = ca.cse([ca.densify(row) for row in rows])
        made[name] = ca.Function(name, [*takes.values()], results, [*takes], function.name_out())
    return made, tuple(order)
