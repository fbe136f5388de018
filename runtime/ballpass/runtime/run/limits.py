"""Limits of the work of a run: it is stopped beyond them, so that no request runs for hours unnoticed.

A step takes some 0.2 to 0.5 microseconds, with reductions up to one, so a run of some turns that reaches its limit has
taken seconds.  The limits are far above what any method needs that fits its model: a turn of a press takes a thousand
steps.  They are reached by an explicit method on an overdamped contact, whose steps are bounded by 3.3 / decay, and
by motion that grows without bound.  They are the same for runs with samples, runs with reductions, and each member of
an ensemble.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Steps, accepted and rejected, that any run may take, a turn, and a second of the machine's time.
STEPS_A_RUN = 20_000_000
STEPS_A_TURN = 10_000_000
STEPS_A_SECOND = 1_000_000

#: So many steps must bring a run so far, as a fraction of it, or as far as the limits of a turn and of a second allow,
#: whichever is less.  A slower run diverges or chatters, or is an explicit method on a stiff model: a long
#: run would take hours before its own limit.
STEPS_A_LOOK = 1_000_000
LEAST_PROGRESS = 0.01

#: Steps of a run that others wait for: a member in lanes, which then continues alone, and one of many trials.
BRIEF_A_RUN = 1_000_000
BRIEF_A_TURN = 100_000


def step_limit(duration: float, turn: float) -> int:
    """Most steps of a run, accepted and rejected.

    Parameters
    ----------
    duration : length of the run [s]
    turn : time of a turn, infinite when nothing turns [s]
    """
    turns = math.ceil(duration / turn)
    return STEPS_A_RUN + STEPS_A_TURN * turns + math.ceil(min(STEPS_A_SECOND * duration, 1e15))


def brief_limit(duration: float, turn: float) -> int:
    """Most steps of a run that others wait for; parameters as for `step_limit`."""
    turns = math.ceil(duration / turn)
    wanted = BRIEF_A_RUN + BRIEF_A_TURN * turns + math.ceil(min(STEPS_A_SECOND * duration, 1e15))
    return min(wanted, step_limit(duration, turn))


@dataclass(slots=True)
class Allowance:
    """Steps that a run has left, and check of its progress.

    Attributes
    ----------
    left : steps, accepted and rejected
    least : least time for `STEPS_A_LOOK` steps [s]
    time : of the last check [s]
    since : steps since then
    """

    left: int
    least: float
    time: float = 0.0
    since: int = 0

    def spend(self, steps: int, time: float) -> bool:
        """Note steps that brought the run to a time; whether it has to be stopped."""
        self.left -= steps
        self.since += steps
        if self.left <= 0:
            return True
        if self.since < STEPS_A_LOOK:
            return False
        crawls = time - self.time < self.least
        if not crawls:
            self.time, self.since = time, 0
        return crawls


def allowance(duration: float, turn: float, begin: float = 0.0, taken: int = 0) -> Allowance:
    """Budget of a run that has reached `begin` [s] in so many steps."""
    least = min(LEAST_PROGRESS * duration, STEPS_A_LOOK * min(turn / STEPS_A_TURN, 1.0 / STEPS_A_SECOND))
    return Allowance(left=max(step_limit(duration, turn) - taken, 1), least=least, time=begin)
