"""Periodic states over a parameter: pseudo-arclength continuation, with the points at which their kind changes.

In: a `Shooting` with a varied parameter, a state to begin with, a range.  Out: a `SteadyBranch`.

Unknown are the states at the segments' starts and the parameter.  Each step goes along the branch's tangent and comes
back to the branch by the shortest way (Moore and Penrose), so that folds are passed.  It is so short that multipliers
near the unit circle turn little.  Where a function of the multipliers changes its sign between two points, or comes
near to zero between them by the parabola through three, Brent's method along the step finds the point:

* fold: the parameter turns back;
* branch point: a multiplier passes 1 and the parameter goes on;
* period doubling: a multiplier passes -1;
* Neimark-Sacker: a pair of complex multipliers passes the unit circle.

Multipliers on both sides confirm each: one or two more lie outside the unit circle on one of them.  Steps in which the
number outside changes by more or less than that are halved.  Every point carries its contact signature; where that of
the next one differs, contacts change between the two.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment, minimize_scalar

from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.motion.contact_sequence import ContactSequence, contact_sequence
from ballpass.runtime.motion.shooting import PeriodicState, Residual, Shooting

#: First, least and largest step, in shares of the range; most points; most iterations of a step.
STEP, LEAST_STEP, LARGEST_STEP, POINTS, ITERATIONS = 0.01, 1e-7, 0.02, 400, 4

#: Done where the last step is below this share of magnitudes and range [1].
CLOSE = 1e-8

#: Points are located so closely, as a share of a step [1].
LOCATED = 1e-9

#: Least cosine of the angles between a step and the branch's directions before and behind it: where they are wider, or
#: iterations more, a step may end on another branch, or beyond a fold on this one, and is halved.
BEND = 0.8

#: Multipliers of this size or more move by at most so much in a step, in shares of their size where that is above one,
#: unless the step is below this share of the range: at contacts that graze they jump [1].
MATTERS, MOVED, LEAST_FOR_MOVES = 0.5, 0.15, 5e-4

#: A function of the multipliers is searched for a pair of zeros within a step where a parabola says that it falls to
#: this share of what it is at the points, in so many evaluations.
FALLS, SOUGHT = 0.7, 12

#: Distances from a located point at which multipliers confirm it, as shares of a step; least share that is halved.
SIDES, HALVED = (1e-3, 1e-5), 1.0 / 64.0

#: A multiplier that passes the unit circle is so near to it at the located point; else it jumps across [1].
ON_CIRCLE = 1e-3

#: First step onto a branch of twice the period, in shares of the range or of magnitudes.
ASIDE = 2e-3

#: Why a branch ends at the range's second and first end.
ENDS = ("at the end of the range", "at the first end of the range, to which it turned back")

MEETS = "where it meets the branch of half the period"

#: States are the same within this share of magnitudes and range [1].
SAME = 1e-6

KINDS = ("fold", "branch point", "period doubling", "Neimark-Sacker")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BranchPoint:
    """A periodic state on a branch.

    Attributes
    ----------
    value : of the parameter
    nodes : states at the starts of the segments, shape (segments, states)
    multipliers : largest first, shape (states,)
    kind : what changes here, one of `KINDS`; "" where nothing does
    tangent : of the branch there, in shares of magnitudes and range
    contacts : which elements touch, in which order, within a period
    """

    value: float
    nodes: np.ndarray
    multipliers: np.ndarray
    kind: str
    tangent: np.ndarray
    contacts: ContactSequence

    @property
    def stable(self) -> bool:
        return bool(abs(self.multipliers[0]) < 1.0)

    @property
    def outside(self) -> int:
        """Multipliers outside the unit circle."""
        return int(np.count_nonzero(np.abs(self.multipliers) > 1.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SteadyBranch:
    """A branch of periodic states.

    Attributes
    ----------
    repeats : periods of the equations after which they repeat
    points : along the branch, special ones among them
    ended : why it ends
    """

    repeats: int
    points: tuple[BranchPoint, ...]
    ended: str

    @property
    def special(self) -> tuple[BranchPoint, ...]:
        return tuple(point for point in self.points if point.kind)

    @property
    def contact_changes(self) -> tuple[tuple[BranchPoint, BranchPoint], ...]:
        """Neighbouring points between which the contact signature changes."""
        return tuple(pair for pair in pairwise(self.points) if not pair[0].contacts.same(pair[1].contacts))

    @property
    def unlocated(self) -> tuple[tuple[BranchPoint, BranchPoint], ...]:
        """Neighbouring points between which multipliers pass the unit circle and no point was found where they do."""
        return tuple((a, b) for a, b in pairwise(self.points) if not (a.kind or b.kind) and a.outside != b.outside)


class _Found:
    """A point on the way: unknowns in shares, what shooting leaves, and what changes its sign at each of `KINDS`."""

    def __init__(self, y: np.ndarray, residual: Residual, tangent: np.ndarray, iterations: int = 0) -> None:
        self.y, self.residual, self.tangent, self.iterations = y, residual, tangent, iterations
        multipliers = np.linalg.eigvals(residual.monodromy)
        self.multipliers = multipliers[np.argsort(-np.abs(multipliers), kind="stable")]
        products = np.multiply.outer(multipliers, multipliers)[np.triu_indices(len(multipliers), 1)]
        functions = (np.prod(multipliers - 1.0), np.prod(multipliers + 1.0), np.prod(products - 1.0))
        self.signals = np.array([float(tangent[-1]), *(float(np.real(one)) for one in functions)])

    @property
    def outside(self) -> int:
        """Multipliers outside the unit circle."""
        return int(np.count_nonzero(np.abs(self.multipliers) > 1.0))

    def moved(self, other: _Found) -> float:
        """How far multipliers are from those there, of each to its own."""
        sizes = np.maximum.outer(np.abs(self.multipliers), np.abs(other.multipliers))
        apart = np.abs(np.subtract.outer(self.multipliers, other.multipliers))
        pairs = linear_sum_assignment(apart)
        matter = sizes[pairs] > MATTERS
        return float(np.max(apart[pairs][matter] / np.maximum(sizes[pairs][matter], 1.0), initial=0.0))


@dataclass(frozen=True, slots=True)
class _Step:
    """A step of the branch, of this length along the tangent at its start."""

    start: _Found
    end: _Found
    length: float


def follow(
    shooting: Shooting,
    begin: PeriodicState | BranchPoint,
    value: float,
    ends: tuple[float, float],
    *,
    tangent: np.ndarray | None = None,
    half: Shooting | None = None,
    progress: Callable[[float], None] | None = None,
) -> SteadyBranch:
    """Follow a branch from a state until the parameter leaves its range.

    Parameters
    ----------
    begin, value : a periodic state, and the parameter there
    ends : of the range; the branch is followed from the first towards the second
    tangent : direction of the first step, in shares; None: that of the branch, towards the second end
    half : of half the period; the branch ends where it meets one of these states again
    progress : called with the finished fraction
    """
    path = _Path(shooting, begin.nodes.shape, ends)
    y = path.shares(begin.nodes, value)
    if tangent is None:
        first = path.at(y, None)
        now = first if first.tangent[-1] > 0.0 else _Found(first.y, first.residual, -first.tangent)
    else:
        # beside a point at which branches cross the tangent is not unique: the one that is given leads away
        now = path.corrected(y, tangent, ASIDE, across=True)
    first, steps = now, list[_Step]()
    length, ended = STEP, f"where its {POINTS} points are used up"
    last: _Found | None = None
    apart: np.ndarray | None = None
    while len(steps) < POINTS:
        try:
            then = path.corrected(now.y, now.tangent, length)
            along = (then.y - now.y) / np.linalg.norm(then.y - now.y)
            if min(along @ now.tangent, along @ then.tangent, now.tangent @ then.tangent) < BEND:
                raise SimulationError("steady: the branch bends too much within a step.")
            moved = now.moved(then)
            if moved > MOVED and length > LEAST_FOR_MOVES:
                raise SimulationError("steady: multipliers move too far within a step.")
            last = None if 0.0 <= then.y[-1] <= 1.0 else path.at_end(now, then)
        except SimulationError:
            length /= 2.0
            if length < LEAST_STEP:
                ended = f"where no step of {LEAST_STEP:g} of the range converges"
                break
            continue
        if half is not None:
            # what half the period changes: of opposite sign on the other side of the branch that this one meets
            before, apart = apart, half.residual(*path.states(then.y)).left
            if before is not None and before @ apart < 0.0:
                ended = MEETS
                break
        steps.append(_Step(now, then, length))
        if progress is not None:
            progress(min(max(float(then.y[-1]), 0.0), 1.0))
        if last is not None:
            ended = ENDS[int(then.y[-1] < 0.0)]
            break
        if len(steps) > 2 and path.passes(now, then, first):
            ended = "where it began: it is closed"
            break
        length = min(length * (1.5 if then.iterations <= 3 and 1.5 * moved < MOVED else 1.0), LARGEST_STEP)
        now = then
    found = [path.point(first, "")]
    for k, step in enumerate(steps):
        found += [point for point in _changes(path, steps[max(k - 1, 0) : k + 2], step) if path.holds(point.value)]
        found.append(path.point(last if last is not None and step is steps[-1] else step.end, ""))
    return SteadyBranch(repeats=shooting.repeats, points=tuple(found), ended=ended)


def doubled(shooting: Shooting, at: BranchPoint, ends: tuple[float, float]) -> SteadyBranch:
    """Follow the branch of twice the period that begins at a period doubling.

    Raises
    ------
    SimulationError
        No state beside it repeats after twice the period.
    """
    if shooting.segments > 1:
        raise SimulationError(
            "steady: branches of twice the period are followed with one segment. Leave segments away."
        )
    values, vectors = np.linalg.eig(shooting.residual(at.nodes, at.value).monodromy)
    flip = np.real(vectors[:, np.argmin(np.abs(values + 1.0))]) / shooting.magnitude
    tangent = np.append(flip / np.linalg.norm(flip), 0.0)
    twice = replace(shooting, repeats=2 * shooting.repeats)
    return follow(twice, at, at.value, ends, tangent=tangent, half=shooting)


class _Path:
    """Unknowns in shares of magnitudes and range, and steps between them."""

    def __init__(self, shooting: Shooting, shape: tuple[int, ...], ends: tuple[float, float]) -> None:
        self.shooting, self.shape = shooting, shape
        self.low, self.width = ends[0], ends[1] - ends[0]

    def shares(self, nodes: np.ndarray, value: float) -> np.ndarray:
        return np.append((nodes / self.shooting.magnitude).ravel(), (value - self.low) / self.width)

    def states(self, y: np.ndarray) -> tuple[np.ndarray, float]:
        return y[:-1].reshape(self.shape) * self.shooting.magnitude, self.low + self.width * float(y[-1])

    def holds(self, value: float) -> bool:
        """Whether the range does."""
        return 0.0 <= (value - self.low) / self.width <= 1.0

    def matrix(self, residual: Residual) -> np.ndarray:
        return np.column_stack([residual.by_states, residual.by_parameter * self.width])

    def at(self, y: np.ndarray, before: np.ndarray | None) -> _Found:
        """What shooting leaves there, with the branch's tangent on the side of the one before."""
        residual = self.shooting.residual(*self.states(y))
        return _Found(y, residual, self.tangent(residual, before))

    def tangent(self, residual: Residual, before: np.ndarray | None) -> np.ndarray:
        direction = np.asarray(np.linalg.svd(self.matrix(residual))[2][-1])
        return -direction if before is not None and direction @ before < 0.0 else direction

    def corrected(self, y: np.ndarray, along: np.ndarray, step: float, *, across: bool = False) -> _Found:
        """The point of the branch near to one that lies so far along a direction, or in the plane across it there.

        Raises
        ------
        SimulationError
            No point was found there.
        """
        aim = y + step * along
        now, before = aim.copy(), np.inf
        for iteration in range(1, ITERATIONS + 1):
            residual = self.shooting.residual(*self.states(now))
            matrix, left = self.matrix(residual), residual.left
            if across:
                matrix, left = np.vstack([matrix, along]), np.append(left, along @ (now - aim))
            try:
                change = -np.linalg.lstsq(matrix, left)[0]  # the smallest that leaves nothing
            except np.linalg.LinAlgError:
                break
            size = float(np.max(np.abs(change)))
            if size > 4.0 * max(before, abs(step)):
                break
            now = now + change
            if size < CLOSE:
                if size > 0.1 * CLOSE:  # multipliers are those of the state that is given
                    residual = self.shooting.residual(*self.states(now))
                return _Found(now, residual, self.tangent(residual, along), iteration)
            before = size
        raise SimulationError("steady: no point of the branch was found across a step.")

    def at_end(self, now: _Found, then: _Found) -> _Found:
        """The point at the end of the range that a step passes.

        Raises
        ------
        SimulationError
            No point was found there.
        """
        step = then.y - now.y
        end = min(max(float(then.y[-1]), 0.0), 1.0)
        along = np.zeros(len(step))
        along[-1] = np.sign(step[-1])
        return self.corrected(now.y + (end - now.y[-1]) / step[-1] * step, along, 0.0, across=True)

    def passes(self, now: _Found, then: _Found, place: _Found) -> bool:
        """Whether a step passes a point of the branch again, in the same direction."""
        step = then.y - now.y
        size = float(np.linalg.norm(step))
        share = float((place.y - now.y) @ step) / size**2
        nearest = now.y + share * step
        if not 0.0 <= share <= 1.0 or np.linalg.norm(place.y - nearest) > size or then.tangent @ place.tangent < BEND:
            return False
        try:
            there = self.corrected(nearest, step / size, 0.0, across=True)
        except SimulationError:
            return False
        return float(np.max(np.abs(there.y - place.y))) < SAME

    def point(self, found: _Found, kind: str) -> BranchPoint:
        nodes, value = self.states(found.y)
        return BranchPoint(
            value=value,
            nodes=nodes,
            multipliers=found.multipliers,
            kind=kind,
            tangent=found.tangent,
            contacts=contact_sequence(self.shooting, nodes, value),
        )


def _changes(path: _Path, beside: list[_Step], step: _Step) -> list[BranchPoint]:
    """Points within a step at which the kind of the states changes, in order.

    Parameters
    ----------
    beside : the step with those before and behind it
    """

    def at(share: float) -> _Found:
        ends = {0.0: step.start, 1.0: step.end}
        return ends.get(share) or path.corrected(step.start.y, step.start.tangent, share * step.length)

    places = [0.0, 1.0]
    for k in range(len(KINDS)):
        for one, other in pairwise(beside):
            share = _pair_within(at, k, one, other, step)
            places += [] if share is None else [share]
    found: list[tuple[float, BranchPoint]] = []
    for low, high in pairwise(sorted(set(places))):
        found += [(share, path.point(at(share), KINDS[k])) for share, k in _crossings(at, low, high)]
    return [point for _, point in sorted(found, key=lambda one: one[0])]


def _crossings(at: Callable[[float], _Found], low: float, high: float) -> list[tuple[float, int]]:
    """Shares of a step at which multipliers pass the unit circle, and which of `KINDS` they are."""
    found, left = list[tuple[float, int]](), 0
    try:
        begin, end = at(low), at(high)
        left = end.outside - begin.outside
        for k in np.flatnonzero(begin.signals * end.signals < 0.0).tolist():
            if k == 1 and begin.signals[0] * end.signals[0] < 0.0:
                continue  # a multiplier passes 1 at a fold as well
            share = float(brentq(lambda share, k=k: at(share).signals[k], low, high, xtol=LOCATED, rtol=1e-12))
            more = _passed(at, share, low, high)
            if k == 0 or (more and np.min(np.abs(np.abs(at(share).multipliers) - 1.0)) < ON_CIRCLE):
                found.append((share, k))
                left -= more
        if left and high - low > HALVED:
            middle = 0.5 * (low + high)
            return _crossings(at, low, middle) + _crossings(at, middle, high)
    except (SimulationError, ValueError):  # no point of the branch was found there; a sign that rounding changes
        return found  # what is left is among `SteadyBranch.unlocated`
    return found


def _passed(at: Callable[[float], _Found], share: float, low: float, high: float) -> int:
    """How many multipliers more lie outside the unit circle behind a point than before it."""
    for aside in SIDES:
        more = at(min(share + aside, high)).outside - at(max(share - aside, low)).outside
        if more:
            return more
    return 0


def _pair_within(at: Callable[[float], _Found], k: int, one: _Step, other: _Step, step: _Step) -> float | None:
    """Where within a step, of two in a row, a signal has the other sign than at the ends, if it has."""
    at_ends = np.array([one.start.signals[k], one.end.signals[k], other.end.signals[k]])
    if np.ptp(np.sign(at_ends)) or not at_ends[0]:
        return None
    sign, places = float(np.sign(at_ends[0])), np.array([-one.length, 0.0, other.length])
    curve = np.polynomial.Polynomial.fit(places, sign * at_ends, 2).convert()
    slope, bend = curve.coef[1], curve.coef[2] if len(curve.coef) > 2 else 0.0
    lowest = -slope / (2.0 * bend) if bend > 0.0 else np.inf
    inside = -one.length < lowest <= 0.0 if step is one else 0.0 < lowest < other.length
    if not inside or curve(lowest) > FALLS * np.min(sign * at_ends):
        return None
    seen: list[float] = []

    def height(share: float) -> float:
        value = sign * float(at(share).signals[k])
        if value < 0.0:
            seen.append(share)
            raise StopIteration
        return value

    with suppress(StopIteration, SimulationError):
        minimize_scalar(height, bounds=(0.0, 1.0), method="bounded", options={"maxiter": SOUGHT, "xatol": LOCATED})
    return seen[0] if seen else None
