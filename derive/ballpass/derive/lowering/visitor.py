"""From SymPy to CasADi: a memoised visitor over the expression DAG.

In: SymPy expressions over known symbols.  Out: CasADi SX expressions that share every common node.

What depends on parameters only is not computed in the step: the visitor hands each largest such subexpression to
its `hoist`
callback, which answers with a symbol of the derived constants.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import reduce
from itertools import pairwise
from operator import add, mul

import casadi as ca
import sympy as sp

from ballpass.derive.bearing.elements.hertz import ellipticity
from ballpass.derive.mechanism.swing import FARTHEST, OF_IDEAL_LINKAGE, POINTS, Average, Ideal, Turns, positions_of
from ballpass.derive.terms import ExpressionError
from ballpass.derive.variables import DRIVER_ANGLE

#: Arithmetic-geometric means from k' = 0.01 (kappa = 100) settle to rounding in six steps; one more for closer
#: conformity.
AGM_STEPS = 7
#: To which fraction of a radian the mean direction of a body is rounded.
STEPS_A_RADIAN = 64.0
#: Newton steps on the logarithm of kappa; the start (1977 fit of Brewe and Hamrock) is 3 % off, each step squares that.
ELLIPTICITY_STEPS = 4


class Visitor:
    """Lowers expressions over one environment.

    Parameters
    ----------
    values : SX expression of each free symbol
    definitions : expression of each defined symbol, lowered when first met
    constant : symbols that do not change during a run
    hoist : called with an expression of constant symbols, answers with its SX; None lowers such expressions in place
    parent : visitor whose results serve every expression free of this visitor's own symbols
    """

    def __init__(
        self,
        values: Mapping[sp.Symbol, ca.SX],
        definitions: Mapping[sp.Symbol, sp.Expr],
        *,
        constant: frozenset[sp.Symbol] = frozenset(),
        hoist: Callable[[sp.Expr], ca.SX] | None = None,
        parent: Visitor | None = None,
    ) -> None:
        self._values = values
        self._definitions = definitions
        self._constant = constant
        self._hoist = hoist
        self._parent = parent
        self._memo: dict[sp.Basic, ca.SX] = {}
        self._is_constant: dict[sp.Basic, bool] = {}
        self._is_own: dict[sp.Basic, bool] = {}
        self._ideals: dict[object, Visitor] = {}
        self._outside = self  # of one at an angle of the ideal linkage, which its means and turns do not depend on
        self._agm: dict[sp.Basic, tuple[ca.SX, ca.SX]] = {}

    def child(self, values: Mapping[sp.Symbol, ca.SX], definitions: Mapping[sp.Symbol, sp.Expr]) -> Visitor:
        """Visitor with further symbols; shares all results that do not depend on them."""
        return Visitor(values, definitions, constant=self._constant, hoist=self._hoist, parent=self)

    def __call__(self, expression: sp.Basic) -> ca.SX:
        """SX of a SymPy expression.

        Raises
        ------
        ExpressionError
            Where the expression holds a symbol or function without a meaning here.
        """
        expression = sp.sympify(expression)
        if self._parent is not None and not self._own(expression):
            return self._parent(expression)
        found = self._memo.get(expression)
        if found is None:
            found = self._memo[expression] = self._lower(expression)
        return found

    # what an expression depends on

    def _own(self, expression: sp.Basic) -> bool:
        found = self._is_own.get(expression)
        if found is None:
            if isinstance(expression, sp.Symbol):
                found = expression in self._values or expression in self._definitions
            else:
                found = any(self._own(a) for a in expression.args)
            self._is_own[expression] = found
        return found

    def is_constant(self, expression: sp.Basic) -> bool:
        """Whether the expression depends on this visitor's constant symbols only."""
        found = self._is_constant.get(expression)
        if found is None:
            if isinstance(expression, sp.Symbol):
                if expression in self._constant:
                    found = True
                elif expression in self._definitions:
                    found = self.is_constant(self._definitions[expression])
                else:
                    found = self._parent.is_constant(expression) if self._parent is not None else False
            else:
                found = isinstance(expression, OF_IDEAL_LINKAGE) or all(self.is_constant(a) for a in expression.args)
            self._is_constant[expression] = found
        return found

    def _closed(self, expression: sp.Expr) -> sp.Expr:
        """Without names that only children define: who takes a hoisted expression does not know them."""
        if self._parent is None:
            return expression
        while named := {s for s in expression.free_symbols if s in self._definitions and not self._parent._knows(s)}:
            expression = expression.xreplace({s: sp.sympify(self._definitions[s]) for s in named})
        return self._parent._closed(expression)

    def _knows(self, symbol: sp.Symbol) -> bool:
        here = symbol in self._values or symbol in self._definitions
        return here or (self._parent is not None and self._parent._knows(symbol))

    # lowering

    def _lower(self, expression: sp.Basic) -> ca.SX:
        if isinstance(expression, sp.Symbol):
            if expression in self._values:
                return self._values[expression]
            if expression in self._definitions:
                defined = self._definitions[expression]
                if self._hoist is not None and not _is_trivial(defined) and self.is_constant(defined):
                    return self._hoist(self._closed(expression))
                return self(defined)
            raise ExpressionError(f"the symbol {expression} has no value here")
        if self._hoist is not None and not _is_trivial(expression) and self.is_constant(expression):
            return self._hoist(self._closed(expression))
        if isinstance(expression, sp.Add | sp.Mul) and self._hoist is not None:
            expression = self._gather(expression)
        return self._operate(expression)

    def _gather(self, expression: sp.Add | sp.Mul) -> sp.Basic:
        """Constant factors or terms of a sum or product taken together, so that they are hoisted as one."""
        constant = [a for a in expression.args if self.is_constant(a)]
        if len(constant) < 2 or all(a.is_Number for a in constant):
            return expression
        varying = [a for a in expression.args if not self.is_constant(a)]
        held = expression.func(*constant)
        if _is_trivial(held):
            return expression
        placeholder = sp.Dummy("held", real=True)
        self._memo[placeholder] = self(held)
        self._is_own[placeholder] = True
        self._is_constant[placeholder] = False
        return expression.func(placeholder, *varying, evaluate=False)

    def _operate(self, expression: sp.Basic) -> ca.SX:
        if expression.is_Number or expression.is_NumberSymbol:
            return ca.SX(float(expression))
        if isinstance(expression, sp.Add):
            return self._sum(expression)
        if isinstance(expression, sp.Mul):
            return self._product(expression)
        if isinstance(expression, sp.Pow):
            return self._power(expression.base, expression.exp)
        if isinstance(expression, sp.Piecewise):
            return self._piecewise(expression)
        if isinstance(expression, sp.logic.boolalg.BooleanAtom):
            return ca.SX(1.0 if expression else 0.0)
        if isinstance(expression, sp.elliptic_k | sp.elliptic_e):
            return self._elliptic(expression)
        if isinstance(expression, OF_IDEAL_LINKAGE):
            return self._ideal(expression) if self._outside is self else self._outside(expression)
        if isinstance(expression, ellipticity):
            return _ellipticity(self(expression.args[0]))
        function = _FUNCTIONS.get(expression.func)
        if function is None:
            known = sorted(str(getattr(f, "__name__", f)) for f in _FUNCTIONS)
            raise ExpressionError(
                f"no CasADi expression is known for {expression.func.__name__} in {expression}. Allowed: powers, "
                f"Piecewise, {', '.join(known)}."
            )
        return function(*(self(a) for a in expression.args))

    def _sum(self, expression: sp.Basic) -> ca.SX:
        total: ca.SX | None = None
        negative: list[sp.Basic] = []
        for term in expression.args:
            if term.could_extract_minus_sign():
                negative.append(-term)
            else:
                total = self(term) if total is None else total + self(term)
        for term in negative:
            total = -self(term) if total is None else total - self(term)
        assert total is not None  # a sum has terms
        return total

    def _product(self, expression: sp.Basic) -> ca.SX:
        above: list[ca.SX] = []
        below: list[ca.SX] = []
        sign = 1
        for factor in expression.args:
            if factor is sp.S.NegativeOne:
                sign = -sign
            elif (
                isinstance(factor, sp.Pow)
                and factor.exp.is_Rational
                and factor.exp.is_negative
                and not self.is_constant(factor)
            ):
                below.append(self(sp.Pow(factor.base, -factor.exp)))
            elif factor.is_Rational and not factor.is_Integer:
                above.append(ca.SX(float(factor)))
            else:
                above.append(self(factor))
        product = reduce(mul, above) if above else ca.SX(1.0)
        if below:
            product = product / reduce(mul, below)
        return product if sign > 0 else -product

    def _power(self, base: sp.Basic, exponent: sp.Basic) -> ca.SX:
        if exponent.is_Rational and exponent.is_negative:
            return 1 / self._power(base, -exponent)
        value = self(base)
        if exponent.is_Rational and exponent.q in (1, 2) and exponent.p <= 8:
            whole, root = divmod(exponent.p, exponent.q)
            factors = [value] * whole if exponent.q == 2 else [value] * exponent.p
            if exponent.q == 2 and root:
                factors.append(ca.sqrt(value))
            return reduce(mul, factors)
        if exponent.is_Rational and exponent > 1:
            # slopes keep a fraction below one as exponent, which C takes by roots
            whole, rest = divmod(exponent.p, exponent.q)
            return reduce(mul, [value] * whole) * ca.power(value, float(sp.Rational(rest, exponent.q)))
        if exponent is sp.E or base is sp.E:
            return ca.exp(self(exponent))
        return ca.power(value, self(exponent))

    def _piecewise(self, expression: sp.Piecewise) -> ca.SX:
        pieces = [(e, c) for e, c in expression.args]
        last, condition = pieces[-1]
        if condition is not sp.true:
            raise ExpressionError(f"the piecewise expression {expression} leaves cases open")
        result = self(last)
        for value, condition in reversed(pieces[:-1]):
            # `if_else` gates the value, so that a square root of a negative deflection never enters a sum or derivative
            result = ca.if_else(self(condition), self(value), result)
        return result

    def _ideal(self, expression: sp.Basic) -> ca.SX:
        """A function of the linkage without play, at angles of the driver that it chooses."""
        closed = positions_of(expression)
        of = DRIVER_ANGLE if isinstance(expression, Ideal | Average) else expression.args[2]

        def at(angle: float | sp.Basic) -> Visitor:
            if (of, angle, closed) not in self._ideals:
                held = {of: self(angle)} | {position: ca.SX(0.0) for position in closed}
                self._ideals[of, angle, closed] = self.child(held, self._definitions)
                self._ideals[of, angle, closed]._outside = self
            return self._ideals[of, angle, closed]

        if isinstance(expression, Ideal):
            return at(expression.args[1])(expression.args[0])
        if isinstance(expression, Average):
            value, first, last, *_ = expression.args
            places = (first + (last - first) * (k + 0.5) / POINTS for k in range(POINTS))
            found = [at(place)(value) for place in places]
            sum_ = reduce(add, (ca.if_else(_is_number(one), one, 0.0) for one in found))
            return ca.SX(sum_ / reduce(add, map(_is_number, found)))
        cos, sin, _, start, period, *_ = expression.args
        angles = (start + 2.0 * math.pi * k / POINTS for k in range(int(period) * POINTS))
        seen = [(visit(cos), visit(sin)) for visit in map(at, angles)]
        if isinstance(expression, Turns):
            steps = [_angle_between(one, other) for one, other in pairwise([*seen, seen[0]])]
            total, most = reduce(add, steps), reduce(ca.fmax, map(ca.fabs, steps))
            whole = ca.floor(total / (2.0 * ca.pi) + 0.5) / int(period)
            return ca.SX(ca.if_else(_is_number(total), ca.if_else(most < FARTHEST, whole, ca.inf), 0.0))
        first = ca.atan2(seen[0][1], seen[0][0])
        total, known, locks = first, ca.SX(1.0), ca.SX(1.0)
        for way in (seen, [seen[0], *seen[:0:-1]]):  # back from the start as well where the way on locks
            angle, valid = first, locks
            for one, other in pairwise(way):
                step = _angle_between(one, other)
                valid = valid * _is_number(step)
                angle = angle + ca.if_else(valid, step, 0.0)
                total, known = total + ca.if_else(valid, angle, 0.0), known + valid
            locks = 1 - valid
        # a step function: no derivative follows a number that cancels
        return ca.SX(ca.floor(total / known * STEPS_A_RADIAN + 0.5) / STEPS_A_RADIAN)

    def _elliptic(self, expression: sp.Basic) -> ca.SX:
        (m,) = expression.args
        if m not in self._agm:
            first, defect = _agm_sum(ca.sqrt(1 - self(m)))
            self._agm[m] = first, first * (1 - defect)
        return self._agm[m][isinstance(expression, sp.elliptic_e)]


def _angle_between(one: tuple[ca.SX, ca.SX], other: tuple[ca.SX, ca.SX]) -> ca.SX:
    """From one direction, cosine and sine, to another [rad]."""
    return ca.atan2(one[0] * other[1] - one[1] * other[0], one[0] * other[0] + one[1] * other[1])


def _is_number(angle: ca.SX) -> ca.SX:
    """1 where it is none of a linkage that cannot be assembled, else 0."""
    return ca.fabs(angle) < ca.inf


def _is_trivial(expression: sp.Basic) -> bool:
    """Whether computing the expression costs nothing worth storing: a number, a symbol, or a symbol's negative."""
    if expression.is_Number or isinstance(expression, sp.Symbol | sp.logic.boolalg.BooleanAtom):
        return True
    return (
        isinstance(expression, sp.Mul)
        and len(expression.args) == 2
        and bool(expression.args[0] is sp.S.NegativeOne)
        and isinstance(expression.args[1], sp.Symbol)
    )


def _agm_sum(complementary: ca.SX) -> tuple[ca.SX, ca.SX]:
    """K and (K - E)/K for the complementary modulus k' (Abramowitz & Stegun 17.6), without cancellation."""
    a, b = ca.SX(1.0), complementary
    weight = 0.5
    total = weight * (1 - complementary * complementary)
    for _ in range(AGM_STEPS):
        a, b, c = (a + b) / 2, ca.sqrt(a * b), (a - b) / 2
        weight *= 2
        total = total + weight * c * c
    return ca.pi / (2 * a), total


def _ellipticity(ratio: ca.SX) -> ca.SX:
    """kappa of `hertz.ellipticity` by Newton's method on ln(kappa); the logarithmic residual is nearly straight."""
    target = ca.log(ratio / (1 + ratio))
    log_kappa = -0.636 * ca.log(ratio)
    for _ in range(ELLIPTICITY_STEPS):
        complementary = ca.exp(-log_kappa)
        square = complementary * complementary  # k'^2
        m = 1 - square
        _, defect = _agm_sum(complementary)
        quotient = defect / (1 - defect)  # (K - E)/E
        residual = ca.log(quotient * square / m) - target
        slope = 1 / quotient - 2 / m + quotient * square / m
        log_kappa = log_kappa - residual / slope
    return ca.exp(log_kappa)


def _fold(function: Callable[[ca.SX, ca.SX], ca.SX]) -> Callable[..., ca.SX]:
    return lambda *values: reduce(function, values)


_FUNCTIONS: dict[object, Callable[..., ca.SX]] = {
    sp.sin: ca.sin,
    sp.cos: ca.cos,
    sp.tan: ca.tan,
    sp.atan2: ca.atan2,
    sp.exp: ca.exp,
    sp.log: ca.log,
    sp.tanh: ca.tanh,
    sp.Abs: ca.fabs,
    sp.sign: ca.sign,
    sp.floor: ca.floor,
    sp.Max: _fold(ca.fmax),
    sp.Min: _fold(ca.fmin),
    sp.And: _fold(ca.logic_and),
    sp.Or: _fold(ca.logic_or),
    sp.Not: ca.logic_not,
    sp.StrictGreaterThan: lambda a, b: a > b,
    sp.GreaterThan: lambda a, b: a >= b,
    sp.StrictLessThan: lambda a, b: a < b,
    sp.LessThan: lambda a, b: a <= b,
}
