"""How much work a run may take before it is given up, so that no request runs for hours unseen.

A step takes some 0.2 to 0.5 microseconds, so a run that reaches its limit has taken seconds.  The limits are far above
what any method needs that fits its model: a turn of a press takes a thousand steps.  What meets them is an explicit
method on an overdamped contact, whose steps are bounded by 3.3 / decay, and motion that grows without bound.
"""

from __future__ import annotations

import math

from raceway.runtime.errors import RequestError
from raceway.runtime.integrate.scales import Scales

#: Steps, accepted and rejected, that any run may take, a turn, and a second of the machine's time.
STEPS_A_RUN = 20_000_000
STEPS_A_TURN = 10_000_000
STEPS_A_SECOND = 1_000_000

#: Step size times fastest decay at which an explicit method of order five becomes unstable [1].
STABLE = 3.3


def step_limit(duration: float, turn: float) -> int:
    """Most steps of a run, accepted and rejected.

    Parameters
    ----------
    duration : length of the run [s]
    turn : time of a turn, infinite when nothing turns [s]
    """
    turns = math.ceil(duration / turn)
    return STEPS_A_RUN + STEPS_A_TURN * turns + math.ceil(min(STEPS_A_SECOND * duration, 1e15))


def refuse_crawl(method: str, scales: Scales, duration: float, turn: float) -> None:
    """Refuse an explicit method that tells no steps where stability alone would make it take more than allowed.

    Raises
    ------
    RequestError
        With the number of steps, its reason and the methods to take instead.
    """
    needed, allowed = scales.decay * duration / STABLE, step_limit(duration, turn)
    if needed > allowed:
        raise RequestError(
            f"method {method}: damping decays at up to {scales.decay:.3g} 1/s, which bounds the steps of an explicit "
            f"method to {STABLE / scales.decay:.3g} s: some {needed:.2g} of them for this run, {allowed:.2g} are "
            "allowed. Take method stepper or rosenbrock, made for stiff models, or a shorter run, and check the "
            "damping coefficient and its unit."
        )
