"""The methods of the stepper, from the registry: what tests over all methods run on."""

from __future__ import annotations

from ballpass.runtime.contract.method_registry import METHODS, STEPPERS
from ballpass.runtime.contract.tableaus import ExplicitTableau

#: Methods by the name that users give them; plain ``stepper`` chooses among them.
FAMILIES: dict[str, str] = {asked: name for asked, name in STEPPERS.items() if name in METHODS}
NAMES = tuple(FAMILIES)
TABLEAUS = {asked: METHODS[name] for asked, name in FAMILIES.items()}
EXPLICIT = tuple(name for name, tableau in TABLEAUS.items() if isinstance(tableau, ExplicitTableau))
IMPLICIT = tuple(name for name in NAMES if name not in EXPLICIT)

#: Order of convergence and order of the dense output, as printed.
ORDERS = {name: (tableau.order, tableau.dense_order) for name, tableau in TABLEAUS.items()}
FAMILY_ORDERS = {FAMILIES[name]: orders for name, orders in ORDERS.items()}
