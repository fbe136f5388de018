"""What waviness, diameters and spalls take from a ball's deflection, written anew for tests: complex, for slopes by a
step along the imaginary axis.

In: a bearing's record, the number of a ball, its angles.  Out: the amount [m].
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

from ballpass.derive.bearing.effects.defects import Spall
from ballpass.derive.scene.bearing_records import Bearing

Value = Callable[[object], float]


def taken(bearing: Bearing, value: Value, ball: int, on_outer: complex, on_inner: complex, spin: complex) -> complex:
    """Reduction of the deflection of a ball, counted from 1.

    Parameters
    ----------
    value : number of a quantity of the scene
    on_outer, on_inner : angle of the ball in axes of each ring
    spin : angle of its own material that meets the outer raceway
    """
    total = 0.0 + 0.0j
    for effect in bearing.effects:
        for part in effect.parts:
            if effect.kind in ("outer_waviness", "inner_waviness"):
                angle = on_outer if effect.kind.startswith("outer") else on_inner
                total -= value(part.amplitude) * cmath.cos(part.order * angle + value(part.phase))
            elif effect.kind == "ball_waviness":
                if part.whose in ("each", str(ball)) and part.order % 2 == 0:
                    total -= 2 * value(part.amplitude) * cmath.cos(part.order * spin + value(part.phase))
            elif effect.kind == "ball_deviation":
                total -= value(part.size) if part.ball == ball else 0.0
            else:
                assert effect.kind == "defects"
                total += _spall(bearing, value, part, ball, on_outer, on_inner, spin)
    return total


def _spall(
    bearing: Bearing, value: Value, spall: Spall, ball: int, on_outer: complex, on_inner: complex, spin: complex
) -> complex:
    middle, small, pitch = value(spall.angle), value(bearing.ball_diameter) / 2, value(bearing.pitch_diameter) / 2
    aside = small * (1.0 if bearing.contact_angle is None else math.cos(value(bearing.contact_angle)))
    if spall.on == "ball":
        if spall.ball != ball:
            return 0.0j
        places = [("outer", spin - middle), ("inner", spin - middle - math.pi)]
    else:
        places = [(spall.on, (on_outer if spall.on == "outer" else on_inner) - middle)]
    total = 0.0j
    for ring, past in places:
        past = complex(math.remainder(past.real, 2 * math.pi), past.imag)
        large = pitch + aside if ring == "outer" else pitch - aside
        own, other = (small, large) if spall.on == "ball" else (large, small)
        half = math.asin(value(spall.chord) / 2 / own)
        if abs(past.real) < half:
            total += _depth(value, spall, ring, past, half, own, other)
    return total


def _depth(value: Value, spall: Spall, ring: str, past: complex, half: float, own: float, other: float) -> complex:
    """How deep a ball sinks: `own` is the radius of the circle with the spall, `other` that of the one in touch."""
    deepest = math.inf if spall.depth is None else value(spall.depth)
    if spall.profile == "rectangular":
        return complex(deepest)
    if spall.profile == "half-sine":
        return deepest * cmath.cos(math.pi * own * cmath.sin(past) / value(spall.chord))
    # both circles meet at the edge: the distance of their centres in the triangle of both radii
    beta = half - past if past.real > 0 else half + past
    along, aside = own * cmath.cos(beta), cmath.sqrt(other**2 - (own * cmath.sin(beta)) ** 2)
    if ring == "inner":  # the centres come nearer than both radii together
        sunk = own + other - (along + aside)
    else:  # and farther apart than their difference
        sunk = (aside - along if own < other else along - aside) - abs(own - other)
    return sunk if sunk.real < deepest else complex(deepest)
