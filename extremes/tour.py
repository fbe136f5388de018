"""All cases of the tour, in the order of the page."""

from __future__ import annotations

from extremes import conditions, generated_c, invariants, methods, physics
from extremes.case import Case


def cases() -> list[Case]:
    """Every case."""
    sections = (physics, invariants, methods, conditions, generated_c)
    return [case for section in sections for case in section.cases()]
