"""Life of a bearing that swings, by hand, and where that ends: critical and dither amplitude.

In: amplitude, load, geometry.  Out: an `Oscillation`.  No standard covers it; source of the equivalent load:
Harris & Kotzalas, Advanced Concepts of Bearing Technology, 5th ed., 2006; the amplitudes follow from the ways of the
balls over the raceways.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ballpass.runtime.ratings.life import MILLION


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """Equivalent load and life of a bearing that swings, by hand.

    Attributes
    ----------
    amplitude : half the angle that its rings swing against each other [rad]
    load : of a bearing that turns as often as this one swings to and fro, with the same damage [N]
    life : L_10 in swings to and fro [1]
    critical : amplitude below which no place of one raceway meets two balls: life and load do not hold [rad]
    dither : amplitude below which a contact moves by less than its own length: fretting decides [rad]
    """

    amplitude: float
    load: float
    life: float
    critical: float
    dither: float

    @property
    def words(self) -> str:
        """What it says, in sentences."""
        swings = f"By hand (Harris): it swings by ±{math.degrees(self.amplitude):.3g} deg"
        if self.amplitude < self.dither:
            return (
                f"{swings}, less than the contact is long (±{math.degrees(self.dither):.3g} deg): fretting decides, "
                "and no formula gives a life."
            )
        found = f"{swings}; equivalent load {self.load:.4g} N, L_10 {self.life / MILLION:.4g} million swings."
        if self.amplitude >= self.critical:
            return found
        return (
            f"{found} Below ±{math.degrees(self.critical):.3g} deg rolling elements do not meet each other's ways: "
            "take this as an estimate, and watch for fretting."
        )


def oscillation(
    amplitude: float,
    load: float,
    *,
    dynamic_rating: float,
    exponent: float,
    balls: int,
    gamma: float,
    contacts: tuple[tuple[float, float], tuple[float, float]],
) -> Oscillation:
    """A swinging bearing: (2 A/π)^(1/p) P turns as 4 A of 2 π of a turn do.

    While the rings swing by 2 A, balls move by A (1 - γ) over the outer and by A (1 + γ) over the inner raceway.

    Parameters
    ----------
    amplitude : A, above zero [rad]
    load, dynamic_rating : P, C_r [N]
    exponent : p, 3 for balls
    balls, gamma : Z, D_w cos α/D_pw
    contacts : half length along the way of the ball and radius of the circle of contacts about the bearing's axis, of
        inner and outer ring [m]
    """
    equivalent = (2.0 * amplitude / math.pi) ** (1.0 / exponent) * load
    life = MILLION * (dynamic_rating / equivalent) ** exponent if load > 0.0 else math.inf
    shares = (1.0 + gamma, 1.0 - gamma)
    return Oscillation(
        amplitude=amplitude,
        load=equivalent,
        life=life,
        critical=max(2.0 * math.pi / (balls * share) for share in shares),
        dither=max(2.0 * half / (radius * share) for (half, radius), share in zip(contacts, shares, strict=True)),
    )
