"""The parts that a scene may name, each in a scene of its own: what the suite over the registries runs on.

`REGISTERED` is read from the tables of `ballpass.derive`; `PARTS` has a case for each entry.  A new law, effect, drive,
force or dyad needs a case here, and `test_every_part.py` says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from coupled_scenes import RUN, bearing, linkage_text
from linkages import GEARED, MACHINES
from quick_cases import long_but

from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.elements import ELEMENTS
from ballpass.derive.bearing.laws import LAWS
from ballpass.derive.drive.laws import LAWS as DRIVES
from ballpass.derive.mechanism.dyads import DYADS
from ballpass.derive.mechanism.forces import FORCE_TABLES
from ballpass.derive.scene.mechanism_records import Gear
from ballpass.derive.scene.read_keys import keys_of

ROOT = Path(__file__).resolve().parents[2]


def kind_of_force(table: str, pathway: type, law: type) -> str:
    """Name of an entry of the tables of forces."""
    return f"{table} {pathway.__name__} {law.__name__}"


REGISTERED: Mapping[str, set[str]] = {
    "damping law": set(LAWS),
    "rolling element": set(ELEMENTS),
    "effect": set(EFFECTS),
    "drive": set(DRIVES),
    "force": {kind_of_force(t.key, pathway, law) for t in FORCE_TABLES for pathway in t.pathways for law in t.laws},
    "dyad": {dyad.kind for dyad in DYADS},
    "shaft": {"tilting"},
    "gear": {*keys_of(Gear)["type"].choices},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """An entry of a registry in a scene.

    Attributes
    ----------
    registry, name : which entry it is
    text : of a scene file that names it
    without : of the same file without it; empty where no scene can do without
    path : under which the scene's features list it; empty where it is none of them
    off : numbers with which nothing is left of it
    docs : a page, and what a row of its tables begins with
    variant : what tells it from another case of the same entry
    """

    registry: str
    name: str
    text: str
    without: str = ""
    path: str = ""
    off: Mapping[str, float] = field(default_factory=dict)
    docs: tuple[str, str]
    variant: str = ""

    def __str__(self) -> str:
        return " ".join(filter(None, (self.registry, self.name, self.variant)))


def shipped(name: str, *changes: tuple[str, str]) -> str:
    """Text of a shipped scene with replacements, each of which must apply."""
    out = (ROOT / "scenes" / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in out, f"{old!r} is not in {name}"
        out = out.replace(old, new)
    return out


# damping laws, on the paper's press: two rings, balls that face each other and balls that do not

VISCOUS = 'coefficient = "683 N*s/m"'
DAMPING = {
    "none": "",
    "one-sided": VISCOUS,
    "one-sided-gated": VISCOUS,
    "two-sided-gated": VISCOUS,
    "tangent": 'ratio = "0.25e-5 s"',
    "hunt-crossley": 'hysteresis = "5 s/m"',
}
_ONE_SIDED = 'law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"'


def press(law: str, numbers: str = "", *changes: tuple[str, str]) -> str:
    """The press with another law."""
    outputs = ('"ball.*"', '"ball.elastic_force"')  # a law without a force has no other
    return shipped("punching_press", (_ONE_SIDED, f'law = "{law}"\n{numbers}'), outputs, *changes)


def _laws() -> list[Part]:
    found = []
    for name, numbers in DAMPING.items():
        for variant, changes in (("", ()), ("of nine balls", (("balls = 8", "balls = 9"),))):
            if variant and name != "one-sided":  # whose kinks opposite balls take out
                continue
            found.append(
                Part(
                    registry="damping law",
                    name=name,
                    text=press(name, numbers, *changes),
                    without=press("none", "", *changes) if numbers else "",
                    path="bearing.damping" if numbers else "",
                    off={f"bearing.damping.{numbers.partition(' ')[0]}": 0.0} if numbers else {},
                    docs=("theory/damping.md", f"`{name}`"),
                    variant=variant,
                )
            )
    return found


# rolling elements, on the rotor of varying compliance, which a tangent law makes feel their slopes

_GIVEN = 'stiffness = "13.34e9 N/m^1.5"'
_STEEL = 'young_modulus = "207 GPa"\npoisson_ratio = 0.3'
ELEMENT_CONTACTS = {
    "ball": f'inner_groove_radius = "4.1275 mm"\nouter_groove_radius = "4.206875 mm"\n{_STEEL}',
    "cylindrical-roller": f'length = "8 mm"\n{_STEEL}',
    "power-law": 'force = "800 N"\ndeflection = "20 um"\nexponent = 1.3',
}


def _elements() -> list[Part]:
    return [
        Part(
            registry="rolling element",
            name=name,
            text=shipped(
                "varying_compliance",
                ("[bearing]\n", f'[bearing]\nelement = "{name}"\n{keys}'),
                (_GIVEN, contact),
                ('law = "none"', 'law = "tangent"\nratio = "0.25e-5 s"'),
            ),
            docs=("theory/rollers.md", f"`{name}`"),
            variant=variant,
        )
        for name, contact, variant, keys in (
            *((name, contact, "", "") for name, contact in ELEMENT_CONTACTS.items()),
            ("ball", ELEMENT_CONTACTS["ball"], "at a contact angle", 'contact_angle = "15 deg"\n'),
            ("ball", ELEMENT_CONTACTS["ball"], "displaced axially", 'axial_displacement = "20 um"\n'),
        )
    ]


# effects on the balls, on the rotor of varying compliance

EFFECT_TABLES = {
    "outer_waviness": '[bearing.outer_waviness]\n7 = { amplitude = "0.5 um", phase = "0.4 rad" }\n',
    "inner_waviness": '[bearing.inner_waviness]\n9 = { amplitude = "0.2 um", phase = "0.3 rad" }\n',
    "ball_waviness": '[bearing.ball_waviness.3]\n2 = { amplitude = "0.2 um", phase = "0.6 rad" }\n'
    '[bearing.ball_waviness.each]\n4 = { amplitude = "0.1 um", phase = "1 rad" }\n',
    "ball_deviation": '[bearing.ball_deviation]\n5 = "-0.2 um"\n',
    "defects": "".join(
        f'[bearing.defects.{on}]\non = "{on}"\n{whose}angle = "{angle} deg"\nchord = "2 mm"\ndepth = "5 um"\n'
        f'profile = "{profile}"\n'
        for on, whose, angle, profile in (
            ("outer", "", 10, "half-sine"),
            ("inner", "", -60, "rectangular"),
            ("ball", "ball = 2\n", 50, "rectangular"),
        )
    ),
}
_OFF = {
    "outer_waviness": {"bearing.outer_waviness.7.amplitude": 0.0},
    "inner_waviness": {"bearing.inner_waviness.9.amplitude": 0.0},
    "ball_waviness": {f"bearing.ball_waviness.{n}.amplitude": 0.0 for n in ("3.2", "each.4")},
    "ball_deviation": {"bearing.ball_deviation.5": 0.0},
    "defects": {f"bearing.defects.{on}.depth": 0.0 for on in ("outer", "inner", "ball")},
}
#: With a law that knows the rate, of which the effects have exact ones; with preload, so that all balls feel them.
_PRESSED = (
    ('law = "none"  ', 'law = "tangent"\nratio = "2e-5 s"  '),
    ('clearance = "0 um"  ', 'clearance = "-20 um"  '),
    ('["3.9937 um", "0.1 um"]', '["0 um", "0 um"]'),
)


def _effects() -> list[Part]:
    return [
        Part(
            registry="effect",
            name=name,
            text=shipped("varying_compliance", *_PRESSED, ("[bearing.inner_ring]", f"{table}[bearing.inner_ring]")),
            without=shipped("varying_compliance", *_PRESSED),
            path=f"bearing.{name}",
            off=_OFF[name],
            docs=("reference/scene/index.md", f"[bearing.{name}"),
        )
        for name, table in EFFECT_TABLES.items()
    ]


# drives, on a slider-crank without bearings

CRANK = (ROOT / "tests/physics/slider_crank.toml").read_text(encoding="utf-8")
TORQUES = {
    "constant": 'torque = "5 N*m"',
    "linear": 'stall_torque = "8 N*m"\nno_load_speed = "200 rad/s"',
    "table": 'speed = ["0 rad/s", "50 rad/s", "200 rad/s"]\ntorque = ["3 N*m", "4 N*m", "-1 N*m"]',
    "asynchronous": 'breakdown_torque = "9 N*m"\nbreakdown_slip = 0.2\nsynchronous_speed = "150 rad/s"',
    "none": "",
}
_NO_TORQUE = {
    "constant": ("torque",),
    "linear": ("stall_torque",),
    "table": ("torque.1", "torque.2", "torque.3"),
    "asynchronous": ("breakdown_torque",),
    "none": (),
}


def driven(law: str, numbers: str) -> str:
    """The slider-crank with a law of the drive's torque."""
    return CRANK.replace('law = "none"', f'law = "{law}"\n{numbers}')


def _drives() -> list[Part]:
    return [
        Part(
            registry="drive",
            name=name,
            text=driven(name, numbers),
            without=CRANK if numbers else "",
            off={f"mechanism.driver.torque.{key}": 0.0 for key in _NO_TORQUE[name]},
            docs=("reference/scene/drive_torque.md", f'`"{name}"`'),
        )
        for name, numbers in TORQUES.items()
    ]


# forces, on the crank-shaper: a dyad with a moving guide

_CUT = """[mechanism.forces.cut]
body = "lever"
point = "tip"
force = ["1500 N", "0 N"]
window = { start = "350 deg", end = "190 deg" }
"""
_HOOK = ("[mechanism.frame.points]\n", '[mechanism.frame.points]\nhook = ["250 mm", "180 mm"]\n')
_POINT = '[mechanism.forces.it]\nbody = "lever"\npoint = "tip"\n'
_PISTON = _POINT + 'direction = "190 deg"\nbore = "16 mm"\n'
_BODY = '[mechanism.torques.it]\nbody = "lever"\n'
#: One through zero, one in radians below it.
_WINDOW = """window = [
    { start = "237 deg", end = "267 deg" },
    { start = "350 deg", end = "20 deg" },
    { start = "-3 rad", end = "-1 rad" },
]
"""
_ENDS = 'bodies = ["crank", "lever"]\npoints = ["A", "tip"]\n'
_TURN = 'bodies = ["crank", "lever"]\n'
#: Keys of the scene file, and the numbers that scale the force.
FORCES: dict[str, tuple[str, tuple[str, ...]]] = {
    "forces PistonPressure Windows": (_PISTON + 'pressure = "7 bar"\n' + _WINDOW, ("bore",)),
    "forces PistonPressure AngleTable": (
        _PISTON + 'table = { angle = ["-20 deg", "30 deg", "190 deg"], pressure = ["1 bar", "700 kPa", "0.05 MPa"] }\n',
        ("bore",),
    ),
    "forces PistonPressure ConstantForce": (_PISTON + 'pressure = "7 bar"\nambient = "1.2 bar"\n', ("bore",)),
    "forces PointForce Windows": (_POINT + 'force = ["1500 N", "90 N"]\n' + _WINDOW, ("force.x", "force.y")),
    "forces PointForce AngleTable": (
        _POINT + 'direction = "10 deg"\ntable = { angle = ["-20 deg", "30 deg", "190 deg"], '
        'force = ["100 N", "1200 N", "-60 N"] }\n',
        ("table.force.1", "table.force.2", "table.force.3"),
    ),
    "forces PointForce ConstantForce": (_POINT + 'force = ["300 N", "-40 N"]\n', ("force.x", "force.y")),
    "torques BodyTorque Windows": (_BODY + 'torque = "20 N*m"\n' + _WINDOW, ("torque",)),
    "torques BodyTorque AngleTable": (
        _BODY + 'table = { angle = ["10 deg", "180 deg"], torque = ["5 N*m", "90 N*m"] }\n',
        ("table.torque.1", "table.torque.2"),
    ),
    "torques BodyTorque ConstantForce": (_BODY + 'torque = "-7 N*m"\n', ("torque",)),
    "springs TwoPoints SpringDamper": (
        '[mechanism.springs.it]\nbodies = ["frame", "lever"]\npoints = ["hook", "tip"]\nstiffness = "2 N/mm"\n'
        'free_length = "150 mm"\ndamping = "40 N*s/m"\npreload = "20 N"\n',
        ("stiffness", "damping", "preload"),
    ),
    "torsion_springs TwoBodies SpringDamper": (
        f'[mechanism.torsion_springs.it]\n{_TURN}stiffness = "30 N*m/rad"\nfree_angle = "80 deg"\n'
        'damping = "0.5 N*m*s/rad"\npreload = "3 N*m"\n',
        ("stiffness", "damping", "preload"),
    ),
    "stops AlongDirection Stop": (
        f'[mechanism.stops.it]\n{_ENDS}direction = "30 deg"\nstiffness = "2e5 N/m"\nfree_distance = "50 mm"\n'
        'hysteresis = "3 s/m"\n',
        ("stiffness",),
    ),
    "stops TwoPoints Stop": (
        f'[mechanism.stops.it]\n{_ENDS}stiffness = "1e5 N/m"\nfree_length = "211 mm"\nhysteresis = "0.4 s/m"\n',
        ("stiffness",),
    ),
    "torsion_stops TwoBodies Stop": (
        '[mechanism.torsion_stops.it]\nbodies = ["frame", "lever"]\nstiffness = "3e4 N*m/rad"\nfree_angle = "88 deg"\n'
        'hysteresis = "0.02 s/rad"\n',
        ("stiffness",),
    ),
    "friction JointTurn Friction": (
        '[mechanism.friction.it]\njoint = "B"\nviscous = "0.4 N*m*s/rad"\ntorque = "30 N*m"\nsmoothing = "5 rad/s"\n',
        ("viscous", "torque"),
    ),
    "guide_friction JointTravel Friction": (
        '[mechanism.guide_friction.it]\njoint = "S"\nviscous = "60 N*s/m"\nforce = "250 N"\nsmoothing = "0.4 m/s"\n',
        ("viscous", "force"),
    ),
}
#: Further cases of an entry, by what tells them apart.
FORCE_VARIANTS: dict[tuple[str, str], tuple[str, tuple[str, ...]]] = {
    ("springs TwoPoints SpringDamper", "damper alone"): (
        '[mechanism.springs.it]\nbodies = ["frame", "lever"]\npoints = ["hook", "tip"]\ndamping = "40 N*s/m"\n',
        ("damping",),
    ),
    ("springs TwoPoints SpringDamper", "between moving bodies"): (
        '[mechanism.springs.it]\nbodies = ["crank", "lever"]\npoints = ["B", "tip"]\nstiffness = "2 N/mm"\n'
        'free_length = "150 mm"\n',
        ("stiffness",),
    ),
}


def shaper(force: str) -> str:
    """The crank-shaper with this force alone."""
    return shipped("crank_shaper", _HOOK, (_CUT, force))


def _forces() -> list[Part]:
    found = []
    plain = {(name, ""): case for name, case in FORCES.items()}
    for (name, variant), (text, scale) in {**plain, **FORCE_VARIANTS}.items():
        table = name.partition(" ")[0]
        path = f"mechanism.{table}.it"
        found.append(
            Part(
                registry="force",
                name=name,
                text=shaper(text),
                without=shaper(""),
                path=path,
                off={f"{path}.{key}": 0.0 for key in scale},
                docs=("reference/scene/index.md", f"[mechanism.{table}.<name>]"),
                variant=variant,
            )
        )
    return found


# dyads, each in a shipped machine, or in one of tests/machines with bearings that move it


def _dyads() -> list[Part]:
    texts = {
        kind: shipped(name) for kind, name in (("RRR", "four_bar"), ("RRP", "offset_slider"), ("RPR", "crank_shaper"))
    }
    turned: dict[str, Any] = {"bodies": ("frame", "crank")}
    texts |= {
        kind: linkage_text(MACHINES[name]().with_joint("A", **turned)) + bearing("F", "block", elastic=True) + RUN
        for kind, name in (("RPP", "yoke on a moving body"), ("PRP", "rapson's slide"))
    }
    return [
        Part(registry="dyad", name=kind, text=text, docs=("reference/scene/joints.md", kind))
        for kind, text in texts.items()
    ]


# a shaft that tilts, in two bearings that carry its axis and a third one on an elastic housing off their line

ROTOR = (ROOT / "tests/physics/tilting_rotor.toml").read_text(encoding="utf-8")


def _shafts() -> list[Part]:
    before, _, run = ROTOR.partition("[run]")
    third = before[before.index("[bearings.right]") :].replace(".right]", ".third]")
    third = third.replace('"80 mm"', '"15 mm"\noffset = ["3 um", "-2 um"]')
    support = 'support = "elastic", mass = "0.5 kg", stiffness = "5e7 N/m", damping = "500 N*s/m"'
    text = (before + third.replace('support = "fixed"', support)).replace(
        'law = "none"', 'law = "tangent", ratio = "2e-5 s"'
    )
    docs = ("theory/supports.md", "A shaft that tilts")
    return [Part(registry="shaft", name="tilting", text=f"{text}[run]{run}", docs=docs)]


# gears, in a machine with a bearing that moves it


def _gears() -> list[Part]:
    machines = {"external": ("geared five-bar", "D", "right"), "internal": ("planetary", "B", "rod")}
    machines["belt"] = ("five-bar with a belt", "D", "right")
    return [
        Part(
            registry="gear",
            name=kind,
            text=linkage_text(GEARED[name]()) + bearing(joint, body, elastic=True) + RUN,
            docs=("reference/scene/gears.md", f'"{kind}"'),
        )
        for kind, (name, joint, body) in machines.items()
    ]


# scenes without states: a driver at constant speed, and no bearing

_SLIDER_CRANK = """
[mechanism]
gravity = "9.81 m/s^2"

[mechanism.driver]
joint = "A"
speed = "60 rad/s"

[mechanism.frame.points]
A = "origin"

[mechanism.bodies.crank]
mass = "0.4 kg"
inertia = "300 kg*mm^2"
center_of_mass = "20 mm"
points = { A = "origin", B = "50 mm" }

[mechanism.bodies.rod]
mass = "0.6 kg"
inertia = "1500 kg*mm^2"
center_of_mass = "60 mm"
points = { B = "origin", C = "160 mm" }

[mechanism.bodies.slider]
mass = "1.2 kg"
center_of_mass = "origin"
points = { C = "origin" }

[mechanism.joints.A]
type = "revolute"
bodies = ["frame", "crank"]

[mechanism.joints.B]
type = "revolute"
bodies = ["crank", "rod"]

[mechanism.joints.C]
type = "revolute"
bodies = ["rod", "slider"]
branch = "ahead"

[mechanism.joints.guide]
type = "prismatic"
bodies = ["frame", "slider"]
points = ["A", "C"]
direction = "0 deg"

[mechanism.forces.work]
body = "slider"
point = "C"
force = ["900 N", "0 N"]
window = { start = "20 deg", end = "150 deg" }

[run]
cycles = 2
transient_cycles = 1
outputs = ["reaction.*", "drive_torque"]
"""


def without_bearing(scene: str) -> str:
    """A shipped scene without its bearing."""
    text = shipped(scene)
    head, _, rest = text.partition("[bearing]")
    return head + rest[rest.index("[run]") : rest.index("outputs = ")] + 'outputs = ["reaction.*", "drive_torque"]\n'


WITHOUT_STATES = {"slider_crank": _SLIDER_CRANK, "four_bar": without_bearing("four_bar")}

#: Scenes without bearings whose driver's motion is a state.
_SPEED = 'speed = "60 rad/s"'
DRIVER_IS_A_STATE = {
    "torque": _SLIDER_CRANK.replace(_SPEED, f'{_SPEED}\ntorque = {{ law = "constant", torque = "25 N*m" }}'),
    "table": _SLIDER_CRANK.replace(_SPEED, 'table = { time = ["0 s", "1 s"], speed = ["60 rad/s", "60 rad/s"] }'),
}


#: One of each kind of force, drive, effect, law, dyad and contact, which the quick tests take; the long ones take all.
QUICK = (
    *("damping law one-sided", "damping law tangent", "damping law hunt-crossley"),
    *("rolling element cylindrical-roller", "rolling element ball at a contact angle"),
    *("effect ball_waviness", "effect defects", "drive table", "drive asynchronous"),
    *(
        "force forces PointForce Windows",
        "force forces PistonPressure AngleTable",
        "force springs TwoPoints SpringDamper",
    ),
    *("force stops TwoPoints Stop", "force friction JointTurn Friction", "dyad RRR", "dyad RPR", "dyad RPP"),
    *("gear external", "shaft tilting"),
)
PARTS: tuple[Part, ...] = (
    *(*_laws(), *_elements(), *_effects(), *_drives(), *_forces(), *_dyads(), *_gears(), *_shafts()),
)


def cases(parts: Iterable[Part] = PARTS) -> list[Any]:
    """Parameters of a test: those of `QUICK`, and the others with the mark `long`."""
    parts = list(parts)
    return long_but(parts, *(str(part) for part in parts if str(part) in QUICK))
