"""Rolling elements as standards rate them, one file each.  A new element is a file and a line here, and in `derive`."""

import re
from collections.abc import Iterable

from ballpass.runtime.contract.plugins import Registry
from ballpass.runtime.ratings.elements.ball import RatedBall
from ballpass.runtime.ratings.elements.cylindrical_roller import RatedCylindricalRoller
from ballpass.runtime.ratings.elements.power_law import RatedPowerLaw
from ballpass.runtime.ratings.elements.rated import ElementGeometry, RacewayContact, RatedElement

#: Elements by their name in the scene file.
RATED: Registry[RatedElement] = Registry(
    "rated_elements", "rated rolling element", RatedElement, (RatedBall(), RatedCylindricalRoller(), RatedPowerLaw())
)


def element_words(text: str, elements: Iterable[str]) -> str:
    """A text on balls, with what the elements of these names are called; names of keys and outputs stay.

    Examples
    --------
    >>> element_words("each ball of ball.force", ["cylindrical-roller"])
    'each roller of ball.force'
    """
    nouns = {RATED[name].noun if name in RATED else "rolling element" for name in elements}
    noun = nouns.pop() if len(nouns) == 1 else "rolling element" if nouns else "ball"
    capital = noun[0].upper() + noun[1:]
    return re.sub(r"(?<![\w.])([Bb])all(?=s?\b(?!\.\w))", lambda found: noun if found[1] == "b" else capital, text)


__all__ = ["RATED", "ElementGeometry", "RacewayContact", "RatedElement", "element_words"]
