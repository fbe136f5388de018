"""The error of a simulation that ended early, with the samples up to there."""

from __future__ import annotations

import math

from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.status import Status
from ballpass.runtime.run.failure_location import FailureLocation
from ballpass.runtime.solution.solution import Solution


class IntegrationError(SimulationError):
    """A simulation that ended early.

    Attributes
    ----------
    status : why
    time : how far it came; of void results, when a ball is flattened most [s]
    crank_angle : angle of driver or shaft at that time [rad]
    ball : the ball with the largest deflection then, counted from 1; None where there is none
    partial : the samples up to that time
    """

    def __init__(
        self, status: Status, *, time: float, place: FailureLocation, method: str, detail: str, partial: Solution
    ) -> None:
        words = f"{detail} {place.words}".strip()
        super().__init__(
            f"{status.value}\nMethod {method}, t = {time:.9g} s, "
            f"crank angle {math.degrees(place.crank_angle):.4f} deg, "
            f"{len(partial.t)} samples kept in .partial. {words}".rstrip()
        )
        self.status = status
        self.time = time
        self.crank_angle = place.crank_angle
        self.ball = place.ball
        self.partial = partial
