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
    balls: int, ball_diameter: float, pitch_diameter: float, speed: float
) -> KinematicFrequencies:
    """Frequencies of a deep groove ball bearing: rolling without slip, contact angle zero, outer ring at rest.

    Parameters
    ----------
    balls : number of balls [1]
    ball_diameter, pitch_diameter : [m]
    speed : angular speed of the inner ring, either sense [rad/s]

    Raises
    ------
    RequestError
        The ball count or a diameter is not that of a bearing.

    References
    ----------
    Harris & Kotzalas, Essential Concepts of Bearing Technology, 5th ed., 2006, ch. 10 with alpha = 0.
    """
    if balls < 1 or not 0.0 < ball_diameter < pitch_diameter or not np.isfinite(speed):
        raise RequestError(
            f"balls {balls!r}, ball_diameter {ball_diameter!r} m, pitch_diameter {pitch_diameter!r} m, "
            f"speed {speed!r} rad/s; "
            "allowed: balls >= 1, 0 < ball_diameter < pitch_diameter, finite speed"
        )
    shaft = abs(speed) / (2.0 * np.pi)
    ratio = ball_diameter / pitch_diameter
    cage = shaft * (1.0 - ratio) / 2.0
    return KinematicFrequencies(
        shaft=shaft,
        cage=cage,
        ball_pass_outer=balls * cage,
        ball_pass_inner=balls * (shaft - cage),
        ball_spin=shaft * (1.0 - ratio**2) / (2.0 * ratio),
    )
