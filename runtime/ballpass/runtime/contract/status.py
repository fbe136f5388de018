"""How a simulation ended; each value is the message and the remedy."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """How a simulation ended."""

    DONE = "The simulation reached its end."
    NOT_FINITE = (
        "The motion stopped being finite. The model diverges from this state or a parameter is out of its range: "
        "check initial state, damping and units, or start nearer to rest."
    )
    STEP_TOO_SMALL = (
        "The step size fell to the resolution of time without meeting the tolerance: the force jumps there (a "
        "discontinuous law switching back and forth) or the motion grows without bound. Take a continuous damping law, "
        "a looser rtol, or check initial state and parameters."
    )
    TOO_MANY_STEPS = (
        "The run took more steps than allowed. Take a shorter run or a looser rtol, and check damping and stiffness: "
        "an explicit method crawls on a stiff model."
    )
    INTEGRATOR_FAILED = (
        "The integrator could not go on: the tolerance asks for steps too small or too many. "
        'Try method="rosenbrock" for a stiff model, a looser rtol, or check initial state and parameters.'
    )
    NO_EQUILIBRIUM = (
        "The quasi-static model finds no position of the rings that balances the load at this instant. Check load, "
        "stiffness and clearance, or take the model with inertia: method stepper."
    )
    FREE_RING = (
        "The quasi-static model has no single answer at this instant: nothing holds a ring in some direction, because "
        "the load vanishes or a single ball carries it. Inertia decides there: take method stepper; or preload the "
        "bearing (a negative clearance), or move bearing.ball_angle off the load line."
    )
