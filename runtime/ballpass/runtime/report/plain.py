"""A report as plain data: for JSON, as text of JSON, and as a table of pandas."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.json_text import finite
from ballpass.runtime.report.report import Report
from ballpass.runtime.report.units import with_units

if TYPE_CHECKING:
    import pandas


def to_plain(report: Report) -> dict[str, Any]:
    """Mappings, lists, texts and finite numbers; numbers that are not finite are None."""
    found: dict[str, Any] = finite(with_units(report.facts))
    return found


def json_text(plain: Any) -> str:
    """Plain data as indented JSON; numbers that are not finite are null."""
    return json.dumps(finite(plain), indent=2, allow_nan=False) + "\n"


def to_pandas(report: Report) -> pandas.DataFrame:
    """The rows of a report, indexed by the columns that name them."""
    table = need("pandas").DataFrame(list(report.records))
    return table.set_index(list(report.index)) if report.index else table
