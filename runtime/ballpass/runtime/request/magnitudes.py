"""Magnitudes of the states of a run, and stiffness of a model, from its own right-hand side.

In: a model, numbers, the length of a run.  Out: one magnitude for each state, which tolerances are relative to.  Where
the stepper runs, its own C finds them (`driver/scales.h`); elsewhere Python does, and with them the rates that show
whether a model is stiff.

Tolerances are relative to magnitudes.  With magnitudes taken from the current state, the allowed error would
vanish when a coordinate passes zero; so they are found once a run, from the model's own right-hand side, at the
moments that load it most.

Coordinates that share a magnitude make a group, as the rings of a bearing do; some have a partner, as the other ring's
coordinate along the same axis.  An angle, which grows as the driver turns, has the magnitude of a radian; moments are
spread over a turn of it, it keeps its initial velocity, and stays where it is while an equilibrium is sought.  So does
the lag of a cage, a velocity that is an angle.

The steps:

1. For each group the moments with its largest acceleration at the initial positions, at rest, are picked from the run.
2. At each, the positions of static equilibrium are found (`equilibrium_newton`).  The residual of the accelerations
   has to fall; where it does not, that of the forces: a ring of a milligramme has enormous accelerations on the way.
   The search ends where both rings have moved so far that rounding hides the distance between them: nothing holds
   them, but the balls between them have reached their deflection.
3. Position magnitude: the group's largest coordinate among these equilibria and the initial state; for a bearing, half
   the clearance and the deflection.  At most `SOFT` times the largest difference between partners: in a soft housing
   both rings move far, and the balls feel the small difference.  Velocity magnitude: ``sqrt(acceleration x
   position)``, the speed after that acceleration over that distance; for a linear oscillator, amplitude times natural
   frequency.
4. Stiffness: eigenvalues of the Jacobian at those equilibria, at rest and moving in each direction (laws that damp
   one way only show their damping only then).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.member_schedule import MOMENTS
from ballpass.runtime.native.stepper import Stepper
from ballpass.runtime.request.equilibrium_newton import SearchEnd, settle
from ballpass.runtime.request.segments import segment_edges
from ballpass.runtime.time import timeline

#: Moments at which equilibria are sought: the most loaded ones of the run.
LOADED_MOMENTS = 3

#: Most iterations of the continuation for one equilibrium.
ITERATIONS = 80

#: Allowed residual, relative to that at the start [1].
SETTLED = 1e-6

#: Largest coordinate over the difference to its partner at which that difference still has digits [1].
FAR = 1e9

#: Magnitude of an angle [rad].
RADIAN = 1.0

#: Most that a position's magnitude may be of the difference between partners [1].
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


@dataclass(frozen=True, slots=True)
class Groups:
    """Coordinates that share a magnitude.

    Attributes
    ----------
    members : coordinates of each group
    partners : of each coordinate the one whose difference to it counts, -1 where there is none
    angles : whether each coordinate is an angle, or has a velocity that is one
    lags : whether it is the latter
    """

    members: dict[str, np.ndarray]
    partners: np.ndarray
    angles: np.ndarray
    lags: np.ndarray

    def apart(self, group: str, x: np.ndarray) -> float:
        """Largest difference between coordinates of a group and their partners."""
        own = self.members[group]
        other = np.where(self.partners[own] >= 0, x[self.partners[own]], 0.0)
        return float(np.max(np.abs(x[own] - other)))

    def gone(self, x: np.ndarray) -> bool:
        """Whether a group has moved so far that rounding hides the differences in it."""
        return any(np.max(np.abs(x[own])) > FAR * self.apart(name, x) for name, own in self.members.items())


#: (inputs u, state x) -> vector or matrix.
Field = Callable[[np.ndarray, np.ndarray], np.ndarray]


# numbers that overflow end a search or a run later, with a message
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _find_scales(
    rhs: Field,
    jacobian: Field,
    inputs: Sequence[np.ndarray],
    initial: np.ndarray,
    horizon: float,
    groups: Groups,
    masses: Sequence[float] | None = None,
) -> Scales:
    """Magnitudes and stiffness of a model of positions followed by velocities.

    Parameters
    ----------
    rhs, jacobian : right-hand side and its derivative along the states
    inputs : inputs at moments spread over the run
    initial : state at the start, shape (states,)
    horizon : a turn, or the run [s]; bounds the travel of an unsupported body
    groups : which coordinates share a magnitude
    masses : of the coordinates [kg].  Default: equal ones
    """
    half = len(initial) // 2
    turns = np.concatenate([groups.angles, np.zeros(half, dtype=bool)])
    rest = np.concatenate([initial[:half], np.where(groups.angles, initial[half:], 0.0)])
    rests = [rest + turns * (2.0 * math.pi * i / len(inputs)) for i in range(len(inputs))]
    accelerations = np.abs([rhs(u, x)[half:] for u, x in zip(inputs, rests, strict=True)])
    weights = np.ones(half) if masses is None else np.array(masses, dtype=float)
    ranked = {}
    for name, members in groups.members.items():
        size = np.max(accelerations[:, members], axis=1)
        size[~np.isfinite(size)] = 0.0
        order = np.argsort(-size, kind="stable")[:LOADED_MOMENTS]
        ranked[name] = (order, float(size[order[0]]))
    loaded = []
    for k in dict.fromkeys(k for order, _ in ranked.values() for k in order.tolist()):
        end = _equilibrium(rhs, jacobian, groups, inputs[k], rests[k], np.ones(half))
        if end is None:
            end = _equilibrium(rhs, jacobian, groups, inputs[k], rests[k], weights)
        loaded.append((inputs[k], *(end or (rests[k], False))))
    held = [x for _, x, is_held in loaded if is_held]
    magnitude = np.empty(2 * half)
    for name, members in groups.members.items():
        acceleration, moving = ranked[name][1], float(np.max(np.abs(initial[half + members])))
        position = max(float(np.max(np.abs(x[members]))) for x in (initial, *held))
        # nothing holds the body: its load pushes it, and its initial velocity carries it
        if not held:
            position = max(position, acceleration * (horizon / (2.0 * math.pi)) ** 2)
        if not held or acceleration == 0.0:
            position = max(position, moving * horizon / (2.0 * math.pi))
        apart = max(groups.apart(name, x) for x in (initial, *(x for _, x, _ in loaded)))
        if np.any(groups.partners[members] >= 0) and apart > 0.0:
            position = min(position, SOFT * apart)
        if np.any(groups.angles[members]):
            position = RADIAN
        speed = max(math.sqrt(acceleration * position), moving)
        # a model at rest without load: any magnitude will do
        position = position or speed * horizon / (2.0 * math.pi) or 1.0
        speed = speed or position * 2.0 * math.pi / horizon
        if np.any(groups.lags[members]):
            position, speed = horizon / (2.0 * math.pi), RADIAN
        magnitude[members], magnitude[half + members] = _rounded(position), _rounded(speed)

    decay = frequency = 0.0
    for u, base, _ in loaded:
        for kick in (np.zeros(half), *np.diag(magnitude[half:]), *np.diag(-magnitude[half:])):
            matrix = jacobian(u, base + np.concatenate([np.zeros(half), kick]))
            if not np.all(np.isfinite(matrix)):
                continue
            decay = max(decay, float(np.max(-np.linalg.eigvals(matrix).real)))
            stiffness = np.linalg.eigvals(-matrix[half:, :half])
            frequency = max(frequency, math.sqrt(float(np.max(np.abs(stiffness)))))
    return Scales(magnitude=magnitude, decay=decay, frequency=frequency)


def _equilibrium(
    rhs: Field, jacobian: Field, groups: Groups, u: np.ndarray, start: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, bool] | None:
    """State at rest with vanishing acceleration, True; or the last one where nothing holds a group, False.

    None when the continuation fails.
    """
    half = len(start) // 2
    free = ~groups.angles

    def state(q: np.ndarray) -> np.ndarray:
        return np.concatenate([q, start[half:]])

    first = float(np.linalg.norm(weights * free * rhs(u, start)[half:]))
    found = settle(
        lambda q: free * rhs(u, state(q))[half:],
        lambda q: -jacobian(u, state(q))[half:, :half] * np.outer(free, free),
        start[:half],
        weights=weights,
        done=lambda _q, net, _k: float(np.linalg.norm(weights * net)) <= SETTLED * first,
        gone=groups.gone,
        iterations=ITERATIONS,
        free=0.0,
    )
    return None if found.end is SearchEnd.STUCK else (state(found.q), found.end is SearchEnd.FOUND)


def _rounded(value: float) -> float:
    """To twelve bits: an equilibrium is known to a part in a million, and the last digits of its size should not decide
    about the last digits of the motion."""
    part, exponent = math.frexp(value)
    return math.ldexp(float(np.rint(part * 4096.0)) / 4096.0, exponent)


def stepper_magnitudes(
    model: LoadedModel,
    stepper: Stepper,
    numbers: Numbers,
    initial: np.ndarray,
    duration: float,
    turn: float,
    begin: float = 0.0,
) -> np.ndarray:
    """Magnitudes as the stepper finds them, shape (states,).

    Parameters
    ----------
    stepper : one of the model's
    initial : state at the start, shape (states,)
    duration, turn, begin : of the run, of a turn, and time at the start [s]
    """
    inputs, horizon = _moments(model, numbers, duration, turn, begin)
    return stepper.magnitudes(numbers.p, numbers.c, initial, inputs, horizon)


def model_scales(
    model: LoadedModel, numbers: Numbers, initial: np.ndarray, duration: float, turn: float, begin: float = 0.0
) -> Scales:
    """Magnitudes and stiffness of a run, by Python.

    Parameters
    ----------
    initial : state at the start, shape (states,)
    duration, turn, begin : of the run, of a turn, infinite where nothing turns, and time at the start [s]
    """
    inputs, horizon = _moments(model, numbers, duration, turn, begin)
    fixed = {"t": 0.0, "p": numbers.p, "c": numbers.c}
    rhs, jacobian = model.kernel("rhs"), model.kernel("rhs_jac_x")
    return _find_scales(
        lambda u, x: rhs({**fixed, "u": u, "x": x}),
        lambda u, x: jacobian({**fixed, "u": u, "x": x}).reshape(len(x), len(x)),
        list(inputs),
        initial,
        horizon,
        _groups(model.manifest),
        np.diag(mass_matrix(model, {**fixed, "u": inputs[0], "x": initial})).tolist()
        if model.manifest.bearings
        else None,
    )


def _groups(manifest: Manifest) -> Groups:
    names = [info.name for info in manifest.coordinates]
    kinds = np.array([info.group for info in manifest.coordinates])
    return Groups(
        {str(group): np.flatnonzero(kinds == group) for group in dict.fromkeys(kinds)},
        np.array([names.index(info.partner) if info.partner else -1 for info in manifest.coordinates]),
        np.array([info.kind != "displacement" for info in manifest.coordinates], dtype=bool),
        np.array([info.kind == "lag" for info in manifest.coordinates], dtype=bool),
    )


def mass_matrix(model: LoadedModel, there: Mapping[str, object]) -> np.ndarray:
    """Mass matrix where t, x, u, p and c are those given, shape (coordinates, coordinates)."""
    size = len(model.states) // 2
    return np.asarray(model.kernel("mass_matrix")(there)).reshape(size, size)


def _moments(
    model: LoadedModel,
    numbers: Numbers,
    duration: float,
    turn: float,
    begin: float,
) -> tuple[np.ndarray, float]:
    """Inputs at the moments, shape (moments, inputs), and the time that bounds travel [s]."""
    horizon = min(duration, turn)
    edges = segment_edges(model, numbers, begin, begin + duration, turn)
    middles = 0.5 * (edges[:-1] + edges[1:])
    if len(middles) > MOMENTS:
        middles = middles[np.linspace(0, len(middles) - 1, MOMENTS).astype(int)]
    moments = np.concatenate([middles, begin + horizon * (np.arange(MOMENTS) + 0.5) / MOMENTS])
    return timeline.inputs_over(model.manifest, numbers.values, moments, moments), horizon
