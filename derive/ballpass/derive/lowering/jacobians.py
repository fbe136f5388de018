"""Jacobians: every quantity of a system and its derivatives along everything a function depends on.

In: the right-hand side and all quantities the scene's model can report, lowered.  Out: CasADi functions for a file of
their own, which is compiled when a derivative is first asked for: a plain run pays nothing.  For each group G of
quantities

G               (t, x, u, p, c) -> y         values, one below the other
G_jac_x         (t, x, u, p, c) -> y_x       sparse derivative by the states; _t, _u, _p, _c: time, inputs, parameters
with the constants held, constants
G_tangent       (t, x, u, p, c, dt, dx, du, dp, dc) -> dy       derivative along one direction

The groups: ``rhs``; ``ring_quantities``, which depend on the rings' states; ``load_quantities``, which do not;
``static_forces``, the net force along each coordinate with everything at rest, for static equilibrium.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

Described = tuple[ca.Function, str]

_WORDS = {
    "x": "states",
    "t": "time",
    "u": "inputs",
    "p": "parameters, constants held",
    "c": "constants",
}

#: Ends of the names of derivatives.
DERIVATIVES = (*(f"_jac_{key}" for key in _WORDS), "_tangent")


def partials(
    name: str, result: str, value: ca.SX, arguments: Mapping[str, ca.SX], along: Sequence[str]
) -> list[Described]:
    """Sparse derivatives of `value` by the arguments named in `along`; those without entries are left out."""
    # common subexpressions of the value, not of each derivative: a third of the time, 3 % more operations
    value = ca.cse(value)
    made = []
    for key in along:
        derivative = ca.jacobian(value, arguments[key])
        if not derivative.nnz():
            continue
        jacobian = ca.Function(
            f"{name}_jac_{key}",
            [*arguments.values()],
            [derivative],
            [*arguments],
            [f"{result}_{key}"],
        )
        made.append((jacobian, f"derivative of {name} by the {_WORDS[key]}"))
    return made


def tangent(name: str, result: str, value: ca.SX, arguments: Mapping[str, ca.SX]) -> Described:
    """Derivative of `value` along a direction of all arguments, named ``dx`` for ``x``."""
    value = ca.cse(value)
    directions = {f"d{key}": ca.SX.sym(f"d{key}", argument.numel()) for key, argument in arguments.items()}
    moved = ca.jtimes(value, ca.vertcat(*arguments.values()), ca.vertcat(*directions.values()))
    function = ca.Function(
        f"{name}_tangent",
        [*arguments.values(), *directions.values()],
        [ca.densify(moved)],
        [*arguments, *directions],
        [f"d{result}"],
    )
    return function, f"derivative of {name} along a direction of all its arguments"


def group_functions(name: str, values: Sequence[ca.SX], arguments: Mapping[str, ca.SX]) -> list[Described]:
    """Value, partial derivatives and directional derivative of a group of quantities."""
    value = ca.cse(ca.densify(ca.vertcat(*values)))
    function = ca.Function(name, [*arguments.values()], [value], [*arguments], ["y"])
    return [
        (function, "quantities, one below the other"),
        *partials(name, "y", value, arguments, tuple(arguments)),
        tangent(name, "y", value, arguments),
    ]
