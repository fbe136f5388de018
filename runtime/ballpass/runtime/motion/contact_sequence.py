"""Contact signature of a periodic state: which elements touch, and in which order, within a period.

In: a `Shooting`, states at the starts of its segments.  Out: a `ContactSequence`.

A plain run over the period, whose steps end where contacts open and close, gives the sets of elements in contact, one
behind the other.  Balls are alike: after a period each has the number of the one in whose place it stands.  Signatures
begin at the same place of the sequence wherever t = 0 lies within it, so that equal motions have equal signatures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise

import numpy as np

from ballpass.runtime.ask.kept_parts import Arrays
from ballpass.runtime.contract.defaults import BRANCH_RTOL
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.motion.shooting import Shooting
from ballpass.runtime.native.reduction_rows import DEFLECTION
from ballpass.runtime.quantity.track import ChannelValues, FollowedRun
from ballpass.runtime.request.ball_angles import ball_angles
from ballpass.runtime.request.locating import kinks_with_derivatives
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import resolve
from ballpass.runtime.request.start import state_at
from ballpass.runtime.run.loop import segments_of, steps_of
from ballpass.runtime.time.turning import TURN

#: Parts of a step at whose ends contacts are evaluated.
PARTS = 4

#: Openings and closings nearer to each other than this share of the period have no order [1].
SAME = 1e-6

#: An extreme of a deflection below this share of the largest one is near grazing [1].
GRAZES = 0.01

#: Most openings and closings in a text.
SHOWN = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactSequence:
    """Elements in contact within a period, in order.

    Attributes
    ----------
    touching : elements in contact at first and after each opening or closing but the last, which leads to the first
        ones, renumbered; balls by number, counted from 1, behind the name of their bearing where there are several
    behind : those after the last one
    margin : smallest extreme of a deflection, relative to the largest deflection of its bearing [1]

    Notes
    -----
    Two that are compared have periods of the same number of turns.  `margin` takes no part.

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8
    >>> found = model.steady(parameters=pitch).contacts
    >>> found.touching[0], found.order[0], found.count > 100
    ((), '1 closes', True)
    """

    touching: tuple[tuple[str, ...], ...]
    behind: tuple[str, ...]
    margin: float

    @property
    def grazes(self) -> bool:
        """Whether a contact is near to opening or closing where it does not, or the reverse."""
        return self.margin < GRAZES

    @property
    def order(self) -> tuple[str, ...]:
        """What happens, in order: elements that open and close together are one entry."""
        every = (*self.touching, self.behind)
        return tuple(_change(before, after) for before, after in pairwise(every) if before != after)

    @property
    def count(self) -> int:
        """Openings and closings in a period."""
        every = (*self.touching, self.behind)
        return sum(len(set(before) ^ set(after)) for before, after in pairwise(every))

    @property
    def words(self) -> str:
        """The signature."""
        order, begin = self.order, f"{', '.join(self.touching[0]) or 'none'} in contact"
        if not order:
            return f"{begin}, without change"
        more = f", and {len(order) - SHOWN} more changes" if len(order) > SHOWN else ""
        return f"{begin}; then {', '.join(order[:SHOWN])}{more}"

    def same(self, other: ContactSequence) -> bool:
        """Whether the same elements touch in the same order.

        Examples
        --------
        >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8
        >>> found = model.steady(parameters=pitch).contacts
        >>> found.same(found)
        True
        """
        return (self.touching, self.behind) == (other.touching, other.behind)


def contact_sequence(shooting: Shooting, nodes: np.ndarray, value: float | None = None) -> ContactSequence:
    """Contacts along the motion from these states at the segments' starts, shape (segments, states).

    Raises
    ------
    RunFailed
        A run failed.
    """
    model, numbers = shooting.model, shooting.numbers(value)
    length = shooting.repeats * shooting.period.time(numbers.values)
    bearings, stops = model.manifest.bearings, model.manifest.stops
    channels = ChannelValues(model, [*(bearing.prefix + DEFLECTION for bearing in bearings), *stops])
    t, parts = [np.zeros(0)], []
    for k in range(len(nodes)):
        compute = partial(_deflections, shooting, numbers, channels, nodes[k], (k, len(nodes)), length)
        times, *found = shooting.once(f"contacts {k}", nodes, value, shooting.rtol, compute)
        first = 1 if k else 0  # the state where a segment ends is the one where the next begins
        t.append(times[first:])
        parts.append([table[first:] for table in found])
    tables = [np.concatenate(one) for one in zip(*parts, strict=True)]
    shifts = [*_shifts(shooting, numbers, nodes[0], length), *(0 for _ in stops)]
    names = [[f"{one.name} {k + 1}".lstrip() for k in range(one.balls)] for one in bearings] + [
        [name] for name in stops
    ]
    margins = [_margin(table, shift) for table, shift in zip(tables, shifts, strict=True)]
    touching = _sequence(np.concatenate(t), tables, length)
    n = len(touching) - 1
    every, again = list(touching[:n]), cache(partial(_renumbered, shifts=shifts, names=names))
    while len(every) < n * max(len(some) for some in [*names, ()]):  # until all balls are where they were
        every += map(again, every[-n:])
    first = _least_rotation(every)
    turned = [every[(first + k) % len(every)] for k in range(n + 1)]
    shown = [tuple(names[table][k] for table, k in some) for some in turned]
    return ContactSequence(touching=tuple(shown[:n]), behind=shown[n], margin=min(margins, default=np.inf))


def _deflections(
    shooting: Shooting,
    numbers: Numbers,
    channels: ChannelValues,
    start: np.ndarray,
    part: tuple[int, int],
    length: float,
) -> Arrays:
    """Times within and at the ends of the steps of a segment, and deflections there, a table for each channel."""
    model = shooting.model
    begin = state_at(model, numbers, shooting.begin(numbers) + part[0] * length / part[1], start)
    kinks = kinks_with_derivatives(None, model.manifest)
    request = Request(
        duration=length / part[1],
        initial=begin,
        rtol=BRANCH_RTOL if shooting.rtol is None else shooting.rtol,
        transient_cycles=0.0,
        kinks=kinks,
    )
    run = resolve(model, numbers, request)
    kept = steps_of(run)
    corners = np.unique([run.begin, *kept[:, 0].tolist(), run.end])
    between = corners[:-1, None] + np.diff(corners)[:, None] * np.arange(PARTS) / PARTS
    t = np.append(between.ravel(), run.end)
    motion = FollowedRun(run=run, segments=segments_of(run), kept=kept)
    seen = channels.along(motion.along(motion.nodes_at(t)), numbers)
    return t, *(seen[name].value for name in channels.channels)


def _shifts(shooting: Shooting, numbers: Numbers, state: np.ndarray, length: float) -> list[int]:
    """For each bearing: after a period ball k stands where ball k + shift stood."""
    begin = shooting.begin(numbers)
    first, last = (ball_angles(shooting.model, numbers, time, state) for time in (begin, begin + length))
    return [round(float(b[0] - a[0]) * len(a) / TURN) % len(a) for a, b in zip(first, last, strict=True)]


def _margin(table: np.ndarray, shift: int) -> float:
    """Smallest extreme of the balls' deflections, relative to the largest deflection."""
    rows = np.vstack([np.roll(table[-2], shift), table, np.roll(table[1], -shift)])
    rise, fall = rows[1:-1] - rows[:-2], rows[2:] - rows[1:-1]
    extremes = np.abs(table[(rise * fall <= 0.0) & (rise != fall)])
    return float(np.min(extremes, initial=np.inf) / max(float(np.max(np.abs(table))), 1e-300))


def _sequence(t: np.ndarray, tables: Sequence[np.ndarray], length: float) -> list[tuple[tuple[int, int], ...]]:
    """Sets of elements in contact, those at the end last: (table, column) each."""
    events = []
    for k, table in enumerate(tables):
        rows, columns = np.nonzero((table[1:] > 0.0) != (table[:-1] > 0.0))
        before, after = table[rows, columns], table[rows + 1, columns]
        times = t[rows] + (t[rows + 1] - t[rows]) * before / (before - after)
        events += [(time, (k, column)) for time, column in zip(times.tolist(), columns.tolist(), strict=True)]
    now = {(k, column) for k, table in enumerate(tables) for column in np.flatnonzero(table[0] > 0.0).tolist()}
    found, last = [tuple(sorted(now))], -np.inf
    for time, element in sorted(events):
        now ^= {element}
        if time - last <= SAME * length:
            found.pop()
        found.append(tuple(sorted(now)))
        last = time
    return found if len(found) > 1 else [*found, *found]  # nothing opens or closes


def _renumbered(
    touching: tuple[tuple[int, int], ...], shifts: Sequence[int], names: Sequence[Sequence[str]]
) -> tuple[tuple[int, int], ...]:
    """The same elements a period later."""
    return tuple(sorted((k, (column - shifts[k]) % len(names[k])) for k, column in touching))


def _least_rotation(every: Sequence[tuple[tuple[int, int], ...]]) -> int:
    """Where the lexicographically smallest rotation of a sequence begins."""
    a, b, same, count = 0, 1, 0, len(every)
    while a < count and b < count and same < count:
        left, right = every[(a + same) % count], every[(b + same) % count]
        if left == right:
            same += 1
            continue
        a, b = (a, b + same + 1) if left < right else (a + same + 1, b)
        b += a == b
        same = 0
    return min(a, b)


def _change(before: tuple[str, ...], after: tuple[str, ...]) -> str:
    """What opens and closes between two sets."""
    opens = [f"{name} opens" for name in before if name not in after]
    closes = [f"{name} closes" for name in after if name not in before]
    return " and ".join([*opens, *closes])
