"""The methods of the stepper, from the tables that register them: what tests over all methods run on."""

from __future__ import annotations

from ballpass.derive.emit.methods_header import _EXPLICIT, _ROSENBROCK
from ballpass.derive.methods.explicit import ExplicitTableau
from ballpass.derive.methods.rosenbrock import RosenbrockTableau
from ballpass.runtime.native.stepper import METHODS, Family

Tableau = ExplicitTableau | RosenbrockTableau

#: Methods a user can name, by name; plain ``stepper`` chooses among them.
FAMILIES: dict[str, Family] = {name: family for name, family in METHODS.items() if family is not Family.AUTO}
NAMES = tuple(FAMILIES)
TABLEAUS: dict[str, Tableau] = {f"stepper-{name}": t for name, t in {**_EXPLICIT, **_ROSENBROCK}.items()}
EXPLICIT = tuple(name for name, tableau in TABLEAUS.items() if isinstance(tableau, ExplicitTableau))
IMPLICIT = tuple(name for name, tableau in TABLEAUS.items() if isinstance(tableau, RosenbrockTableau))

#: Order of convergence and order of the dense output, as printed.
ORDERS: dict[str, tuple[int, int]] = {
    "stepper-dp54": (5, 4),
    "stepper-dop853": (8, 7),
    "stepper-rodas4": (4, 3),
    "stepper-rodas5p": (5, 4),
}
FAMILY_ORDERS = {FAMILIES[name]: orders for name, orders in ORDERS.items()}
