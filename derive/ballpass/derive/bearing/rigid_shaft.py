"""A rigid shaft that moves and tilts in its bearings: its axis runs through the inner rings of two of them.

In: the bearings of a shaft with their places along it.  Out: a `RigidShaft`: the motion of its axis at any place, what
it adds to the equations of motion, and the motion of further inner rings.

Its four coordinates are those of the first two inner rings, u_1 and u_2 at z_1 and z_2; at z the axis is displaced by
u = u_1 + (z - z_1) s with the slope s = (u_2 - u_1)/(z_2 - z_1), which is (phi_y, -phi_x) of the tilts about x and y.
Tilts are small: terms of second order in them are left out.  The torque of the drive acts about the tilted axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.bearing.equations import ring_coordinates
from ballpass.derive.bearing.ring_load import RingLoad
from ballpass.derive.bearing.two_way import Coupled, ring
from ballpass.derive.mechanism.kinematics import Ledger, Motion, displaced
from ballpass.derive.mechanism.linear_forms import Effort, Inertia, inertias_of
from ballpass.derive.mechanism.vectors import add, dot, scale
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.mechanism_records import CENTER_OF_MASS, Mechanism
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.shaft_records import Shaft
from ballpass.derive.terms import Definition, defined, symbol_of
from ballpass.derive.variables import Output


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidShaft:
    """A shaft on two bearings or more.

    Attributes
    ----------
    reference : motion of the axis in the plane z = 0
    slope : of the axis over z, and its rates
    constants, definitions : of the symbols in these, and of the motion of inner rings without coordinates
    mass, transverse_inertia, polar_inertia, center_of_mass : of the scene; no polar inertia is zero
    """

    reference: Motion
    slope: Motion
    constants: tuple[Definition, ...]
    definitions: tuple[Definition, ...]
    mass: sp.Expr
    transverse_inertia: sp.Expr
    polar_inertia: sp.Expr
    center_of_mass: sp.Expr

    @property
    def tilting(self) -> tuple[Inertia, ...]:
        """Inertia of the tilts."""
        return tuple(inertias_of(self.transverse_inertia, self.slope))

    def gyroscopic(self, speed: sp.Expr) -> tuple[Effort, ...]:
        """Moments of a rotor that turns at a speed [rad/s], which do no work."""
        x, y = self.slope.velocity
        moment = self.polar_inertia * speed
        return tuple(Effort(amount=f, rate=v) for f, v in ((-moment * y, x), (moment * x, y)) if moment != 0)

    def loaded(self, load: RingLoad, speed: sp.Expr) -> Coupled:
        """What a shaft adds that is loaded one-way; its own inertia is not that of a linkage's body."""
        own = inertias_of(self.mass, displaced(self.reference, self.slope, self.center_of_mass))
        pairs = ((load.force, self.reference.velocity), (load.moment, self.slope.velocity))
        work = (Effort(amount=f, rate=v) for pair in pairs for f, v in zip(*pair, strict=True) if f != 0)
        return Coupled(inertias=(*own, *self.tilting), efforts=(*work, *self.gyroscopic(speed)))

    def outputs(self, load: RingLoad | None) -> list[Output]:
        """Tilts, and of a shaft that is loaded one-way its load, the power of that, and its kinetic energy."""
        x, y = self.slope.position
        rows = [
            ("shaft.tilt.x", -y, "rad", "Tilt of the shaft about x"),
            ("shaft.tilt.y", x, "rad", "Tilt of the shaft about y"),
        ]
        if load is not None:
            for axis, force in zip("xy", load.force, strict=True):
                rows.append((f"shaft.load.{axis}", force, "N", f"Sum of the forces on the shaft along {axis}"))
            power = dot(load.force, self.reference.velocity) + dot(load.moment, self.slope.velocity)
            rows.append(("shaft.load.power", power, "W", "Power of the forces on the shaft"))
            center = displaced(self.reference, self.slope, self.center_of_mass).velocity
            twice = self.mass * dot(center, center) + self.transverse_inertia * dot(*[self.slope.velocity] * 2)
            rows.append(("shaft.kinetic_energy", twice / 2, "J", "Kinetic energy of the shaft without its rotation"))
        return [Output(name=n, expression=e, unit=u, description=d) for n, e, u, d in rows]


def rigid_shaft(bearings: Sequence[Bearing], shaft: Shaft | None, mechanism: Mechanism | None) -> RigidShaft | None:
    """The shaft that tilts in its bearings; None where the scene has none."""
    on_shaft = [bearing for bearing in bearings if bearing.tilts]
    if not on_shaft:
        return None
    first, second, *further = on_shaft
    ledger, z_1, z_2 = Ledger(), _place(first.position), _place(second.position)
    words = "One over the distance of the two bearings whose inner rings carry the axis"
    per_distance = defined("shaft.per_distance", 1 / (z_2 - z_1), "1/m", words, r"1/\Delta z")
    words = "Place of the bearing on the line between the two whose inner rings carry the axis"
    along = tuple(
        defined(f"{b.path}.along_axis", (_place(b.position) - z_1) / (z_2 - z_1), "1", words, "s") for b in further
    )
    one, two = (ring(ring_coordinates(bearing), 0) for bearing in (first, second))
    units = (("position", "", "1"), ("velocity", "v", "1/s"), ("acceleration", "a", "1/s^2"))
    slope = Motion(
        **{
            what: ledger.name_pair(
                "shaft.slope",
                mark,
                scale(per_distance.symbol, add(getattr(two, what), scale(sp.Integer(-1), getattr(one, what)))),
                unit,
                f"{what} of the slope of the shaft's axis" if mark else "slope of the shaft's axis",
                r"s_{AXIS}" if not mark else rf"{'d' * len(mark)}s_{{AXIS,{mark}}}",
            )
            for what, mark, unit in units
        }
    )
    reference = ledger.name_motion("shaft", displaced(one, slope, -z_1), "the shaft's axis in the plane z = 0", "0")
    for bearing in further:
        moved = displaced(reference, slope, _place(bearing.position))
        for axis, c in enumerate(ring_coordinates(bearing)[:2]):
            for symbol, pair, words in (
                (c.position, moved.position, c.words[0]),
                (c.velocity, moved.velocity, c.words[1]),
                (c.acceleration, moved.acceleration, f"Acceleration {c.description}"),
            ):
                ledger.define(symbol.name, pair[axis], c.unit, words, c.latex)
    if shaft is not None:
        numbers = (shaft.mass, shaft.transverse_inertia, shaft.polar_inertia, shaft.center_of_mass)
    else:
        assert mechanism is not None
        body = next(body for body in mechanism.bodies if body.transverse_inertia is not None)
        numbers = (body.mass, body.transverse_inertia, body.inertia, dict(body.positions).get(CENTER_OF_MASS))
    mass, transverse, polar, center = map(_place, numbers)
    return RigidShaft(
        reference=reference,
        slope=slope,
        constants=(per_distance, *along),
        definitions=ledger.definitions,
        mass=mass,
        transverse_inertia=transverse,
        polar_inertia=polar,
        center_of_mass=center,
    )


def _place(number: SceneNumber | None) -> sp.Expr:
    return sp.S.Zero if number is None else symbol_of(number)
