"""The tables [shaft] and [bearing] of a scene file to their records.

In: the tables.  Out: records, possibly with placeholders where faults were noted (see `schema.py`).
"""

from __future__ import annotations

from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.laws import LAWS
from ballpass.derive.reading.read_cage import read_cage
from ballpass.derive.reading.read_coupling import read_count, read_coupling, read_inner_body, refuse_effects
from ballpass.derive.reading.read_designation import fill_by_designation
from ballpass.derive.reading.read_duty import read_lubrication
from ballpass.derive.reading.read_fit import mounted
from ballpass.derive.scene.bearing_records import (
    BallEffect,
    Bearing,
    Damping,
    EquivalentMass,
    GivenContact,
    HertzContact,
    InitialState,
    InnerRing,
    Material,
    OuterRing,
)
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.records import FRAME, Mechanism, Shaft
from ballpass.derive.scene.schema import Table, listing, suggest
from ballpass.derive.scene.units import show

_HERTZ_KEYS = ("inner_groove_radius", "outer_groove_radius", "young_modulus", "poisson_ratio")
FEWEST_BALLS, MOST_BALLS = 3, 200


def read_shaft(table: Table) -> Shaft:
    """Speed of the inner ring where no mechanism turns it."""
    with table:
        return Shaft(
            speed=table.quantity("speed", "rad/s", "Speed of the shaft", r"\omega", example="1200 rpm"),
        )


def read_bearing(table: Table, mechanism: Mechanism | None, driven: str | None, name: str = "") -> Bearing:
    """A bearing; with a mechanism it must sit at the driver's joint.

    `driven` is the driven body, None where there is no mechanism or the driver has a fault.
    """
    with table:
        table.know("joint", "share", "balls", "ball_diameter", "pitch_diameter", "clearance", "ball_angle", "contact")
        table.know("coupling", "count", "damping", "inner_ring", "outer_ring", "initial", "cage", *EFFECTS)
        coupling = read_coupling(table, mechanism)
        catalogue = fill_by_designation(table)
        joint, share = _read_place(table, mechanism, driven, coupling)
        support = _read_outer_ring(table)
        inner_body = ""
        if coupling == "two-way":
            refuse_effects(table, "coupling two-way", "load the bearing one-way")
            inner_body = read_inner_body(table, mechanism, joint)
        elif mechanism is not None and mechanism.driver.table is not None:
            refuse_effects(table, "mechanism.driver.table", "write speed instead of the table")
        ball = table.quantity("ball_diameter", "m", "Ball diameter", "D_w", example="7.9375 mm")
        pitch = table.quantity(
            "pitch_diameter", "m", "Diameter of the circle of ball centres", "D_{pw}", example="33.5 mm"
        )
        clearance = table.quantity("clearance", "m", "Diametral clearance of the bearing", "P_d", example="10 um")
        clearance, catalogue = mounted(table, catalogue, clearance, ball.value, pitch.value)
        balls = table.integer("balls", FEWEST_BALLS, MOST_BALLS, example="8")
        return Bearing(
            name=name,
            joint=joint,
            share=share,
            coupling=coupling,
            inner_body=inner_body,
            count=read_count(table, coupling),
            balls=balls,
            ball_diameter=ball,
            pitch_diameter=pitch,
            clearance=clearance,
            ball_angle=table.quantity(
                "ball_angle",
                "rad",
                "Angle of the first ball at the start",
                r"\theta_0",
                example="0 deg",
                default="0 deg",
            ),
            contact=_read_contact(table),
            damping=_read_damping(table),
            effects=_read_effects(table, balls),
            inner=_read_inner_ring(table, mechanism is not None) if coupling == "one-way" else None,
            outer=support,
            initial=_read_initial(table, moving_outer=support is not None),
            catalogue=catalogue,
            cage=read_cage(table, "two-way" if coupling == "two-way" else _uneven(mechanism)),
            lubrication=read_lubrication(table),
        )


def _read_place(
    table: Table, mechanism: Mechanism | None, driven: str | None, coupling: str
) -> tuple[str | None, Quantity | None]:
    if mechanism is None:
        for key in ("joint", "share"):
            if table.has(key):
                table.fault(
                    key,
                    "there is no mechanism to load the bearing",
                    given=show(table.data[key]),
                    allowed="joint and share only in a scene with [mechanism]",
                    remedy="delete the key, or describe the mechanism",
                )
        return None, None
    share = None
    if coupling == "one-way":
        words = "Share of the joint's reaction that the bearing carries"
        share = table.quantity("share", "1", words, "s", example="0.5")
    elif table.has("share"):
        table.fault(
            "share",
            "a bearing coupled two-way takes the load that the motion gives it",
            given=show(table.data["share"]),
            allowed="count, the number of bearings side by side",
            remedy="write count = 2 instead of share = 0.5",
        )
    name = table.text("joint", mechanism.driver.joint or "A")
    if not name or not mechanism.joints:
        return name, share
    joint = next((joint for joint in mechanism.joints if joint.name == name), None)
    names = [joint.name for joint in mechanism.joints]
    if joint is None:
        table.fault(
            "joint",
            f"there is no joint {show(name)}",
            given=show(name),
            allowed=listing(names),
            remedy=suggest(name, names, "name the driver's joint"),
        )
    elif coupling == "two-way":
        if joint.kind != "revolute":
            table.fault(
                "joint",
                "the bearing must sit at a revolute joint",
                given=f"{show(name)}, a {joint.kind} joint",
                allowed=listing([j.name for j in mechanism.joints if j.kind == "revolute"]),
                remedy="name one of these joints",
            )
    elif driven is not None and (joint.kind != "revolute" or joint.bodies != (FRAME, driven)):
        table.fault(
            "joint",
            "a bearing that is loaded one-way must sit at the driver's joint: its inner ring turns with the driver",
            given=f"{show(name)}, a {joint.kind} joint with bodies {listing(joint.bodies)}",
            allowed=f'"{mechanism.driver.joint}"',
            remedy=f'write joint = "{mechanism.driver.joint}", or coupling = "two-way"',
        )
    return name, share


def _read_contact(table: Table) -> HertzContact | GivenContact:
    with table.table("contact", "groove radii and elastic constants, or stiffness") as contact:
        if contact.has("stiffness"):
            contact.know(*_HERTZ_KEYS, "ball_material")
            extra = [key for key in (*_HERTZ_KEYS, "ball_material") if key in contact.data]
            if extra:
                contact.fault(
                    "stiffness",
                    "the contact stiffness is given twice: as a number and by geometry",
                    given=f"stiffness and {listing(extra)}",
                    allowed=f"either stiffness, or {listing(_HERTZ_KEYS)}",
                    remedy=f"delete stiffness, or delete {listing(extra)}",
                )
            return GivenContact(
                stiffness=contact.quantity(
                    "stiffness",
                    "N/m^1.5",
                    "Contact stiffness of a ball between both raceways",
                    "k_b",
                    example="8.6e9 N/m^1.5",
                ),
                smoothing=_read_smoothing(contact),
            )
        if not contact.missing and not any(key in contact.data for key in _HERTZ_KEYS):
            contact.know(*_HERTZ_KEYS, "ball_material")
            contact.fault(
                "",
                "nothing gives the contact stiffness",
                given=listing(list(contact.data)),
                allowed=f"either stiffness, or {listing(_HERTZ_KEYS)}",
                remedy='write the four keys of the geometry, or stiffness = "8.6e9 N/m^1.5"',
            )
            contact.missing = True
        return HertzContact(
            inner_groove_radius=contact.quantity(
                "inner_groove_radius",
                "m",
                "Groove curvature radius of the inner raceway",
                "r_i",
                example="4.1275 mm",
            ),
            outer_groove_radius=contact.quantity(
                "outer_groove_radius",
                "m",
                "Groove curvature radius of the outer raceway",
                "r_e",
                example="4.206875 mm",
            ),
            ring=_read_material(contact, "rings", "E", r"\nu"),
            ball=_read_ball_material(contact),
            smoothing=_read_smoothing(contact),
        )


def _read_smoothing(contact: Table) -> Quantity | None:
    return contact.optional_quantity("smoothing", "m", "Half width of the smoothed contact onset", r"w_\delta")


def _read_ball_material(contact: Table) -> Material | None:
    if not contact.has("ball_material"):
        return None
    with contact.table("ball_material", "young_modulus and poisson_ratio") as material:
        return _read_material(material, "balls", "E_w", r"\nu_w")


def _read_material(table: Table, part: str, young: str, poisson: str) -> Material:
    return Material(
        young_modulus=table.quantity("young_modulus", "Pa", f"Young's modulus of the {part}", young, example="207 GPa"),
        poisson_ratio=table.quantity("poisson_ratio", "1", f"Poisson's ratio of the {part}", poisson, example="0.3"),
    )


def _read_damping(table: Table) -> Damping:
    with table.table("damping", "law and ratio") as damping:
        name = damping.choice("law", tuple(LAWS))
        if name is None:
            damping.know(*damping.data)
            return Damping(law="none", numbers=())
        law = LAWS[name]
        smoothing = None
        if law.kinked_at_rest:
            words = "Half width of the smoothed kink of the damping at rest"
            smoothing = damping.optional_quantity("smoothing", "m/s", words, "w_v")
        elif damping.has("smoothing"):
            kinked = [other.name for other in LAWS.values() if other.kinked_at_rest]
            damping.fault(
                "smoothing",
                f'the law "{name}" has no kink at rest',
                given=show(damping.data["smoothing"]),
                allowed=f"smoothing with the laws {listing(kinked)}",
                remedy="delete the key; smoothing in [bearing.contact] smooths what happens at contact",
            )
        return Damping(law=name, numbers=law.read(damping), smoothing=smoothing)


def _read_effects(table: Table, balls: int) -> tuple[BallEffect, ...]:
    return tuple(effect.read(table.table(kind), balls) for kind, effect in EFFECTS.items() if table.has(kind))


def _uneven(mechanism: Mechanism | None) -> str:
    """What makes a one-way bearing's rings turn unevenly; empty where nothing does."""
    return "mechanism.driver.table" if mechanism is not None and mechanism.driver.table is not None else ""


def _read_inner_ring(table: Table, with_mechanism: bool) -> InnerRing:
    with table.table("inner_ring", "mass or equivalent_mass") as ring:
        damping = ring.optional_quantity(
            "damping", "N*s/m", "Viscous damping of the inner ring's motion to the frame", "c_i"
        )
        ring.know("mass", "equivalent_mass")
        by_eq_3 = "equivalent_mass" in ring.data
        if not ring.missing and by_eq_3 == ("mass" in ring.data):
            ring.fault(
                "",
                "the moved mass is given twice" if by_eq_3 else "the moved mass is missing",
                given="mass and equivalent_mass" if by_eq_3 else "neither mass nor equivalent_mass",
                allowed='either mass (as in "0.4 kg") or the table equivalent_mass, Eq. (3)',
                remedy="delete one of the two" if by_eq_3 else 'add mass = "0.4 kg"',
            )
            ring.missing = True
        if not by_eq_3:
            mass = ring.quantity("mass", "kg", "Mass moved by the inner ring", "m_{ei}", example="0.4 kg")
            return InnerRing(mass=mass, damping=damping)
        if not with_mechanism:
            ring.fault(
                "equivalent_mass",
                "Eq. (3) takes the mass of the driven body, and there is no mechanism",
                given=show(ring.data["equivalent_mass"]),
                allowed='mass, as in "0.4 kg"',
                remedy='write mass = "0.4 kg" instead',
            )
        with ring.table("equivalent_mass", "ring, crankpin and crank") as parts:
            return InnerRing(
                mass=EquivalentMass(
                    ring=parts.quantity("ring", "kg", "Mass of the inner ring", "m_i", example="0.032 kg"),
                    crankpin=parts.quantity("crankpin", "kg", "Mass of the crankpin", "m_x", example="0.05 kg"),
                    crank=parts.choice("crank", ("whole", "half")) or "whole",
                ),
                damping=damping,
            )


def _read_outer_ring(table: Table) -> OuterRing | None:
    with table.table("outer_ring", "support") as ring:
        support = ring.choice("support", ("elastic", "fixed"))
        keys = ("mass", "stiffness", "damping")
        ring.know(*keys)
        if support == "elastic":
            return OuterRing(
                mass=ring.quantity(
                    "mass", "kg", "Mass of the outer ring and what moves with it", "m_o", example="0.5 kg"
                ),
                stiffness=ring.quantity(
                    "stiffness", "N/m", "Stiffness between outer ring and frame", "k_p", example="50 N/um"
                ),
                damping=ring.quantity(
                    "damping", "N*s/m", "Damping between outer ring and frame", "c_p", example="500 N*s/m"
                ),
            )
        if support == "fixed":
            for key in keys:
                if key in ring.data:
                    ring.fault(
                        key,
                        "a fixed outer ring does not move",
                        given=show(ring.data[key]),
                        allowed='nothing besides support = "fixed"',
                        remedy='delete the key, or write support = "elastic"',
                    )
    return None


def _read_initial(table: Table, *, moving_outer: bool) -> InitialState:
    position: list[Quantity] = []
    velocity: list[Quantity] = []
    with table.table("initial", required=False) as initial:
        for part, subscript in (("inner", "i"), ("outer", "o")):
            initial.know(part, f"{part}_velocity")
            if part == "outer" and not moving_outer:
                _refuse_outer(initial, table)
                continue
            position += _read_pair(initial, part, "m", f"Centre of the {part} ring at the start", ("", subscript))
            velocity += _read_pair(
                initial,
                f"{part}_velocity",
                "m/s",
                f"Velocity of the {part} ring at the start",
                (r"\dot ", subscript),
            )
    return InitialState(position=tuple(position), velocity=tuple(velocity))


def _refuse_outer(initial: Table, table: Table) -> None:
    ring = table.data.get("outer_ring")
    if not isinstance(ring, dict) or ring.get("support") != "fixed":  # the support itself has a fault
        return
    for key in ("outer", "outer_velocity"):
        if key in initial.data:
            initial.fault(
                key,
                "a fixed outer ring has no initial state",
                given=show(initial.data[key]),
                remedy='delete the key, or write support = "elastic" in the table outer_ring',
            )


def _read_pair(initial: Table, key: str, unit: str, description: str, latex: tuple[str, str]) -> list[Quantity]:
    example = f'["0 {unit}", "0 {unit}"]'
    given = initial.data.get(key, [f"0 {unit}", f"0 {unit}"])
    if not isinstance(given, list) or len(given) != 2:
        initial.fault(
            key, "these are not two components", given=show(given), allowed=example, remedy=f"write {key} = {example}"
        )
        return []
    return [
        initial.collector.quantity(
            (*initial.path, key, axis), value, unit, f"{description}, {axis}", f"{latex[0]}{axis}_{{{latex[1]}}}(0)"
        )
        for axis, value in zip("xy", given, strict=True)
    ]
