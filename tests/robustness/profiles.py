"""How long the tests of limits take.

BALLPASS_LONG=1 lets hypothesis draw more scenes, and others of them on every run, kills more processes and runs more
simulations.
"""

from __future__ import annotations

import os

from hypothesis import settings

#: Whether the long profile was asked for.
LONG = bool(os.environ.get("BALLPASS_LONG"))


def examples(quick: int, long: int) -> settings:
    """So many examples; the same ones on every run of the quick profile."""
    return settings(max_examples=long if LONG else quick, derandomize=not LONG, deadline=None)
