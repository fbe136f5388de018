"""Frequencies of a ball bearing from its kinematics alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.errors import RequestError


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicFrequencies:
    """Frequencies of a ball bearing whose inner ring turns, from kinematics alone [Hz].

    Attributes
    ----------
    shaft : turns of the inner ring
    cage : turns of the cage (FTF)
    ball_pass_outer : balls over a point of the outer ring (BPFO)
    ball_pass_inner : balls over a point of the inner ring (BPFI)
    ball_spin : turns of a ball about itself, seen from the cage (BSF); a spot on it meets a ring at twice this
    """

    shaft: float
    cage: float
    ball_pass_outer: float
    ball_pass_inner: float
    ball_spin: float


def kinematic_frequencies(
    balls: int, ball_diameter: float, pitch_diameter: float, speed: float, contact_angle: float = 0.0
) -> KinematicFrequencies:
    """Frequencies of a deep groove ball bearing: rolling without slip, outer ring at rest.

    Parameters
    ----------
    balls : number of balls [1]
    ball_diameter, pitch_diameter : [m]
    speed : angular speed of the inner ring, either sense [rad/s]
    contact_angle : from 0 to below a right angle [rad]

    Raises
    ------
    RequestError
        The ball count, a diameter or the contact angle is not that of a bearing.

    References
    ----------
    Harris & Kotzalas, Essential Concepts of Bearing Technology, 5th ed., 2006, ch. 10.
    """
    angled = 0.0 <= contact_angle < np.pi / 2.0
    if balls < 1 or not 0.0 < ball_diameter < pitch_diameter or not np.isfinite(speed) or not angled:
        raise RequestError(
            f"balls {balls!r}, ball_diameter {ball_diameter!r} m, pitch_diameter {pitch_diameter!r} m, "
            f"speed {speed!r} rad/s, contact_angle {contact_angle!r} rad; "
            "allowed: balls >= 1, 0 < ball_diameter < pitch_diameter, finite speed, 0 <= contact_angle < pi/2"
        )
    shaft = abs(speed) / (2.0 * np.pi)
    cosine = float(np.cos(contact_angle))
    ratio = cosine * ball_diameter / pitch_diameter
    cage = shaft * (1.0 - ratio) / 2.0
    return KinematicFrequencies(
        shaft=shaft,
        cage=cage,
        ball_pass_outer=balls * cage,
        ball_pass_inner=balls * (shaft - cage),
        ball_spin=cosine * shaft * (1.0 - ratio**2) / (2.0 * ratio),
    )
