"""Newton–Euler balances of the bodies of a linkage: the equations A r = b, and the steps of their solution.

A `Balance` holds the forces that every joint transmits to its bodies, and the other loads on them.  A dyad or the
driver takes the known force or moment on a body from it and defines one unknown after the other.

Signs: the reaction of a joint is the force of ``bodies[1]`` on ``bodies[0]``; the reaction of a guide is a force along
its normal, to the left of its direction, at ``points[1]``, and a moment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.mechanism.kinematics import Ledger, Pose, joint_point
from ballpass.derive.mechanism.vectors import ZERO, Pair, add, cross, quarter_turn, scale, subtract
from ballpass.derive.scene.mechanism_records import CENTER_OF_MASS, Joint, Mechanism
from ballpass.derive.scene.table import FRAME
from ballpass.derive.terms import components, subscript, symbol_of

#: Torque of the drive on the driven body [N*m], counter-clockwise.
DRIVE_TORQUE = sp.Symbol("drive_torque", real=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Guide:
    """A prismatic joint once it is placed.

    Attributes
    ----------
    joint : the joint
    host, slider : the body that counts as its rail, and the one that slides on it
    direction : unit vector of the guide in the frame's axes
    travel : distance [m] of the slider from where the joint's two points coincide, along `direction`
    """

    joint: Joint
    host: str
    slider: str
    direction: Pair
    travel: sp.Expr

    @property
    def normal(self) -> Pair:
        """Unit vector to the left of `direction`."""
        return quarter_turn(self.direction)


@dataclass(frozen=True, slots=True, kw_only=True)
class AppliedLoad:
    """A force [N] in the frame's axes on a point [m] in body axes, or a torque [N*m], that acts on a moving body.

    `at` names the point.
    """

    body: str
    at: str = ""
    point: Pair = ZERO
    force: Pair = ZERO
    torque: sp.Expr = sp.S.Zero


@dataclass(frozen=True, slots=True, kw_only=True)
class JointAction:
    """Forces and moment of one joint on its two bodies; of a gear as a joint, at points on the axes.

    `along` holds the unknown force components with their directions.  The force acts on each body at the joint's point
    plus one of `shifts` (vectors in the frame's axes).
    """

    joint: Joint
    along: tuple[tuple[sp.Symbol, Pair], ...]
    moment: sp.Symbol | None = None
    shifts: tuple[Pair, Pair] = (ZERO, ZERO)

    def sign(self, body: str) -> int:
        """+1 on the first body, −1 on the second."""
        return 1 if self.joint.bodies[0] == body else -1

    @property
    def force(self) -> Pair:
        """Force of the second body on the first."""
        return add(*(scale(symbol, direction) for symbol, direction in self.along))


class Balance:
    """Newton–Euler balances of one mechanism.

    Parameters
    ----------
    mechanism, poses : bodies and joints, and how the moving bodies move
    driver : the driver's joint; it comes last, as in Eq. (1)
    guides : prismatic joints by name
    meshes : of gears
    loads : applied forces and torques
    moments : prismatic joints on the frame whose guide moment is wanted
    """

    def __init__(
        self,
        mechanism: Mechanism,
        poses: Mapping[str, Pose],
        driver: Joint,
        guides: Mapping[str, Guide],
        meshes: Sequence[JointAction],
        loads: Sequence[AppliedLoad],
        moments: frozenset[str],
    ) -> None:
        self._mechanism = mechanism
        self._poses = poses
        self._guides = guides
        self._loads = loads
        self._without_moment = [g.slider for name, g in guides.items() if g.host == FRAME and name not in moments]
        ordered = [j for j in mechanism.joints if j is not driver] + [driver]
        self.contacts = {mesh.joint.name: mesh for mesh in meshes}
        self.contacts |= {joint.name: self._contact(joint) for joint in ordered}
        self._solved: list[JointAction] = []

    def _contact(self, joint: Joint) -> JointAction:
        guide = self._guides.get(joint.name)
        prefix = f"reaction.{joint.name}"
        if guide is None:
            x, y = sp.symbols((f"{prefix}.x", f"{prefix}.y"), real=True)
            return JointAction(joint=joint, along=((x, (sp.S.One, sp.S.Zero)), (y, (sp.S.Zero, sp.S.One))))
        # The force acts where points[1] is: on bodies[0] that place moves along the guide.
        travel = guide.travel if guide.slider == joint.bodies[1] else -guide.travel
        moment = None if guide.slider in self._without_moment else sp.Symbol(f"{prefix}.moment", real=True)
        return JointAction(
            joint=joint,
            along=((sp.Symbol(f"{prefix}.normal", real=True), guide.normal),),
            moment=moment,
            shifts=(scale(travel, guide.direction), ZERO),
        )

    @property
    def unknowns(self) -> tuple[sp.Symbol, ...]:
        """Joint after joint its force components and moment; the drive torque comes last."""
        symbols: list[sp.Symbol] = []
        for contact in self.contacts.values():
            symbols.extend(symbol for symbol, _ in contact.along)
            if contact.moment is not None:
                symbols.append(contact.moment)
        return (*symbols, DRIVE_TORQUE)

    # --- what is known on one body --------------------------------------------------------------------------------

    def _arm(self, body: str, point: Pair, about: Pair) -> Pair:
        return self._poses[body].rotate(subtract(point, about))

    def contact_arm(self, contact: JointAction, body: str, about: Pair) -> Pair:
        """From a body point to where a joint's force acts on the body, in the frame's axes [m]."""
        side = contact.joint.bodies.index(body)
        return add(self._arm(body, self.point(contact.joint, body), about), contact.shifts[side])

    def point(self, joint: Joint, body: str) -> Pair:
        """Point of a joint on one of its bodies, in body axes [m]."""
        return joint_point(self._mechanism, joint, body)

    def center(self, body: str) -> Pair:
        """Centre of mass in body axes [m]."""
        return components(self._mechanism.body(body).center_of_mass)

    def _weight_and_inertia(self, body: str) -> Pair:
        """Weight minus mass times acceleration of the centre of mass."""
        gravity = self._mechanism.gravity
        weight = ZERO if gravity is None else components(gravity, axis=(0, -1))
        acceleration = self._poses[body].center_of_mass.acceleration
        mass = symbol_of(self._mechanism.body(body).mass)
        return subtract(scale(mass, weight), scale(mass, acceleration))

    def _turning_inertia(self, body: str) -> sp.Expr:
        """Moment of inertia about the centre of mass times angular acceleration."""
        inertia = self._mechanism.body(body).inertia
        # A slider on a fixed guide may have no moment of inertia: it does not turn.
        return sp.S.Zero if inertia is None else symbol_of(inertia) * self._poses[body].acceleration

    def known_forces(self, body: str) -> list[tuple[str, Pair]]:
        """Weight and inertia, applied loads and reactions already solved, with the names of their points."""
        joints = [(c.joint.point(body), scale(c.sign(body), c.force)) for c in self._solved if body in c.joint.bodies]
        applied = [(load.at, load.force) for load in self._loads if load.body == body]
        return [(CENTER_OF_MASS, self._weight_and_inertia(body)), *applied, *joints]

    def known_force(self, body: str) -> Pair:
        """Sum of applied loads, weight, inertia and reactions already solved."""
        return add(*(force for _, force in self.known_forces(body)))

    def known_moment(self, body: str, about: Pair) -> sp.Expr:
        """Moment of the same about a body point."""
        terms = [
            cross(self._arm(body, self.center(body), about), self._weight_and_inertia(body)),
            -self._turning_inertia(body),
        ]
        for load in self._loads:
            if load.body == body:
                terms += [load.torque, cross(self._arm(body, load.point, about), load.force)]
        for contact in self._solved:
            if body not in contact.joint.bodies:
                continue
            sign = contact.sign(body)
            terms.append(sign * cross(self.contact_arm(contact, body, about), contact.force))
            if contact.moment is not None:
                terms.append(sign * contact.moment)
        return sp.Add(*terms)

    # --- the equations --------------------------------------------------------------------------------------------

    def equations(self, driven: str) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix, tuple[tuple[str, str], ...]]:
        """A, b and the body and balance of each row; nothing may be solved yet."""
        columns = {symbol: k for k, symbol in enumerate(self.unknowns)}
        coefficients: list[list[sp.Expr]] = []
        right_side: list[sp.Expr] = []
        rows: list[tuple[str, str]] = []
        for body in (b.name for b in self._mechanism.bodies):
            center = self.center(body)
            known = self.known_force(body)
            x, y, moment = ([sp.S.Zero] * len(columns) for _ in range(3))
            for contact in self.contacts.values():
                if body not in contact.joint.bodies:
                    continue
                sign, arm = contact.sign(body), self.contact_arm(contact, body, center)
                for symbol, direction in contact.along:
                    k = columns[symbol]
                    x[k], y[k], moment[k] = sign * direction[0], sign * direction[1], sign * cross(arm, direction)
                if contact.moment is not None:
                    moment[columns[contact.moment]] = sp.Integer(sign)
            if body == driven:
                moment[columns[DRIVE_TORQUE]] = sp.S.One
            coefficients += [x, y]
            right_side += [-known[0], -known[1]]
            rows += [(body, "x"), (body, "y")]
            if body not in self._without_moment:
                coefficients.append(moment)
                right_side.append(-self.known_moment(body, center))
                rows.append((body, "moment"))
        return sp.ImmutableMatrix(coefficients), sp.ImmutableMatrix(right_side), tuple(rows)

    # --- steps of the solution ------------------------------------------------------------------------------------

    def name_moment(self, ledger: Ledger, body: str, outer: Joint) -> sp.Expr:
        """Name the known moment on a body about one of its joints [N*m]."""
        return ledger.name(
            f"body.{body}.known_moment",
            self.known_moment(body, self.point(outer, body)),
            "N*m",
            f"moment about {outer.name} of loads, inertia and reactions already known on {body}",
            f"K_{{{subscript(body)}}}",
        )

    def solve_hinge(self, ledger: Ledger, joint: Joint, body: str, force: Pair) -> None:
        """Define a revolute joint's unknowns by its force on a body [N]."""
        contact = self.contacts[joint.name]
        on_first = scale(contact.sign(body), force)
        for (symbol, _), axis, value in zip(contact.along, "xy", on_first, strict=True):
            ledger.define(symbol.name, value, "N", *_force_words(joint, axis))
        self.know(joint.name)

    def know(self, name: str) -> None:
        """Count the force of a joint or gear, which has been defined, as known."""
        self._solved.append(self.contacts[name])

    def solve_hinge_by_forces(self, ledger: Ledger, joint: Joint, body: str) -> None:
        """Define a revolute joint's unknowns by the balance of forces on a body."""
        self.solve_hinge(ledger, joint, body, scale(sp.Integer(-1), self.known_force(body)))

    def solve_guide(self, ledger: Ledger, guide: Guide, normal: sp.Expr, about: Pair) -> None:
        """Define the unknowns of a prismatic joint; its moment by the balance of moments on the slider.

        Parameters
        ----------
        normal : normal force on the slider [N]
        about : point of the slider about which no unknown force has a moment, in its axes [m]
        """
        joint, slider = guide.joint, guide.slider
        contact = self.contacts[joint.name]
        mark, sign, (on, by) = subscript(joint.name), contact.sign(slider), joint.bodies
        ((symbol, _),) = contact.along
        ledger.define(
            symbol.name,
            sign * normal,
            "N",
            f"normal force of {by} on {on} at guide {joint.name}, positive to the left of the guide",
            f"N_{{{mark}}}",
        )
        if contact.moment is not None:
            self._solved.append(replace(contact, moment=None))
            moment = -sign * self.known_moment(slider, about)
            words = f"moment of {by} on {on} at guide {joint.name}"
            ledger.define(contact.moment.name, moment, "N*m", words, f"M_{{{mark}}}")
            self._solved.pop()
        self._solved.append(contact)

    def force_symbols(self, ledger: Ledger, joint: Joint) -> Pair:
        """Components of a joint's reaction; those of a guide are defined from its normal force."""
        force = self.contacts[joint.name].force
        x, y = (
            ledger.name(f"reaction.{joint.name}.{axis}", value, "N", *_force_words(joint, axis))
            for axis, value in zip("xy", force, strict=True)
        )
        return x, y


def _force_words(joint: Joint, axis: str) -> tuple[str, str]:
    """Description and LaTeX symbol of a component of a joint's reaction."""
    on, by = joint.bodies
    return f"{axis} force of {by} on {on} at joint {joint.name}", f"R_{{{subscript(joint.name)},{axis}}}"
