"""Which conditions must a one-step method meet to be of order p?  Rooted trees and their elementary weights.

A method with matrix ``alpha`` (arguments of the right-hand side), ``beta = alpha + gamma`` (Jacobian included) and
weights ``b`` is of order p when ``sum_i b_i Phi_i(t) = 1 / density(t)`` for every rooted tree ``t`` of at most p
vertices.  A vertex with one branch carries ``beta``, a vertex with several carries ``alpha``; an explicit method is
the case ``beta = alpha``.

Linearly implicit methods are also asked about index-1 systems ``y' = f(y, z), 0 = g(y, z)``, the limit of a component
that relaxes much faster than the step.  Their trees have a second kind of vertex, for the algebraic part, which
carries the inverse of ``beta`` and adds nothing to the order.

All figures are `decimal.Decimal` with `PRECISION` digits: 30 printed digits stay visible through order 8, where double
precision would hide the last fourteen.

References
----------
E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, Springer 1993, sections II.2 and II.6,
doi:10.1007/978-3-540-78862-1.  E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, section
IV.7 (table 7.1) and section VI.4 (index 1), doi:10.1007/978-3-642-05221-7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Significant digits of the checks; the longest figures have 31, and cancellation takes a few.
PRECISION = 50

#: Vector or matrix of `decimal.Decimal`.
Figures: TypeAlias = NDArray[np.object_]


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

    Parameters
    ----------
    order : highest order wanted, at least 1
    algebraic : include the trees of index-1 systems.  Left out are those whose condition repeats another: an algebraic
        vertex with a single branch, and a differential vertex whose only branch is algebraic.

    Returns
    -------
    200 trees for order 8; 17 for order 5, and 59 more with `algebraic`

    Raises
    ------
    ValueError
        `order` is below 1.
    """
    if order < 1:
        raise ValueError(f"the order of a tree is at least 1, given {order}")
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
        grown += [_grow(trees, branches, algebraic=True) for branches in several]
        trees += grown
    return tuple(trees)


def _forests(trees: Sequence[Tree], total: int) -> list[tuple[int, ...]]:
    """Multisets of trees, as non-decreasing places, whose orders add up to `total`."""
    found: list[tuple[int, ...]] = []

    def extend(chosen: tuple[int, ...], left: int) -> None:
        if left == 0:
            found.append(chosen)
            return
        for place in range(chosen[-1] if chosen else 0, len(trees)):
            if trees[place].order <= left:
                extend((*chosen, place), left - trees[place].order)

    extend((), total)
    return found


def _grow(trees: Sequence[Tree], branches: tuple[int, ...], *, algebraic: bool) -> Tree:
    """The tree with a new root under `branches`."""
    order = sum(trees[place].order for place in branches) + (0 if algebraic else 1)
    density = 1 if algebraic else order
    for place in branches:
        density *= trees[place].density
    inside = ",".join(trees[place].notation for place in branches)
    notation = f"{{{inside}}}" if algebraic else f"[{inside}]" if branches else "•"
    return Tree(branches=branches, order=order, density=density, algebraic=algebraic, notation=notation)


def elementary_weights(trees: Sequence[Tree], alpha: Figures, beta: Figures) -> tuple[Figures, ...]:
    """Phi_i(t) of every tree and stage.

    Parameters
    ----------
    trees : as `rooted_trees` gives them
    alpha, beta : matrices of the method, shape (s, s); `beta` regular if there are algebraic trees

    Returns
    -------
    one vector of shape (s,) for each tree
    """
    one = np.full(len(alpha), Decimal(1), dtype=object)
    omega = inverse_of_lower(beta) if any(tree.algebraic for tree in trees) else None
    weights: list[Figures] = []
    carried_by_alpha: dict[int, Figures] = {}
    for tree in trees:
        product = one
        if len(tree.branches) == 1:
            product = beta @ weights[tree.branches[0]]
        else:
            for place in tree.branches:
                if place not in carried_by_alpha:
                    carried_by_alpha[place] = alpha @ weights[place]
                product = product * carried_by_alpha[place]
        weights.append(omega @ product if tree.algebraic and omega is not None else product)
    return tuple(weights)


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderConditions:
    """The order conditions of one method, ready to be asked for any of its sets of weights.

    Attributes
    ----------
    trees : the trees of the conditions
    weights : their elementary weights
    tolerance : residual that the rounding of the printed figures may leave
    """

    trees: tuple[Tree, ...]
    weights: tuple[Figures, ...]
    tolerance: Decimal

    def _needed(self, order: int, algebraic_order: int) -> list[tuple[Tree, Figures]]:
        pairs = zip(self.trees, self.weights, strict=True)
        return [(tree, phi) for tree, phi in pairs if tree.order <= (algebraic_order if tree.algebraic else order)]

    def faults_of_step(self, label: str, b: Figures, order: int, algebraic_order: int = 0) -> list[str]:
        """Conditions missed by a solution ``y0 + h sum_i b_i k_i`` that claims `order`."""
        return [
            f"{label}: tree {tree.notation} of order {tree.order}: {residual:.1e} is left over"
            for tree, phi in self._needed(order, algebraic_order)
            if abs(residual := b @ phi - Decimal(1) / tree.density) > self.tolerance
        ]

    def faults_of_estimate(self, label: str, e: Figures, order: int, algebraic_order: int = 0) -> list[str]:
        """Conditions missed by error weights that belong to an embedded solution of exactly `order`.

        The estimate must vanish through `order` and must not vanish one order higher, where it is what it measures.
        """
        faults = [
            f"{label}: tree {tree.notation} of order {tree.order}: {residual:.1e} instead of 0"
            for tree, phi in self._needed(order, algebraic_order)
            if abs(residual := e @ phi) > self.tolerance
        ]
        higher = [
            phi
            for tree, phi in zip(self.trees, self.weights, strict=True)
            if tree.order == order + 1 and not tree.algebraic
        ]
        if all(abs(e @ phi) <= self.tolerance for phi in higher):
            faults.append(f"{label}: vanishes at order {order + 1} as well, so the embedded order is not {order}")
        return faults

    def faults_of_dense_output(
        self, label: str, powers: Sequence[Figures], order: int, algebraic_order: int = 0
    ) -> list[str]:
        """Conditions missed by ``y(t + theta h) = y0 + h sum_i b_i(theta) k_i``.

        ``sum_i b_i(theta) Phi_i(t)`` has to be ``theta**order(t) / density(t)``, power by power; `powers[k]` are the
        weights of ``theta**(k + 1)``.
        """
        faults = []
        for tree, phi in self._needed(order, algebraic_order):
            for power, b in enumerate(powers, start=1):
                wanted = Decimal(1) / tree.density if power == tree.order else Decimal(0)
                residual = b @ phi - wanted
                if abs(residual) > self.tolerance:
                    faults.append(f"{label}: tree {tree.notation}, power {power}: {residual:.1e} is left over")
        return faults


def inverse_of_lower(matrix: Figures) -> Figures:
    """Inverse of a regular lower triangular matrix, shape (n, n), by forward substitution."""
    size = len(matrix)
    inverse = np.full((size, size), Decimal(0), dtype=object)
    for column in range(size):
        for row in range(column, size):
            right_hand_side = Decimal(1 if row == column else 0)
            carried = matrix[row, column:row] @ inverse[column:row, column] if row > column else Decimal(0)
            inverse[row, column] = (right_hand_side - carried) / matrix[row, row]
    return inverse


def decimal_of(number: Fraction) -> Decimal:
    """`number` rounded to the current precision."""
    return Decimal(number.numerator) / Decimal(number.denominator)


def vector(numbers: Sequence[Fraction], size: int) -> Figures:
    """`numbers` as decimals of the current precision, followed by zeros up to `size`."""
    figures = np.full(size, Decimal(0), dtype=object)
    for place, number in enumerate(numbers):
        figures[place] = decimal_of(number)
    return figures


def lower_triangle(rows: Sequence[Sequence[Fraction]], size: int) -> Figures:
    """Strictly lower rows as a square matrix, shape (size, size)."""
    return np.array([vector(row, size) for row in rows], dtype=object).reshape(len(rows), size)
