"""Slip within the contact of a ball and a conforming groove (Heathcote).

The contact is curved across the groove, so that only two lines of it roll; between them the ball slips one way, beyond
them the other.  Without traction the friction of the three strips is in balance.
Source: Heathcote 1921, The ball bearing; Johnson, Contact Mechanics, 1985, section 8.5.
"""

from __future__ import annotations

import math
from typing import Any

#: Place of the pure-rolling lines over the semi-axis across the groove: the root of c³ - 3 c + 1 in (0, 1).
PURE_ROLLING = 2.0 * math.cos(4.0 * math.pi / 9.0)


def creepage(place: Any, semi_axis: Any, ball_diameter: Any, raceway_radius: Any, groove_radius: Any) -> Any:
    """Speed of slip over speed of rolling at a place across the groove; zero on the two pure-rolling lines [1].

    Parameters
    ----------
    place : from the middle of the contact, across the groove [m]
    semi_axis : of the contact across the groove [m]
    ball_diameter : [m]
    raceway_radius : of the groove's bottom from the bearing's axis, negative for an outer ring [m]
    groove_radius : of the groove's cross section [m]
    """
    # the deformed contact has the mean of both curvatures; radii of rolling change by its depth
    curvature = (2.0 / ball_diameter + 1.0 / groove_radius) / 2.0
    along = 2.0 / ball_diameter + 1.0 / raceway_radius
    return along * curvature / 2.0 * (place**2 - (PURE_ROLLING * semi_axis) ** 2)
