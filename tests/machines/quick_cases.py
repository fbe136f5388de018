"""Parameters of which a few run with the quick tests, the others with the long ones."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def long_but(cases: Iterable[Any], *quick: str) -> list[Any]:
    """The cases, all but those of these names long."""
    cases = list(cases)
    missing = set(quick) - {str(case) for case in cases}
    assert not missing, f"no case is called {', '.join(sorted(missing))}"
    return [case if str(case) in quick else pytest.param(case, marks=pytest.mark.long) for case in cases]
