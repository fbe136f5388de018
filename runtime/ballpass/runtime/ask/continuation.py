"""Periodic states over a parameter: pseudo-arclength continuation, with the points at which their kind changes.

In: a `Shooting` with a varied parameter, a state to begin with, a range.  Out: a `SteadyBranch`.

Unknown are the states at the segments' starts and the parameter.  Each step goes along the branch's tangent and comes
back to the branch by the shortest way (Moore and Penrose), so that folds are passed.  Where a function of the
multipliers changes its sign between two points, the point between them is found by Brent's method along the step:

* fold: the parameter turns back;
* branch point: a multiplier passes 1 and the parameter goes on;
* period doubling: a multiplier passes -1;
* Neimark-Sacker: a pair of complex multipliers passes the unit circle.

Every point carries its contact signature; where that of the next one differs, contacts change between the two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from ballpass.runtime.ask.contact_sequence import ContactSequence, contact_sequence
from ballpass.runtime.ask.shooting import PeriodicState, Residual, Shooting
from ballpass.runtime.contract.errors import SimulationError

#: First, least and largest step, in shares of the range; most points; most iterations of a step.
STEP, LEAST_STEP, LARGEST_STEP, POINTS, ITERATIONS = 0.01, 1e-7, 0.02, 400, 4

#: Done where the last step is below this share of magnitudes and range [1].
CLOSE = 1e-8

#: Points are located so closely, as a share of a step [1].
LOCATED = 1e-9

#: Least cosine of the angles between a step and the branch's directions before and behind it: where they are wider, or
#: iterations more, a step may end on another branch, or beyond a fold on this one, and is halved.
BEND = 0.8

#: Largest distance from the unit circle at which a complex pair is said to pass it [1].
ON_CIRCLE = 1e-3

#: First step onto a branch of twice the period, in shares of the range or of magnitudes.
ASIDE = 2e-3

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
        pairs = zip(self.points, self.points[1:], strict=False)
        return tuple((one, other) for one, other in pairs if not one.contacts.same(other.contacts))


@dataclass(frozen=True, slots=True)
class _Found:
    """A point on the way: unknowns in shares, and what shooting leaves there."""

    y: np.ndarray
    residual: Residual
    tangent: np.ndarray
    iterations: int


def follow(
    shooting: Shooting,
    begin: PeriodicState | BranchPoint,
    value: float,
    ends: tuple[float, float],
    *,
    tangent: np.ndarray | None = None,
    points: int = POINTS,
    half: Shooting | None = None,
    progress: Callable[[float], None] | None = None,
) -> SteadyBranch:
    """Follow a branch from a state until the parameter leaves its range.

    Parameters
    ----------
    begin, value : a periodic state, and the parameter there
    ends : of the range; the branch is followed from the first towards the second
    tangent : direction of the first step, in shares; None: that of the branch, towards the second end
    points : most steps
    half : of half the period; the branch ends where it meets one of these states again
    progress : called with the finished fraction
    """
    path = _Path(shooting, begin.nodes.shape, ends)
    y = path.shares(begin.nodes, value)
    if tangent is None:
        first = path.at(y, None)
        now = first if first.tangent[-1] > 0.0 else _turned(first)
    else:
        # beside a point at which branches cross the tangent is not unique: the one that is given leads away
        now = path.corrected(y, tangent, ASIDE, across=True)
    found = [path.point(now, "")]
    step, ended, apart = STEP, f"after {points} points", None
    for _ in range(points):
        try:
            then = path.corrected(now.y, now.tangent, step)
            along = (then.y - now.y) / np.linalg.norm(then.y - now.y)
            if min(along @ now.tangent, along @ then.tangent, now.tangent @ then.tangent) < BEND:
                raise SimulationError("steady: the branch bends too much within a step.")
            end = None if 0.0 <= then.y[-1] <= 1.0 else path.at_end(now, then)
        except SimulationError:
            step /= 2.0
            if step < LEAST_STEP:
                ended = f"where no step of {LEAST_STEP:g} of the range converges"
                break
            continue
        if half is not None:
            # what half the period changes: of opposite sign on the other side of the branch that this one meets
            before, apart = apart, half.residual(*path.states(then.y)).left
            if before is not None and before @ apart < 0.0:
                ended = "where it meets the branch of half the period"
                break
        found += [point for point in _changes(path, now, then, step) if path.holds(point.value)]
        if progress is not None:
            progress(min(max(float(then.y[-1]), 0.0), 1.0))
        if end is not None:
            found.append(path.point(end, ""))
            ended = "at the end of the range"
            break
        found.append(path.point(then, ""))
        step = min(step * (1.5 if then.iterations <= 3 else 1.0), LARGEST_STEP)
        now = then
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
    return follow(twice, at, at.value, ends, tangent=tangent, points=POINTS // 4, half=shooting)


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
        return _Found(y, residual, self.tangent(residual, before), 0)

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

    def point(self, found: _Found, kind: str) -> BranchPoint:
        nodes, value = self.states(found.y)
        multipliers = np.linalg.eigvals(found.residual.monodromy)
        order = np.argsort(-np.abs(multipliers), kind="stable")
        return BranchPoint(
            value=value,
            nodes=nodes,
            multipliers=multipliers[order],
            kind=kind,
            tangent=found.tangent,
            contacts=contact_sequence(self.shooting, nodes, value),
        )


def _turned(found: _Found) -> _Found:
    return _Found(found.y, found.residual, -found.tangent, found.iterations)


def _signals(found: _Found) -> tuple[float, float, float, float]:
    """What changes its sign at each of `KINDS`."""
    multipliers = np.linalg.eigvals(found.residual.monodromy)
    products = np.multiply.outer(multipliers, multipliers)[np.triu_indices(len(multipliers), 1)]
    return (
        float(found.tangent[-1]),
        float(np.real(np.prod(multipliers - 1.0))),
        float(np.real(np.prod(multipliers + 1.0))),
        float(np.real(np.prod(products - 1.0))),
    )


def _changes(path: _Path, now: _Found, then: _Found, step: float) -> list[BranchPoint]:
    """Points between two steps at which the kind of the states changes, in order."""
    before, after = _signals(now), _signals(then)
    found: list[tuple[float, BranchPoint]] = []
    for k, kind in enumerate(KINDS):
        if before[k] * after[k] >= 0.0 or (kind == "branch point" and before[0] * after[0] < 0.0):
            continue  # a multiplier passes 1 at a fold as well

        def signal(share: float, row: int = k) -> float:
            return before[row] if share == 0.0 else _signals(path.corrected(now.y, now.tangent, share * step))[row]

        try:
            share = float(brentq(signal, 0.0, 1.0, xtol=LOCATED, rtol=1e-12))
            there = path.corrected(now.y, now.tangent, share * step)
        except SimulationError:
            continue
        except ValueError:  # the sign changed by rounding alone
            continue
        point = path.point(there, kind)
        if kind == "Neimark-Sacker":
            pairs = [abs(abs(m) - 1.0) for m in point.multipliers if abs(m.imag) > ON_CIRCLE]
            if not pairs or min(pairs) > ON_CIRCLE:
                continue  # two real multipliers whose product is 1
        found.append((share, point))
    return [point for _, point in sorted(found, key=lambda one: one[0])]
