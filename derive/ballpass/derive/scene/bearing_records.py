"""The bearing of a scene as frozen records in SI units; see `records`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from ballpass.derive.scene.designations import GROUPS
from ballpass.derive.scene.keys import ChoiceKey, Needs, PairKey, TextKey, WholeKey
from ballpass.derive.scene.quantity import Bounds, SceneNumber, UsualRange
from ballpass.derive.scene.rating_records import Alignment, Catalogue, Lubrication
from ballpass.derive.scene.read_keys import Either, not_negative, positive, quantity
from ballpass.runtime.contract.manifest import FitInfo

FEWEST_BALLS, MOST_BALLS = 3, 200
_BY_DESIGNATION = "required without a designation"
#: Clearance or preload over ball diameter.
_CLEARANCE = UsualRange(
    least=-0.01, most=0.01, of="ball_diameter", hint="Clearances are some micrometres: check the unit."
)
#: Young's modulus from magnesium to silicon carbide.
_MODULUS = UsualRange(least=50e9, most=400e9, hint="Steel has 207 GPa: check the unit.")
#: Over ball diameter: ISO 16281 takes 0.52 and 0.53; the bounds are wider than those of real bearings.
_GROOVE = UsualRange(
    least=0.505, most=0.56, of="ball_diameter", hint="Check that the ball's diameter was given, not its radius."
)
_WIDTH = "give a small width, or delete the key for the law itself"
#: Slip of a cage: beyond this, balls skid, and the model of an evenly turning cage does not hold.
_PERCENTS = "A cage lags by some hundredths: check whether a percentage was given."


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Young's modulus [Pa] and Poisson's ratio [1]."""

    young_modulus: SceneNumber = positive("Pa", "Young's modulus of the PART", "E_OF", "207 GPa", usual=_MODULUS)
    poisson_ratio: SceneNumber = quantity(
        "1",
        "Poisson's ratio of the PART",
        r"\nu_OF",
        0.3,
        bounds=Bounds(above=-1.0, below=0.5),
        remedy="give about 0.3 for steel",
    )


def _groove(ring: str, symbol: str, example: str) -> Any:
    return positive(
        "m",
        f"Groove curvature radius of the {ring} raceway",
        symbol,
        example,
        usual=_GROOVE,
        note="of the cross section, above half the ball diameter",
    )


def smoothing_key() -> Any:
    """The key of the smoothed onset of a contact."""
    hint = "The contact then acts where ball and raceway are apart: give a smaller width."
    return positive(
        "m",
        "Half width of the smoothed contact onset",
        r"w_\delta",
        "0.05 um",
        optional=True,
        when="optional; default: Hertz's law itself",
        remedy=_WIDTH,
        usual=UsualRange(most=1.0, of="clearance", hint=hint),
        note="see {doc}`../../theory/damping`",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzContact:
    """Contact stiffness from geometry: groove radii [m] and materials; `ball` None means as the rings.

    `smoothing` is the half width [m] of the smoothed contact onset; None for Hertz's law itself.
    """

    inner_groove_radius: SceneNumber = _groove("inner", "r_i", "4.1275 mm")
    outer_groove_radius: SceneNumber = _groove("outer", "r_e", "4.206875 mm")
    ring: Material
    ball: Material | None
    smoothing: SceneNumber | None = smoothing_key()


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenContact:
    """Contact stiffness of one ball between both raceways, k_b [N/m^1.5], as a number; `smoothing` as above."""

    stiffness: SceneNumber = positive(
        "N/m^1.5", "Contact stiffness of a ball between both raceways", "k_b", "8.6e9 N/m^1.5"
    )
    smoothing: SceneNumber | None = smoothing_key()


@dataclass(frozen=True, slots=True, kw_only=True)
class Damping:
    """Damping law at the ball, by name, and its numbers, which the law defines.

    `smoothing` is the half width [m/s] of the smoothed kink of one-sided laws at rest, or None.
    """

    law: str
    numbers: tuple[SceneNumber, ...]
    smoothing: SceneNumber | None = positive(
        "m/s",
        "Half width of the smoothed kink of the damping at rest",
        "w_v",
        "1 mm/s",
        optional=True,
        when="optional, for the two one-sided laws",
        remedy=_WIDTH,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BallEffect:
    """An effect on the balls: its kind, and its own records, which this layer only stores."""

    kind: str
    parts: tuple[Any, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CageMotion:
    """The cage of a scene: its ratio to the inner ring's speed instead of that of rolling, and its slip.

    `slip` is the part by which it turns slower [1].  None: rolling, or the slip of each row of a table holds from its
    `time` [s] until the next; the first is zero.  `lag` is the angle by which it lags then [rad].
    """

    ratio: SceneNumber | None = quantity(
        "1",
        "Speed of the cage over that of the inner ring",
        r"\kappa_c",
        0.4,
        optional=True,
        when="default: $(1 - D_w/D_{pw})/2$",
        bounds=Bounds(above=0.0, below=1.0),
    )
    slip: SceneNumber | None = quantity(
        "1",
        "Part by which the cage turns slower than by rolling",
        "s_c",
        0.02,
        optional=True,
        when="default: none",
        bounds=Bounds(above=-1.0, below=1.0),
        usual=UsualRange(least=0.0, most=0.3, hint=_PERCENTS),
        note="seen from the ring that stands, or the outer one where both turn. Or a table over time, from 0 s on, "
        'each value constant until the next row: `{ time = ["0 s", "0.5 s"], value = [0.0, 0.04] }`',
    )
    time: tuple[SceneNumber, ...] = ()
    slips: tuple[SceneNumber, ...] = ()
    lag: SceneNumber | None = None

    @property
    def slipping(self) -> bool:
        """Whether it slips at all."""
        return self.slip is not None or bool(self.time)


@dataclass(frozen=True, slots=True, kw_only=True)
class EquivalentMass:
    """Eq. (3): ring mass m_i, crankpin mass m_x [kg], crank counted whole or halved (a pair of bearings carries it)."""

    ring: SceneNumber = positive("kg", "Mass of the inner ring", "m_i", "0.032 kg")
    crankpin: SceneNumber = not_negative("kg", "Mass of the crankpin", "m_x", "0.05 kg")
    crank: Literal["whole", "half"] = ChoiceKey(
        words="How much of the crank counts", choices=("whole", "half")
    ).declared()


@dataclass(frozen=True, slots=True, kw_only=True)
class InnerRing:
    """Mass moved by the inner ring: a number [kg] or Eq. (3); None on a shaft that tilts, which has its own.

    `damping` to the frame [N*s/m] or None.
    """

    mass: SceneNumber | EquivalentMass | None = positive(
        "kg",
        "Mass moved by the inner ring",
        "m_{ei}",
        "0.4 kg",
        when="this or `equivalent_mass`; refused on a shaft that tilts, which has its own",
    )
    damping: SceneNumber | None = not_negative(
        "N*s/m", "Viscous damping of the inner ring's motion to the frame", "c_i", "200 N*s/m", optional=True
    )


_MOVING = (Needs(key="support", value="elastic", why="a fixed outer ring does not move"),)


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterRing:
    """Outer ring on an elastic housing: mass [kg], stiffness [N/m], damping [N*s/m]."""

    mass: SceneNumber = positive(
        "kg",
        "Mass of the outer ring and what moves with it",
        "m_o",
        "0.5 kg",
        needs=_MOVING,
        remedy='give the moved mass, or write support = "fixed"',
    )
    stiffness: SceneNumber = not_negative(
        "N/m", "Stiffness between outer ring and frame", "k_p", "50 N/um", needs=_MOVING
    )
    damping: SceneNumber = not_negative(
        "N*s/m", "Damping between outer ring and frame", "c_p", "500 N*s/m", needs=_MOVING
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialState:
    """Ring centres [m] and velocities [m/s] at t = 0: inner x, y, (outer x, y); outer empty when it is fixed."""

    position: tuple[SceneNumber, ...]
    velocity: tuple[SceneNumber, ...]


_ONE_WAY = (
    Needs(
        key="coupling",
        value="one-way",
        why="a bearing coupled two-way takes the load that the motion gives it",
        remedy="write count = 2 instead of share = 0.5",
    ),
)
_PLACED = (
    Needs(
        key="parted",
        why="a bearing coupled two-way takes the load that the motion gives it",
        words="a share of the load, or on a shaft that tilts",
        remedy="give the driven body a transverse_inertia, with which it tilts",
    ),
)
_ON_TILTING = (
    Needs(
        key="tilts",
        why="the offset of a housing loads bearings only where their shaft has a stiffness against it",
        words="a shaft that tilts",
        remedy="give [shaft] or the driven body a transverse_inertia",
    ),
)
_AXIAL = (Needs(key="element", value="ball", why="a bearing of such elements carries no axial force"),)
_ONLY_BALLS = (Needs(key="element", value="ball", why="a bearing of such elements has no contact angle"),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bearing:
    """A rolling bearing.

    `name` is empty for the scene's only ``[bearing]``; ``[bearings.<name>]`` have one.  `joint` names the revolute
    joint whose reaction loads it (None without mechanism).
    `coupling` one-way: `share` is the part of the ideal reaction it takes, `inner` what moves with the inner ring.
    `coupling` two-way: its play moves the bodies of the joint; `inner_body` carries the inner ring, `count` bearings
    stand side by side (None: one); `beside` names the first of several at the joint, whose inner ring moves alike.
    On a shaft that `tilts` the axis runs through the inner rings of the first two bearings; with `has_axis` the inner
    ring follows from theirs.
    `element` is the kind of its rolling elements, `contact` a record of that kind.  `balls`, their number, is
    structure.  `clearance` is diametral (ISO 5753) [m].  `ball_angle` is theta_0 [rad].
    `outer` is None for a fixed outer ring.  `catalogue`, `cage`, `lubrication`, `alignment` and `fit` (by class) are
    None where the scene says nothing of that kind.
    """

    one_of: ClassVar[tuple[Either, ...]] = (
        Either(
            what="the contact angle",
            groups=(("contact_angle",), ("axial_displacement",), ("axial_force",)),
            at="axial_displacement",
            optional=True,
        ),
        Either(what="what the bearing carries", groups=(("share",), ("position",)), at="position", optional=True),
    )

    name: str
    joint: str | None = TextKey(
        words="The joint that the bearing is at",
        example="A",
        needs=(
            Needs(
                key="mechanism",
                why="there is no mechanism to load the bearing",
                words="[mechanism]",
                remedy="delete the key, or describe the mechanism",
            ),
        ),
        note="one-way: the driver's joint, or that of a wheel of a gear on the frame; two-way: any revolute joint",
    ).declared()
    share: SceneNumber | None = quantity(
        "1",
        "Share of the joint's reaction that the bearing carries",
        "s",
        0.5,
        when="one-way with a mechanism: this or `position`; two-way: refused; on a shaft, of its load: all without it",
        needs=_ONE_WAY,
        usual=UsualRange(least=-3.0, most=3.0, hint="0.5 is one of a pair; beside an overhung crank it is above 1."),
        note="any number: a crank 40 mm before two bearings 60 mm apart loads them by 1.67 and −0.67 of the reaction",
    )
    position: SceneNumber | None = quantity(
        "m",
        "Place of the bearing along the shaft",
        "z",
        "40 mm",
        optional=True,
        when="instead of `share`, for both of two bearings on a shaft, or for all of one that tilts",
        needs=_PLACED,
        note="from any plane, which is that of points and loads without a place of their own, in any direction: the "
        "shares follow by levers, or from the tilts of the shaft, see {doc}`../../theory/supports`",
    )
    offset: tuple[SceneNumber, SceneNumber] | None = PairKey(
        unit="m",
        words="Offset of the housing, AXIS",
        symbol=r"e_{h,AXIS}",
        example="20 um",
        optional=True,
        needs=_ON_TILTING,
        note="how far the housing stands off the line of the others; on a shaft that tilts",
    ).declared()
    coupling: Literal["one-way", "two-way"] = ChoiceKey(
        words="How bearing and linkage move each other",
        choices=("one-way", "two-way"),
        default="one-way",
        note="one-way: the reaction of an ideal linkage loads the bearing; two-way: its clearance and its forces "
        "act on both bodies, see {doc}`../../theory/coupling`. The same for all bearings of a scene",
    ).declared()
    inner_body: str = ""
    beside: str = ""
    tilts: bool = False
    has_axis: bool = False
    count: SceneNumber | None = positive(
        "1",
        "Bearings side by side at the joint",
        "n_b",
        2,
        optional=True,
        when="two-way: default 1, else refused",
        needs=(
            Needs(
                key="coupling",
                value="two-way",
                why="a bearing that is loaded one-way carries a share of the reaction",
                remedy="write share = 0.5 for one of two bearings",
            ),
        ),
        note="a whole number; those that differ have tables of their own",
    )
    balls: int = WholeKey(
        words="Number of balls",
        lowest=FEWEST_BALLS,
        highest=MOST_BALLS,
        example=8,
        when=_BY_DESIGNATION,
        note="they must fit on the pitch circle",
    ).declared()
    ball_diameter: SceneNumber = positive("m", "Ball diameter", "D_w", "7.9375 mm", when=_BY_DESIGNATION)
    pitch_diameter: SceneNumber = positive(
        "m", "Diameter of the circle of ball centres", "D_{pw}", "33.5 mm", when=_BY_DESIGNATION
    )
    clearance: SceneNumber = quantity(
        "m",
        "Diametral clearance of the bearing",
        "P_d",
        "10 um",
        when='required; with a designation default `"CN"`',
        usual=_CLEARANCE,
        groups=GROUPS,
        note='negative is preload. With a designation also a group: `"C2"`, `"CN"`, `"C3"`, `"C4"`, `"C5"`',
    )
    contact_angle: SceneNumber | None = quantity(
        "rad",
        "Contact angle",
        r"\alpha",
        "8 deg",
        optional=True,
        when="default: none, contact in the radial plane",
        needs=_ONLY_BALLS,
        bounds=Bounds(least=0.0, below=math.pi / 2),
        remedy="give an angle from 0 deg to below 90 deg",
        usual=UsualRange(most=math.radians(50), hint="Angular contact bearings have up to 45 deg: check the unit."),
        note="a constant of the run, with `clearance` as what is left radially; balls only, "
        "see {doc}`../../theory/contact_angle`",
    )
    axial_displacement: SceneNumber | None = not_negative(
        "m",
        "Axial displacement of the inner ring by its preload",
        r"\delta_a",
        "40 um",
        optional=True,
        when="instead of `contact_angle`",
        needs=(
            *_ONLY_BALLS,
            Needs(
                key="contact",
                value="grooves",
                why="the contact angle follows from the radii of the grooves, and the scene gives a stiffness",
                words="inner_groove_radius and outer_groove_radius in the table contact",
                remedy="write contact_angle instead",
            ),
        ),
        usual=UsualRange(most=0.03, of="ball_diameter", hint="Preload moves rings by some hundredths: check the unit."),
        note="the contact angle follows with `clearance` and grooves; not with a given `stiffness`",
    )
    axial_force: float | None = positive(
        "N",
        "Axial force on the bearing, in `ballpass life`",
        example="500 N",
        optional=True,
        setting=True,
        when="instead of `contact_angle`",
        needs=_AXIAL,
        remedy="delete the key where there is none",
        note="of a shaft on the bearing that locates it; the motion stays radial, see {doc}`../../theory/life`",
    )
    shoulder_height: float | None = positive(
        "m",
        "Height of the grooves' shoulders above their bottom",
        example="1.6 mm",
        optional=True,
        setting=True,
        needs=_AXIAL,
        usual=UsualRange(most=0.5, of="ball_diameter", hint="Shoulders have about a fifth of the ball's diameter."),
        note="`ballpass life` warns where axial force or tilt moves a contact over it",
    )
    ball_angle: SceneNumber = quantity(
        "rad", "Angle of the first ball at the start", r"\theta_0", "0 deg", default="0 deg"
    )
    contact: Any
    damping: Damping
    effects: tuple[BallEffect, ...]
    inner: InnerRing | None
    outer: OuterRing | None
    initial: InitialState
    element: str = "ball"
    catalogue: Catalogue | None = None
    cage: CageMotion | None = None
    lubrication: Lubrication | None = None
    alignment: Alignment | None = None
    fit: FitInfo | None = None

    @property
    def prefix(self) -> str:
        """Prefix of the names of its states and outputs."""
        return f"{self.name}." if self.name else ""

    @property
    def path(self) -> str:
        """Its place in the scene file: the prefix of the names of its parameters and constants."""
        return f"bearings.{self.name}" if self.name else "bearing"
