"""Ranges in which the numbers of a scene usually lie: beyond them a number is allowed, and probably a slip.

In: a `Scene`.  Out: ranges for its manifest, by which the runtime warns, wherever a number comes from.  What no value
may have is in `values.py`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby

from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.mechanism.forces.friction import Friction
from ballpass.derive.mechanism.forces.windows import Windows
from ballpass.derive.scene.bearing_records import Bearing, HertzContact
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.records import Mechanism, Scene
from ballpass.runtime.contract.manifest import UsualInfo

#: Groove radius over ball diameter: ISO 16281 takes 0.52 and 0.53; the bounds are those of made bearings, wide.
GROOVE = (0.505, 0.56)
#: Clearance or preload over ball diameter.
CLEARANCE = (-0.01, 0.01)
#: Slip of a cage: beyond, balls skid, and the model of a cage that turns evenly is none.
SLIP, SLIPS = (0.0, 0.3), (-0.3, 0.3)
#: Young's modulus from magnesium to silicon carbide [Pa].
MODULUS = (50e9, 400e9)
#: Half width of the smoothed contact onset over clearance.
SMOOTHING = (None, 1.0)
#: Sum of the shares of several bearings at one joint.
SHARES = (1.0 - 1e-9, 1.0 + 1e-9)
#: An angle of the driver [rad].  Both edges of a window between zero and 2 pi degrees are probably meant in radians.
ANGLE = (-4.0 * math.pi, 4.0 * math.pi)
RADIANS = math.radians(2.0 * math.pi)
#: Speed within which Coulomb friction turns round, over the speed of a constant drive: above it is mostly viscous.
TURNS_ROUND = (None, 0.1)


def usual_ranges(scene: Scene) -> tuple[UsualInfo, ...]:
    """The ranges that apply to the numbers of a scene."""
    found: list[UsualInfo] = []
    if scene.mechanism is not None:
        found += _of_windows(scene.mechanism)
        found += _of_friction(scene.mechanism)
    for bearing in scene.bearings:
        found += _of_bearing(bearing)
    at_joint = sorted((b for b in scene.bearings if b.joint is not None), key=lambda bearing: bearing.joint or "")
    for joint, group in groupby(at_joint, key=lambda bearing: bearing.joint):
        shares = [bearing.share.path for bearing in group if bearing.share is not None]
        if len(shares) > 1:
            hint = f"The bearings at joint {joint} carry its whole reaction together."
            found.append(UsualInfo(names=tuple(shares), least=SHARES[0], most=SHARES[1], hint=hint))
    return tuple(found)


def _range(
    quantity: Quantity, bounds: tuple[float | None, float | None], hint: str, of: Quantity | None = None
) -> UsualInfo:
    return UsualInfo(
        names=(quantity.path,), least=bounds[0], most=bounds[1], of="" if of is None else of.path, hint=hint
    )


def _of_windows(mechanism: Mechanism) -> Iterator[UsualInfo]:
    for force in mechanism.forces:
        if not isinstance(force.law, Windows):
            continue
        for window in force.law.windows:
            edges = (window.start, window.end)
            for edge in edges:
                yield _range(edge, ANGLE, "Check whether degrees were given as radians.")
            names = (window.start.path, window.end.path)
            hint = "Check whether radians were given as degrees."
            yield UsualInfo(names=names, least=RADIANS, each=True, hint=hint)


def _of_friction(mechanism: Mechanism) -> Iterator[UsualInfo]:
    for force in mechanism.forces:
        law, driver = force.law, mechanism.driver
        smoothing = law.smoothing if isinstance(law, Friction) and driver.torque is None else None
        if smoothing is not None and smoothing.unit == driver.speed.unit:
            hint = "Coulomb friction is whole only at rates well above it: give a smaller one."
            yield _range(smoothing, TURNS_ROUND, hint, driver.speed)


def _of_bearing(bearing: Bearing) -> Iterator[UsualInfo]:
    ball, contact = bearing.ball_diameter, bearing.contact
    yield _range(bearing.clearance, CLEARANCE, "Clearances are some micrometres: check the unit.", ball)
    if isinstance(contact, HertzContact):
        for radius in (contact.inner_groove_radius, contact.outer_groove_radius):
            yield _range(radius, GROOVE, "Check that the ball's diameter was given, not its radius.", ball)
        for material in (contact.ring, contact.ball):
            if material is not None:
                yield _range(material.young_modulus, MODULUS, "Steel has 207 GPa: check the unit.")
    if contact.smoothing is not None:
        hint = "The contact then acts where ball and raceway are apart: give a smaller width."
        yield _range(contact.smoothing, SMOOTHING, hint, bearing.clearance)
    if bearing.cage is not None and bearing.cage.slip is not None:
        yield _range(bearing.cage.slip, SLIP, "A cage lags by some hundredths: check whether percents were given.")
    if bearing.cage is not None:
        for slip in bearing.cage.slips:
            yield _range(slip, SLIPS, "A cage lags by some hundredths: check whether percents were given.")
    for effect in bearing.effects:
        for number, bounds, hint in EFFECTS[effect.kind].usual(effect):
            yield _range(number, bounds, hint, ball)
