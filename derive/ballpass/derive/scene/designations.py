"""Bearings by designation, and groups of clearance.

In: a designation ("6204"), a bore.  Out: dimensions, elements and ratings of catalogues; the clearance of a group.
Where the numbers are from, and which of them no standard fixes, is said at the head of each table (``*.csv``).
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from importlib.resources import files

#: Groove radius over ball diameter, inner and outer: reference values of ISO 16281.
GROOVES = (Decimal("0.52"), Decimal("0.53"))
#: Groups of radial clearance of bearings with cylindrical bore; ISO 5753-1.  It is the diametral clearance P_d: the way
#: of one ring from one side to the other.  Their ranges are in ``clearances.csv``.
GROUPS = ("C2", "CN", "C3", "C4", "C5")
#: The usual bearings: their table comes first, and says nothing of their element.
FIRST = "deep_groove.csv"
MAKERS = ("nsk", "koyo", "skf")


@dataclass(frozen=True, slots=True, kw_only=True)
class CatalogueRating:
    """Ratings of one maker's catalogue: C, C_0 and, where it prints one, the fatigue load limit [N]."""

    maker: str
    dynamic: float
    static: float
    limit: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingType:
    """A bearing of a table; lengths as decimals in mm, so that what follows from them is exact.

    `length` is the effective one of rollers, None of balls.
    """

    designation: str
    element: str
    bore: Decimal
    outside: Decimal
    width: Decimal
    balls: int
    ball_diameter: Decimal
    pitch_diameter: Decimal
    length: Decimal | None
    catalogues: tuple[CatalogueRating, ...]

    def clearance(self, group: str) -> tuple[int, int] | None:
        """Lowest and highest clearance of a group [µm]; None where ISO 5753-1 has none for this bore."""
        rows = (row for row in _rows("clearances.csv") if row["element"] == self.element)
        text = next(row for row in rows if self.bore <= int(row["bore"]))[group]
        least, _, most = text.partition("-")
        return (int(least), int(most)) if text else None


@cache
def _rows(table: str) -> list[dict[str, str]]:
    """Rows of a table, without its notes."""
    text = files("ballpass.derive.scene").joinpath(table).read_text(encoding="utf-8")
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


@cache
def bearing_types() -> dict[str, BearingType]:
    """All bearings of the tables by designation, in their order."""
    names = (path.name for path in files("ballpass.derive.scene").iterdir() if path.name.endswith(".csv"))
    rows = (row for name in sorted(names, key=lambda name: (name != FIRST, name)) for row in _rows(name))
    return {row["designation"]: _bearing_type(row) for row in rows if "designation" in row}


def _bearing_type(row: dict[str, str]) -> BearingType:
    bore, outside = Decimal(row["bore"]), Decimal(row["outside"])
    catalogues = []
    for maker in MAKERS:
        if row.get(f"{maker}_dynamic"):
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
        element=row.get("element", "ball"),
        bore=bore,
        outside=outside,
        width=Decimal(row["width"]),
        balls=int(row["balls"]),
        ball_diameter=Decimal(row["ball_diameter"]),
        # a rule, not a standard, where the table has none: the mean of bore and outside diameter
        pitch_diameter=Decimal(row["pitch_diameter"]) if "pitch_diameter" in row else (bore + outside) / 2,
        length=Decimal(row["length"]) if "length" in row else None,
        catalogues=tuple(catalogues),
    )
