"""Checks of a damping law of one's own, for its tests.  Ballpass's own laws pass them."""

from ballpass.testing.damping_law import ConformanceError, check_damping_law

__all__ = ["ConformanceError", "check_damping_law"]
