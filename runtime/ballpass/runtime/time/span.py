"""The time of a run: where it begins, from where it counts and where it ends, in time and in turns of the driver.

In: what turns, and turns or times as they are asked for.  Out: a `Span`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ballpass.runtime.contract.defaults import longer_words
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import real
from ballpass.runtime.time.turning import Turning

#: Longest run, in turns and in time [s].  A press takes days of computing for so many turns, and
#: the angle of an edge within the last of them is exact to a thousandth of a turn.
MOST_TURNS, MOST_TIME = 1e9, 1e9

#: Part of a turn by which times miss it by rounding.
NEAR = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """The time of a run.

    Attributes
    ----------
    turning : of driver or shaft; where a torque drives, at its first speed
    begin, start, end : of the run, and from where it counts [s]
    transient : turns from t = 0 on that do not count
    asked : turns from its begin that were asked for; None where a time was

    Examples
    --------
    >>> from ballpass.runtime.time.span import Span
    >>> from ballpass.runtime.time.turning import TURN, Turning
    >>> run_up = Turning.by_speeds(0.0, [0.0, 2.0], [0.0, TURN])  # to a turn a second in two
    >>> span = Span.of(run_up, cycles=3.0, transient=1.0)
    >>> span.start, span.end, span.counted
    (2.0, 4.0, 2.0)
    """

    turning: Turning
    begin: float
    start: float
    end: float
    transient: float
    asked: float | None = None

    @classmethod
    def of(
        cls,
        turning: Turning,
        *,
        begin: float = 0.0,
        cycles: float | None = None,
        duration: float = math.nan,
        transient: float = 0.0,
    ) -> Span:
        """So many turns, or a time [s] where there are none, from its begin on.

        Raises
        ------
        RequestError
            The driver does not make so many turns, the run is too long, or the transient is no number from 0 on.
        """
        end = begin + duration if cycles is None else turning.after(cycles, begin)
        if cycles is not None and math.isinf(end):
            made = turning.turns(begin, max(begin, float(turning.begin[-1]))) if turning.fastest else 0.0
            still = f"the driver stands still after {made:.4g} turns" if made else "nothing turns in this model"
            raise RequestError(f"cycles: {still} (its speed is zero). Give duration in seconds.")
        check_length(turning, end)
        start = max(begin, turning.after(check_transient(transient)))
        return cls(turning=turning, begin=begin, start=start, end=end, transient=transient, asked=cycles)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.end - self.begin

    @property
    def cycles(self) -> float:
        """Turns of the run."""
        return self.turning.turns(self.begin, self.end)

    @property
    def counted(self) -> float:
        """Turns that count."""
        return self.turning.turns(self.start, self.end)

    def counting(self, turns: float) -> Span:
        """The same with so many turns that count, at the speed behind the last row."""
        return replace(self, end=self.start + turns * self.turning.turn, asked=None)

    def whole_cycles(self, cycle: int) -> tuple[float, float] | None:
        """Begin and end of the last whole turns that count [s]: as many as loads repeat after, or several times that.

        They begin and end where the driver has made whole turns since t = 0, as segments of a run do, or with what
        counts; where its speed changes they are all that counts.  None where it holds none.
        """
        if not self.turning.is_even:
            count = cycle * round(self.counted / cycle)
            return (self.start, self.end) if count and abs(self.counted - count) < NEAR * count else None
        turn = self.turning.turn
        first, last = self.start / turn, self.end / turn
        for end in (last, math.floor(last + NEAR)):
            count = cycle * math.floor((end - first) / cycle + NEAR)
            begin = end - count
            if count > 0 and min(abs(begin - first), abs(begin - round(begin))) < NEAR * max(last, 1.0):
                return begin * turn, end * turn
        return None

    def check(self) -> Span:
        """The span itself.

        Raises
        ------
        RequestError
            Nothing turns, or nothing of the run is left behind the transient.
        """
        if self.transient > 0.0 and self.turning.fastest == 0.0:
            raise RequestError("transient: its cycles are turns, and nothing turns in this model. Set it to 0.")
        if self.start >= self.end * (1.0 - 1e-9):
            raise RequestError(
                f"The run of {self.turning.turns(0.0, self.end):g} cycles lies within its {self.transient:g} transient "
                f"cycles: nothing is left. Remedy: {longer_words(self.transient)}."
            )
        return self


def check_length(turning: Turning, end: float) -> None:
    """Refuse a run that would not come to its end: RequestError where that is beyond `MOST_TURNS` or `MOST_TIME`."""
    turns = turning.turns(0.0, end)
    if not (turns <= MOST_TURNS * (1.0 + 1e-9) and end <= MOST_TIME):
        words = f"{end:g} s, {turns:.3g} turns," if turns else f"{end:g} s"
        raise RequestError(
            f"A run of {words} is too long to be computed. Allowed: up to {MOST_TURNS:g} turns and {MOST_TIME:g} s. "
            "Give fewer cycles or a shorter duration."
        )


def check_transient(given: float) -> float:
    """A number of turns from 0 on; RequestError for another."""
    if not 0.0 <= real(given) < math.inf:
        raise RequestError(f"transient: a number of cycles from 0 on is expected, not {given!r}.")
    return real(given)
