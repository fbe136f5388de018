"""The error of a simulation that ended early, with the samples up to there."""

from __future__ import annotations

from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.status import Status
from ballpass.runtime.run.solution import Solution


class IntegrationError(SimulationError):
    """A simulation that ended early.

    Attributes
    ----------
    status : why
    time : how far it came [s]
    crank_angle : angle of driver or shaft at that time [rad]
    ball : the ball with the largest deflection then, counted from 1; None where there is none
    partial : the samples up to that time
    """

    def __init__(
        self,
        status: Status,
        *,
        time: float,
        crank_angle: float,
        method: str,
        detail: str,
        partial: Solution,
        ball: int | None = None,
    ) -> None:
        degrees = crank_angle * 57.29577951308232
        super().__init__(
            f"{status.value}\nMethod {method}, t = {time:.9g} s, crank angle {degrees:.4f} deg, "
            f"{len(partial.t)} samples kept in .partial. {detail}".rstrip()
        )
        self.status = status
        self.time = time
        self.crank_angle = crank_angle
        self.ball = ball
        self.partial = partial
