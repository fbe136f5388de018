"""The bearing's equations of motion from energies, dissipation and virtual work.

In: one bearing of the scene, its cage's angle and the load on its inner ring as expressions.  Out: a `BearingModel`.

One generic ball at the angle theta_j stands for all: delta_j is geometry (Eq. 6) less what the ball's effects take from
it, its rate is the time derivative (Eq. 11), and the force F_j of the ball does the virtual work -F_j d(delta_j) on the
rings.  Lagrange's equations with the rings' kinetic energy and the housing's potential energy and dissipation give
Eq. (2); the sums over the balls in them are Eqs. (8) and (9).
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.bearing.cage import Cage
from ballpass.derive.bearing.contact_direction import ball_turns, contact_direction
from ballpass.derive.bearing.effects import EFFECTS, GenericBall
from ballpass.derive.bearing.elements import ELEMENTS
from ballpass.derive.bearing.laws import LAWS
from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.own_terms import AngleAxes, OwnTerms, own_terms
from ballpass.derive.bearing.switching import LawSmoothness, Switching, find_switching, smoothness_of
from ballpass.derive.mechanism.linear_forms import EquationsOfMotion
from ballpass.derive.mechanism.vectors import Pair
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.terms import TIME, Definition, Names, names_of, refuse_kinks, symbol_of
from ballpass.derive.variables import Coordinate


@dataclass(frozen=True, slots=True, kw_only=True)
class BallRelations:
    """The generic ball j at the angle ``cage.angle + 2 pi (j - 1) / count``.

    Attributes
    ----------
    cage : how the balls turn
    cos, sin : of the angle of ball j
    cosine : factor of all sums of forces: of the contact angle; 1 where the scene names none
    deflection, deflection_rate, elastic_force, damping_force, force : symbols; no damping force is None
    own : what effects take from the deflection, None without effects
    definitions : they use `cos` and `sin`
    sums : symbol := sum over j of the force times a weight; `weights` says which
    weights : slopes of the deflection along x and y, without `cosine`; where bodies move with the rings, also that of
        what effects take from it, by the angle of the inner ring: its sum is a torque
    switching : where the force of a ball has kinks
    """

    count: int
    cage: Cage
    cos: sp.Symbol
    sin: sp.Symbol
    cosine: sp.Expr
    deflection: sp.Symbol
    deflection_rate: sp.Symbol
    elastic_force: sp.Symbol
    damping_force: sp.Symbol | None
    force: sp.Symbol
    own: OwnTerms | None
    definitions: tuple[Definition, ...]
    sums: tuple[Definition, ...]
    weights: tuple[sp.Expr, ...]
    switching: Switching

    @property
    def ring_force(self) -> Pair:
        """Force of the inner ring on the balls, x and y, by virtual work: the radial part of their forces [N]."""
        sum_x, sum_y = (s.symbol for s in self.sums[:2])
        return self.cosine * sum_x, self.cosine * sum_y


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingModel:
    """Contact between the rings of one bearing, over coordinates of the rings.

    `apart` is from the centre of the outer ring to that of the inner one [m], `parting` its rate.
    """

    names: Names
    noun: str  # of an element
    constants: tuple[Definition, ...]
    coordinates: tuple[Coordinate, ...]
    apart: Pair
    parting: Pair
    ball: BallRelations
    laws: tuple[tuple[str, LawSmoothness], ...]  # elastic, and damping where there is some


def derive_bearing(bearing: Bearing, cage: Cage) -> BearingModel:
    """Contact of the balls; `cage` says how they turn."""
    names = names_of(bearing)
    stiffness = names.constant("k_b")
    direction = contact_direction(bearing)
    constants = [*direction.constants, *ELEMENTS[bearing.element].stiffness(bearing, names), *cage.constants]
    law = LAWS[bearing.damping.law]
    numbers = {q.path.rpartition(".")[2]: symbol_of(q) for q in bearing.damping.numbers}
    coefficient = law.coefficient(numbers, stiffness)
    if coefficient != 0:
        constants.append(names.define(names.constant("c_b"), coefficient, law.unit, law.words, law.latex))
    coordinates = ring_coordinates(bearing)
    off = (sp.S.Zero, sp.S.Zero) if bearing.offset is None else tuple(map(symbol_of, bearing.offset))
    # a fixed outer ring has no coordinates
    sides = [[*zip(coordinates[axis::2], (1, -1), strict=False)] for axis in (0, 1)]
    apart = tuple(sum((s * c.position for c, s in side), start=-e) for side, e in zip(sides, off, strict=True))
    parting = tuple(sum((s * c.velocity for c, s in side), start=sp.S.Zero) for side in sides)
    ball, parts = _ball(bearing, names, coordinates, cage, (apart[0], apart[1]))
    return BearingModel(
        names=names,
        noun=ELEMENTS[bearing.element].noun,
        constants=tuple(constants),
        coordinates=coordinates,
        apart=(apart[0], apart[1]),
        parting=(parting[0], parting[1]),
        ball=ball,
        laws=tuple(
            (name, smoothness_of(part, ball.deflection, ball.deflection_rate))
            for name, part in zip(("elastic", "damping"), parts, strict=False)
        ),
    )


def ring_coordinates(bearing: Bearing) -> tuple[Coordinate, ...]:
    """Centres of the rings: of the frame's axes, from where they are unloaded.

    The inner ring of a bearing beside another one has the coordinates of that; on a shaft that tilts that of a third
    bearing follows from those of the first two.
    """
    own = names_of(bearing)
    first = Names(prefix=f"{bearing.beside}.", path=f"bearings.{bearing.beside}") if bearing.beside else own
    rings = [("inner", "inner ring", "i", first)] + ([("outer", "outer ring", "o", own)] if bearing.outer else [])
    of = f" of {bearing.name}" if bearing.name else ""
    partners = {"inner": f"{own.prefix}outer", "outer": f"{first.prefix}inner"}
    return tuple(
        Coordinate(
            name=f"{names.prefix}{ring}.{axis}",
            kind="displacement",
            unit="m",
            position=names.variable(f"{ring}.{axis}"),
            velocity=names.variable(f"{ring}.v{axis}"),
            latex=names.latex(f"{axis}_{letter}"),
            description=f"of the centre of the {words}{of} along {axis}",
            group=first.path,
            partner=f"{partners[ring]}.{axis}" if bearing.outer and not bearing.has_axis else "",
        )
        for ring, words, letter, names in rings
        for axis in "xy"
    )


def own_coordinates(bearing: Bearing) -> tuple[Coordinate, ...]:
    """Those of its rings that do not follow from bearings before it."""
    return ring_coordinates(bearing)[2 if bearing.beside or bearing.has_axis else 0 :]


def _ball(
    bearing: Bearing, names: Names, coordinates: tuple[Coordinate, ...], cage: Cage, apart: Pair
) -> tuple[BallRelations, list[sp.Expr]]:
    """The generic ball, and the parts of its force."""
    cos, sin, speed = names.variable("ball.cos"), names.variable("ball.sin"), cage.rate
    motion = {c.position: sp.Function(c.name)(TIME) for c in coordinates}
    angle = sp.Function("theta")(TIME)
    contact_at = contact_direction(bearing)
    geometry = contact_at.deflection(apart[0] * sp.cos(angle) + apart[1] * sp.sin(angle))  # Eq. (6)
    approach = sp.Dummy("approach", real=True)
    steepness = sp.diff(contact_at.deflection(approach), approach)
    alike = approach not in steepness.free_symbols  # for all balls
    # Eq. (11): the time derivative, the cage turning
    rate = sp.diff(geometry.subs(motion), TIME)
    rate = rate.subs(sp.diff(angle, TIME), speed)
    rate = rate.subs({sp.diff(motion[c.position], TIME): c.velocity for c in coordinates})
    rate = rate.subs({moving: fixed for fixed, moving in motion.items()})
    direction = {sp.cos(angle): cos, sp.sin(angle): sin}
    geometry, rate = geometry.subs(direction), rate.subs(direction)
    cosine = steepness if alike else sp.S.One
    weights = [sp.diff(geometry, c.position) / cosine for c in coordinates[:2]]
    own = _own_terms(bearing, names, cage, cos, sin)
    if own is not None:
        geometry, rate = geometry - own.deflection, rate - own.rate

    def optional(quantity: object) -> sp.Expr | None:
        return None if quantity is None else symbol_of(quantity)  # type: ignore[arg-type]

    factor, exponent = ELEMENTS[bearing.element].power_law(bearing, names)
    contact = Contact(stiffness=factor, exponent=exponent, width=optional(bearing.contact.smoothing))
    rest = SmoothedRest(width=optional(bearing.damping.smoothing))
    delta, delta_rate = names.variable("ball.deflection"), names.variable("ball.deflection_rate")
    elastic, damping, force = (names.variable(f"ball.{n}") for n in ("elastic_force", "damping_force", "force"))
    parts = [contact.force(delta)]
    damped = sp.sympify(LAWS[bearing.damping.law].force(delta, delta_rate, names.constant("c_b"), contact, rest))
    refuse_kinks(
        f'The damping law "{bearing.damping.law}"',
        damped,
        "sympy.Piecewise((a, condition), (b, True)), with conditions on the deflection or the rate; "
        "rest.positive(rate) for the positive part. Write one.",
        located=(delta, delta_rate),
    )
    if contact.width is None and rest.width is None:
        damped = sp.piecewise_fold(damped)  # constants meet in one product
    definitions = [
        *(own.definitions if own is not None else ()),
        names.define(delta, geometry, "m", "Deflection of ball j, Eq. (6)", r"\delta_j"),
        names.define(elastic, parts[0], "N", "Elastic force of ball j, Eq. (4)", "F_{rj}"),
    ]
    total: sp.Expr = elastic
    if damped != 0:
        parts.append(damped)
        words = f"Damping force of ball j, law {bearing.damping.law}"
        definitions += [
            names.define(delta_rate, rate, "m/s", "Rate of deflection of ball j, Eq. (11)", r"\dot\delta_j"),
            names.define(damping, damped, "N", words, "F_{cj}"),
        ]
        total = elastic + damping
    definitions.append(names.define(force, total, "N", "Force of ball j", "F_j"))
    sums = tuple(
        names.define(
            names.variable(f"ball.sum_{axis}"),
            force * weight,
            "N",
            f"Sum of the ball forces along {axis}, Eqs. (8) and (9)",
            rf"(F_{axis} + F_{{c,{axis}}})",
        )
        for axis, weight in zip("xy", weights, strict=True)
    )
    sloped = own is not None and any(d.symbol == own.slope and d.expression != 0 for d in own.definitions)
    if own is not None and sloped and bearing.coupling == "two-way":
        words = "Torque of the ball forces on the inner ring by the slopes of the reductions of their deflections"
        torque = names.variable("ball.sum_torque")
        weights.append(own.slope)
        sums += (names.define(torque, force * own.slope, "N*m", words, r"\textstyle\sum_j F_j e'_j"),)
    ball = BallRelations(
        count=bearing.balls,
        cage=cage,
        cos=cos,
        sin=sin,
        cosine=cosine,
        deflection=delta,
        deflection_rate=delta_rate,
        elastic_force=elastic,
        damping_force=damping if damped != 0 else None,
        force=force,
        own=own,
        definitions=tuple(definitions),
        sums=sums,
        weights=tuple(weights),
        # opposite balls are equal, and have opposite rates, where no effect and no curved path distinguishes them
        switching=find_switching(parts, delta, delta_rate, pairs=bearing.balls % 2 == 0 and own is None and alike),
    )
    return ball, parts


def _own_terms(bearing: Bearing, names: Names, cage: Cage, cos: sp.Symbol, sin: sp.Symbol) -> OwnTerms | None:
    """What effects take from the deflection of the generic ball; None where they take nothing."""
    if not bearing.effects:
        return None
    on_outer, on_inner, from_first, spin = (
        sp.Function(n)(TIME) for n in ("theta", "theta_inner", "theta_first", "spin")
    )

    def rate(angle: sp.Expr, share: sp.Expr) -> sp.Expr:
        """By time where the rings turn evenly, else by the angle of the inner ring relative to the outer one."""
        if cage.ring_rate is not None:
            return share
        return cage.rate - sp.diff(cage.angle - angle, TIME)

    seen = (
        (on_outer, cage.in_outer, cage.share, "outer", " as the outer ring sees it"),
        (on_inner, cage.in_inner, cage.share - 1, "inner", " as the inner ring sees it"),
        (from_first, sp.S.Zero, sp.S.Zero, "first", " from ball 1"),
    )
    axes = [
        AngleAxes(angle=angle, rate=rate(at, share), turned=cage.angle - at, name=name, words=words)
        for angle, at, share, name, words in seen
    ]
    further = {}
    if cage.spin is not None:
        further[spin] = (
            cage.spin,
            sp.diff(cage.spin, TIME) if cage.ring_rate is None else ball_turns(bearing) * cage.share,
        )
    ball = GenericBall(balls=bearing.balls, on_outer=on_outer, on_inner=on_inner, from_first=from_first, spin=spin)
    gates = (*(i.symbol for i in cage.inputs), *(d.symbol for d in cage.definitions))
    taken: sp.Expr = sp.S.Zero
    for effect in bearing.effects:
        term = sp.sympify(EFFECTS[effect.kind].term(effect, bearing, names, ball))
        refuse_kinks(
            f'The effect "{effect.kind}"',
            term,
            "sympy.Piecewise with a gate of `edges` in each condition, as of a spall; ball.only. Write one.",
            located=(from_first, *gates),
        )
        taken += term
    return own_terms(taken, axes, further, (cos, sin), names, cage.ring_rate) if taken != 0 else None


def ring_motion(bearing: Bearing, model: BearingModel, load: Pair, inner_mass: sp.Expr) -> EquationsOfMotion:
    """Lagrange's equations of the second kind for rings under a load, mass matrix and forcing apart, Eq. (2).

    Parameters
    ----------
    load : force on the inner ring, x and y [N]
    inner_mass : mass moved by the inner ring [kg], an expression of parameters
    """
    coordinates, ball, moved = model.coordinates, model.ball, model.names.constant("m_ei")
    assert bearing.inner is not None  # one-way coupling
    q = [c.position for c in coordinates]
    v = [c.velocity for c in coordinates]
    half = sp.Rational(1, 2)
    kinetic = half * moved * (v[0] ** 2 + v[1] ** 2)
    potential: sp.Expr = sp.S.Zero
    dissipation: sp.Expr = sp.S.Zero  # Rayleigh's function
    if bearing.inner.damping is not None:
        dissipation += half * symbol_of(bearing.inner.damping) * (v[0] ** 2 + v[1] ** 2)
    if bearing.outer is not None:
        outer = bearing.outer
        kinetic += half * symbol_of(outer.mass) * (v[2] ** 2 + v[3] ** 2)
        potential += half * symbol_of(outer.stiffness) * (q[2] ** 2 + q[3] ** 2)
        dissipation += half * symbol_of(outer.damping) * (v[2] ** 2 + v[3] ** 2)
    mass = sp.ImmutableMatrix(sp.hessian(kinetic, v))
    forcing = []
    for k in range(len(coordinates)):
        # virtual work of the balls: -sum_j F_j d(delta_j)/d(q_k), which the outer ring has with the other sign
        contact = (-1 if k < 2 else 1) * ball.ring_force[k % 2]
        applied = load[k] if k < 2 else sp.S.Zero
        forcing.append(applied + contact - sp.diff(potential, q[k]) - sp.diff(dissipation, v[k]))
    words = "Mass moved by the inner ring, Eq. (3) or given"
    constants = (model.names.define(moved, inner_mass, "kg", words, "m_{ei}"),)
    return EquationsOfMotion(mass=mass, forcing=sp.ImmutableMatrix(forcing), definitions=constants)
