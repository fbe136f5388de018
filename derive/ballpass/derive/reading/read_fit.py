"""Reduction of the clearance of a bearing by fits and temperatures: the table ``[bearing.fit]``.

In: the table of a bearing, its clearance before mounting.  Out: the clearance in operation, which the model uses, and
its spread where classes of shaft or housing are given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from ballpass.derive.scene.designations import bearing_types
from ballpass.derive.scene.keys import ChoiceKey
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.rating_records import Catalogue
from ballpass.derive.scene.read_keys import Either, keys_of, not_negative, quantity, read_record
from ballpass.derive.scene.table import Table
from ballpass.derive.scene.units import show
from ballpass.runtime.contract.manifest import FitInfo
from ballpass.runtime.ratings import tolerances
from ballpass.runtime.ratings.mounted_clearance import inner_growth, outer_shrinkage, thermal_reduction
from ballpass.runtime.ratings.tolerances import Spread

#: Reduction of clearance, as a function of interference, diameter of the seat and of the raceway.
Change = Callable[[float, float, float], float]


def _interference(words: str, seat: str) -> Any:
    return not_negative(
        "m",
        f"Effective interference of {words}",
        example="10 um",
        optional=True,
        setting=True,
        when=f"optional, instead of `{seat}`",
        remedy="delete the key: a fit with play changes no clearance",
    )


def _class(words: str, choices: tuple[str, ...]) -> Any:
    note = "ISO 286, with a ring of class Normal, ISO 492"
    words = f"Tolerance class of {words}"
    return ChoiceKey(words=words, choices=choices, optional=True, when="optional", note=note).declared()


def _size(words: str, example: str) -> Any:
    when = "required with the interference or class of that ring, unless the designation gives it"
    return quantity("m", words, example=example, optional=True, setting=True, when=when)


def _warming(ring: str) -> Any:
    words = f"Temperature rise of the {ring} ring since the clearance was measured"
    return quantity("K", words, example="10 K", default="0 K", setting=True, note="the balls have the mean")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The values of the table."""

    one_of: ClassVar[tuple[Either, ...]] = (
        Either(what="the fit of the shaft", groups=(("shaft",), ("inner_interference",)), optional=True),
        Either(what="the fit of the housing", groups=(("housing",), ("outer_interference",)), optional=True),
    )

    shaft: str | None = _class("the shaft", tolerances.SHAFTS)
    housing: str | None = _class("the housing's bore", tolerances.HOUSINGS)
    roughness: float = not_negative(
        "m",
        "Roughness Rz of seat and ring together",
        example="6 um",
        default="0 um",
        setting=True,
        note="0.4 of it reduces the interference of a class",
    )
    inner_interference: float | None = _interference("shaft and bore", "shaft")
    outer_interference: float | None = _interference("outer ring and housing", "housing")
    bore: float | None = _size("Bore of the bearing", "20 mm")
    outside_diameter: float | None = _size("Outside diameter of the bearing", "47 mm")
    inner_warming: float = _warming("inner")
    outer_warming: float = _warming("outer")


def mounted(
    table: Table, catalogue: Catalogue | None, clearance: SceneNumber, ball_diameter: float, pitch_diameter: float
) -> tuple[SceneNumber, Catalogue | None, FitInfo | None]:
    """Clearance in operation, the catalogue with the range of its group in operation, and fits by class."""
    if not table.has("fit"):
        return clearance, catalogue, None
    inner_race, outer_race = pitch_diameter - ball_diameter, pitch_diameter + ball_diameter
    kind = bearing_types().get(catalogue.designation) if catalogue is not None else None
    bore, outside = (None, None) if kind is None else (float(kind.bore) / 1e3, float(kind.outside) / 1e3)
    with table.table("fit", "shaft") as data:
        fit = read_record(Fit, data)
        bore, outside = fit.bore or bore, fit.outside_diameter or outside
        rings = [
            _pressed(data, "bore", fit, fit.inner_interference, bore, inner_race, inner_growth),
            _pressed(data, "outside_diameter", fit, fit.outer_interference, outside, outer_race, outer_shrinkage),
        ]
        inner, outer = fit.inner_warming, fit.outer_warming
        warm = thermal_reduction(inner, (inner + outer) / 2.0, outer, ball_diameter, pitch_diameter)
    span = catalogue.clearance_range if catalogue is not None else None
    free = (clearance.value, clearance.value) if span is None else span
    operating = tolerances.operating_clearance(free, rings, warm)
    lost = sum(free) / 2.0 - operating.mean
    if catalogue is not None:
        span = None if span is None else (span[0] - lost, span[1] - lost)
        catalogue = replace(catalogue, clearance_range=span, mounting_loss=lost)
    spread = None
    if fit.shaft or fit.housing:
        fives = [ring.five if name else () for name, (ring, _) in zip((fit.shaft, fit.housing), rings, strict=True)]
        spread = FitInfo(shaft=fit.shaft, housing=fit.housing, inner=fives[0], outer=fives[1], clearance=operating.five)
    return replace(clearance, value=clearance.value - lost), catalogue, spread


def _pressed(
    data: Table, key: str, fit: Fit, given: float | None, diameter: float | None, raceway: float, change: Change
) -> tuple[Spread, float]:
    """Interference of a ring, and the clearance that it takes for its length; zeros without one, or with a fault."""
    seat, name = ("shaft", fit.shaft) if key == "bore" else ("housing", fit.housing)
    nothing = Spread.within(0.0, 0.0), 0.0
    if not name and (not given or given < 0.0):  # reported
        return nothing
    if diameter is None:
        data.take(key, keys_of(Fit)[key].sample)
        return nothing
    within = 0.0 < diameter < raceway if key == "bore" else diameter > raceway
    if not within:
        data.fault(
            key,
            "the raceway is not within its ring",
            given=f"{diameter:.6g} m, raceway {raceway:.6g} m",
            allowed="bore < inner raceway, outer raceway < outside_diameter",
            remedy="correct the diameter of the ring",
        )
        return nothing
    rate = change(1.0, diameter, raceway)
    if not name:
        return Spread.within(given or 0.0, given or 0.0), rate
    try:
        return tolerances.seat_interference(name, diameter, fit.roughness), rate
    except ValueError as fault:
        data.fault(
            seat,
            str(fault),
            given=show(name),
            allowed="diameters above 3 mm to 180 mm; j to 120 mm, J6 and J7 from above 6 mm",
            remedy="give the effective interference of the ring instead",
        )
        return nothing
