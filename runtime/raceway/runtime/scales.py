"""How large the states get and how stiff the model is, asked of the model itself.

Tolerances are relative to magnitudes.  With magnitudes taken from the momentary state, an error control asks for
nonsense when a coordinate passes zero; so they are found once a run, from the model's own right-hand side, at the
moments that load it most:

1. The moments with the largest acceleration at the initial positions, at rest, are picked from the run.
2. At each, the positions of static equilibrium are found by pseudo-transient continuation,
   ``q += (I / tau - J)^-1 a(q)`` with tau growing while the residual falls.  Where nothing touches (J = 0) this is a
   walk along the force, and where something does it is Newton's method.  (Kelley and Keyes, SIAM J. Numer. Anal. 35
   (1998) 508, doi:10.1137/S0036142996304796.)
3. Position magnitude: the largest coordinate among these equilibria and the initial state; for a bearing, half the
   clearance and the deflection.  Velocity magnitude: ``sqrt(acceleration x position)``, the speed gained on falling
   through that distance; for a linear oscillator, amplitude times natural frequency.
4. Stiffness: eigenvalues of the Jacobian at those equilibria, at rest and moving in each direction (laws that damp
   one way only show their damping only then).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

#: Moments at which equilibria are sought: the most loaded ones of the run.
LOADED_MOMENTS = 3

#: Most iterations of the continuation for one equilibrium.
ITERATIONS = 80


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Magnitudes and rates of a run.

    Attributes
    ----------
    magnitude : of each state, shape (states,) [units of the states]
    decay : fastest decay, the largest -Re(eigenvalue) seen [1/s]
    frequency : fastest natural frequency without damping [rad/s]
    """

    magnitude: np.ndarray
    decay: float
    frequency: float

    @property
    def stiffness(self) -> float:
        """Fastest decay over fastest natural frequency [1]; 2 and more is overdamped."""
        if self.frequency == 0.0:
            return math.inf if self.decay > 0.0 else 0.0
        return self.decay / self.frequency


#: (inputs u, state x) -> vector or matrix.
Field = Callable[[np.ndarray, np.ndarray], np.ndarray]


def find_scales(
    rhs: Field, jacobian: Field, inputs: Sequence[np.ndarray], initial: np.ndarray, horizon: float
) -> Scales:
    """Magnitudes and stiffness of a model of positions followed by velocities.

    Parameters
    ----------
    rhs, jacobian : right-hand side and its derivative along the states
    inputs : inputs at moments spread over the run
    initial : state at the start, shape (states,)
    horizon : a turn, or the run [s]; bounds the travel of a body that nothing holds
    """
    half = len(initial) // 2
    rest = np.concatenate([initial[:half], np.zeros(half)])
    accelerations = np.array([np.max(np.abs(rhs(u, rest)[half:])) for u in inputs])
    accelerations[~np.isfinite(accelerations)] = 0.0
    order = np.argsort(-accelerations, kind="stable")[:LOADED_MOMENTS]
    acceleration = float(accelerations[order[0]])
    loaded = [(inputs[k], _equilibrium(rhs, jacobian, inputs[k], rest)) for k in order]

    travel = [float(np.max(np.abs(x[:half]))) for _, x in loaded if x is not None]
    if not travel and acceleration > 0.0:  # nothing holds the body: what it travels in the time at hand
        travel = [acceleration * (horizon / (2.0 * math.pi)) ** 2]
    position = max([*travel, float(np.max(np.abs(initial[:half])))])
    speed = max(math.sqrt(acceleration * position), float(np.max(np.abs(initial[half:]))))
    # a model at rest without load: any magnitude will do
    position = position or speed * horizon / (2.0 * math.pi) or 1.0
    speed = speed or position * 2.0 * math.pi / horizon
    magnitude = np.concatenate([np.full(half, position), np.full(half, speed)])

    decay = frequency = 0.0
    for u, x in loaded:
        base = rest if x is None else x
        for kick in (np.zeros(half), *(sign * speed * unit for unit in np.eye(half) for sign in (1.0, -1.0))):
            matrix = jacobian(u, base + np.concatenate([np.zeros(half), kick]))
            if not np.all(np.isfinite(matrix)):
                continue
            decay = max(decay, float(np.max(-np.linalg.eigvals(matrix).real)))
            stiffness = np.linalg.eigvals(-matrix[half:, :half])
            frequency = max(frequency, math.sqrt(float(np.max(np.abs(stiffness)))))
    return Scales(magnitude=magnitude, decay=decay, frequency=frequency)


def _equilibrium(rhs: Field, jacobian: Field, u: np.ndarray, start: np.ndarray) -> np.ndarray | None:
    """State at rest with vanishing acceleration, or None when the continuation finds none."""
    half = len(start) // 2
    x = start.copy()
    force = rhs(u, x)[half:]
    size = first = float(np.linalg.norm(force))
    if size == 0.0:
        return x
    # the first step moves by a nanometre (or a nano of what else is moved): well inside any clearance
    tau = 1e-9 * (1.0 + float(np.max(np.abs(x[:half])))) / size
    for _ in range(ITERATIONS):
        stiffness = jacobian(u, x)[half:, :half]
        trial = x.copy()
        trial[:half] += np.linalg.solve(np.eye(half) / tau - stiffness, force)
        force_there = rhs(u, trial)[half:]
        size_there = float(np.linalg.norm(force_there))
        if not math.isfinite(size_there) or size_there > 1.5 * size:
            tau /= 8.0
            continue
        x, force = trial, force_there
        tau *= 4.0 * min(max(size / size_there if size_there else 1.0, 1.0), 16.0)
        size = size_there
        if size <= 1e-6 * first:
            return x
    return None
