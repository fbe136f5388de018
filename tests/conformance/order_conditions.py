"""Which conditions must a one-step method meet to be of order p?  Rooted trees and their elementary weights.

A method with matrix ``alpha`` (arguments of the right-hand side), ``beta = alpha + gamma`` (Jacobian included) and
weights ``b`` is of order p when ``sum_i b_i Phi_i(t) = 1 / density(t)`` for every rooted tree ``t`` of at most p
vertices.  A vertex with one branch carries ``beta``, a vertex with several carries ``alpha``; an explicit method is
the case ``gamma = 0``.

Linearly implicit methods are also asked about index-1 systems ``y' = f(y, z), 0 = g(y, z)``, the limit of a component
that relaxes much faster than the step.  Their trees have a second kind of vertex, for the algebraic part, which
carries the inverse of ``beta`` and adds nothing to the order.

Conditions are checked in `decimal.Decimal` with `PRECISION` digits: 30 printed digits stay visible through order 8,
where double precision would hide the last fourteen.

References
----------
E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, Springer 1993, sections II.2 and II.6,
doi:10.1007/978-3-540-78862-1.  E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, section
IV.7 (table 7.1) and section VI.4 (index 1), doi:10.1007/978-3-642-05221-7.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.tableaus import ExplicitTableau, RosenbrockTableau, Row, Rows, Tableau

#: Significant digits of the checks; the longest figures have 31, and cancellation takes a few.
PRECISION = 50

#: Vector or matrix of `Fraction` or `Decimal`.
Figures = NDArray[np.object_]
decimals = np.frompyfunc(lambda number: Decimal(number.numerator) / Decimal(number.denominator), 1, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claims:
    """Orders printed for a method, beside those of its embedded solutions, which its tableau names.

    Attributes
    ----------
    order, dense_order : of solution and dense output, for ordinary differential equations
    algebraic_orders : of solution, embedded solution and dense output in the algebraic component of index-1 systems:
        what is left of the order in a component that relaxes within a fraction of the step
    rounding : residual in a condition that the rounding of the printed figures explains
    """

    order: int
    dense_order: int
    algebraic_orders: tuple[int, int, int] = (0, 0, 0)
    rounding: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class Tree:
    """A rooted tree, its branches given by their places in the tuple that `rooted_trees` returns.

    Attributes
    ----------
    branches : places of the sub-trees at the root, not decreasing
    order : number of differential vertices
    density : product, over the differential vertices, of the order of the sub-tree that grows from them
    algebraic : whether the root belongs to the algebraic part of an index-1 system
    notation : brackets for a differential root, braces for an algebraic one, "•" for the single vertex
    """

    branches: tuple[int, ...]
    order: int
    density: int
    algebraic: bool
    notation: str


@cache
def rooted_trees(order: int, *, algebraic: bool = False) -> tuple[Tree, ...]:
    """All trees up to `order`, lowest order first, every branch before the tree it belongs to.

    With `algebraic` those of index-1 systems as well, except where a condition repeats another: an algebraic vertex
    with a single branch, and a differential vertex whose only branch is algebraic.
    """
    trees: list[Tree] = []
    for current in range(1, order + 1):
        differential = [
            branches
            for branches in _forests(trees, current - 1)
            if not (len(branches) == 1 and trees[branches[0]].algebraic)
        ]
        several = [branches for branches in _forests(trees, current) if len(branches) > 1] if algebraic else []
        # No tree with several branches has one of its own order among them, so both lists are made before either is
        # added.
        grown = [_grow(trees, branches, algebraic=False) for branches in differential]
        trees += grown + [_grow(trees, branches, algebraic=True) for branches in several]
    return tuple(trees)


def _forests(trees: Sequence[Tree], total: int, first: int = 0) -> Iterator[tuple[int, ...]]:
    """Multisets of trees from place `first` on, as non-decreasing places, whose orders add up to `total`."""
    if total == 0:
        yield ()
    for place in range(first, len(trees)):
        if trees[place].order <= total:
            yield from ((place, *others) for others in _forests(trees, total - trees[place].order, place))


def _grow(trees: Sequence[Tree], branches: tuple[int, ...], *, algebraic: bool) -> Tree:
    """The tree with a new root under `branches`."""
    order = sum(trees[place].order for place in branches) + (not algebraic)
    density = math.prod(trees[place].density for place in branches) * (1 if algebraic else order)
    inside = ",".join(trees[place].notation for place in branches)
    notation = f"{{{inside}}}" if algebraic else f"[{inside}]" if branches else "•"
    return Tree(branches=branches, order=order, density=density, algebraic=algebraic, notation=notation)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassicalForm:
    """A method as its order conditions see it, in decimals of `PRECISION` digits.

    ``k_i = f(t + alpha_i h, y0 + h sum_j alpha_ij k_j) + h J sum_j gamma_ij k_j + h gamma_i f_t``, with row sums
    alpha_i and gamma_i, and ``y1 = y0 + h sum_i b_i k_i``.  The time derivative is that of the autonomous system with t
    as a further unknown: two sets of row sums.

    Attributes
    ----------
    alpha, gamma : alpha_ij, strictly lower, and gamma_ij, lower, shape (s, s); end slope and dense stages included
    alpha_sums, gamma_sums : row sums as printed, shape (s,)
    weights : b_i, shape (s,)
    error_weights : for each embedded solution its order and b_i minus its weights, shape (s,)
    dense_weights : row k are the weights of ``theta**(k + 1)``, shape (degree, s)
    """

    alpha: Figures
    gamma: Figures
    alpha_sums: Figures
    gamma_sums: Figures
    weights: Figures
    error_weights: tuple[tuple[int, Figures], ...]
    dense_weights: Figures


def classical_form(tableau: Tableau) -> ClassicalForm:
    """The form of textbooks.  Linearly implicit methods are printed for ``u = h Gamma k``:

    ``Gamma**-1 = diag(1 / gamma) - C``, ``alpha = a Gamma`` and ``b = m Gamma``.
    """
    with localcontext(prec=PRECISION):
        dense = decimals(dense_weights(tableau))
        size = dense.shape[1]
        if isinstance(tableau, ExplicitTableau):
            matrix, estimates = all_stages(tableau), [(e.order, e.weights) for e in tableau.error_estimates]
            nodes, time_weights = (*tableau.nodes, Fraction(1), *tableau.dense_nodes), ()
            gamma, to_slopes = decimals(padded((), size, size)), decimals(np.eye(size, dtype=int).astype(object))
        else:
            matrix, estimates = tableau.matrix, [(tableau.embedded_order, tableau.error_weights)]
            nodes, time_weights = tableau.nodes, tableau.time_weights
            inverse = np.diag([1 / tableau.gamma] * size) - padded(tableau.coupling, size, size)
            gamma = to_slopes = inverse_of_lower(decimals(inverse))
        return ClassicalForm(
            alpha=decimals(padded(matrix, size, size)) @ to_slopes,
            gamma=gamma,
            alpha_sums=decimals(padded((nodes,), 1, size))[0],
            gamma_sums=decimals(padded((time_weights,), 1, size))[0],
            weights=decimals(padded((tableau.weights,), 1, size))[0] @ to_slopes,
            error_weights=tuple((p, decimals(padded((e,), 1, size))[0] @ to_slopes) for p, e in estimates),
            dense_weights=dense @ to_slopes,
        )


def all_stages(tableau: ExplicitTableau) -> Rows:
    """a_ij of all stages as strictly lower rows; the row of the end slope holds the weights."""
    return (*tableau.matrix, tableau.weights, *tableau.dense_matrix)


def dense_weights(tableau: Tableau) -> Figures:
    """Row k are the weights of ``theta**(k + 1)`` in ``y(t + theta h) - y0``, those of k_i times h or of u_i."""
    if isinstance(tableau, RosenbrockTableau):
        terms = (tableau.weights, *tableau.dense_rows)
        return nested_powers(terms, [place != 1 for place in range(len(terms))])
    size = len(all_stages(tableau))
    delta, start, end = (
        *padded((tableau.weights,), 1, size),
        *np.eye(size, dtype=int)[[0, tableau.stages]].astype(object),
    )
    terms = (delta, start - delta, 2 * delta - start - end, *padded(tableau.dense_rows, len(tableau.dense_rows), size))
    return nested_powers(terms, [place % 2 == 0 for place in range(len(terms))])


def nested_powers(terms: Sequence[Row | Figures], by_theta: Sequence[bool]) -> Figures:
    """Weights of the powers of theta in ``g0 (T0 + g1 (T1 + g2 (T2 + ...)))``, without the zero weights of theta**0.

    A factor g is theta where `by_theta` is true, ``1 - theta`` where it is not; the first is theta.
    """
    nothing = padded((), 1, len(terms[0]))
    powers = nothing
    for term, theta in reversed(list(zip(terms, by_theta, strict=True))):
        powers = np.vstack([powers[:1] + np.array(term, dtype=object), powers[1:]])
        raised = np.vstack([nothing, powers])
        powers = raised if theta else np.vstack([powers, nothing]) - raised
    return powers[1:]


def faults(tableau: Tableau, claims: Claims) -> list[str]:
    """Conditions of the claimed orders, and of stiff problems, that the figures miss by more than their rounding."""
    with localcontext(prec=PRECISION):
        form, tolerance = classical_form(tableau), decimals(claims.rounding)
        stiff = isinstance(tableau, RosenbrockTableau)
        highest = max(
            claims.order, claims.dense_order, *claims.algebraic_orders, *(p + 1 for p, _ in form.error_weights)
        )
        trees = rooted_trees(highest, algebraic=stiff)
        conditions = list(zip(trees, elementary_weights(trees, form), strict=True))
        residuals = [
            *_row_sum_residuals(form),
            *(_stiffness_residuals(form) if stiff else ()),
            *_order_residuals(form, claims, conditions),
        ]
        found = [f"{label}: {residual:.1e}" for label, residual in residuals if abs(residual) > tolerance]
        for order, e in form.error_weights:
            higher = [phi for tree, phi in conditions if tree.order == order + 1 and not tree.algebraic]
            if all(abs(e @ phi) <= tolerance for phi in higher):
                found.append(f"error estimate of order {order}: vanishes at order {order + 1} as well")
        return found


def _row_sum_residuals(form: ClassicalForm) -> Iterator[tuple[str, Decimal]]:
    for label, matrix, sums in (("alpha", form.alpha, form.alpha_sums), ("gamma", form.gamma, form.gamma_sums)):
        yield from ((f"{label}, row {row}", off) for row, off in enumerate(matrix.sum(axis=1) - sums, start=1))


def _stiffness_residuals(form: ClassicalForm) -> Iterator[tuple[str, Decimal]]:
    """The last stage is the solution, its argument the embedded one, and ``R(infinity) = 1 - b beta**-1 1 = 0``."""
    beta = form.alpha + form.gamma
    relaxed = inverse_of_lower(beta).sum(axis=1)
    ((_, error_weights),) = form.error_weights
    b_hat = form.weights - error_weights
    for label, b, last in (("solution", form.weights, beta[-1]), ("embedded solution", b_hat, form.alpha[-1])):
        yield f"{label}: stiff accuracy", max(abs(last - b))
        yield f"{label}: R(infinity)", 1 - b @ relaxed


def _order_residuals(
    form: ClassicalForm, claims: Claims, conditions: Sequence[tuple[Tree, Figures]]
) -> Iterator[tuple[str, Decimal]]:
    """The dense output has to give ``theta**order(t) / density(t)`` for each tree t, power by power."""
    of_solution, of_embedded, of_dense = claims.algebraic_orders
    for tree, phi in conditions:
        wanted = 1 / Decimal(tree.density)
        if tree.order <= (of_solution if tree.algebraic else claims.order):
            yield f"solution: tree {tree.notation}", form.weights @ phi - wanted
        for order, e in form.error_weights:
            if tree.order <= (of_embedded if tree.algebraic else order):
                yield f"error estimate of order {order}: tree {tree.notation}", e @ phi
        if tree.order <= (of_dense if tree.algebraic else claims.dense_order):
            for power, b in enumerate(form.dense_weights, start=1):
                residual = b @ phi - (wanted if power == tree.order else 0)
                yield f"dense output: tree {tree.notation}, power {power}", residual


def elementary_weights(trees: Sequence[Tree], form: ClassicalForm) -> list[Figures]:
    """Phi_i(t) of every tree, each of shape (s,)."""
    beta = form.alpha + form.gamma
    omega = inverse_of_lower(beta) if any(tree.algebraic for tree in trees) else None
    weights: list[Figures] = []

    @cache
    def carried_by_alpha(place: int) -> Figures:
        return form.alpha @ weights[place]

    for tree in trees:
        if len(tree.branches) == 1:
            product = beta @ weights[tree.branches[0]]
        else:
            product = np.full(len(beta), Decimal(1), dtype=object)
            for place in tree.branches:
                product = product * carried_by_alpha(place)
        weights.append(omega @ product if tree.algebraic else product)
    return weights


def stability_polynomial(tableau: ExplicitTableau) -> Row:
    """Coefficients of R(z), constant first, for ``y' = lambda y`` and ``z = h lambda``; shape (s + 1,)."""
    size = tableau.stages
    matrix, powers = padded(tableau.matrix, size, size), np.full(size, Fraction(1), dtype=object)
    coefficients = [Fraction(1)]
    for _ in range(size):
        coefficients.append(np.array(tableau.weights) @ powers)
        powers = matrix @ powers
    return tuple(coefficients)


def inverse_of_lower(matrix: Figures) -> Figures:
    """Inverse of a regular lower triangular matrix, by forward substitution."""
    inverse = np.full_like(matrix, Decimal(0))
    for row in range(len(matrix)):
        unit = np.array([Decimal(row == column) for column in range(len(matrix))])
        inverse[row] = (unit - matrix[row, :row] @ inverse[:row]) / matrix[row, row]
    return inverse


def padded(rows: Rows, height: int, width: int) -> Figures:
    """Rows as a rectangular array, zeros where they are shorter and where there are none."""
    array = np.full((height, width), Fraction(0), dtype=object)
    for place, row in enumerate(rows):
        array[place, : len(row)] = row
    return array
