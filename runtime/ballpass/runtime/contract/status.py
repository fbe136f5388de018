"""How a simulation ended; each value is the message and the remedy."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """How a simulation ended.

    Examples
    --------
    >>> model.simulate(cycles=1).status.name
    'DONE'
    """

    DONE = "The simulation reached its end."
    NOT_FINITE = (
        "The motion stopped being finite. The model diverges from this state or a parameter is out of its range: "
        "check initial state, damping and units, or start nearer to rest."
    )
    STEP_TOO_SMALL = (
        "The step size fell to the resolution of time without meeting the tolerance: the force jumps there (a "
        "discontinuous law switching back and forth), its derivative has no bound (tangent damping of rollers that "
        "meet and part), or the motion grows without bound, as by damping that gives energy (ballpass.testing finds "
        "it). Take a continuous damping law, of rollers one-sided or Hunt-Crossley, a looser rtol, or check initial "
        "state and parameters."
    )
    TOO_MANY_STEPS = (
        "The run took more steps than allowed. Take a shorter run or a looser rtol, and check damping and stiffness: "
        "an explicit method crawls on a stiff model."
    )
    STALLED = (
        "The driver has stalled: at the edge of a window it turns back again and again. Give the drive more torque or "
        "a heavier flywheel, a higher initial speed, or less load."
    )
    LOCKED = (
        "The driver has come to the end of its range, or to where the linkage locks. Take a shorter run, loads or a "
        "torque with which the driver turns back before, less play of bearings coupled two-way, or other lengths."
    )
    VOID = "The rings moved as they do in no bearing."
    INTEGRATOR_FAILED = (
        "The integrator could not go on: the tolerance asks for steps too small or too many. "
        "Try a looser rtol, or check initial state and parameters."
    )
