"""From kinematics to joint reactions and drive torque: Newton–Euler, Eq. (1) of the paper.

In: a `Mechanism` and its `Linkage`.  Out: `Reactions`: the linear equations A r = b, and their solution in closed form.

Each moving body gives force balances along x and y and a moment balance about its centre of mass; inertia terms and
applied loads stand in b.  The solution walks the dyads from the last to the first: two equations for the inner joint,
then one balance after the other.  No general elimination takes place, so the solution is as accurate as LAPACK's.

Signs: the reaction of a joint is the force of ``bodies[1]`` on ``bodies[0]``; the reaction of a guide is a force along
its normal, to the left of its direction, at ``points[1]``, and a moment; the drive torque acts on the driven body,
counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import sympy as sp

from ballpass.derive.mechanism.assembly import point_name
from ballpass.derive.mechanism.dyads.dyad import Dyad, Guide
from ballpass.derive.mechanism.kinematics import (
    ZERO,
    Ledger,
    Pair,
    add,
    body_point,
    cross,
    dot,
    scale,
    subscript,
    subtract,
)
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.scene.errors import Fault, LinkageError
from ballpass.derive.scene.records import Joint, Mechanism
from ballpass.derive.terms import Definition, components, symbol_of

DRIVE_TORQUE = sp.Symbol("drive_torque", real=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reactions:
    """Joint reactions and drive torque.

    Attributes
    ----------
    matrix, unknowns, right_side : A (n × n), r (n), b (n) of A r = b; the driver's joint and torque come last
    rows : body and balance (``x``, ``y``, ``moment``) of each equation
    definitions : the solution, ordered; the unknowns are among the symbols
    joint_force : by joint, force [N] of ``bodies[1]`` on ``bodies[0]``
    joint_moment : by prismatic joint, moment [N*m] of ``bodies[1]`` on ``bodies[0]`` with the force at ``points[1]``; a
        joint whose moment was not asked for is none of them
    drive_torque : torque [N*m] of the drive on the driven body, counter-clockwise
    """

    matrix: sp.ImmutableMatrix
    unknowns: tuple[sp.Symbol, ...]
    right_side: sp.ImmutableMatrix
    rows: tuple[tuple[str, str], ...]
    definitions: tuple[Definition, ...]
    joint_force: Mapping[str, Pair]
    joint_moment: Mapping[str, sp.Expr]
    drive_torque: sp.Expr


@dataclass(frozen=True, slots=True, kw_only=True)
class _Contact:
    """What one joint does to the bodies it joins.

    `along` holds the unknown force components with their directions.  The force acts on each body at `point` of that
    body plus `shift` (a vector in the frame's axes).
    """

    joint: Joint
    along: tuple[tuple[sp.Symbol, Pair], ...]
    moment: sp.Symbol | None
    points: tuple[Pair, Pair]
    shifts: tuple[Pair, Pair]

    def sign(self, body: str) -> int:
        return 1 if self.joint.bodies[0] == body else -1

    @property
    def force(self) -> Pair:
        return add(*(scale(symbol, direction) for symbol, direction in self.along))


def derive_reactions(
    mechanism: Mechanism, linkage: Linkage, gates: Mapping[str, sp.Expr], moments: frozenset[str]
) -> Reactions:
    """Derive A r = b and its solution.

    Parameters
    ----------
    mechanism, linkage : the linkage and its kinematics
    gates : by name of an applied force or torque, the factor that switches it; 1 where absent
    moments : prismatic joints on the frame whose guide moment is wanted; each adds the moment balance of its slider

    Raises
    ------
    LinkageError
        a body without inertia whose moment balance is needed; `moments` names a joint that is not prismatic.
    """
    balance = _Balance(mechanism, linkage, gates, moments)
    matrix, right_side, rows = balance.equations()
    ledger = Ledger()
    for dyad in reversed(linkage.dyads):
        (balance.solve_rrr if dyad.guide is None else balance.solve_rrp)(ledger, dyad)
    balance.solve_driver(ledger)
    forces = {joint.name: balance.force_symbols(ledger, joint) for joint in mechanism.joints}
    contacts = balance.contacts
    return Reactions(
        matrix=matrix,
        unknowns=balance.unknowns,
        right_side=right_side,
        rows=rows,
        definitions=ledger.definitions,
        joint_force=MappingProxyType(forces),
        joint_moment=MappingProxyType({c.joint.name: c.moment for c in contacts if c.moment is not None}),
        drive_torque=DRIVE_TORQUE,
    )


class _Balance:
    """Newton–Euler balances of one mechanism: the equations, and the steps of their solution."""

    def __init__(
        self, mechanism: Mechanism, linkage: Linkage, gates: Mapping[str, sp.Expr], moments: frozenset[str]
    ) -> None:
        self._mechanism = mechanism
        self._linkage = linkage
        self._gates = gates
        self._guides = {d.guide.joint.name: d.guide for d in linkage.dyads if d.guide is not None}
        self._without_moment = tuple(g.slider for name, g in self._guides.items() if g.fixed and name not in moments)
        self._refuse(moments)
        #: The driver's joint is the last, as in Eq. (1).
        ordered = [j for j in mechanism.joints if j is not linkage.driver] + [linkage.driver]
        self.contacts = tuple(self._contact(joint) for joint in ordered)
        self._solved: list[_Contact] = []

    def _refuse(self, moments: frozenset[str]) -> None:
        at_rest = {g.slider for g in self._guides.values() if g.fixed}
        faults = [
            Fault(
                key=f"mechanism.bodies.{body.name}.inertia",
                problem=f"the moment balance of {body.name} is needed, and the body has no moment of inertia",
                given="nothing",
                allowed="a moment of inertia about the centre of mass; it may be left out for a slider on a fixed "
                "guide, which does not turn",
                remedy=f'give mechanism.bodies.{body.name}.inertia, as in inertia = "611.7 kg*mm^2"',
            )
            for body in self._mechanism.bodies
            if body.inertia is None and body.name not in at_rest
        ]
        faults += [
            Fault(
                key=f"mechanism.joints.{name}",
                problem=f"the guide moment of joint {name} is asked for, and it is not a prismatic joint",
                given=name,
                allowed=", ".join(self._guides) or "nothing: the linkage has no prismatic joint",
                remedy=f"leave the moment of {name} out of the outputs",
            )
            for name in sorted(moments)
            if name not in self._guides
        ]
        if faults:
            raise LinkageError(faults)

    def _contact(self, joint: Joint) -> _Contact:
        first, second = (body_point(self._mechanism, body, point_name(joint, body)) for body in joint.bodies)
        guide = self._guides.get(joint.name)
        prefix = f"reaction.{joint.name}"
        if guide is None:
            x, y = sp.symbols((f"{prefix}.x", f"{prefix}.y"), real=True)
            along: tuple[tuple[sp.Symbol, Pair], ...] = ((x, (sp.S.One, sp.S.Zero)), (y, (sp.S.Zero, sp.S.One)))
            return _Contact(joint=joint, along=along, moment=None, points=(first, second), shifts=(ZERO, ZERO))
        # The force acts where points[1] is: on bodies[0] that place moves along the guide.
        travel = guide.travel if guide.slider == joint.bodies[1] else -guide.travel
        moment = None if guide.slider in self._without_moment else sp.Symbol(f"{prefix}.moment", real=True)
        return _Contact(
            joint=joint,
            along=((sp.Symbol(f"{prefix}.normal", real=True), guide.normal),),
            moment=moment,
            points=(first, second),
            shifts=(scale(travel, guide.direction), ZERO),
        )

    @property
    def unknowns(self) -> tuple[sp.Symbol, ...]:
        symbols: list[sp.Symbol] = []
        for contact in self.contacts:
            symbols.extend(symbol for symbol, _ in contact.along)
            if contact.moment is not None:
                symbols.append(contact.moment)
        return (*symbols, DRIVE_TORQUE)

    # --- one body -------------------------------------------------------------------------------------------------

    def _arm(self, body: str, point: Pair, about: Pair) -> Pair:
        return self._linkage.poses[body].rotate(subtract(point, about))

    def _contact_arm(self, contact: _Contact, body: str, about: Pair) -> Pair:
        side = contact.joint.bodies.index(body)
        return add(self._arm(body, contact.points[side], about), contact.shifts[side])

    def _center(self, body: str) -> Pair:
        return components(self._mechanism.body(body).center_of_mass)

    def _applied(self, body: str) -> list[tuple[Pair, Pair]]:
        """Applied forces on a body: point in body axes, force in the frame's axes."""
        loads = []
        for load in self._mechanism.forces:
            if load.body == body:
                force = scale(self._gates.get(load.name, sp.S.One), components(load.force))
                loads.append((body_point(self._mechanism, body, load.point), force))
        return loads

    def _applied_torque(self, body: str) -> sp.Expr:
        torques = (t for t in self._mechanism.torques if t.body == body)
        return sp.Add(*(self._gates.get(t.name, sp.S.One) * symbol_of(t.torque) for t in torques))

    def _weight_and_inertia(self, body: str) -> Pair:
        """Weight minus mass times acceleration of the centre of mass."""
        gravity = self._mechanism.gravity
        weight = ZERO if gravity is None else components(gravity, axis=(0, -1))
        acceleration = self._linkage.poses[body].center_of_mass.acceleration
        mass = symbol_of(self._mechanism.body(body).mass)
        return subtract(scale(mass, weight), scale(mass, acceleration))

    def _turning_inertia(self, body: str) -> sp.Expr:
        """Moment of inertia about the centre of mass times angular acceleration."""
        inertia = self._mechanism.body(body).inertia
        acceleration = self._linkage.poses[body].acceleration
        # A slider on a fixed guide may have no moment of inertia: it does not turn.
        return sp.S.Zero if inertia is None else symbol_of(inertia) * acceleration

    def _known_force(self, body: str) -> Pair:
        """Sum of applied loads, weight, inertia and reactions already solved."""
        joints = [scale(c.sign(body), c.force) for c in self._solved if body in c.joint.bodies]
        return add(self._weight_and_inertia(body), *(force for _, force in self._applied(body)), *joints)

    def _known_moment(self, body: str, about: Pair) -> sp.Expr:
        """Moment of the same about a body point."""
        terms = [
            cross(self._arm(body, self._center(body), about), self._weight_and_inertia(body)),
            -self._turning_inertia(body),
            self._applied_torque(body),
            *(cross(self._arm(body, point, about), force) for point, force in self._applied(body)),
        ]
        for contact in self._solved:
            if body not in contact.joint.bodies:
                continue
            sign = contact.sign(body)
            terms.append(sign * cross(self._contact_arm(contact, body, about), contact.force))
            if contact.moment is not None:
                terms.append(sign * contact.moment)
        return sp.Add(*terms)

    # --- the equations --------------------------------------------------------------------------------------------

    def equations(self) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix, tuple[tuple[str, str], ...]]:
        """A, b and the body and balance of each row."""
        columns = {symbol: k for k, symbol in enumerate(self.unknowns)}
        coefficients: list[list[sp.Expr]] = []
        right_side: list[sp.Expr] = []
        rows: list[tuple[str, str]] = []
        for body in (b.name for b in self._mechanism.bodies):
            center = self._center(body)
            known = self._known_force(body)
            x, y, moment = ([sp.S.Zero] * len(columns) for _ in range(3))
            for contact in self.contacts:
                if body not in contact.joint.bodies:
                    continue
                sign, arm = contact.sign(body), self._contact_arm(contact, body, center)
                for symbol, direction in contact.along:
                    k = columns[symbol]
                    x[k], y[k], moment[k] = sign * direction[0], sign * direction[1], sign * cross(arm, direction)
                if contact.moment is not None:
                    moment[columns[contact.moment]] = sp.Integer(sign)
            if body == self._linkage.driven:
                moment[columns[DRIVE_TORQUE]] = sp.S.One
            coefficients += [x, y]
            right_side += [-known[0], -known[1]]
            rows += [(body, "x"), (body, "y")]
            if body not in self._without_moment:
                coefficients.append(moment)
                right_side.append(-self._known_moment(body, center))
                rows.append((body, "moment"))
        return sp.ImmutableMatrix(coefficients), sp.ImmutableMatrix(right_side), tuple(rows)

    # --- the solution ---------------------------------------------------------------------------------------------

    def _solve(self, ledger: Ledger, contact: _Contact, force: Pair) -> None:
        """Define a revolute joint's unknowns by the force on ``bodies[0]``."""
        name = contact.joint.name
        for (symbol, _), axis, value in zip(contact.along, "xy", force, strict=True):
            ledger.define(symbol.name, value, "N", *_force_words(contact.joint, axis))
        self._solved.append(self._by_joint(name))

    def _by_joint(self, name: str) -> _Contact:
        return next(c for c in self.contacts if c.joint.name == name)

    def _name_moment(self, ledger: Ledger, body: str, outer: Joint) -> sp.Expr:
        about = body_point(self._mechanism, body, point_name(outer, body))
        return ledger.name(
            f"body.{body}.known_moment",
            self._known_moment(body, about),
            "N*m",
            f"moment about {outer.name} of loads, inertia and reactions already known on {body}",
            f"K_{{{subscript(body)}}}",
        )

    def solve_rrr(self, ledger: Ledger, dyad: Dyad) -> None:
        """Inner joint: moments of each body about its outer joint.  Outer joints: balance of forces."""
        inner = self._by_joint(dyad.inner.name)
        one, two = (self._name_moment(ledger, body, joint) for body, joint in zip(dyad.bodies, dyad.outer, strict=True))
        v1, v2 = dyad.spans
        # v1 × f + K1 = 0 and v2 × (−f) + K2 = 0, determinant v1 × v2.
        force = scale(-1 / dyad.determinant, add(scale(one, v2), scale(two, v1)))
        self._solve(ledger, inner, force)
        for body, joint in zip(dyad.bodies, dyad.outer, strict=True):
            self._solve_by_force_balance(ledger, body, joint)

    def solve_rrp(self, ledger: Ledger, dyad: Dyad) -> None:
        """Inner joint: moment of the rod about its hinge, balance of the slider along the guide; then the rest."""
        assert dyad.guide is not None
        guide, (rod, slider) = dyad.guide, dyad.bodies
        inner = self._by_joint(dyad.inner.name)
        moment = self._name_moment(ledger, rod, dyad.outer[0])
        push = ledger.name(
            f"body.{slider}.known_push",
            dot(guide.direction, self._known_force(slider)),
            "N",
            f"force along {guide.joint.name} of loads, inertia and reactions already known on {slider}",
            f"P_{{{subscript(slider)}}}",
        )
        (v,), t = dyad.spans, guide.direction
        # f on the rod: v × f + K = 0 and t · (−f) + P = 0, determinant v · t.
        on_rod = (
            (moment * t[1] + push * v[0]) / dyad.determinant,
            (push * v[1] - moment * t[0]) / dyad.determinant,
        )
        self._solve(ledger, inner, scale(inner.sign(rod), on_rod))
        self._solve_by_force_balance(ledger, rod, dyad.outer[0])
        self._solve_guide(ledger, guide)

    def _solve_by_force_balance(self, ledger: Ledger, body: str, joint: Joint) -> None:
        contact = self._by_joint(joint.name)
        self._solve(ledger, contact, scale(-contact.sign(body), self._known_force(body)))

    def _solve_guide(self, ledger: Ledger, guide: Guide) -> None:
        contact, slider, joint = self._by_joint(guide.joint.name), guide.slider, guide.joint
        mark, sign = subscript(joint.name), contact.sign(slider)
        ((normal, _),) = contact.along
        on, by = joint.bodies
        ledger.define(
            normal.name,
            -sign * dot(guide.normal, self._known_force(slider)),
            "N",
            f"normal force of {by} on {on} at guide {joint.name}, positive to the left of the guide",
            f"N_{{{mark}}}",
        )
        if contact.moment is None:
            self._solved.append(contact)
            return
        # About the centre of mass, with the normal force among the known ones and the moment not yet.
        force_only = _Contact(
            joint=joint, along=contact.along, moment=None, points=contact.points, shifts=contact.shifts
        )
        self._solved.append(force_only)
        moment = -sign * self._known_moment(slider, self._center(slider))
        ledger.define(
            contact.moment.name, moment, "N*m", f"moment of {by} on {on} at guide {joint.name}", f"M_{{{mark}}}"
        )
        self._solved[-1] = contact

    def solve_driver(self, ledger: Ledger) -> None:
        """Driver's joint by balance of forces, drive torque by moments about that joint."""
        driver, driven = self._linkage.driver, self._linkage.driven
        about = body_point(self._mechanism, driven, point_name(driver, driven))
        torque = -self._known_moment(driven, about)
        self._solve_by_force_balance(ledger, driven, driver)
        ledger.define(DRIVE_TORQUE.name, torque, "N*m", f"torque of the drive on {driven}, counter-clockwise", "M_d")

    def force_symbols(self, ledger: Ledger, joint: Joint) -> Pair:
        """Components of a joint's reaction; those of a guide are defined from its normal force."""
        contact = self._by_joint(joint.name)
        if joint.name not in self._guides:
            (x, _), (y, _) = contact.along
            return x, y
        x, y = (
            ledger.name(f"reaction.{joint.name}.{axis}", value, "N", *_force_words(joint, axis))
            for axis, value in zip("xy", contact.force, strict=True)
        )
        return x, y


def _force_words(joint: Joint, axis: str) -> tuple[str, str]:
    """Description and LaTeX symbol of a component of a joint's reaction."""
    on, by = joint.bodies
    return f"{axis} force of {by} on {on} at joint {joint.name}", f"R_{{{subscript(joint.name)},{axis}}}"
