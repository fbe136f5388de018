"""Checks of laws and other parts of one's own, for their tests.  Ballpass's own pass them."""

from ballpass.testing.damping_law import ConformanceError, check_damping_law
from ballpass.testing.scene import check_quantity, check_scene

__all__ = ["ConformanceError", "check_damping_law", "check_quantity", "check_scene"]
