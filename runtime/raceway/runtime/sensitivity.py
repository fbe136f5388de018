"""Forward sensitivities of a run: derivatives of the states by parameters, exact for the discrete solution.

In: a model, numbers of a run, names of parameters.  Out: `Sensitivities`.  The stepper differentiates each accepted
step line by
line at fixed step size, many parameters in one pass.  The chain from a parameter goes through the derived constants
(groove radius, elliptic integrals, stiffness), through the phases, and through the times at which loads switch: where
such a time moves, the derivative at fixed time jumps by the difference of the rates before and behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from raceway.runtime import clock
from raceway.runtime.errors import RequestError
from raceway.runtime.parameters import unknown_name
from raceway.runtime.stepper import METHODS, Segments, Tangents

if TYPE_CHECKING:
    from raceway.runtime.model import Model
    from raceway.runtime.simulate import Numbers, Request
    from raceway.runtime.solution import Solution


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivities:
    """A solution and the derivatives of its states.

    Attributes
    ----------
    solution : the run itself
    names : parameters, in the order of the last axis
    x : derivative of each state at fixed time, shape (samples, states, parameters) [state's unit / parameter's unit]
    """

    solution: Solution
    names: tuple[str, ...]
    x: np.ndarray

    def __getitem__(self, key: tuple[str, str]) -> np.ndarray:
        """Derivative of a state by a parameter, ``s["inner.y", "bearing.clearance"]``, shape (samples,)."""
        state, parameter = key
        states = self.solution.states
        if state not in states:
            raise RequestError(unknown_name("state", state, states))
        if parameter not in self.names:
            raise RequestError(unknown_name("parameter of this sensitivity", parameter, self.names))
        return np.asarray(self.x[:, states.index(state), self.names.index(parameter)])


class Directions:
    """Directions of a run along parameters, as the driver takes them, and the derivatives it gives.

    Parameters
    ----------
    model, numbers : the model and the run's numbers
    names : parameters
    samples : number of samples of the run
    """

    def __init__(self, model: Model, numbers: Numbers, names: Sequence[str], samples: int) -> None:
        self._inputs = model.manifest.inputs
        self._values = numbers.values
        rows = {name: row for row, name in enumerate(numbers.parameters)}
        for name in names:
            if name not in rows:
                raise RequestError(unknown_name("parameter", name, rows))
        self.names = tuple(names)
        count, lanes = len(names), model.differentiating_stepper.lanes
        self._lanes, self._blocks, self._count = lanes, -(-count // lanes), count
        #: dp/d(direction), dc/d(direction), one column for each direction; padding directions are zero
        self._p = np.zeros((len(numbers.p), self._blocks * lanes))
        for column, name in enumerate(names):
            self._p[rows[name], column] = 1.0
        by_parameters = model.kernel("constants_jac")({"p": numbers.p}).reshape(len(numbers.c), len(numbers.p))
        self._c = by_parameters @ self._p
        self._rows = rows
        self._constants = {info.name: row for row, info in enumerate(model.manifest.constants)}
        initial = np.zeros((len(model.states), self._blocks * lanes))
        for row, name in enumerate(model.manifest.initial):
            initial[row] = self._p[rows[name]]
        self._x = self._blocked(initial)
        self.samples = np.zeros((samples, self._blocks, len(model.states), lanes))

    def _blocked(self, columns: np.ndarray) -> np.ndarray:
        """(rows, directions) to (blocks, rows, lanes)."""
        blocks = columns.reshape(columns.shape[0], self._blocks, self._lanes)
        return np.ascontiguousarray(blocks.transpose(1, 0, 2))

    def _derivative(self, name: str) -> np.ndarray:
        """Derivative of a parameter or derived constant along all directions."""
        matrix, row = (self._p, self._rows) if name in self._rows else (self._c, self._constants)
        return np.asarray(matrix[row[name]])

    def tangents(self, segments: Segments, first: int, count: int) -> Tangents:
        """What the driver needs for `segments`, whose samples are `first` ... `first + count`."""
        starts = segments.times[:-1]
        u = np.zeros((len(starts), max(len(self._inputs), 1), self._p.shape[1]))
        shift = np.zeros((len(starts), self._p.shape[1]))
        for k, start in enumerate(starts):
            for row, name, slope in clock.input_derivatives(self._inputs, self._values, float(start)):
                u[k, row] += slope * self._derivative(name)
            if segments.restarts[k] and start > 0.0:
                for name, slope in clock.breakpoint_derivative(self._inputs, self._values, float(start)):
                    shift[k] += slope * self._derivative(name)
        shape = (len(starts), u.shape[1], self._blocks, self._lanes)
        return Tangents(
            p=self._blocked(self._p),
            c=self._blocked(self._c),
            u=np.ascontiguousarray(u.reshape(shape).transpose(0, 2, 1, 3)),
            shift=np.ascontiguousarray(shift.reshape(len(starts), self._blocks, self._lanes)),
            x=self._x,
            outputs=self.samples[first : first + count],
        )

    def states(self, finished: int) -> np.ndarray:
        """Derivatives of the states at the samples, shape (finished, states, parameters)."""
        blocks = self.samples[:finished].transpose(0, 2, 1, 3)
        return np.ascontiguousarray(blocks.reshape(finished, blocks.shape[1], -1)[:, :, : self._count])


def sensitivities(model: Model, numbers: Numbers, request: Request, names: Sequence[str]) -> Sensitivities:
    """Run a model with its derivatives along parameters.

    Raises
    ------
    RequestError
        An unknown parameter, a method that is not the stepper's, a law whose force jumps.
    IntegrationError
        The computation failed.
    """
    from raceway.runtime.simulate import simulate

    jumping = [law for law, smoothness in model.manifest.smoothness if smoothness == "discontinuous"]
    if jumping:
        raise RequestError(
            f"sensitivities: the {' and '.join(jumping)} law of this scene is discontinuous (its force jumps at "
            "contact), so the derivative of the steps is not that of the motion. Take the law tangent or one-sided."
        )
    method = request.method or model.manifest.run.method
    if method not in ("auto", *METHODS):
        raise RequestError(
            f"sensitivities: the method {method!r} was given; allowed are auto, {', '.join(METHODS)}, which "
            "differentiate their own steps."
        )
    if not names:
        raise RequestError("sensitivities: no parameter was named. Give the names of one or more parameters.")
    made: list[Directions] = []

    def prepare(samples: int) -> Directions:
        made.append(Directions(model, numbers, names, samples))
        return made[0]

    solution = simulate(model, numbers, request, prepare)
    return Sensitivities(solution=solution, names=tuple(names), x=made[0].states(len(solution)))
