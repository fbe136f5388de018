"""Text with a unit to a number in SI, with all units that pint knows.

The grammar, and the sizes of the usual units, are in `ballpass.runtime.contract.units`.  pint is used only for the
size of any other unit: pint and its definitions take a third of a second to load.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ballpass.runtime.contract import units
from ballpass.runtime.contract.units import COMMON, KINDS, GrammarError, QuantityError, UnitSize, show, unit_hint

if TYPE_CHECKING:
    import pint

__all__ = ["COMMON", "KINDS", "QuantityError", "check_unit", "looked_up_size", "parse_quantity", "show"]


def parse_quantity(given: object, unit: str) -> float:
    """Value in SI of a text or number of a scene file; see `ballpass.runtime.contract.units.parse_quantity`."""
    return units.parse_quantity(given, unit, looked_up_size)


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    """Pint's registry in rational arithmetic; made at the first use, because reading its definitions takes 0.2 s."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction, cache_folder=None)


@lru_cache(maxsize=512)
def looked_up_size(name: str) -> UnitSize:
    """Size of a unit of this name, as pint has it."""
    import pint
    from pint.util import UnitsContainer

    registry = _registry()
    try:
        # A container instead of text: pint's parser of expressions is not used.
        unit = UnitsContainer({registry.get_name("deg" if name == "°" else name): 1})
        zero, one = (registry.Quantity(Fraction(number), unit).to_root_units() for number in (0, 1))
    except (pint.UndefinedUnitError, pint.DefinitionSyntaxError):
        raise GrammarError(f"no unit is called {show(name)}", unit_hint(name)) from None
    except TypeError:  # a logarithmic unit (dB), which rational arithmetic cannot hold
        raise _not_proportional(name) from None
    if zero.magnitude != 0:
        raise _not_proportional(name)
    return UnitSize(
        exact=Fraction(str(one.magnitude)),
        rounded=1.0,
        base=tuple(sorted((str(base), Fraction(str(power))) for base, power in one.unit_items())),
    )


def check_unit(text: str) -> None:
    """Refuse what is no unit; a number without one has the unit "1"."""
    if not text:
        raise GrammarError('no unit is given; a number without one has the unit "1"', 'write "1"')
    units.unit_size(text, looked_up_size)


def _not_proportional(name: str) -> GrammarError:
    return GrammarError(f'"{name}" is an offset or logarithmic unit', "use a unit that is proportional to its SI unit")
