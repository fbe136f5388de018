"""The shaft of a scene without a mechanism, and loads on inner rings, as frozen records in SI units; see `records`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from ballpass.derive.scene.keys import ChoiceKey, Needs
from ballpass.derive.scene.quantity import AMOUNT, SceneNumber, Vector
from ballpass.derive.scene.read_keys import Either, column, force_key, not_negative, positive, quantity

_TILTING = (Needs(key="transverse_inertia", why="only a shaft that tilts in its bearings is a body of its own"),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shaft:
    """Rotation of a ring where no mechanism gives it: constant speed [rad/s].  The other ring stands.

    With `outer_speed` [rad/s] both rings turn.  With `transverse_inertia` [kg*m^2] it is a rigid body that tilts in its
    bearings, of a `mass` [kg] and a `polar_inertia` [kg*m^2], with its `center_of_mass` at a place along it [m];
    without, these are None.
    """

    speed: SceneNumber = quantity(
        "rad/s",
        "Speed of the shaft",
        r"\omega",
        "1200 rpm",
        note="of the ring that turns, whose angle is zero at t = 0",
    )
    ring: Literal["inner", "outer"] = ChoiceKey(
        words="The ring that turns with the shaft",
        choices=("inner", "outer"),
        default="inner",
        note="loads act on the inner ring, also where it stands",
    ).declared()
    outer_speed: SceneNumber | None = quantity(
        "rad/s",
        "Speed of the outer ring",
        r"\omega_o",
        "-800 rpm",
        optional=True,
        needs=(Needs(key="ring", value="inner", why="both rings turn, each at a speed of its own"),),
        note="where both rings turn, as between two shafts or in a planet; without it the other ring stands",
    )
    transverse_inertia: SceneNumber | None = positive(
        "kg*m^2",
        "Moment of inertia of the shaft about axes across it through its centre of mass",
        "J_t",
        "0.02 kg*m^2",
        optional=True,
        note="the shaft then tilts in its bearings, which have places: {doc}`../../theory/supports`",
    )
    mass: SceneNumber | None = positive("kg", "Mass of the shaft with the inner rings", "m", "4 kg", needs=_TILTING)
    polar_inertia: SceneNumber | None = positive(
        "kg*m^2",
        "Moment of inertia of the shaft about its axis",
        "J_p",
        "0.004 kg*m^2",
        optional=True,
        needs=_TILTING,
        note="its gyroscopic moments act on the tilts; without it none",
    )
    center_of_mass: SceneNumber | None = quantity(
        "m",
        "Place of the shaft's centre of mass along it",
        "z_c",
        "20 mm",
        optional=True,
        needs=_TILTING,
        note="without it zero",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantLoad:
    """Constant force on the inner ring [N]."""

    force: Vector = force_key("the load on the inner ring", "F").declared()


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicLoad:
    """``mean + amplitude * cos(2 pi frequency t + phase)`` on the inner ring [N], [Hz], [rad].

    `phase` is one for both components, or that of x and that of y.
    """

    mean: Vector = force_key("the mean load on the inner ring", r"\bar F").declared()
    amplitude: Vector = force_key("the amplitude of the load on the inner ring", r"\hat F").declared()
    frequency: SceneNumber = positive("Hz", "Frequency of the load", "f", "50 Hz")
    phase: SceneNumber | tuple[SceneNumber, SceneNumber] = quantity(
        "rad",
        "Phase of the load at the start",
        r"\varphi",
        "0 deg",
        note="of both components, or a list: that of x and that of y, `load.phase.x`",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLoad:
    """Force on the inner ring, linear between rows.

    Rows are over the `time` [s], constant before the first and after the last, or the `angle` of the shaft [rad],
    periodic over a turn; the other one is empty.  Rows strictly increasing, `x` and `y` [N]; all of one length of at
    least two.
    """

    one_of: ClassVar[tuple[Either, ...]] = (
        Either(what="what the rows are over", groups=(("time",), ("angle",)), at="angle"),
    )

    time: tuple[SceneNumber, ...] = column(
        "s",
        "Time of row ROW of the load's table",
        "t_{ROW}",
        note="strictly increasing, two rows or more; constant outside",
    )
    angle: tuple[SceneNumber, ...] = column(
        "rad",
        "Angle of the shaft in row ROW of the load's table",
        r"\theta_{ROW}",
        note="within less than a turn; periodic",
    )
    x: tuple[SceneNumber, ...] = column("N", "x component of the load in row ROW of its table", "F_{x,ROW}")
    y: tuple[SceneNumber, ...] = column("N", "y component of the load in row ROW of its table", "F_{y,ROW}")

    @property
    def over(self) -> Literal["time", "angle"]:
        """What the rows are over."""
        return "angle" if self.angle else "time"

    @property
    def rows(self) -> tuple[SceneNumber, ...]:
        """Their times or angles."""
        return self.angle or self.time or ()


@dataclass(frozen=True, slots=True, kw_only=True)
class UnbalanceLoad:
    """Unbalance of the shaft: a mass [kg] at an eccentricity [m], at an angle of the shaft [rad]."""

    mass: SceneNumber = not_negative("kg", "Unbalanced mass", "m_u", "5 g")
    eccentricity: SceneNumber = not_negative(
        "m", "Distance of the unbalanced mass from the axis", "e_u", "20 mm", remedy=AMOUNT.remedy
    )
    angle: SceneNumber = quantity("rad", "Angle of the unbalance at t = 0", r"\alpha_u", "0 deg", default="0 deg")


LoadLaw = ConstantLoad | HarmonicLoad | TableLoad | UnbalanceLoad


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadWindow:
    """From `start` (inclusive) to `end` (exclusive; None: for ever): times [s], or angles of the shaft [rad]."""

    start: SceneNumber = quantity("UNIT", "WHAT at which the load begins", "SYMBOL_{on}", "FIRST")
    end: SceneNumber | None = quantity(
        "UNIT", "WHAT at which the load ends", "SYMBOL_{off}", "LAST", when="required for angles; without one a step"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """A force on the inner ring of every bearing, acting within its windows where it has some.

    `name` is empty for the scene's only ``[load]``; ``[loads.<name>]`` have one.
    """

    name: str
    law: LoadLaw
    angle_window: LoadWindow | None = None
    time_window: LoadWindow | None = None
    position: SceneNumber | None = quantity(
        "m",
        "Place of the load along the shaft",
        "z_F",
        "-40 mm",
        optional=True,
        note="with bearings that have a `position`; without it zero",
    )

    @property
    def path(self) -> str:
        """Its place in the scene file: the prefix of the names of its constants."""
        return f"loads.{self.name}" if self.name else "load"

    @property
    def label(self) -> str:
        """Prefix of the names of its inputs and variables."""
        return f"load.{self.name}" if self.name else "load"

    @property
    def turns(self) -> bool:
        """Whether it depends on the angle of the shaft."""
        over_angle = isinstance(self.law, TableLoad) and self.law.over == "angle"
        return over_angle or isinstance(self.law, UnbalanceLoad) or self.angle_window is not None
