"""What the user asked for of a bearing, as frozen records in SI units; see `records`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ballpass.derive.scene.quantity import Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Young's modulus [Pa] and Poisson's ratio [1]."""

    young_modulus: Quantity
    poisson_ratio: Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzContact:
    """Contact stiffness from geometry: groove radii [m] and materials; `ball` None means as the rings.

    `smoothing` is the half width [m] of the smoothed contact onset; None for Hertz's law itself.
    """

    inner_groove_radius: Quantity
    outer_groove_radius: Quantity
    ring: Material
    ball: Material | None
    smoothing: Quantity | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenContact:
    """Contact stiffness of one ball between both raceways, k_b [N/m^1.5], as a number; `smoothing` as above."""

    stiffness: Quantity
    smoothing: Quantity | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Damping:
    """Damping law at the ball, by name, and its numbers; the law itself says what they are.

    `smoothing` is the half width [m/s] of the smoothed kink of one-sided laws at rest, or None.
    """

    law: str
    numbers: tuple[Quantity, ...]
    smoothing: Quantity | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BallEffect:
    """An effect on the balls: its kind, what of it is structure, and its numbers; `kind` says what they are."""

    kind: str
    structure: tuple[int | str, ...]
    numbers: tuple[Quantity, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CageMotion:
    """What a scene says of the cage: its ratio to the inner ring's speed instead of that of rolling, and its slip.

    `slip` is the part by which it turns slower [1].  None: rolling, or the slip of each row of a table holds from its
    `time` [s] until the next; the first is zero.
    """

    ratio: Quantity | None
    slip: Quantity | None = None
    time: tuple[Quantity, ...] = ()
    slips: tuple[Quantity, ...] = ()

    @property
    def slipping(self) -> bool:
        """Whether it slips at all."""
        return self.slip is not None or bool(self.time)


@dataclass(frozen=True, slots=True, kw_only=True)
class EquivalentMass:
    """Eq. (3): ring mass m_i, crankpin mass m_x [kg], crank counted whole or halved (a pair of bearings carries it)."""

    ring: Quantity
    crankpin: Quantity
    crank: Literal["whole", "half"]


@dataclass(frozen=True, slots=True, kw_only=True)
class InnerRing:
    """Mass moved by the inner ring: a number [kg] or Eq. (3).  `damping` to the frame [N*s/m] or None."""

    mass: Quantity | EquivalentMass
    damping: Quantity | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterRing:
    """Outer ring on an elastic housing: mass [kg], stiffness [N/m], damping [N*s/m]."""

    mass: Quantity
    stiffness: Quantity
    damping: Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialState:
    """Ring centres [m] and velocities [m/s] at t = 0: inner x, y, (outer x, y); outer empty when it is fixed."""

    position: tuple[Quantity, ...]
    velocity: tuple[Quantity, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Catalogue:
    """What a catalogue says of a bearing, for its ratings; nothing that is derived depends on it.

    `designation` and `clearance_group` are empty where the scene names none; `clearance_range` is that of the group
    [m] in operation, after `mounting_loss` [m].  Ratings and fatigue load limit [N] are None where the scene does not
    give them.
    """

    designation: str
    clearance_group: str
    clearance_range: tuple[float, float] | None
    dynamic_rating: float | None
    static_rating: float | None
    fatigue_limit: float | None
    mounting_loss: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Lubrication:
    """Film and dirt, for the life factor of ISO 281; nothing that is derived depends on it.

    Of `viscosity_ratio` [1] and kinematic `viscosity` at the bearing's temperature [m^2/s] one is given;
    `contamination` is e_C [1].
    """

    viscosity_ratio: float | None
    viscosity: float | None
    contamination: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Bearing:
    """A deep groove ball bearing.

    `name` is empty for the scene's only ``[bearing]``; ``[bearings.<name>]`` have one.  `joint` names the revolute
    joint whose reaction loads it (None without mechanism).
    `coupling` one-way: `share` is the part of the ideal reaction it takes, `inner` what moves with the inner ring.
    `coupling` two-way: its play moves the bodies of the joint; `inner_body` carries the inner ring, `count` bearings
    stand side by side (None: one).
    `balls` is structure.  `clearance` is diametral (ISO 5753) [m].  `ball_angle` is theta_0 [rad].
    `outer` is None for a fixed outer ring.  `catalogue`, `cage` and `lubrication` are None where the scene says
    nothing of that kind.
    """

    name: str
    joint: str | None
    share: Quantity | None
    coupling: Literal["one-way", "two-way"] = "one-way"
    inner_body: str = ""
    count: Quantity | None = None
    balls: int
    ball_diameter: Quantity
    pitch_diameter: Quantity
    clearance: Quantity
    ball_angle: Quantity
    contact: HertzContact | GivenContact
    damping: Damping
    effects: tuple[BallEffect, ...]
    inner: InnerRing | None
    outer: OuterRing | None
    initial: InitialState
    catalogue: Catalogue | None = None
    cage: CageMotion | None = None
    lubrication: Lubrication | None = None

    @property
    def prefix(self) -> str:
        """What the names of its states and outputs begin with."""
        return f"{self.name}." if self.name else ""

    @property
    def path(self) -> str:
        """Its place in the scene file, which the names of its parameters and constants begin with."""
        return f"bearings.{self.name}" if self.name else "bearing"
