"""Find the number of turns for a peak: a run continues until its extremes and means settle.

In: a model, numbers, a request.  Out: `Settled`.  The balls meet the load's peak in other places each turn, so the peak
of two turns depends on the balls' first angle.  The turns are doubled until that changes no extreme of any channel by
more than `PEAKS` of its range, and no rms by more than `MEANS`.  Fewer than `LEAST` turns are not trusted: two and four
of them may share a peak by luck.

What later turns do not come near is of the start, as the impact of a ring that falls through its clearance: where the
second half of the turns misses an extreme of the first by more than `START` of the range, the first half is transient.

`look_beyond` shows what more turns change in any run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeVar

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, real
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, asked_span, resolve
from ballpass.runtime.run.reduced_run import ReducedRun, reduced, start_reducing
from ballpass.runtime.run.reductions import Reductions, channel_names, joined
from ballpass.runtime.show import html
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.time.repetition import MOST_RUN, Repetition
from ballpass.runtime.time.span import Span

#: Change of extremes, relative to the channel's range, and of rms, relative to itself, that counts as zero [1].
PEAKS, MEANS = 5e-3, 1e-2

#: Part of its range by which an extreme of a channel is above all of later turns where it is one of the start [1].
START = 5e-2

#: Steady turns that are compared with twice as many at first.
LEAST = 64

#: Steps that `look_beyond` may take beside a run: some tenth of a second.
STEPS = 100_000


class _Found(Protocol):
    @property
    def settled(self) -> bool: ...


Alike = TypeVar("Alike", bound=_Found)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Settled(ShortRepr):
    """A run whose extremes and means more turns do not change.

    Attributes
    ----------
    reductions : over all steady turns
    turns : how many they are
    dropped : turns before them that were transient as well
    first : of each channel whose extreme is one of the start: "max" or "min", its time [s], it, and that of later turns
    settled : whether half of them gave the same; False where the most turns were not enough
    changes : of each channel by the second half of the turns: of the extremes, over the range, and of the rms [1]
    """

    reductions: Reductions
    turns: int
    settled: bool
    changes: Mapping[str, tuple[float, float]]
    dropped: int = 0
    first: Mapping[str, tuple[str, float, float, float]] = field(default_factory=dict)

    def _repr_html_(self) -> str:
        state = "Settled" if self.settled else "Not settled"
        return html.block(html.title(f"{state}: {self.turns} turns", self.words), self.reductions.table_html())

    @property
    def words(self) -> str:
        """The result as a sentence."""
        return self.words_of(str)

    def words_of(self, called: Callable[[str], str]) -> str:
        """The result as a sentence, with words for the name of a channel."""
        name = max(self.changes, key=lambda channel: max(self.changes[channel]))
        peak, mean = self.changes[name]
        state = "settled" if self.settled else "not settled"
        behind = f" behind {self.dropped} of transient" if self.dropped else ""
        return (
            f"peaks and rms {state} over {self.turns} steady turns{behind}: the second half changed extremes and rms "
            f"most in {called(name)}, by {rounded(100.0 * peak, 2)} % of its range and {rounded(100.0 * mean, 2)} %"
        )


def settle(model: LoadedModel, numbers: Numbers, request: Request, most: int = MOST_RUN) -> Settled:
    """Continue a run until twice the turns change nothing.

    Parameters
    ----------
    request : without a length
    most : steady turns

    Raises
    ------
    RequestError
        A wrong request, nothing turns, or something follows a table over time.
    SimulationError
        The computation failed.
    """
    repetition = Repetition.of(model.manifest, numbers.values)
    turn = repetition.turn
    slowest = math.ceil(max(repetition.slowest_load, repetition.slowest_beat(MOST_RUN // 2 * turn)) / turn)
    turns = repetition.whole(max(LEAST, slowest))
    if not (real(most) >= 2 * turns and float(most).is_integer()):
        why = f" The slowest harmonic load, or beat, takes {slowest} turns for a period." if slowest > LEAST else ""
        raise RequestError(f"settle: most = {most!r}; a whole number of turns from {2 * turns} on is expected.{why}")
    span = asked_span(model, numbers, replace(request, cycles=1.0))
    if not repetition.holds(span.start):
        raise RequestError(
            "settle: load, speed or slip of this scene follow a table or a window over time, so that its turns are "
            "unlike each other. Give a transient behind its last row (transient, --transient), or run the turns that "
            "are meant, without settle."
        )
    run = resolve(model, numbers, request, span=span.counting(turns))

    def compared(going: ReducedRun, before: Settled | None) -> Settled:
        later = going.take()
        if before is None:
            return Settled(reductions=later, turns=turns, settled=False, changes={})
        done = 2 * (before.dropped + before.turns)
        found = _compared(run, before.reductions, before.reductions, later, done - before.dropped, before.dropped)
        if not found.first:
            return found
        # the first half is of the start
        return replace(found, reductions=later, turns=done // 2, dropped=done // 2, settled=False, first={})

    return until_alike(run, channel_names(model.manifest), doubled(span, turns, most), compared)


def until_alike(
    run: Run,
    channels: Collection[str],
    ends: Iterable[float],
    compared: Callable[[ReducedRun, Alike | None], Alike],
) -> Alike:
    """Continue a run from one end to the next until what is found there is settled.

    Parameters
    ----------
    channels : that are reduced
    ends : times [s]
    compared : gives what is found so far, compared with what was found at the end before; None at the first one

    Raises
    ------
    SimulationError
        The computation failed.
    """
    going, found = start_reducing(run, channels), None
    for end in ends:
        going.go_on(end)
        found = compared(going, found)
        if found.settled:
            break
    assert found is not None  # there is an end
    return found


def doubled(span: Span, turns: float, most: float) -> Iterator[float]:
    """Ends of so many turns that count, of twice as many, and so on up to the most [s]."""
    while turns <= most:
        yield span.counting(turns).end
        turns *= 2


def look_beyond(run: Run, few: Reductions | None = None, turns: int | None = None) -> Settled | None:
    """Change of the extremes and rms of a run by `LEAST` turns, or by as many as `STEPS` steps reach.

    None where the run is about as long, nothing turns, or something follows a table over time.

    Parameters
    ----------
    few : reductions of the run, where they are known
    turns : in place of those that `STEPS` steps reach

    Raises
    ------
    SimulationError
        The longer run failed.
    """
    model, turn = run.model, run.span.turning.turn
    repetition = Repetition.of(model.manifest, run.numbers.values)
    if not repetition.holds(run.start):
        return None
    if few is None:
        few = reduced(run)
    whole = (few.start + few.duration - run.begin) / turn
    if turns is None:
        turns = min(repetition.whole(LEAST), int(STEPS * whole / max(few.steps, 1)))
        turns -= turns % repetition.turns
    if turns < 2.0 * few.duration / turn:
        return None
    longer = replace(run, span=run.span.counting(turns), progress=None)
    going = start_reducing(longer, channel_names(model.manifest))
    going.go_on((longer.start + longer.end) / 2.0)
    early = going.take()
    going.go_on()
    return _compared(longer, few, early, going.take(), turns)


def _compared(run: Run, few: Reductions, early: Reductions, later: Reductions, turns: int, dropped: int = 0) -> Settled:
    """What both halves of some turns have, compared with fewer turns."""
    found = joined(early, later)
    assert found is not None
    changes = changed(run, few, found)
    return Settled(
        reductions=found,
        turns=turns,
        settled=all(peak <= PEAKS and mean <= MEANS for peak, mean in changes.values()),
        changes=changes,
        dropped=dropped,
        first=extremes_of_start(run, few, later),
    )


def _tolerated(run: Run) -> dict[str, float]:
    """What steps may be off by in each state: of a ring that has come to rest no digit is left.

    Infinite for the driver's angle, which counts turns.
    """
    found = dict(zip(run.model.states, (run.rtol * run.magnitude).tolist(), strict=True))
    mechanism = run.model.manifest.mechanism
    return found | ({mechanism.angle: math.inf} if mechanism is not None and mechanism.angle else {})


def changed(run: Run, few: Reductions, many: Reductions) -> dict[str, tuple[float, float]]:
    """Change of the extremes of each channel of a run over its range, and of its rms [1]; none within rounding."""
    found, tolerated = {}, _tolerated(run)
    for name, less in few.items():
        more, span, least = many[name], many[name].range, tolerated.get(name, 0.0)
        if least == math.inf:
            continue
        peak = max(abs(more.maximum - less.maximum), abs(more.minimum - less.minimum))
        mean = abs(less.rms / more.rms - 1.0) if abs(less.rms - more.rms) > least and more.rms > 0.0 else 0.0
        found[name] = (peak / span if peak > least and span > 0.0 else 0.0, mean)
    return found


def extremes_of_start(run: Run, few: Reductions, later: Reductions) -> dict[str, tuple[str, float, float, float]]:
    """Extremes that later turns do not come near, as `Settled.first`; none within rounding."""
    found, tolerated = {}, _tolerated(run)
    for name, first in few.items():
        behind = later[name]
        up, down = first.maximum - behind.maximum, behind.minimum - first.minimum
        missed = max(up, down)
        if missed > max(START * behind.range, tolerated.get(name, 0.0)):
            most = ("max", first.maximum_time, first.maximum, behind.maximum)
            found[name] = most if up >= down else ("min", first.minimum_time, first.minimum, behind.minimum)
    return found
