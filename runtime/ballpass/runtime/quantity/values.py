"""Quantities of one run by their names, for tables and notebooks.

In: a model, numbers, a request, names.  Out: a `QuantityValue` of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Estimate, Quantity
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import resolve


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityValue:
    """A quantity's value: name, number, unit; time and ball of an extreme; remarks."""

    name: str
    value: float
    unit: str
    time: float | None
    ball: int | None
    notes: tuple[str, ...]


def value_of(quantity: Quantity, estimate: Estimate) -> QuantityValue:
    """What was found of a quantity."""
    return QuantityValue(
        name=quantity.name,
        value=estimate.value,
        unit=quantity.unit,
        time=estimate.time,
        ball=estimate.ball,
        notes=(*estimate.notes, estimate.kink) if estimate.kink else estimate.notes,
    )


def quantity_values(
    model: LoadedModel, numbers: Numbers, request: Request, of: Sequence[str]
) -> dict[str, QuantityValue]:
    """Evaluate quantities of a run.

    Raises
    ------
    RequestError
        Unknown names, or a wrong request.
    SimulationError
        The computation failed.
    """
    quantities = quantities_of(model, of)
    found = QuantityRun(model, quantities).measure(resolve(model, numbers, request))
    return {item.name: value_of(item, one) for item, one in zip(quantities, found.estimates, strict=True)}
