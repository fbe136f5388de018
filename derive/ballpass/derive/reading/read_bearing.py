"""The tables [shaft] and [bearing] of a scene file to their records.

In: the tables.  Out: records, possibly with placeholders where faults were noted (see `table.py`).
"""

from __future__ import annotations

from dataclasses import replace

from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.elements import ELEMENTS, RollingElement
from ballpass.derive.bearing.laws import LAWS
from ballpass.derive.reading.read_cage import read_cage
from ballpass.derive.reading.read_coupling import check_count, read_coupling, read_inner_body
from ballpass.derive.reading.read_designation import fill_by_designation
from ballpass.derive.reading.read_duty import read_alignment, read_lubrication
from ballpass.derive.reading.read_fit import mounted
from ballpass.derive.scene.bearing_records import (
    BallEffect,
    Bearing,
    Damping,
    EquivalentMass,
    InitialState,
    InnerRing,
    OuterRing,
)
from ballpass.derive.scene.keys import ChoiceKey, Needs, PairKey
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.rating_records import Catalogue
from ballpass.derive.scene.read_keys import Either, choices_of, keys_of, read_inner, read_keys, read_record
from ballpass.derive.scene.shaft_records import Shaft
from ballpass.derive.scene.table import FRAME, Table, listing, suggest
from ballpass.derive.scene.units import show

#: Keys that every bearing has.
_NUMBERS = (
    *("balls", "ball_diameter", "pitch_diameter", "clearance", "ball_angle"),
    *("contact_angle", "axial_displacement", "axial_force", "shoulder_height"),
)
#: Its other keys and tables.
_TABLES = (
    *("designation", "element", "fit", "contact", "damping", "inner_ring", "outer_ring", "initial", "cage"),
    *("lubrication", "alignment"),
)
ELEMENT = ChoiceKey(
    words="Kind of the rolling elements",
    choices=ELEMENTS,
    default=next(iter(ELEMENTS)),
    note='in names of other keys and of outputs "ball" stands for all',
)
MASS = Either(what="the moved mass", groups=(("mass",), ("equivalent_mass",)))
SUPPORT = ChoiceKey(words="Support of the outer ring", choices=("elastic", "fixed"), note="fixed: nothing else")
LAW = ChoiceKey(words="Law of the damping at a ball", choices=LAWS)
_MOVING_OUTER = (
    Needs(
        key="support",
        value="elastic",
        why="a fixed outer ring has no initial state",
        remedy='delete the key, or write support = "elastic" in the table outer_ring',
    ),
)
#: Keys of the start, in this order.
INITIAL = {
    f"{part}{ending}": PairKey(
        unit=unit,
        words=f"{words} of the {part} ring at the start, AXIS",
        symbol=f"{accent}AXIS_{{{part[0]}}}(0)",
        example=f"0 {unit}",
        default=f"0 {unit}",
        when="default: zeros" + "; refused with a fixed outer ring" * (part == "outer"),
        needs=_MOVING_OUTER * (part == "outer"),
    )
    for ending, unit, words, accent in (("", "m", "Centre", ""), ("_velocity", "m/s", "Velocity", r"\dot "))
    for part in ("inner", "outer")
}


def read_shaft(table: Table) -> Shaft:
    """Speed of the inner ring where no mechanism turns it."""
    with table:
        table.refuse(
            [key for key in ("bending_stiffness", "diameter", "stiffness", "young_modulus") if key in table.data],
            "the shaft is rigid: it tilts in its bearings, and does not bend",
            allowed=", ".join(keys_of(Shaft)),
            remedy="delete the key; take a rotor program for a shaft that bends, or [bearings.NAME.alignment] for the "
            "tilt that bending gives a bearing",
        )
        return read_record(Shaft, table)


def read_bearing(table: Table, mechanism: Mechanism | None, driven: str | None, tilts: bool, name: str = "") -> Bearing:
    """A bearing; with a mechanism it must sit at the driver's joint.

    `driven` is the driven body, None where there is no mechanism or the driver has a fault; `tilts` says whether it, or
    the shaft, tilts in its bearings.
    """
    with table:
        keys = keys_of(Bearing)
        table.know(*keys, *keys_of(Catalogue), *_TABLES, *EFFECTS)
        coupling = read_coupling(table, mechanism)
        catalogue = fill_by_designation(table)
        element = ELEMENTS[ELEMENT.read(table, "element") or next(iter(ELEMENTS))]
        support, outer = _read_outer_ring(table)
        named = table.data.get("joint")
        inner_body = ""
        if coupling == "two-way":
            inner_body = read_inner_body(table, mechanism, named if isinstance(named, str) else None)
            tilts = tilts and mechanism is not None and (named, inner_body) == (mechanism.driver.joint, driven)
        joint, share, position, count, offset = _read_place(table, mechanism, driven, coupling, tilts)
        contact = table.data.get("contact")
        stiff = isinstance(contact, dict) and "stiffness" in contact
        facts = {"element": element.name, "contact": "stiffness" if stiff else "grooves"}
        numbers = read_keys(table, {name: keys[name] for name in _NUMBERS}, choices_of(Bearing)[:1], facts)
        ball, pitch = numbers["ball_diameter"].value, numbers["pitch_diameter"].value
        numbers["clearance"], catalogue, fit = mounted(table, catalogue, numbers["clearance"], ball, pitch)
        return Bearing(
            name=name,
            joint=joint,
            share=share,
            position=position,
            offset=offset,
            tilts=tilts,
            coupling=coupling,
            inner_body=inner_body,
            count=count,
            **numbers,
            contact=element.read_contact(table),
            damping=_read_damping(table, element),
            effects=_read_effects(table, numbers["balls"]),
            inner=_read_inner_ring(table, mechanism is not None, tilts) if coupling == "one-way" else None,
            outer=outer,
            initial=_read_initial(table, support),
            element=element.name,
            catalogue=catalogue,
            cage=read_cage(table),
            lubrication=read_lubrication(table),
            alignment=read_alignment(table),
            fit=fit,
        )


def _read_place(
    table: Table, mechanism: Mechanism | None, driven: str | None, coupling: str, tilts: bool
) -> tuple[
    str | None, SceneNumber | None, SceneNumber | None, SceneNumber | None, tuple[SceneNumber, SceneNumber] | None
]:
    """Joint of a bearing, its share of the reaction or its place, number of bearings side by side, housing's offset."""
    keys = {key: keys_of(Bearing)[key] for key in ("joint", "share", "position", "count", "offset")}
    carries = replace(choices_of(Bearing)[1], optional=not tilts and (mechanism is None or coupling == "two-way"))
    if mechanism is not None:
        keys["joint"] = replace(keys["joint"], example=mechanism.driver.joint or "A")
    on_tilting = True if tilts else None
    facts = {"mechanism": mechanism, "coupling": coupling, "tilts": on_tilting}
    facts["parted"] = True if coupling == "one-way" else on_tilting
    name, share, position, count, offset = read_keys(table, keys, (carries,), facts).values()
    check_count(table, count)
    if tilts and share is not None:
        table.fault(
            "share",
            "the shaft tilts, and stiffnesses part its forces between its bearings",
            given=show(table.data["share"]),
            allowed='position, as in "40 mm"',
            remedy="give the bearing its position, or delete transverse_inertia",
        )
    place = name, share, position, count, offset
    if mechanism is None or not name or not mechanism.joints:
        return place
    joint = next((joint for joint in mechanism.joints if joint.name == name), None)
    names, given = [joint.name for joint in mechanism.joints], show(name)
    if joint is None:
        problem, allowed = f"there is no joint {show(name)}", listing(names)
        remedy = suggest(name, names, "name the driver's joint")
    elif joint.kind is None or not joint.bodies:  # reported
        return place
    elif coupling == "two-way" and joint.kind != "revolute":
        problem, remedy = "the bearing must sit at a revolute joint", "name one of these joints"
        given = f"{given}, a {joint.kind} joint"
        allowed = listing([j.name for j in mechanism.joints if j.kind == "revolute"])
    elif (
        coupling == "one-way" and driven is not None and joint.name not in (hinges := _driven_hinges(mechanism, driven))
    ):
        problem = (
            "a bearing that is loaded one-way must sit at the driver's joint, or hold a wheel of a gear to the frame: "
            "its inner ring turns with the driver"
        )
        given = f"{given}, a {joint.kind} joint with bodies {listing(joint.bodies)}"
        allowed, remedy = listing(hinges), f'write joint = "{mechanism.driver.joint}", or coupling = "two-way"'
    elif coupling == "one-way" and joint.name != mechanism.driver.joint and (tilts or position is not None):
        problem, remedy = "places along the shaft, and its tilts, are those of the driven body", "write share = 1"
        allowed = f"{show(mechanism.driver.joint)}; elsewhere a share, where the driven body does not tilt"
    else:
        return place
    table.fault("joint", problem, given=given, allowed=allowed, remedy=remedy)
    return place


def _driven_hinges(mechanism: Mechanism, driven: str) -> list[str]:
    """Hinges on the frame of bodies that the driver turns, or a gear."""
    turned = {driven, *(wheel for gear in mechanism.gears for wheel in gear.bodies)}
    hinges = (joint for joint in mechanism.joints if joint.kind == "revolute" and FRAME in joint.bodies)
    return [joint.name for joint in hinges if joint.other(FRAME) in turned]


def _read_damping(table: Table, element: RollingElement) -> Damping:
    with table.table("damping", 'law = "tangent" and ratio = "0.25e-5 s"') as damping:
        damping.know("law")
        name = LAW.read(damping, "law")
        if name is None or name != damping.data["law"]:  # a guess does not say which keys belong here
            damping.know(*damping.data)
            return Damping(law="none", numbers=(), smoothing=None)
        law, known = LAWS[name], {"law": name, "numbers": ()}
        others = {key for other in LAWS.values() for key in other.keys}
        samples = " and ".join(f"{own} = {declared.sample}" for own, declared in law.keys.items())
        for key in (key for key in damping.data if key in others and key not in law.keys):
            damping.refuse(
                (key,),
                f'the law "{name}" has no {key}',
                allowed=samples or "no further key",
                remedy="delete the key" + f" and write {samples}" * bool(samples) + ", or name another law",
            )
        if not law.kinked_at_rest:
            known["smoothing"] = None
            kinked = [other.name for other in LAWS.values() if other.kinked_at_rest]
            damping.refuse(
                ("smoothing",),
                f'the law "{name}" has no kink at rest',
                allowed=f"smoothing with the laws {listing(kinked)}",
                remedy="delete the key; smoothing in [bearing.contact] smooths the contact onset",
            )
        return read_record(Damping, damping, **known | {"numbers": law.read(damping, element.fill)})


def _read_effects(table: Table, balls: int) -> tuple[BallEffect, ...]:
    return tuple(effect.read(table.table(kind), balls) for kind, effect in EFFECTS.items() if table.has(kind))


def _read_inner_ring(table: Table, with_mechanism: bool, tilts: bool) -> InnerRing:
    with table.table("inner_ring", 'mass = "0.4 kg"', required=not tilts) as ring:
        if tilts:
            ring.refuse(
                [key for key in ("mass", "equivalent_mass") if key in ring.data],
                "the inner ring moves with the shaft that tilts, whose mass contains the ring",
                allowed="damping alone",
                remedy="delete the key",
            )
            return read_record(InnerRing, ring, mass=None)
        chosen = MASS.choose(ring, keys_of(InnerRing))
        ring.missing = ring.missing or not chosen
        if chosen != ("equivalent_mass",):
            return read_record(InnerRing, ring)
        if not with_mechanism:
            ring.refuse(
                ("equivalent_mass",),
                "Eq. (3) takes the mass of the driven body, and there is no mechanism",
                allowed='mass, as in "0.4 kg"',
                remedy='write mass = "0.4 kg" instead',
            )
        mass = read_inner(EquivalentMass, ring, "equivalent_mass", "ring, crankpin and crank")
        return read_record(InnerRing, ring, mass=mass)


def _read_outer_ring(table: Table) -> tuple[str | None, OuterRing | None]:
    """Support of the outer ring, None with a fault, and its numbers where it moves."""
    with table.table("outer_ring", 'support = "fixed"') as ring:
        ring.know("support", *keys_of(OuterRing))
        support = SUPPORT.read(ring, "support")
        found = read_record(OuterRing, ring, facts={"support": support})
    return support, found if support == "elastic" else None


def _read_initial(table: Table, support: str | None) -> InitialState:
    with table.table("initial", required=False) as initial:
        read = read_keys(initial, INITIAL, facts={"support": support})
    given = {key: pair for key, pair in read.items() if pair is not None}
    return InitialState(
        position=tuple(q for key, pair in given.items() if "velocity" not in key for q in pair),
        velocity=tuple(q for key, pair in given.items() if "velocity" in key for q in pair),
    )
