"""All cases of the tour, in the order of the page."""

from __future__ import annotations

from extremes import conditions, drivers, generated_c, invariants, late_times, methods, physics, sanitized
from extremes.case import Case


def cases() -> list[Case]:
    """Every case."""
    sections = (physics, late_times, invariants, methods, drivers, conditions, generated_c, sanitized)
    return [case for section in sections for case in section.cases()]
