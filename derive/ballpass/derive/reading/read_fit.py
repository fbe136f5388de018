"""What fits and temperatures take from the clearance of a bearing: the table ``[bearing.fit]``.

In: the table of a bearing, its clearance before mounting.  Out: the clearance in operation, which the model has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ballpass.derive.scene.bearing_records import Catalogue
from ballpass.derive.scene.designations import bearing_types
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.schema import Table
from ballpass.runtime.ratings.mounted_clearance import inner_growth, outer_shrinkage, thermal_reduction


def mounted(
    table: Table, catalogue: Catalogue | None, clearance: Quantity, ball_diameter: float, pitch_diameter: float
) -> tuple[Quantity, Catalogue | None]:
    """Clearance in operation, and the catalogue with the range of its group in operation."""
    if not table.has("fit"):
        return clearance, catalogue
    inner_race, outer_race = pitch_diameter - ball_diameter, pitch_diameter + ball_diameter
    kind = bearing_types().get(catalogue.designation) if catalogue is not None else None
    bore, outside = ("", "") if kind is None else (f"{kind.bore} mm", f"{kind.outside} mm")
    with table.table("fit", "inner_interference") as fit:
        lost = _pressed(fit, "inner", ("bore", bore), inner_race, inner_growth)
        lost += _pressed(fit, "outer", ("outside_diameter", outside), outer_race, outer_shrinkage)
        inner, outer = (
            fit.quantity(f"{ring}_warming", "K", "", "", example="10 K", default="0 K").value
            for ring in ("inner", "outer")
        )
        lost += thermal_reduction(inner, (inner + outer) / 2.0, outer, ball_diameter, pitch_diameter)
    if catalogue is not None:
        span = catalogue.clearance_range
        span = None if span is None else (span[0] - lost, span[1] - lost)
        catalogue = replace(catalogue, clearance_range=span, mounting_loss=lost)
    return replace(clearance, value=clearance.value - lost), catalogue


def _pressed(
    fit: Table, ring: str, size: tuple[str, str], raceway: float, change: Callable[[float, float, float], float]
) -> float:
    """Clearance that the interference of a ring takes [m]; 0 where there is none, or with a fault."""
    key, default = size
    if not fit.has(f"{ring}_interference"):
        if default:
            fit.know(key)
        return 0.0
    interference = fit.quantity(f"{ring}_interference", "m", "", "", example="10 um").value
    diameter = fit.quantity(key, "m", "", "", example="20 mm", default=default or None).value
    outside_its_ring = diameter <= 0.0 or (diameter >= raceway if ring == "inner" else diameter <= raceway)
    if interference < 0.0 or outside_its_ring:
        fit.fault(
            f"{ring}_interference" if interference < 0.0 else key,
            "a fit with play changes no clearance" if interference < 0.0 else "the raceway is not within its ring",
            given=f"{interference:.6g} m" if interference < 0.0 else f"{diameter:.6g} m, raceway {raceway:.6g} m",
            allowed="zero or above" if interference < 0.0 else "bore < inner raceway, outer raceway < outside_diameter",
            remedy="delete the key" if interference < 0.0 else "correct the diameter of the ring",
        )
        return 0.0
    return change(interference, diameter, raceway)
