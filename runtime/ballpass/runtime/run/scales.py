"""How large the states get and how stiff the model is, asked of the model itself.

Tolerances are relative to magnitudes.  With magnitudes taken from the momentary state, an error control asks for
nonsense when a coordinate passes zero; so they are found once a run, from the model's own right-hand side, at the
moments that load it most:

1. The moments with the largest acceleration at the initial positions, at rest, are picked from the run.
2. At each, the positions of static equilibrium are found (`equilibrium_newton`).  What has to fall is the residual of
   the accelerations; where that gets stuck, that of the forces: a ring of a milligramme has enormous accelerations on
   the way.  The walk ends where both rings have gone too far for the distance between them to be told: nothing holds
   them, but the balls between them have found their deflection.
3. Position magnitude: the largest coordinate among these equilibria and the initial state; for a bearing, half the
   clearance and the deflection.  At most `SOFT` times the largest distance of the two rings' centres: in a soft
   housing both move far, and the balls feel the small difference.  Velocity magnitude: ``sqrt(acceleration x
   position)``, the speed gained on falling through that distance; for a linear oscillator, amplitude times natural
   frequency.
4. Stiffness: eigenvalues of the Jacobian at those equilibria, at rest and moving in each direction (laws that damp
   one way only show their damping only then).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.run.equilibrium_newton import Rest, settle

#: Moments at which equilibria are sought: the most loaded ones of the run.
LOADED_MOMENTS = 3

#: Most iterations of the continuation for one equilibrium.
ITERATIONS = 80

#: Residual left over, relative to that at the start [1].
SETTLED = 1e-6

#: Largest coordinate over the distance between the rings' centres at which that distance still has digits [1].
FAR = 1e9

#: Most that a position's magnitude may be of the distance between the rings' centres [1].
SOFT = 10.0


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
    rhs: Field,
    jacobian: Field,
    inputs: Sequence[np.ndarray],
    initial: np.ndarray,
    horizon: float,
    masses: Sequence[float] | None = None,
) -> Scales:
    """Magnitudes and stiffness of a model of positions followed by velocities.

    Parameters
    ----------
    rhs, jacobian : right-hand side and its derivative along the states
    inputs : inputs at moments spread over the run
    initial : state at the start, shape (states,)
    horizon : a turn, or the run [s]; bounds the travel of a body that nothing holds
    masses : of the coordinates [kg].  Default: equal ones
    """
    # numbers that overflow end a search or a run further down, with words
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _find_scales(rhs, jacobian, inputs, initial, horizon, masses)


def _find_scales(
    rhs: Field,
    jacobian: Field,
    inputs: Sequence[np.ndarray],
    initial: np.ndarray,
    horizon: float,
    masses: Sequence[float] | None,
) -> Scales:
    half = len(initial) // 2
    rest = np.concatenate([initial[:half], np.zeros(half)])
    accelerations = np.array([np.max(np.abs(rhs(u, rest)[half:])) for u in inputs])
    accelerations[~np.isfinite(accelerations)] = 0.0
    order = np.argsort(-accelerations, kind="stable")[:LOADED_MOMENTS]
    acceleration = float(accelerations[order[0]])
    # what a body travels in the time at hand where nothing holds it
    reach = acceleration * (horizon / (2.0 * math.pi)) ** 2
    weights = np.ones(half) if masses is None else np.array(masses, dtype=float)
    loaded = []
    for k in order:
        end = _equilibrium(rhs, jacobian, inputs[k], rest, np.ones(half))
        if end is None:
            end = _equilibrium(rhs, jacobian, inputs[k], rest, weights)
        loaded.append((inputs[k], *(end or (rest, False))))

    travel = [float(np.max(np.abs(x[:half]))) for _, x, held in loaded if held]
    if not travel or acceleration == 0.0:
        # its load pushes the body, and its initial velocity carries it
        travel += [reach, float(np.max(np.abs(initial[half:]))) * horizon / (2.0 * math.pi)]
    position = max([*travel, float(np.max(np.abs(initial[:half])))])
    apart = max(_apart(x) for x in (initial, *(x for _, x, _ in loaded)))
    if half > 2 and apart > 0.0:
        position = min(position, SOFT * apart)
    speed = max(math.sqrt(acceleration * position), float(np.max(np.abs(initial[half:]))))
    # a model at rest without load: any magnitude will do
    position = position or speed * horizon / (2.0 * math.pi) or 1.0
    speed = speed or position * 2.0 * math.pi / horizon
    magnitude = np.concatenate([np.full(half, _rounded(position)), np.full(half, _rounded(speed))])

    decay = frequency = 0.0
    for u, base, _ in loaded:
        for kick in (np.zeros(half), *(sign * speed * unit for unit in np.eye(half) for sign in (1.0, -1.0))):
            matrix = jacobian(u, base + np.concatenate([np.zeros(half), kick]))
            if not np.all(np.isfinite(matrix)):
                continue
            decay = max(decay, float(np.max(-np.linalg.eigvals(matrix).real)))
            stiffness = np.linalg.eigvals(-matrix[half:, :half])
            frequency = max(frequency, math.sqrt(float(np.max(np.abs(stiffness)))))
    return Scales(magnitude=magnitude, decay=decay, frequency=frequency)


def _apart(x: np.ndarray) -> float:
    """Distance between the centres of the rings, the larger component; of one ring to the fixed other [m]."""
    return float(np.max(np.abs(x[:2] - x[2:4]))) if len(x) == 8 else float(np.max(np.abs(x[: len(x) // 2])))


def _equilibrium(
    rhs: Field, jacobian: Field, u: np.ndarray, start: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, bool] | None:
    """State at rest with vanishing acceleration, True; or where both rings got to as nothing holds them, False.

    None when the continuation gets nowhere.
    """
    half = len(start) // 2

    def state(q: np.ndarray) -> np.ndarray:
        return np.concatenate([q, np.zeros(half)])

    first = float(np.linalg.norm(weights * rhs(u, start)[half:]))
    found = settle(
        lambda q: rhs(u, state(q))[half:],
        lambda q: -jacobian(u, state(q))[half:, :half],
        start[:half],
        weights=weights,
        done=lambda _q, net, _k: float(np.linalg.norm(weights * net)) <= SETTLED * first,
        gone=lambda q: float(np.max(np.abs(q))) > FAR * _apart(state(q)),
        iterations=ITERATIONS,
    )
    return None if found.end is Rest.STUCK else (state(found.q), found.end is Rest.FOUND)


def _rounded(value: float) -> float:
    """To twelve bits: an equilibrium is known to a part in a million, and the last digits of its size should not decide
    about the last digits of the motion."""
    part, exponent = math.frexp(value)
    return math.ldexp(float(np.rint(part * 4096.0)) / 4096.0, exponent)
