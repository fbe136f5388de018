"""A bearing by its designation: keys that the scene leaves out are filled in from the table of bearings.

In: the table of a bearing.  Out: the same with balls, diameters, clearance and grooves filled in, as text in the
form of the scene file; and the record of the catalogue's values.
"""

from __future__ import annotations

from decimal import Decimal

from ballpass.derive.bearing.elements import ELEMENTS
from ballpass.derive.reading.clearance_groups import no_group
from ballpass.derive.scene.designations import GROUPS, BearingType, bearing_types
from ballpass.derive.scene.keys import TextKey
from ballpass.derive.scene.rating_records import Catalogue
from ballpass.derive.scene.read_keys import keys_of, read_record
from ballpass.derive.scene.table import Table, listing, suggest
from ballpass.derive.scene.units import show

#: Bearing steel of rings and balls, where a designation gives the geometry.
YOUNG_MODULUS, POISSON_RATIO = "207 GPa", 0.3
RATINGS = keys_of(Catalogue)
SIZES = ("balls", "ball_diameter", "pitch_diameter")
DESIGNATION = TextKey(
    words="A bearing of the table", example="6204", optional=True, note="supplies the keys below that are not given"
)


def fill_by_designation(table: Table) -> Catalogue | None:
    """Fill in what the designation of a bearing gives; None where the scene takes nothing from a catalogue."""
    kind = _bearing_type(table) if table.has("designation") else None
    lacks = kind is None and table.data.get("clearance") in GROUPS and not any(key in table.data for key in SIZES)
    group = _clearance_group(table, kind)
    if lacks:  # reported with the clearance; what the designation gives is not missing as well
        kind = bearing_types()["6204"]
    span = kind.clearance(group) if kind is not None and group else None
    if kind is not None:
        filled: dict[str, object] = {
            "element": kind.element,
            "balls": kind.balls,
            "ball_diameter": f"{kind.ball_diameter} mm",
            "pitch_diameter": f"{kind.pitch_diameter} mm",
        }
        if span is not None:
            filled["clearance"] = f"{Decimal(sum(span)) / 2} um"
        given = {key: value for key, value in table.data.items() if key != "clearance" or not group}
        table.data = filled | given
        _check_element(table, kind)
        _fill_contact(table, kind)
    catalogue = read_record(
        Catalogue,
        table,
        designation=kind.designation if kind is not None else "",
        clearance_group=group if span is not None else "",
        clearance_range=(span[0] / 1e6, span[1] / 1e6) if span is not None else None,
        mounting_loss=0.0,
    )
    return None if kind is None and not any(key in table.data for key in RATINGS) else catalogue


def _bearing_type(table: Table) -> BearingType:
    types, given = bearing_types(), table.data["designation"]
    number = isinstance(given, int) and str(given) not in types
    name = str(given) if number else DESIGNATION.read(table, "designation")
    if not name or name in types:
        return types[name or "6204"]
    others = [name for name, kind in types.items() if kind.element != "ball"]
    table.fault(
        "designation",
        "the table of bearings does not have it",
        given=show(name),
        allowed=", ".join(["6000 to 6016, 6200 to 6216, 6300 to 6316, 618/3 to 61805, 619/3 to 61905", *others])
        + ", without suffixes",
        remedy=suggest(name, list(types), "see `ballpass bearings`, or give balls and diameters as numbers"),
    )
    return types["6204"]  # so that this fault causes no others; the record is never used


def _clearance_group(table: Table, kind: BearingType | None) -> str:
    """Name of the clearance group; empty where the clearance is a number."""
    given = table.data.get("clearance", "CN" if kind is not None else None)
    if given in GROUPS and kind is not None and kind.clearance(given) is not None:
        return str(given)
    allowed, remedy = f'{listing(GROUPS)}, or a length, as in "10 um"', "write the clearance as a number"
    if given in GROUPS and kind is None:
        problem = "a group of clearance holds for a bore, and none is known"
        allowed = 'a length, as in "10 um"; a group only together with designation'
        remedy = f'add designation = "6204", or {remedy}'
    elif given in GROUPS and kind is not None:
        problem, allowed = no_group(kind)
        remedy = f"name one of them, or {remedy}"
    elif kind is not None and isinstance(given, str) and given[:1].isalpha():
        problem = "this is not a clearance group"
        remedy = suggest(given, GROUPS, 'write clearance = "CN" for the normal group')
    else:
        return ""
    table.fault("clearance", problem, given=show(given), allowed=allowed, remedy=remedy)
    table.data = {**table.data, "clearance": "0 um"}  # the fault is reported; no second one
    return ""


def _fill_contact(table: Table, kind: BearingType) -> None:
    """What the element's contact needs, and steel; of these, what goes with a stiffness where the scene gives one."""
    contact, element = table.data.get("contact", {}), ELEMENTS[kind.element]
    if not isinstance(contact, dict):
        return
    filled: dict[str, object] = {"young_modulus": YOUNG_MODULUS, "poisson_ratio": POISSON_RATIO}
    filled |= element.fill_contact(table.data["ball_diameter"], kind)
    if "stiffness" in contact:
        filled = {key: value for key, value in filled.items() if key in keys_of(element.given)}
    table.data = {**table.data, "contact": filled | contact}


def _check_element(table: Table, kind: BearingType) -> None:
    given = table.data["element"]
    if given in ELEMENTS and given != kind.element:
        table.fault(
            "element",
            f"the bearing {kind.designation} has other rolling elements",
            given=show(given),
            allowed=show(kind.element),
            remedy="delete the key, or the designation",
        )
        table.data = {**table.data, "element": kind.element}  # no second fault
