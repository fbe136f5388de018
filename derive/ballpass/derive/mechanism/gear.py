"""The gear pair: a wheel that turns with another one at a constant ratio, on the body that carries both axes.

In: a `Gear` of the scene, and bodies already placed.  Out: the pose of the wheel, and the force between the teeth.

Seen from the carrier, θ₂ − θ₂₀ = σ z₁/z₂ (θ₁ − θ₁₀), σ = −1 for external gears and +1 for internal ones.  With e from
the first axis to the second one the pitch point is z₁/(z₁ − σ z₂) e from the first.  The force acts there along the
line of pressure: it drives by its part along the common tangent, and pushes the wheels apart.  A belt that does not
slip turns both pulleys as an internal gear does (σ = +1); the strand that carries pulls them together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.mechanism.balance import Balance, JointAction
from ballpass.derive.mechanism.dyads.dyad import Group, Margin, Placement, name_acceleration, name_hinge, name_rate
from ballpass.derive.mechanism.kinematics import Ledger, Play, Pose, Turn, body_point, joint_point, name_turn, place
from ballpass.derive.mechanism.vectors import add, cross, dot, quarter_turn, rotate, scale, subtract, unit
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.mechanism_records import Gear, Joint, Mechanism
from ballpass.derive.scene.table import FRAME
from ballpass.derive.terms import subscript, symbol_of
from ballpass.derive.variables import Words


@dataclass(frozen=True, slots=True, kw_only=True)
class GearPair(Group):
    """A wheel in mesh with a body already placed.

    Attributes
    ----------
    bodies : the wheel
    hosts : the body that carries its hinge, and the wheel already placed
    carrier : the body that carries both axes
    axes : points of the carrier on the axes of both wheels, in the gear's order
    hinges : joints that hold the axes there; the first one holds the wheel
    mesh : the gear as a joint, at points of its bodies on their axes
    """

    gear: Gear
    carrier: str
    axes: tuple[str, str]
    hinges: tuple[Joint, ...]
    mesh: Joint

    @property
    def joints(self) -> tuple[str, ...]:
        """Name of the joint that holds the wheel."""
        return (self.hinges[0].name,)

    @property
    def outputs(self) -> Sequence[Words]:
        """The force between the teeth, or that of the strand."""
        name, words = f"gear.{self.gear.name}.force", f"Force of gear {self.gear.name} along its line of action"
        return ((name, sp.Symbol(name, real=True), "N", words),)

    @property
    def circles(self) -> tuple[str, str, str, str, float] | None:
        """Pitch circles; pulleys of a belt have none."""
        (one, other), (axis, far) = self.mesh.bodies, self.mesh.points
        return (one, axis, other, far, float(self.lever)) if self.gear.radius is None else None

    @property
    def sense(self) -> int:
        """+1 where both wheels turn the same way, seen from the carrier."""
        return -1 if self.gear.kind == "external" else 1

    @property
    def length(self) -> sp.Symbol:
        """Distance of the axes [m]."""
        return sp.Symbol(f"gear.{self.gear.name}.distance", real=True)

    @property
    def radii(self) -> tuple[sp.Expr, sp.Expr]:
        """From each axis to the pitch point, along the way from the first axis to the second; of pulleys [m]."""
        first, second = self.gear.teeth
        if self.gear.radius is not None:
            radius = symbol_of(self.gear.radius)
            return radius, radius * sp.Rational(second, first)
        return self.lever * self.length, (self.lever - 1) * self.length

    @property
    def lever(self) -> sp.Rational:
        """From the first axis to the pitch point, over the way to the second axis."""
        first, second = self.gear.teeth
        return sp.Rational(first, first - self.sense * second)

    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Angle by the ratio, seen from the carrier; the axis as its hinge has it."""
        (wheel,), (hinge, *_), gear = self.bodies, self.hinges, self.gear
        if loose := [joint.name for joint in self.hinges if joint.name in play]:
            raise Fault(
                key=f"mechanism.gears.{gear.name}",
                problem=f"the bearing at joint {loose[0]} is coupled two-way, and its play would move an axis of gear "
                f"{gear.name}, whose wheels are rigid",
                given=f'coupling = "two-way" at {", ".join(loose)}',
                allowed="bearings coupled two-way at joints that hold no axis of a gear",
                remedy='give the bearing coupling = "one-way", or put it at another joint',
            ).of_linkage()
        side = gear.bodies.index(wheel)
        ratio = self.sense * sp.Rational(*gear.teeth)
        ratio = ratio if side else 1 / ratio
        carrier, partner = poses[self.carrier], poses[gear.bodies[1 - side]]
        starts = [symbol_of(angle) for angle in (gear.first_angle, gear.second_angle)]
        start, other = starts[side], starts[1 - side]
        ends = [body_point(mechanism, self.carrier, point) for point in self.axes]
        across = subtract(ends[1], ends[0])
        apart = dot(across, across) / (dot(across, across) + dot(ends[0], ends[0]) + dot(ends[1], ends[1]))
        if gear.radius is not None:
            apart = 1 - (self.radii[0] - self.radii[1]) ** 2 / dot(across, across)
        words = f"squared distance of the axes of gear {gear.name}, by the squared lengths to it"
        angle, both = None, ((carrier.cos, carrier.sin), (partner.cos, partner.sin))
        if carrier.angle is not None and partner.angle is not None:
            turned = start + ratio * (partner.angle - carrier.angle - other)
            angle = carrier.angle + turned
            cos, sin = unit(angle)
        else:
            # within half a turn of the position that the scene names; opposite to it the angle would jump
            seen = (dot(*both), cross(*both))
            seen = rotate(sp.cos(other), -sp.sin(other), seen)
            cos, sin = rotate(*both[0], unit(start + ratio * sp.atan2(seen[1], seen[0])))
            apart, words = apart * (1 + seen[0]) / 2, f"{words}, and how far the other wheel is from half a turn"
        cos, sin = name_turn(ledger, wheel, cos, sin, subscript(wheel))
        turn = Turn(
            cos=cos,
            sin=sin,
            rate=name_rate(ledger, wheel, carrier.rate + ratio * (partner.rate - carrier.rate)),
            acceleration=name_acceleration(
                ledger, wheel, carrier.acceleration + ratio * (partner.acceleration - carrier.acceleration)
            ),
            angle=angle,
        )
        axle = name_hinge(ledger, mechanism, hinge, poses[self.hosts[0]], play)
        pose = place(ledger, mechanism, wheel, turn, joint_point(mechanism, hinge, wheel), axle)
        length = ledger.define(
            self.length.name,
            sp.sqrt(dot(across, across)),
            "m",
            f"distance of the axes of gear {gear.name}",
            f"a_{{{subscript(gear.name)}}}",
        )
        way = ledger.name_pair(
            f"gear.{gear.name}.axes",
            "",
            carrier.rotate(across),
            "m",
            f"component of the line from the first axis of gear {gear.name} to the second",
            f"e_{{{subscript(gear.name)},AXIS}}",
        )
        return Placement(
            dyad=self,
            poses=(pose,),
            spans=(scale(1 / length, way),),
            determinant=self.radii[side],
            margin=Margin(joint=hinge.name, expression=apart, description=words),
        )

    def meshing(self, placement: Placement) -> JointAction:
        """The gear in balances: a force that drives along the tangent and pushes the wheels apart; of a belt the pull
        of the strand that carries, where it leaves the pulleys."""
        (along,), (first, second), across = placement.spans, self.radii, quarter_turn(placement.spans[0])
        side = sp.Symbol(f"gear.{self.gear.name}.side", real=True)
        if self.gear.radius is None:
            slope = self.sense * side * sp.tan(symbol_of(self.gear.pressure_angle))
            direction, normal = add(across, scale(slope, along)), along
        else:
            cosine = (first - second) / self.length
            sine = side * sp.sqrt(1 - cosine**2)
            direction = add(scale(cosine, across), scale(sine, along))
            normal = subtract(scale(cosine, along), scale(sine, across))
        size = sp.Symbol(f"gear.{self.gear.name}.tangential", real=True)
        shifts = scale(first, normal), scale(second, normal)
        return JointAction(joint=self.mesh, along=((size, direction),), shifts=shifts)

    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Teeth: moment of the wheel about its axis; then the hinge."""
        (wheel,), hinge, name = self.bodies, self.hinges[0], self.gear.name
        sense = 1 if wheel == self.gear.bodies[1] else -1
        force = sense * balance.name_moment(ledger, wheel, hinge) / placement.determinant
        first, second = self.gear.bodies
        words = f"of {second} on {first} at gear {name}"
        mark = subscript(name)
        push = ledger.define(
            f"gear.{name}.tangential",
            force,
            "N",
            f"force {words} along the tangent, to the left of the line from the first axis to the second",
            f"F_{{t,{mark}}}",
        )
        side = ledger.define(
            f"gear.{name}.side",
            sp.sign(push),
            "1",
            f"flank that carries gear {name}: sense of its tangential force",
            "s",
        )
        normal = push * side / (1 if self.gear.radius else sp.cos(symbol_of(self.gear.pressure_angle)))
        ledger.define(f"gear.{name}.force", normal, "N", f"force {words} along its line of action", f"F_{{n,{mark}}}")
        balance.know(name)
        balance.solve_hinge_by_forces(ledger, hinge, wheel)


#: Points of a carrier and of a wheel on the wheel's axis, and joints that hold it there.
Axis = tuple[str, str, tuple[str, ...]]


def next_gear(mechanism: Mechanism, placed: Sequence[str]) -> GearPair | None:
    """The first gear of which one wheel is placed, and of the other one the body that holds it."""
    for gear in mechanism.gears:
        loose = [body for body in gear.bodies if body not in placed]
        held = [j for j in mechanism.joints if loose[:1] == [b for b in j.bodies if b not in placed]]
        found = {carrier: axes for carrier, axes in carriers(mechanism, gear).items() if carrier in placed}
        if len(loose) != 1 or len(held) != 1 or not found:
            continue
        carrier, ends = next(iter(found.items()))
        hinges = dict.fromkeys((held[0].name, *(name for *_, names in ends for name in names)))
        points = ends[0][1], ends[1][1]
        return GearPair(
            bodies=(loose[0],),
            hosts=(held[0].other(loose[0]), next(body for body in gear.bodies if body in placed)),
            gear=gear,
            carrier=carrier,
            axes=(ends[0][0], ends[1][0]),
            hinges=tuple(mechanism.joint(name) for name in hinges),
            mesh=Joint(name=gear.name, kind="revolute", bodies=gear.bodies, points=points, direction=None, branch=None),
        )
    return None


def carriers(mechanism: Mechanism, gear: Gear) -> dict[str, tuple[Axis, Axis]]:
    """Bodies that carry both axes: a wheel is hinged to the carrier, or both are to a third body at one point."""
    found = {}
    for carrier in (FRAME, *(body.name for body in mechanism.bodies)):
        first, second = (_axis(mechanism, carrier, body) for body in gear.bodies)
        if first is not None and second is not None and carrier not in gear.bodies:
            found[carrier] = first, second
    return found


def _axis(mechanism: Mechanism, carrier: str, wheel: str) -> Axis | None:
    hinges = [joint for joint in mechanism.joints if joint.kind == "revolute"]
    for joint in hinges:
        if carrier in joint.bodies and wheel in joint.bodies:
            return joint.point(carrier), joint.point(wheel), (joint.name,)
    for one in (joint for joint in hinges if wheel in joint.bodies):
        third = one.other(wheel)
        for two in (joint for joint in hinges if {*joint.bodies} == {carrier, third}):
            if one.point(third) == two.point(third):
                return two.point(carrier), one.point(wheel), (one.name, two.name)
    return None
