"""The closed curve on which stroboscopic points lie, as a Fourier series over a phase.

In: a phase and a state at each point.  Out: `InvariantCurve`.

Half of the points fit the series; the other half say how well, and how many harmonics it should have: more than the
points determine bring the curve away from those that were left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Harmonics that are tried; and points of the fit for each, at least: it has two numbers, and phases are not evenly
#: spaced.
TRIED, POINTS_EACH = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512), 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InvariantCurve:
    """A closed curve of states over a phase.

    Attributes
    ----------
    coefficients : of 1, cos, sin of each harmonic in turn, shape (1 + 2 harmonics, states)
    missed : rms distance of points that did not fit the curve, in shares of the points' standard deviation,
        shape (states,) [1]
    drift : of the phase from point to point, between -1/2 and 1/2 [1]
    """

    coefficients: np.ndarray
    missed: np.ndarray
    drift: float

    @property
    def harmonics(self) -> int:
        return len(self.coefficients) // 2

    def __call__(self, phase: np.ndarray) -> np.ndarray:
        """States at these phases, shape (phases, states)."""
        return np.asarray(_basis(phase, self.harmonics) @ self.coefficients)


def fit_curve(phase: np.ndarray, states: np.ndarray) -> InvariantCurve:
    """Fit a curve to every second point, with as many harmonics as bring it nearest to the others.

    Parameters
    ----------
    phase : of each point, of which a whole number is a round of the curve, shape (points,) [1]
    states : shape (points, states)
    """
    spread = np.maximum(states.std(axis=0), 1e-300)
    best: InvariantCurve | None = None
    step = float(np.mean(np.diff(np.unwrap(phase, period=1.0))))
    for harmonics in TRIED:
        if POINTS_EACH * harmonics > len(phase[::2]):
            break
        # phases that come again determine few harmonics: least squares then takes the smallest coefficients
        found = np.linalg.lstsq(_basis(phase[::2], harmonics), states[::2], rcond=1e-8)[0]
        others = _basis(phase[1::2], harmonics) @ found
        missed = np.sqrt(np.mean((others - states[1::2]) ** 2, axis=0)) / spread
        if best is None or missed.mean() < best.missed.mean():
            best = InvariantCurve(coefficients=found, missed=missed, drift=step)
    assert best is not None
    return best


def _basis(phase: np.ndarray, harmonics: int) -> np.ndarray:
    angles = 2.0 * np.pi * np.multiply.outer(phase, np.arange(1, harmonics + 1))
    waves = np.stack([np.cos(angles), np.sin(angles)], axis=-1).reshape(len(phase), -1)
    return np.column_stack([np.ones(len(phase)), waves])
