"""The page docs/extremes.md from the rows of a tour."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from extremes import coverage, figures
from extremes.case import Row

#: The page's text before its tables.
TEMPLATE = Path(__file__).with_name("page.md")


def write(rows: Sequence[Row], page: Path, seconds: float) -> None:
    """Write page and figures."""
    images = page.parent / "images"
    images.mkdir(parents=True, exist_ok=True)
    figures.write(rows, images)
    broken = [row for row in rows if not row.holds]
    refused = sum(row.finding is not None and row.finding.status.startswith("refused") for row in rows)
    words = {
        "CASES": str(len(rows)),
        "HOLD": str(len(rows) - len(broken)),
        "REFUSED": str(refused),
        "MINUTES": f"{seconds / 60.0:.1f}",
        "PROCESSORS": str(os.cpu_count() or 1),
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    for word, value in words.items():
        text = text.replace(f"@{word}@", value)
    text = text.replace("@COVERAGE@", "\n".join(coverage.table(rows)))
    text = text.replace("@TABLES@", "\n".join(tables(rows)))
    temporary = page.with_suffix(".tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(page)


def tables(rows: Sequence[Row]) -> list[str]:
    """Markdown, a table for each section."""
    lines: list[str] = []
    for group in dict.fromkeys(row.case.group for row in rows):
        lines += [
            f"## {group}",
            "",
            "| case | method | status | error | allowed | against | time |",
            "| --- | --- | --- | ---: | ---: | --- | ---: |",
        ]
        lines += [_row(row) for row in rows if row.case.group == group]
        lines.append("")
    return lines


def _row(row: Row) -> str:
    case, found = row.case, row.finding
    if found is None:
        return f"| {case.name} | {case.method} | **does not hold** | | | {case.against} | {row.seconds:.1f} s |"
    status = found.status if found.holds else "**does not hold**"
    if found.note:
        status += f" ({found.note})"
    error, bound = (f"{value:.2g}" if value is not None else "" for value in (found.error, found.bound))
    return f"| {case.name} | {case.method} | {status} | {error} | {bound} | {case.against} | {row.seconds:.1f} s |"
