"""Wear of a raceway by Archard's law, from the slip within its contacts.

In: loads of a ball, its contact.  Out: depths over the wear coefficient [N/m]; times the coefficient [m^2/N], in m.

Source: Archard 1953, doi:10.1063/1.1721448; the slip is that of the element's contact, of balls by Heathcote, see
`groove_slip`.
"""

from __future__ import annotations

from typing import Any

from ballpass.runtime.ratings.of_bearing import RacewayContact

#: Wear coefficient of mild wear, least and most [m^2/N]: 1e-8 to 1e-4 mm^3/(N m).  That of a bearing lies between, by
#: lubricant and surface.
COEFFICIENTS = (1e-17, 1e-13)


def depth_of_pass(place: Any, load: Any, contact: RacewayContact) -> Any:
    """Depth that a pass of a ball wears off at a place across the groove, over the wear coefficient [N/m].

    The pressure along the way of the ball, integrated, times the share of the way that slips; of a ball
    (π/2) p_0 b (1 - x²/a²) abs(s(x)).  It holds within the contact; beyond it there is no wear.

    Parameters
    ----------
    place : x, from the middle of the groove, abs(x) < a [m]
    load : of the ball, above 0 [N]
    """
    return contact.depth_of_pass(place, load)
