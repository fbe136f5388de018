"""The bearing's equations of motion from energies, dissipation and virtual work.

In: the scene's bearing, the cage's angle and the load on the inner ring as expressions.  Out: a `BearingModel`.

One generic ball at the angle theta_j stands for all: delta_j is geometry (Eq. 6), its rate is its time derivative
(Eq. 11), and the
force F_j of the ball does the virtual work -F_j * d(delta_j) on the rings.  Lagrange's equations with the rings'
kinetic energy and the
housing's potential energy and dissipation give Eq. (2); the sums over the balls in them are Eqs. (8) and (9).
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.bearing import hertz, laws
from ballpass.derive.scene.records import Bearing, Body, EquivalentMass, GivenContact, HertzContact, Vector
from ballpass.derive.terms import TIME, Definition, Smoothness, components, symbol_of


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


#: Direction of the generic ball j from the bearing's centre.
COS, SIN = _real("ball.cos"), _real("ball.sin")


@dataclass(frozen=True, slots=True, kw_only=True)
class Coordinate:
    """A generalized coordinate [m] and its velocity [m/s]."""

    name: str
    position: sp.Symbol
    velocity: sp.Symbol
    latex: str
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Ball:
    """The generic ball j at the angle ``cage_angle + 2 pi (j - 1) / count``.

    `definitions` use `cos` and `sin` of that angle; each of `sums` is (symbol, summand, description, latex): symbol
    := sum of summand over j.
    """

    count: int
    cage_angle: sp.Expr
    cos: sp.Symbol
    sin: sp.Symbol
    deflection: sp.Symbol
    deflection_rate: sp.Symbol
    elastic_force: sp.Symbol
    damping_force: sp.Symbol | None
    force: sp.Symbol
    definitions: tuple[Definition, ...]
    sums: tuple[Definition, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingModel:
    """Equations of motion ``mass * acceleration = forcing`` and what they need."""

    constants: tuple[Definition, ...]
    coordinates: tuple[Coordinate, ...]
    ball: Ball
    mass: sp.ImmutableMatrix
    forcing: sp.ImmutableMatrix
    smoothness: tuple[tuple[str, Smoothness], ...]


CAGE_RATIO = _real("bearing.cage_ratio")
CAGE_SPEED = _real("bearing.cage_speed")
STIFFNESS = _real("bearing.k_b")
DAMPING_COEFFICIENT = _real("bearing.c_b")
INNER_MASS = _real("bearing.m_ei")


def _constant(symbol: sp.Symbol, expression: sp.Expr, unit: str, description: str, latex: str) -> Definition:
    return Definition(symbol=symbol, expression=expression, unit=unit, description=description, latex=latex)


def _stiffness_constants(bearing: Bearing) -> list[Definition]:
    """k_b, and for contact from geometry the way to it: Eq. (5) and Hertz's theory."""
    contact = bearing.contact
    total = "Stiffness factor of a ball between both raceways, Eq. (5)"
    if isinstance(contact, GivenContact):
        return [_constant(STIFFNESS, symbol_of(contact.stiffness), "N/m^1.5", total, "k_b")]
    ball_diameter, pitch_diameter = symbol_of(bearing.ball_diameter), symbol_of(bearing.pitch_diameter)
    out: list[Definition] = []
    factors = []
    for ring, sign, groove in (("inner", 1, contact.inner_groove_radius), ("outer", -1, contact.outer_groove_radius)):
        letter = ring[0]
        raceway = _real(f"bearing.{ring}_raceway_radius")
        ratio, curvature = _real(f"bearing.{ring}_curvature_ratio"), _real(f"bearing.{ring}_curvature_sum")
        kappa, factor = _real(f"bearing.{ring}_ellipticity"), _real(f"bearing.k_{letter}")
        ratio_of, sum_of = hertz.curvature_ratio(ball_diameter, sign * raceway, symbol_of(groove))
        out += [
            _constant(
                raceway,
                (pitch_diameter - sign * ball_diameter) / 2,
                "m",
                f"Radius of the {ring} raceway from the bearing axis, Eq. (7)",
                "r_b" if ring == "inner" else "R_b",
            ),
            _constant(
                ratio, ratio_of, "1", f"Ratio of the principal curvature sums at the {ring} contact", rf"(A/B)_{letter}"
            ),
            _constant(curvature, sum_of, "1/m", f"Curvature sum at the {ring} contact", rf"\Sigma\rho_{letter}"),
            _constant(
                kappa, hertz.ellipticity(ratio), "1", f"Ellipticity a/b of the {ring} contact", rf"\kappa_{letter}"
            ),
            _constant(
                factor,
                hertz.contact_stiffness(kappa=kappa, curvature_sum=curvature, compliance=_compliance(contact)),
                "N/m^1.5",
                f"Stiffness factor of the {ring} contact",
                f"k_{letter}",
            ),
        ]
        factors.append(factor)
    out.append(_constant(STIFFNESS, hertz.series_stiffness(*factors), "N/m^1.5", total, "k_b"))
    return out


def _compliance(contact: HertzContact) -> sp.Expr:
    ring, ball = contact.ring, contact.ball or contact.ring
    return sum(
        ((1 - symbol_of(m.poisson_ratio) ** 2) / symbol_of(m.young_modulus) for m in (ring, ball)), start=sp.S.Zero
    )


def equivalent_mass(given: EquivalentMass, crank: Body, joint_point: Vector, far_point: Vector) -> sp.Expr:
    """Eq. (3) [kg]: ring, half the crankpin, and the crank's mass by the lever rule.

    l_1 - l_o1 is measured along the crank from its centre of mass to the far joint: for theta_1p = 0, where the
    rule holds, this is the printed one.
    """
    near, far, center = components(joint_point), components(far_point), components(crank.center_of_mass)
    arm = (far[0] - near[0], far[1] - near[1])
    rest = (far[0] - center[0], far[1] - center[1])
    lever = sp.cancel((rest[0] * arm[0] + rest[1] * arm[1]) / (arm[0] ** 2 + arm[1] ** 2))
    share = sp.Rational(1, 2) if given.crank == "half" else sp.S.One
    return symbol_of(given.ring) + share * symbol_of(crank.mass) * lever + symbol_of(given.crankpin) / 2


def derive_bearing(
    bearing: Bearing,
    *,
    shaft_speed: sp.Expr,
    cage_phase: sp.Expr,
    load: tuple[sp.Expr, sp.Expr],
    inner_mass: sp.Expr,
) -> BearingModel:
    """Equations of motion of the rings.

    Parameters
    ----------
    shaft_speed : speed of the inner ring [rad/s]
    cage_phase : angle of ball 1 at the reference time [rad]
    load : force on the inner ring, x and y [N]
    inner_mass : mass moved by the inner ring [kg], an expression of parameters
    """
    ball_diameter, pitch_diameter = symbol_of(bearing.ball_diameter), symbol_of(bearing.pitch_diameter)
    constants = [
        *_stiffness_constants(bearing),
        _constant(
            CAGE_RATIO,
            (1 - ball_diameter / pitch_diameter) / 2,
            "1",
            "Speed of the cage over speed of the inner ring, r_b/(R_b + r_b), Eq. (7)",
            r"\omega_c/\omega",
        ),
        _constant(CAGE_SPEED, CAGE_RATIO * shaft_speed, "rad/s", "Speed of the cage", r"\omega_c"),
        _constant(INNER_MASS, inner_mass, "kg", "Mass moved by the inner ring, Eq. (3) or given", "m_{ei}"),
    ]
    damping = bearing.damping
    if damping.law != "none":
        if damping.coefficient is not None:
            coefficient = symbol_of(damping.coefficient)
        else:
            assert damping.ratio is not None  # the reader requires one of the two
            ratio = symbol_of(damping.ratio)
            coefficient = ratio if damping.law == "tangent" else ratio * STIFFNESS
        constants.append(
            _constant(DAMPING_COEFFICIENT, coefficient, "s", "Damping time constant of the contact", r"\beta")
            if damping.law == "tangent"
            else _constant(DAMPING_COEFFICIENT, coefficient, "N*s/m", "Damping coefficient of a ball, Eq. (10)", "c_b")
        )

    rings = [("inner", "inner ring", "i")] + ([("outer", "outer ring", "o")] if bearing.outer else [])
    coordinates = tuple(
        Coordinate(
            name=f"{ring}.{axis}",
            position=_real(f"{ring}.{axis}"),
            velocity=_real(f"{ring}.v{axis}"),
            latex=f"{axis}_{letter}",
            description=f"of the centre of the {words} along {axis}",
        )
        for ring, words, letter in rings
        for axis in "xy"
    )
    ball, gradient = _ball(bearing, coordinates, cage_phase)
    mass, forcing = _lagrange(bearing, coordinates, gradient, ball, load)
    smoothed = bearing.contact.smoothing is not None
    smoothness = [("elastic", Smoothness.TWICE_SMOOTH if smoothed else laws.ELASTIC_SMOOTHNESS)]
    if damping.law != "none":
        smoothness.append(("damping", _damping(bearing, ball.deflection, ball.deflection_rate).smoothness))
    return BearingModel(
        constants=tuple(constants),
        coordinates=coordinates,
        ball=ball,
        mass=mass,
        forcing=forcing,
        smoothness=tuple(smoothness),
    )


def _damping(bearing: Bearing, delta: sp.Expr, rate: sp.Expr) -> laws.SmoothedDamping:
    """The scene's damping law over deflection and rate."""
    contact, damping = bearing.contact, bearing.damping
    return laws.smoothed_damping(
        damping.law,
        delta,
        rate,
        STIFFNESS,
        DAMPING_COEFFICIENT,
        width=symbol_of(contact.smoothing) if contact.smoothing is not None else None,
        rate_width=symbol_of(damping.smoothing) if damping.smoothing is not None else None,
    )


def _ball(bearing: Bearing, coordinates: tuple[Coordinate, ...], cage_phase: sp.Expr) -> tuple[Ball, list[sp.Expr]]:
    """The generic ball, and d(delta_j)/d(coordinate) for each coordinate."""
    motion = {c.position: sp.Function(c.name)(TIME) for c in coordinates}
    angle = sp.Function("theta")(TIME)
    # Eq. (6); a fixed outer ring has no coordinates
    x, y = (
        sum((s * c.position for c, s in zip(coordinates[axis::2], (1, -1), strict=False)), start=sp.S.Zero)
        for axis in (0, 1)
    )
    geometry = x * sp.cos(angle) + y * sp.sin(angle) - symbol_of(bearing.clearance) / 2
    # Eq. (11): the time derivative, the cage turning
    rate = sp.diff(geometry.subs(motion), TIME)
    rate = rate.subs(sp.diff(angle, TIME), CAGE_SPEED)
    rate = rate.subs({sp.diff(motion[c.position], TIME): c.velocity for c in coordinates})
    rate = rate.subs({moving: fixed for fixed, moving in motion.items()})
    direction = {sp.cos(angle): COS, sp.sin(angle): SIN}
    geometry, rate = geometry.subs(direction), rate.subs(direction)
    gradient = [sp.diff(geometry, c.position) for c in coordinates]

    width = symbol_of(bearing.contact.smoothing) if bearing.contact.smoothing is not None else None
    delta, delta_rate = _real("ball.deflection"), _real("ball.deflection_rate")
    elastic, damping, force = _real("ball.elastic_force"), _real("ball.damping_force"), _real("ball.force")
    definitions = [
        Definition(
            symbol=delta, expression=geometry, unit="m", description="Deflection of ball j, Eq. (6)", latex=r"\delta_j"
        ),
        Definition(
            symbol=elastic,
            expression=laws.elastic_force(delta, STIFFNESS)
            if width is None
            else laws.smoothed_elastic_force(delta, STIFFNESS, width),
            unit="N",
            description="Elastic force of ball j, Eq. (4)",
            latex="F_{rj}",
        ),
    ]
    total: sp.Expr = elastic
    law = bearing.damping.law
    if law != "none":
        definitions += [
            Definition(
                symbol=delta_rate,
                expression=rate,
                unit="m/s",
                description="Rate of deflection of ball j, Eq. (11)",
                latex=r"\dot\delta_j",
            ),
            Definition(
                symbol=damping,
                expression=_damping(bearing, delta, delta_rate).force,
                unit="N",
                description=f"Damping force of ball j, law {law}",
                latex="F_{cj}",
            ),
        ]
        total = elastic + damping
    definitions.append(Definition(symbol=force, expression=total, unit="N", description="Force of ball j", latex="F_j"))
    sums = tuple(
        Definition(
            symbol=_real(f"ball.sum_{axis}"),
            expression=force * direction_symbol,
            unit="N",
            description=f"Sum of the ball forces along {axis}, Eqs. (8) and (9)",
            latex=rf"(F_{axis} + F_{{c,{axis}}})",
        )
        for axis, direction_symbol in (("x", COS), ("y", SIN))
    )
    ball = Ball(
        count=bearing.balls,
        cage_angle=cage_phase + CAGE_SPEED * TIME,
        cos=COS,
        sin=SIN,
        deflection=delta,
        deflection_rate=delta_rate,
        elastic_force=elastic,
        damping_force=damping if law != "none" else None,
        force=force,
        definitions=tuple(definitions),
        sums=sums,
    )
    return ball, gradient


def _lagrange(
    bearing: Bearing,
    coordinates: tuple[Coordinate, ...],
    gradient: list[sp.Expr],
    ball: Ball,
    load: tuple[sp.Expr, sp.Expr],
) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix]:
    """Lagrange's equations of the second kind, mass matrix and forcing apart, Eq. (2)."""
    q = [c.position for c in coordinates]
    v = [c.velocity for c in coordinates]
    half = sp.Rational(1, 2)
    kinetic = half * INNER_MASS * (v[0] ** 2 + v[1] ** 2)
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
    sum_x, sum_y = (s.symbol for s in ball.sums)
    forcing = []
    for k, slope in enumerate(gradient):
        # virtual work of the balls: -sum_j F_j d(delta_j)/d(q_k), linear in cos and sin of theta_j
        contact = -(slope.coeff(ball.cos) * sum_x + slope.coeff(ball.sin) * sum_y)
        applied = load[k] if k < 2 else sp.S.Zero
        forcing.append(applied + contact - sp.diff(potential, q[k]) - sp.diff(dissipation, v[k]))
    return mass, sp.ImmutableMatrix(forcing)
