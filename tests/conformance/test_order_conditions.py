"""Rooted trees of the order conditions are counted as in the literature; nested dense output is expanded by hand."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

from order_conditions import Tree, nested_powers, rooted_trees


def symmetry(trees: tuple[Tree, ...], tree: Tree) -> int:
    """Number of ways in which a tree maps onto itself."""
    product = 1
    for place, times in Counter(tree.branches).items():
        product *= math.factorial(times) * symmetry(trees, trees[place]) ** times
    return product


def test_numbers_of_rooted_trees_are_those_of_cayley():
    counts = Counter(tree.order for tree in rooted_trees(8))
    assert [counts[order] for order in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]


def test_monotonic_labellings_of_all_trees_add_up():
    # A tree with n vertices has n! / (density symmetry) monotonic labellings; all trees together have (n - 1)!.
    trees = rooted_trees(8)
    for order in range(1, 9):
        labellings = [
            Fraction(math.factorial(order), tree.density * symmetry(trees, tree))
            for tree in trees
            if tree.order == order
        ]
        assert all(number.denominator == 1 for number in labellings)
        assert sum(labellings) == math.factorial(order - 1)


def test_trees_of_index_one_systems_contain_those_of_ordinary_equations():
    both = rooted_trees(5, algebraic=True)
    assert [tree for tree in both if not (set("{}") & set(tree.notation))] != []
    assert {tree.notation for tree in rooted_trees(5)} == {
        tree.notation for tree in both if not (set("{}") & set(tree.notation))
    }
    # The lowest condition of the algebraic component: sum b_i omega_ij alpha_j**2 = 1.
    lowest = next(tree for tree in both if tree.algebraic)
    assert (lowest.notation, lowest.order, lowest.density) == ("{•,•}", 2, 1)


def test_nested_powers_of_a_polynomial_worked_by_hand():
    # theta (1 + (1 - theta) (2 + theta 3)) = 3 theta + theta**2 - 3 theta**3
    terms = ((Fraction(1),), (Fraction(2),), (Fraction(3),))
    assert nested_powers(terms, [True, False, True]).tolist() == [[3], [1], [-3]]
