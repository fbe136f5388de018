"""The numbers of a scene as a page shows them: words, unit, the range of a slider, which come first.

In: the manifest, values, and units by name where a scene file has its own.  Out: plain numbers for JSON.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping
from typing import Any

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest, ParameterInfo
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.contract.units import QuantityError, parse_quantity

#: Units that people read numbers in, by SI unit, where a scene file says nothing else.
READ_IN = {
    "m": "mm",
    "rad": "deg",
    "rad/s": "rpm",
    "kg*m^2": "kg*mm^2",
    "Pa": "bar",
    "s*m^0.5": "s*mm^0.5",
    "m^2/s": "mm^2/s",
}

#: Lengths below this are read in micrometres [m].
SMALL = 1e-4

#: What people change first, in this order, and how many such numbers stand in front of the search.
CHOSEN = (
    r"bearings?(\.\w+)?\.clearance",
    r"bearings?(\.\w+)?\.damping\.\w+",
    r"mechanism\.driver\.speed|shaft\.speed",
    r"mechanism\.(forces|torques)\.\w+\.(force\.\w+|torque)|loads?(\.\w+)?\.(force\.\w+|unbalance|magnitude)",
    r"bearings?(\.\w+)?\.outer_ring\.stiffness",
    r"mechanism\.driver\.torque\.\w+",
    r"mechanism\.bodies\.\w+\.mass",
    r"bearings?(\.\w+)?\.inner_ring\.(\w+\.)?\w+",
)
FIRST = 8

#: Half the range of a slider of a number that is zero, by SI unit.
_AROUND_ZERO = {"m": 1e-3, "rad": math.pi, "m/s": 0.1, "N": 1000.0, "N*m": 10.0}


def check_units(manifest: Manifest, units: Mapping[str, str]) -> None:
    """Refuse units of unknown parameters, and units that are none.

    Raises
    ------
    RequestError
        All faults at once.
    """
    own = {info.name: info.unit for info in manifest.parameters}
    faults = []
    for name, unit in units.items():
        if name not in own:
            faults.append(unknown_name("parameter", name, own))
        elif not isinstance(unit, str) or unit != own[name]:
            try:
                parse_quantity(f"1 {unit}", own[name])
            except QuantityError as fault:
                faults.append(f"units: {name}: {fault}")
    if faults:
        raise RequestError("\n".join(faults))


def sliders(manifest: Manifest, values: Mapping[str, float], units: Mapping[str, str]) -> list[dict[str, Any]]:
    """A row for each parameter, in the manifest's order.

    Parameters
    ----------
    values : of all parameters [SI]
    units : by name of a parameter, where it is read in another one than the usual
    """
    first = _first(manifest, values)
    alike = Counter(info.description for info in manifest.parameters)
    rows = []
    for info in manifest.parameters:
        value = values[info.name]
        small = info.unit == "m" and (abs(value) < SMALL if value else info.name.endswith(".clearance"))
        common = "um" if small else "GPa" if info.name.endswith("modulus") else READ_IN.get(info.unit, info.unit)
        unit = units.get(info.name) or common
        low, high, logarithmic = _range(manifest, info, value, values)
        rows.append(
            {
                "name": info.name,
                # of several bearings the same numbers have the same words
                "words": info.description if alike[info.description] == 1 else f"{info.description} ({info.name})",
                "unit": "" if unit == "1" else unit,
                "factor": 1.0 if unit == "1" else parse_quantity(f"1 {unit}", info.unit),
                "value": value,
                "low": low,
                "high": high,
                "log": logarithmic,
                "first": first.index(info.name) if info.name in first else None,
            }
        )
    return rows


def _first(manifest: Manifest, values: Mapping[str, float]) -> list[str]:
    """What stands in front of the search; of zeros, which many scenes have to fill a place, clearances alone."""
    names = [info.name for info in manifest.parameters]
    found = [name for kind in CHOSEN for name in names if re.fullmatch(kind, name)]
    return [name for name in dict.fromkeys(found) if values[name] != 0.0 or name.endswith(".clearance")][:FIRST]


def _range(
    manifest: Manifest, info: ParameterInfo, value: float, values: Mapping[str, float]
) -> tuple[float, float, bool]:
    """Ends of a slider [SI], and whether it moves by factors; a field beside it takes all that is allowed."""
    if ".damping." in info.name and value > 0.0:
        return value / 30.0, 30.0 * value, True
    if info.unit == "rad":
        low, high = value - math.pi / 2.0, value + math.pi / 2.0
    elif value == 0.0:
        half = _AROUND_ZERO.get(info.unit, 1.0)
        low, high = -half, half
    else:
        # speeds, masses and lengths near zero make other machines
        near = value / 5.0 if info.above == 0.0 or info.unit == "rad/s" else 0.0
        low, high = sorted((near, 3.0 * value))
    usual = next((one for one in manifest.usual if one.names == (info.name,) and one.of), None)
    if usual is not None and usual.least is not None and usual.least < 0.0 <= value:
        # clearances below zero are preloads, which are worth a look
        most = abs(usual.least * values[usual.of])
        low, high = (-min(value, most), high) if value else (-most / 2.0, most / 2.0)
    bounds = ((info.least, info.above), (info.most, info.below))
    low = max([low, *(bound for bound in bounds[0] if bound is not None)])
    high = min([high, *(bound for bound in bounds[1] if bound is not None)])
    if low == info.above:  # which itself is not allowed
        low = min(value, high) / 100.0
    return low, high, False
