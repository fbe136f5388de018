"""Frequencies of a ball bearing from its kinematics alone: rolling without slip, outer ring at rest.

Source: Harris & Kotzalas, Essential Concepts of Bearing Technology, 5th ed., 2006, ch. 10.
"""

from __future__ import annotations

import math

from ballpass.runtime.quantity.characteristic import KinematicFrequencies


def kinematic_frequencies(
    balls: int, ball_diameter: float, pitch_diameter: float, speed: float, contact_angle: float = 0.0
) -> KinematicFrequencies:
    """Frequencies of a bearing.

    Parameters
    ----------
    balls : number of balls [1]
    ball_diameter, pitch_diameter : [m]
    speed : angular speed of the inner ring, either sense [rad/s]
    contact_angle : from 0 to below a right angle [rad]
    """
    shaft, cosine = abs(speed) / (2.0 * math.pi), math.cos(contact_angle)
    ratio = cosine * ball_diameter / pitch_diameter
    cage = shaft * (1.0 - ratio) / 2.0
    return KinematicFrequencies(
        shaft=shaft,
        cage=cage,
        ball_pass_outer=balls * cage,
        ball_pass_inner=balls * (shaft - cage),
        ball_spin=cosine * shaft * (1.0 - ratio**2) / (2.0 * ratio),
    )
