"""What a query of sensitivities answers: values, derivatives with their certificates, warnings.

In: nothing but numbers.  Out: `SensitivityReport`, which gives JSON and prints the tables of `sensitivity_table`.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ballpass.runtime.certify.certificate import Check, Verdict
from ballpass.runtime.certify.grazing import Grazing
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import unknown_name


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityValue:
    """A quantity's value: name, number, unit; time and ball of an extreme; what to mind."""

    name: str
    value: float
    unit: str
    time: float | None
    ball: int | None
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """Derivative of one quantity by one parameter.

    Attributes
    ----------
    quantity, parameter : names
    value, parameter_value : numbers
    derivative, unit : dQ/dp
    dimensionless : (p/Q) dQ/dp; NaN where p or Q is zero: there it says nothing of the parameter's effect
    scale : change of the parameter that is a large one, in its unit: its value; for an angle a radian; where it is
        zero, what positions move by in the run, or the largest value of its unit
    uncertainty : of the derivative, from a run at a looser tolerance, same unit; None where there was none
    check : the certificate
    """

    quantity: str
    parameter: str
    value: float
    parameter_value: float
    derivative: float
    unit: str
    dimensionless: float
    scale: float
    uncertainty: float | None
    check: Check

    @property
    def is_nothing(self) -> bool:
        """Whether the check says no more than that the derivative is below what counts as nothing."""
        return self.check.is_nothing(self.derivative)

    @property
    def change(self) -> float:
        """Change of the quantity per `scale` of the parameter, in the quantity's unit."""
        return self.derivative * self.scale


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SensitivityReport:
    """Answer to a query: every pair, with what it takes to judge them.

    Attributes
    ----------
    scene : name
    quantities : values
    parameters : names
    pairs : quantity by quantity, parameters in order
    grazing : where the trajectory grazes a kink
    settings : cycles, transient, method, tolerances, steps
    """

    scene: str
    quantities: tuple[QuantityValue, ...]
    parameters: tuple[str, ...]
    pairs: tuple[Sensitivity, ...]
    grazing: tuple[Grazing, ...]
    settings: Mapping[str, Any]

    def __repr__(self) -> str:
        """One line."""
        verdicts = ", ".join(f"{count} {verdict.value}" for verdict, count in self.verdicts.items() if count)
        return (
            f"SensitivityReport({self.scene!r}: {len(self.quantities)} quantities by {len(self.parameters)} "
            f"parameters, {verdicts})"
        )

    def __str__(self) -> str:
        """The tables of ``ballpass sensitivity``, without colours."""
        from rich.console import Console

        from ballpass.runtime.certify.sensitivity_table import WIDTH, render_report

        out = io.StringIO()
        Console(file=out, width=WIDTH, color_system=None, highlight=False).print(render_report(self))
        return "\n".join(line.rstrip() for line in out.getvalue().splitlines())

    def __getitem__(self, key: tuple[str, str]) -> Sensitivity:
        """The pair of a quantity and a parameter."""
        quantity, parameter = key
        names = [item.name for item in self.quantities]
        if quantity not in names:
            raise RequestError(unknown_name("quantity of this report", quantity, names))
        if parameter not in self.parameters:
            raise RequestError(unknown_name("parameter of this report", parameter, self.parameters))
        return self.pairs[names.index(quantity) * len(self.parameters) + self.parameters.index(parameter)]

    def of(self, quantity: str) -> tuple[Sensitivity, ...]:
        """Pairs of one quantity, ranked by the size of the dimensionless derivative.

        Behind them those that have none, for parameter or quantity is zero, ranked by the change per `scale`.
        """
        pairs = [self[quantity, name] for name in self.parameters]
        return tuple(sorted(pairs, key=_rank))

    @property
    def verdicts(self) -> dict[Verdict, int]:
        """How many pairs have each verdict."""
        return {verdict: sum(pair.check.verdict is verdict for pair in self.pairs) for verdict in Verdict}

    @property
    def disagreements(self) -> tuple[Sensitivity, ...]:
        """Pairs whose two routes disagree."""
        return tuple(pair for pair in self.pairs if pair.check.verdict is Verdict.DISAGREES)

    def to_json(self) -> dict[str, Any]:
        """The report as JSON-ready mapping; numbers that are not finite are null."""
        return {
            "scene": self.scene,
            "settings": dict(self.settings),
            "verdicts": {verdict.value: count for verdict, count in self.verdicts.items()},
            "quantities": [
                {
                    "name": item.name,
                    "value": _plain(item.value),
                    "unit": item.unit,
                    "time": _plain(item.time),
                    "ball": item.ball,
                    "notes": list(item.notes),
                }
                for item in self.quantities
            ],
            "sensitivities": [
                {
                    "quantity": pair.quantity,
                    "parameter": pair.parameter,
                    "value": _plain(pair.value),
                    "parameter_value": pair.parameter_value,
                    "derivative": _plain(pair.derivative),
                    "unit": pair.unit,
                    "dimensionless": _plain(pair.dimensionless),
                    "parameter_scale": pair.scale,
                    "change_per_scale": _plain(pair.change),
                    "uncertainty": _plain(pair.uncertainty),
                    "certificate": {
                        "route": pair.check.route,
                        "value": _plain(pair.check.value),
                        "uncertainty": _plain(pair.check.uncertainty),
                        "disagreement": _plain(pair.check.disagreement),
                        "verdict": pair.check.verdict.value,
                        "nothing": pair.is_nothing,
                        "within_bound_only": pair.check.bounded,
                        "bound": _plain(pair.check.quantum),
                        "reason": pair.check.reason,
                    },
                }
                for pair in self.pairs
            ],
            "grazing": [
                {
                    "ball": item.ball,
                    "time": item.time,
                    "crank_angle": item.crank_angle,
                    "depth": item.depth,
                    "kink": item.kink,
                }
                for item in self.grazing
            ],
        }


def ratio_unit(above: str, below: str) -> str:
    """Unit of a derivative."""
    if below in ("", "1"):
        return above or "1"
    under = f"({below})" if any(sign in below for sign in "*/") else below
    return f"{above or '1'}/{under}"


def _rank(pair: Sensitivity) -> tuple[bool, float]:
    """Sort key: those with a dimensionless derivative first, larger ones first, what is no number last."""
    has_one = math.isfinite(pair.dimensionless)
    size = pair.dimensionless if has_one else pair.change
    return not has_one, -abs(size) if math.isfinite(size) else 1.0


def _plain(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
