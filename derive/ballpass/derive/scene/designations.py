"""Deep groove ball bearings by designation, and groups of clearance.

In: a designation ("6204"), a bore.  Out: dimensions, balls and ratings of catalogues; the clearance of a group.  Where
the numbers are from, and which of them no standard fixes, is said at the head of ``deep_groove.csv``.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from importlib.resources import files

#: Groove radius over ball diameter, inner and outer: reference values of ISO 16281.
GROOVES = (Decimal("0.52"), Decimal("0.53"))
#: Radial clearance of deep groove ball bearings with cylindrical bore, lowest and highest [µm], by the bore up to which
#: [mm] it holds; ISO 5753-1.  It is the diametral clearance P_d: the way of one ring from one side to the other.
GROUPS = ("C2", "CN", "C3", "C4", "C5")
_CLEARANCES: tuple[tuple[int, tuple[tuple[int, int] | None, ...]], ...] = (
    (6, ((0, 7), (2, 13), (8, 23), None, None)),
    (10, ((0, 7), (2, 13), (8, 23), (14, 29), (20, 37))),
    (18, ((0, 9), (3, 18), (11, 25), (18, 33), (25, 45))),
    (24, ((0, 10), (5, 20), (13, 28), (20, 36), (28, 48))),
    (30, ((1, 11), (5, 20), (13, 28), (23, 41), (30, 53))),
    (40, ((1, 11), (6, 20), (15, 33), (28, 46), (40, 64))),
    (50, ((1, 11), (6, 23), (18, 36), (30, 51), (45, 73))),
    (65, ((1, 15), (8, 28), (23, 43), (38, 61), (55, 90))),
    (80, ((1, 15), (10, 30), (25, 51), (46, 71), (65, 105))),
    (100, ((1, 18), (12, 36), (30, 58), (53, 84), (75, 120))),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CatalogueRating:
    """Ratings of one maker's catalogue: C, C_0 and, where it prints one, the fatigue load limit [N]."""

    maker: str
    dynamic: float
    static: float
    limit: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingType:
    """A bearing of the table; lengths as decimals in mm, so that what follows from them is exact."""

    designation: str
    bore: Decimal
    outside: Decimal
    width: Decimal
    element: str = "ball"
    balls: int
    ball_diameter: Decimal
    catalogues: tuple[CatalogueRating, ...]

    @property
    def pitch_diameter(self) -> Decimal:
        """Mean of bore and outside diameter [mm]: a rule, not a standard."""
        return (self.bore + self.outside) / 2

    def clearance(self, group: str) -> tuple[int, int] | None:
        """Lowest and highest clearance of a group [µm]; None where ISO 5753-1 has none for this bore."""
        row = next(row for bore, row in _CLEARANCES if self.bore <= bore)
        return row[GROUPS.index(group)]


@cache
def bearing_types() -> dict[str, BearingType]:
    """All bearings of the table by designation, in its order."""
    text = files("ballpass.derive.scene").joinpath("deep_groove.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    return {row["designation"]: _bearing_type(row) for row in rows}


def _bearing_type(row: dict[str, str]) -> BearingType:
    catalogues = []
    for maker in ("nsk", "koyo", "skf"):
        if row[f"{maker}_dynamic"]:
            limit = row.get(f"{maker}_limit")
            catalogues.append(
                CatalogueRating(
                    maker=maker,
                    dynamic=float(row[f"{maker}_dynamic"]),
                    static=float(row[f"{maker}_static"]),
                    limit=float(limit) if limit else None,
                )
            )
    return BearingType(
        designation=row["designation"],
        bore=Decimal(row["bore"]),
        outside=Decimal(row["outside"]),
        width=Decimal(row["width"]),
        balls=int(row["balls"]),
        ball_diameter=Decimal(row["ball_diameter"]),
        catalogues=tuple(catalogues),
    )
