"""Rolling elements as standards rate them, one file each.  A new element is a file and a line here, and in `derive`."""

from ballpass.runtime.ratings.elements.ball import RatedBall
from ballpass.runtime.ratings.elements.cylindrical_roller import RatedCylindricalRoller
from ballpass.runtime.ratings.elements.rated import ElementGeometry, RacewayContact, RatedElement

#: Elements by their name in the scene file.
RATED: dict[str, RatedElement] = {element.name: element for element in (RatedBall(), RatedCylindricalRoller())}

__all__ = ["RATED", "ElementGeometry", "RacewayContact", "RatedElement"]
