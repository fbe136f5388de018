"""Least squares: unknowns from measured signals, how well the data determine them, and what they do not.

In: a `Misfit` and a start.  Out: a `Fitted`.

Noise is white and of one size in each signal, and in all quantities over their deviations; that size is found with the
unknowns.  Deviations are those of the linearized problem, for a robust loss with the factor of M-estimators (Huber
1981).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.errors import BallpassError
from ballpass.runtime.fit.misfit import Misfit

#: Losses, and the noise beyond which a sample counts less, in deviations: 95 % as sharp as least squares for normal
#: noise (Huber 1981; Rey 1983).
LOSSES = {"linear": 1.0, "huber": 1.345, "cauchy": 2.385}

#: Times that the noise is found anew, and its relative change that ends that.
WEIGHINGS, SAME_NOISE = 6, 1e-3

#: Confidence of all intervals.
CONFIDENCE = 0.95

#: Smallest part in a direction that the data do not determine by which an unknown belongs to it, of the largest.
BELONGS = 0.1

#: A count nearer to its bound than this is held by it.
HELD = 1e-4

#: Where a profile's end is near enough, relative; most refits for one end.
PROFILE_NEAR, PROFILE_STEPS = 5e-3, 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blind:
    """A direction in which the data do not determine the unknowns.

    Attributes
    ----------
    unknowns : that belong to it
    changes : their relative changes along it, the largest 1; of an unknown that may be zero in shares of its range
    """

    unknowns: tuple[int, ...]
    changes: np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """The least misfit.

    Attributes
    ----------
    counts : of the unknowns
    cost : half the sum of the losses, of differences over noise
    weights, noise : of each record: over which differences were taken, and as found from them
    differences : model less measured, of each record
    covariance : of the counts; zero for unknowns that a bound holds
    held : "first", "second" or "" for each unknown: the end of its range that holds it
    blind : what the data do not determine
    spread : deviations of unknowns are multiplied by it for an interval
    scale : growth of twice the cost that is one of a squared deviation [1]
    converged : whether the search ended by itself
    """

    counts: np.ndarray
    cost: float
    weights: np.ndarray
    noise: np.ndarray
    differences: tuple[np.ndarray, ...]
    covariance: np.ndarray
    held: tuple[str, ...]
    blind: tuple[Blind, ...]
    spread: float
    scale: float
    converged: bool


class _Weighted:
    """Differences over noise and their derivatives, remembered for one point."""

    def __init__(self, misfit: Misfit, noise: np.ndarray) -> None:
        self.misfit, self.noise = misfit, noise
        self._at = np.zeros(0)
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self.fault: BallpassError | None = None

    def _evaluate(self, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        if not np.array_equal(counts, self._at):
            self._at = counts.copy()
            try:
                found = self.misfit.outputs(counts)
            except BallpassError as fault:
                self._last, self.fault = None, fault
            else:
                over = zip(found, self.misfit.records, self.noise, strict=True)
                parts = [((y - record.values) / size, slope / size) for (y, slope), record, size in over]
                self._last = np.concatenate([y for y, _ in parts]), np.concatenate([slope for _, slope in parts])
        return self._last

    def differences(self, counts: np.ndarray) -> np.ndarray:
        """NaN where the model cannot be run: the search then takes a shorter step."""
        found = self._evaluate(counts)
        return np.full(sum(len(one.values) for one in self.misfit.records), np.nan) if found is None else found[0]

    def jacobian(self, counts: np.ndarray) -> np.ndarray:
        found = self._evaluate(counts)
        assert found is not None  # only asked for where differences were known
        return found[1]


def search(
    weighted: _Weighted, start: np.ndarray, loss: str, fixed: dict[int, float]
) -> tuple[np.ndarray, float, bool]:
    """Counts of the least misfit, its cost, and whether the search ended by itself.

    Parameters
    ----------
    fixed : counts that stay, by place

    Raises
    ------
    BallpassError
        The model cannot be run at the start.
    """
    from scipy.optimize import least_squares

    free = np.array([k for k in range(len(start)) if k not in fixed], dtype=int)
    whole = start.copy()
    whole[list(fixed)] = list(fixed.values())

    def filled(part: np.ndarray) -> np.ndarray:
        counts = whole.copy()
        counts[free] = part
        return counts

    if not np.all(np.isfinite(weighted.differences(whole))):
        assert weighted.fault is not None
        raise weighted.fault
    if not len(free):
        squares = (weighted.differences(whole) / LOSSES[loss]) ** 2
        return whole, 0.5 * LOSSES[loss] ** 2 * float(np.sum(_rho(loss, squares)[0])), True
    low, high = weighted.misfit.bounds
    found = least_squares(
        lambda part: weighted.differences(filled(part)),
        whole[free],
        jac=lambda part: weighted.jacobian(filled(part))[:, free],
        bounds=(low[free], high[free]),
        loss=loss,
        f_scale=LOSSES[loss],
        ftol=1e-10,
        xtol=1e-8,
        gtol=1e-10,
        max_nfev=200,
    )
    return filled(found.x), float(found.cost), bool(found.status > 0)


def best_of(misfit: Misfit, candidates: np.ndarray) -> np.ndarray:
    """Counts to start from: the candidate with the least misfit, with the gains and offsets that fit it best.

    Parameters
    ----------
    candidates : counts of the unknowns that have ranges, in order, shape (candidates, .)

    Raises
    ------
    BallpassError
        None of them can be run.
    """
    linear = misfit.linear
    ranged = [k for k in range(len(misfit.unknowns)) if k not in linear]
    weighted = _Weighted(misfit, np.array([record.noise for record in misfit.records]))
    best, least = None, np.inf
    for shares in candidates:
        counts = np.zeros(len(misfit.unknowns))
        counts[ranged] = shares
        counts[[k for k in linear if misfit.unknowns[k].kind == "gain"]] = 1.0
        left = weighted.differences(counts)
        if not np.all(np.isfinite(left)):
            continue
        if len(linear):
            columns = weighted.jacobian(counts)[:, linear]
            change = np.linalg.lstsq(columns, -left, rcond=None)[0]
            counts[linear] += change
            left = left + columns @ change
        if best is None or float(left @ left) < least:
            best, least = counts, float(left @ left)
    if best is None:
        assert weighted.fault is not None
        raise weighted.fault
    return best


def fit_unknowns(misfit: Misfit, start: np.ndarray, loss: str, progress: Callable[[float], None] | None) -> Fitted:
    """Find all unknowns, and the noise.

    Raises
    ------
    BallpassError
        The model cannot be run at the start.
    """
    from scipy.stats import t as student

    noise = np.array([record.noise for record in misfit.records])
    # of exact data, as another run of the model, no more is known than the rounding of the numbers
    least = np.finfo(float).eps * np.array([np.max(np.abs(record.values)) for record in misfit.records])
    counts = start
    samples = sum(len(record.values) for record in misfit.records)
    for weighing in range(WEIGHINGS):
        weighted = _Weighted(misfit, noise)
        counts, cost, converged = search(weighted, counts, loss, {})
        whole, jacobian = weighted.differences(counts), weighted.jacobian(counts)
        ends = np.cumsum([len(record.values) for record in misfit.records])[:-1]
        parts = [size * part for size, part in zip(noise, np.split(whole, ends), strict=True)]
        found = np.maximum([_size(part, loss) for part in parts], least)
        # quantities are few in a trial, and have deviations or values to be counted in: of one size in all trials
        few = [k for k, record in enumerate(misfit.records) if record.axis == "quantity"]
        if few:
            found[few] = max(_size(np.concatenate([parts[k] for k in few]), loss), float(np.max(least[few])))
        done = np.all(np.abs(found / noise - 1.0) < SAME_NOISE) or (loss == "linear" and len(parts) == 1)
        if progress is not None:
            progress((weighing + 1) / WEIGHINGS)
        if done:
            break
        noise = found
    held = tuple(
        "" if one.range is None or HELD <= c <= 1.0 - HELD else "first" if c < 0.5 else "second"
        for one, c in zip(misfit.unknowns, counts.tolist(), strict=True)
    )
    scale, steepness = _scale(loss, whole, samples - len(counts))
    scale = max(scale, float(np.min(least / noise)) ** 2)
    covariance, blind = determine(misfit, counts, jacobian, scale / steepness, held)
    return Fitted(
        counts=counts,
        cost=cost,
        weights=noise,
        noise=found,
        differences=tuple(parts),
        covariance=covariance,
        held=held,
        blind=blind,
        spread=float(student.ppf(0.5 + 0.5 * CONFIDENCE, samples - len(counts))),
        scale=scale,
        converged=converged,
    )


def _size(differences: np.ndarray, loss: str) -> float:
    """Size of the noise; for a robust loss by the median, of which normal noise has 1.4826 to a deviation."""
    if loss == "linear":
        return float(np.sqrt(np.mean(differences**2)))
    return float(1.4826 * np.median(np.abs(differences)))


def _rho(loss: str, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A loss over squares and its first two derivatives, as `least_squares` has them."""
    if loss == "huber":
        far, root = z > 1.0, np.sqrt(np.maximum(z, 1.0))
        return np.where(far, 2.0 * root - 1.0, z), 1.0 / root, np.where(far, -0.5 * root**-3, 0.0)
    if loss == "cauchy":
        return np.log1p(z), 1.0 / (1.0 + z), -1.0 / (1.0 + z) ** 2
    return z, np.ones_like(z), np.zeros_like(z)


def _scale(loss: str, differences: np.ndarray, free: int) -> tuple[float, float]:
    """Mean of psi squared over that of psi', and the latter; the covariance of the counts is their ratio by (JᵀJ)⁻¹."""
    z = (differences / LOSSES[loss]) ** 2
    _, first, second = _rho(loss, z)
    steepness = float(np.mean(first + 2.0 * z * second))
    return float(np.sum((first * differences) ** 2)) / free / steepness, steepness


def determine(
    misfit: Misfit, counts: np.ndarray, jacobian: np.ndarray, factor: float, held: tuple[str, ...]
) -> tuple[np.ndarray, tuple[Blind, ...]]:
    """Covariance of the counts, and the directions that the data do not determine.

    Directions are singular vectors of the Jacobian by relative changes.  One of them is not determined where its
    interval is as wide as the bounds; the covariance then has its width within them.

    Parameters
    ----------
    factor : of the covariance over (JᵀJ)⁻¹ [1]
    """
    free = np.array([k for k, end in enumerate(held) if not end], dtype=int)
    covariance = np.zeros((len(counts), len(counts)))
    if not len(free):
        return covariance, ()
    sizes = np.ones(len(free))
    for k, place in enumerate(free):
        one, value = misfit.unknowns[place], misfit.unknowns[place].value(float(counts[place]))
        if one.relative:
            sizes[k] = abs(value / one.slope(float(counts[place])))
    _, singular, rows = np.linalg.svd(jacobian[:, free] * sizes, full_matrices=False)
    blind = []
    for value, row in zip(singular, rows, strict=True):
        reach = 1.0 / max(float(np.max(np.abs(row) * sizes)), 1e-300)  # ranges are 1 wide
        deviation = np.sqrt(factor) / value if value > 0.0 else np.inf
        if 4.0 * deviation >= reach:
            deviation = reach
            belongs = np.flatnonzero(np.abs(row) >= BELONGS * np.max(np.abs(row)))
            lead = row[belongs[np.argmax(np.abs(row[belongs]))]]
            blind.append(Blind(unknowns=tuple(free[belongs].tolist()), changes=row[belongs] / lead))
        along = row * sizes * deviation
        covariance[np.ix_(free, free)] += np.outer(along, along)
    return covariance, tuple(blind)


def profile_end(misfit: Misfit, fitted: Fitted, loss: str, place: int, side: float) -> float:
    """Count at which the least misfit over all others has grown as much as the confidence allows; NaN beyond a bound.

    Parameters
    ----------
    place : of the unknown
    side : -1 or 1
    """
    deviation = float(np.sqrt(fitted.covariance[place, place]))
    low, high = misfit.bounds
    weighted = _Weighted(misfit, fitted.weights)
    along = side * fitted.covariance[:, place] / deviation  # all unknowns where this one moves by a deviation
    step, at = fitted.spread, float("nan")
    for _ in range(PROFILE_STEPS):
        start = np.clip(fitted.counts + step * along, low, high)
        at = float(fitted.counts[place] + side * step * deviation)
        if not low[place] < at < high[place]:
            return float("nan")
        _, cost, _ = search(weighted, start, loss, {place: at})
        grown = np.sqrt(max(2.0 * (cost - fitted.cost) / fitted.scale, 0.0)) / fitted.spread
        if abs(grown - 1.0) < PROFILE_NEAR:
            break
        step /= min(max(grown, 0.5), 2.0)
    return at
