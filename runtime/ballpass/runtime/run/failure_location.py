"""Where a machine stood when a run ended early: crank angle and the ball that was pressed most, for messages."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.run import inputs as clock

if TYPE_CHECKING:
    from ballpass.runtime.contract import Manifest
    from ballpass.runtime.contract.parameters import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Whereabouts:
    """An instant of a run.

    Attributes
    ----------
    crank_angle : angle of driver or shaft, in [0, 2 pi) [rad]
    ball : the ball with the largest deflection, counted from 1; None without a bearing or a finite state
    ball_angle : its angle, in [0, 2 pi) [rad]
    deflection : its deflection, Eq. (6); negative where no ball touches [m]
    """

    crank_angle: float
    ball: int | None
    ball_angle: float
    deflection: float

    @property
    def words(self) -> str:
        """The ball in a sentence, or nothing."""
        if self.ball is None:
            return ""
        angle = math.degrees(self.ball_angle)
        return f"Most deflected there: ball {self.ball} at {angle:.2f} deg, by {1e6 * self.deflection:.4g} um."


def whereabouts(manifest: Manifest, numbers: Numbers, time: float, state: np.ndarray) -> Whereabouts:
    """Look at a state.

    Parameters
    ----------
    time : time of the state [s]
    state : positions and velocities, shape (states,)
    """
    values = numbers.values
    crank = clock.crank_angle(manifest, values, time)
    if manifest.bearing is None or not np.all(np.isfinite(state)) or not len(state):
        return Whereabouts(crank_angle=crank, ball=None, ball_angle=math.nan, deflection=math.nan)
    count = manifest.bearing.balls
    first = values["bearing.ball_angle"] + (values["bearing.cage_speed"] * time) % clock.TURN
    angles = (first + clock.TURN * np.arange(count) / count) % clock.TURN
    x, y = state[:2] - state[2:4] if manifest.bearing.outer_ring else state[:2]
    deflections = x * np.cos(angles) + y * np.sin(angles) - 0.5 * values["bearing.clearance"]  # Eq. (6)
    ball = int(np.argmax(deflections))
    return Whereabouts(
        crank_angle=crank, ball=ball + 1, ball_angle=float(angles[ball]), deflection=float(deflections[ball])
    )
