"""Numbers of a derivation: ordered definitions evaluated with NumPy, for whole arrays at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ballpass.derive.terms import Definition

#: Value of a symbol: a number, or an array over the points of a sweep; real or complex.
Values = Mapping[sp.Symbol, Any]


class Evaluator:
    """Compiled definitions and result expressions.

    Parameters
    ----------
    definitions : ordered; those that no result needs are left out
    results : expressions in parameters, inputs and defined symbols
    """

    def __init__(self, definitions: Sequence[Definition], results: Sequence[sp.Expr]) -> None:
        needed = set[sp.Symbol]().union(*(sp.sympify(expression).free_symbols for expression in results))
        kept = []
        for definition in reversed(definitions):
            if definition.symbol in needed:
                kept.append(definition)
                needed |= sp.sympify(definition.expression).free_symbols
        self._steps = [(d.symbol, *_compile(d.expression)) for d in reversed(kept)]
        self._results = [_compile(e) for e in results]

    def __call__(self, values: Values) -> list[Any]:
        """Values of the results; arrays where a given value is one.  A value that is given replaces its definition.

        Raises
        ------
        KeyError
            a symbol that is neither defined nor given.
        """
        known = dict(values)
        for symbol, function, arguments in self._steps:
            if symbol not in values:
                known[symbol] = function(*(known[a] for a in arguments))
        return [function(*(known[a] for a in arguments)) for function, arguments in self._results]


def _compile(expression: sp.Expr) -> tuple[Callable[..., Any], tuple[sp.Symbol, ...]]:
    expression = sp.sympify(expression)
    arguments = tuple(sorted(expression.free_symbols, key=str))
    return sp.lambdify(arguments, expression, modules=np), arguments
