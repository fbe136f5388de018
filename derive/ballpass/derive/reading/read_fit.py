"""Reduction of the clearance of a bearing by fits and temperatures: the table ``[bearing.fit]``.

In: the table of a bearing, its clearance before mounting.  Out: the clearance in operation, which the model uses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ballpass.derive.scene.bearing_records import Catalogue
from ballpass.derive.scene.designations import bearing_types
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import keys_of, not_negative, quantity, read_record
from ballpass.derive.scene.table import Table
from ballpass.runtime.ratings.mounted_clearance import inner_growth, outer_shrinkage, thermal_reduction

#: Reduction of clearance, as a function of interference, diameter of the seat and of the raceway.
Change = Callable[[float, float, float], float]


def _interference(words: str) -> Any:
    return not_negative(
        "m",
        f"Effective interference of {words}",
        example="10 um",
        optional=True,
        setting=True,
        remedy="delete the key: a fit with play changes no clearance",
    )


def _size(words: str, example: str) -> Any:
    when = "required with the interference of that ring, unless the designation gives it"
    return quantity("m", words, example=example, optional=True, setting=True, when=when)


def _warming(ring: str) -> Any:
    words = f"Temperature rise of the {ring} ring since the clearance was measured"
    return quantity("K", words, example="10 K", default="0 K", setting=True, note="the balls have the mean")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The values of the table."""

    inner_interference: float | None = _interference("shaft and bore")
    outer_interference: float | None = _interference("outer ring and housing")
    bore: float | None = _size("Bore of the bearing", "20 mm")
    outside_diameter: float | None = _size("Outside diameter of the bearing", "47 mm")
    inner_warming: float = _warming("inner")
    outer_warming: float = _warming("outer")


def mounted(
    table: Table, catalogue: Catalogue | None, clearance: SceneNumber, ball_diameter: float, pitch_diameter: float
) -> tuple[SceneNumber, Catalogue | None]:
    """Clearance in operation, and the catalogue with the range of its group in operation."""
    if not table.has("fit"):
        return clearance, catalogue
    inner_race, outer_race = pitch_diameter - ball_diameter, pitch_diameter + ball_diameter
    kind = bearing_types().get(catalogue.designation) if catalogue is not None else None
    bore, outside = (None, None) if kind is None else (float(kind.bore) / 1e3, float(kind.outside) / 1e3)
    with table.table("fit", "inner_interference") as data:
        fit = read_record(Fit, data)
        bore, outside = fit.bore or bore, fit.outside_diameter or outside
        lost = _pressed(data, "bore", fit.inner_interference, bore, inner_race, inner_growth)
        lost += _pressed(data, "outside_diameter", fit.outer_interference, outside, outer_race, outer_shrinkage)
        inner, outer = fit.inner_warming, fit.outer_warming
        lost += thermal_reduction(inner, (inner + outer) / 2.0, outer, ball_diameter, pitch_diameter)
    if catalogue is not None:
        span = catalogue.clearance_range
        span = None if span is None else (span[0] - lost, span[1] - lost)
        catalogue = replace(catalogue, clearance_range=span, mounting_loss=lost)
    return replace(clearance, value=clearance.value - lost), catalogue


def _pressed(
    data: Table, key: str, interference: float | None, diameter: float | None, raceway: float, change: Change
) -> float:
    """Clearance that the interference of a ring takes [m]; 0 where there is none, or with a fault."""
    if not interference or interference < 0.0:  # reported
        return 0.0
    if diameter is None:
        data.take(key, keys_of(Fit)[key].sample)
        return 0.0
    within = 0.0 < diameter < raceway if key == "bore" else diameter > raceway
    if within:
        return change(interference, diameter, raceway)
    data.fault(
        key,
        "the raceway is not within its ring",
        given=f"{diameter:.6g} m, raceway {raceway:.6g} m",
        allowed="bore < inner raceway, outer raceway < outside_diameter",
        remedy="correct the diameter of the ring",
    )
    return 0.0
