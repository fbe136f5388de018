"""Directions of a run: input of the stepper to differentiate its steps along parameters.

The chain from a parameter goes through the derived constants (groove radius, elliptic integrals, stiffness), through
the phases, and through the times at which loads switch: where such a time moves, the derivative at fixed time jumps by
the difference of the rates before and after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, check_name
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import Segments, Tangents
from ballpass.runtime.request.direction_scales import direction_scales
from ballpass.runtime.request.locating import STEPPED_OVER, Kinks, stepper_for
from ballpass.runtime.request.request import check_memory
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import breakpoint_slopes
from ballpass.runtime.time.turning import Turning


class Chain:
    """Derivatives of the numbers of a run along parameters, all but those of the states.

    Parameters
    ----------
    model, numbers : the model and the run's numbers
    names : parameters, one direction each

    Attributes
    ----------
    names : as given
    moved_numbers : numbers that inputs depend on, by name, of each direction
    p, c : derivatives of parameters and derived constants, shapes (parameters, directions), (constants, directions)
    initial : of the states at the start, shape (states, directions)
    moved, stretch : of the time at which driver or shaft reach an angle: at t = 0, and how fast it grows with time,
        shape (directions,) each; zero where the speed changes [s/unit], [1/unit]

    Raises
    ------
    RequestError
        An unknown parameter.
    """

    def __init__(self, model: LoadedModel, numbers: Numbers, names: Sequence[str]) -> None:
        self._manifest = model.manifest
        self._values = numbers.values
        rows = {name: row for row, name in enumerate(numbers.parameters)}
        for name in names:
            check_name("parameter", name, rows)
        self.names = tuple(names)
        self.p = np.zeros((len(numbers.p), len(names)))
        for column, name in enumerate(names):
            self.p[rows[name], column] = 1.0
        self.c = np.zeros((0, len(names)))
        if len(numbers.c):
            by_parameters = model.kernel("constants_jac")({"p": numbers.p}).reshape(len(numbers.c), len(numbers.p))
            self.c = by_parameters @ self.p
        self._rows = rows
        self._constants = {info.name: row for row, info in enumerate(model.manifest.constants)}
        self.initial = np.zeros((len(model.states), len(names)))
        for row, name in enumerate(model.manifest.initial):
            self.initial[row] = self.p[rows[name]]
        self.moved, self.stretch = np.zeros(len(names)), np.zeros(len(names))
        named = timeline.names_of_inputs(model.manifest)
        slopes = np.array([self.derivative(name) for name in named]).reshape(len(named), len(names))
        self.moved_numbers = [dict(zip(named, column.tolist(), strict=True)) for column in slopes.T]
        info = timeline.driver_info(model.manifest)
        moving = () if info is None else timeline.names_of(info)
        steps = [{name: float(self.derivative(name)[column]) for name in moving} for column in range(len(names))]
        self._drivers = [
            Turning.of(info, timeline.along(numbers.values, moved)) if info and any(moved.values()) else None
            for moved in steps
        ]
        speed, mechanism = timeline.speed_name(model.manifest), model.manifest.mechanism
        if speed is not None and numbers.values[speed] != 0.0 and timeline.is_even(model.manifest, numbers.values):
            self.stretch = -self.derivative(speed) / numbers.values[speed]
            if mechanism is not None:
                self.moved = -self.derivative(mechanism.start_angle) / numbers.values[speed]

    def derivative(self, name: str) -> np.ndarray:
        """Derivative of a parameter or derived constant, shape (directions,)."""
        matrix, row = (self.p, self._rows) if name in self._rows else (self.c, self._constants)
        return np.asarray(matrix[row[name]])

    def inputs(self, times: np.ndarray) -> np.ndarray:
        """Derivative of the inputs at fixed times, the starts of segments; gates are flat.

        Parameters
        ----------
        times : ends of the segments, shape (segments + 1,) [s]

        Returns
        -------
        array, shape (segments, inputs, directions)
        """
        starts, middles = times[:-1], 0.5 * (times[:-1] + times[1:])
        u = np.zeros((len(starts), len(self._manifest.inputs), len(self.names)))
        for column, moved in enumerate(self.moved_numbers):
            u[:, :, column] = timeline.input_slopes(self._manifest, self._values, moved, starts, middles)
        return u

    def after(self, time: float, begin: float = 0.0) -> np.ndarray:
        """Derivative of the time at which as many turns are made since another, shape (directions,) [s/unit].

        Raises
        ------
        RequestError
            Driver or shaft stands there.
        """
        return np.array([0.0 if one is None else one.after_slope(time, begin) for one in self._drivers])

    def breakpoint(self, time: float) -> np.ndarray | None:
        """Derivative of the time of the breakpoint there, shape (directions,); None where no load switches [s/unit].

        Raises
        ------
        RequestError
            Several loads switch at that time, and a parameter moves one of them away from another.
        """
        edges, shifts = breakpoint_slopes(self._manifest, self._values, self.moved_numbers, time)
        if not edges:
            return None
        apart = np.ptp(shifts, axis=0) > 1e-9 * np.max(np.abs(shifts), axis=0)
        if np.any(apart):
            raise RequestError(
                f"At t = {time:.9g} s several loads switch at once ({', '.join(edges)}): the "
                f"motion has no derivative along {self.names[int(np.argmax(apart))]}, which moves only some of them. "
                "Move their edges apart, or differentiate by other parameters."
            )
        return np.asarray(shifts[0])


class Directions:
    """Directions of a run along parameters, as the driver takes them, and the derivatives it gives.

    Parameters
    ----------
    model, numbers : the model and the run's numbers
    names : parameters
    samples : number of samples of the run
    kinks : treatment of the kinks of the laws
    magnitude : of the states, shape (states,): follow one direction more, whose start is moved by the magnitudes of the
        positions, for `growth`.  It has no part in the choice of step sizes, and fills a lane that is free, if any

    Raises
    ------
    RequestError
        An unknown parameter, or derivatives that would not fit into memory.
    """

    def __init__(
        self,
        model: LoadedModel,
        numbers: Numbers,
        names: Sequence[str],
        samples: int,
        kinks: Kinks = STEPPED_OVER,
        magnitude: np.ndarray | None = None,
    ) -> None:
        self.chain = Chain(model, numbers, names)
        self.names = self.chain.names
        count, lanes = len(names), stepper_for(model, kinks, derivatives=True).lanes
        self._magnitude = magnitude
        self._lanes, self._blocks, self._count = lanes, -(-(count + (magnitude is not None)) // lanes), count
        self._check_memory(
            f"{samples} samples of derivatives of {len(model.states)} states by {count} parameters, as the driver "
            "writes them and as they are handed out, of",
            samples,
            2 * len(model.states),
        )
        self._x = self._blocked(self.chain.initial)
        if magnitude is not None:
            half = len(magnitude) // 2
            self._x[-1, :half, count % lanes] = magnitude[:half]
        self._height = max(len(model.manifest.inputs), 1)
        self.samples = np.zeros((samples, self._blocks, len(model.states), lanes))
        self._scales = partial(direction_scales, model.manifest, numbers.values, self.names)
        self._weight: np.ndarray | None = None
        self._rtol = 0.0

    @property
    def controlled(self) -> bool:
        """Whether the derivatives take part in the choice of step sizes."""
        return self._weight is not None

    def control(self, rtol: float, magnitude: np.ndarray) -> None:
        """Let the derivatives take part in the choice of step sizes.

        Parameters
        ----------
        rtol : error allowed in a step, relative to the states' magnitudes over the parameters' scales (see
            `ballpass.runtime.request.direction_scales`), or to the derivative itself where it is larger [1]
        magnitude : of the states, shape (states,)
        """
        self._rtol = rtol
        self._weight = self._blocked(self._scales(magnitude)[None, :] / (rtol * magnitude[:, None]))

    def _blocked(self, columns: np.ndarray) -> np.ndarray:
        """(rows, directions) to (blocks, rows, lanes); directions that fill the last block are zero."""
        padded = np.zeros((columns.shape[0], self._blocks * self._lanes))
        padded[:, : self._count] = columns
        blocks = padded.reshape(columns.shape[0], self._blocks, self._lanes)
        return np.ascontiguousarray(blocks.transpose(1, 0, 2))

    def _check_memory(self, what: str, rows: int, columns: int) -> None:
        """Refuse rows of so many columns along each direction, all lanes counted, that would not fit into memory."""
        check_memory(
            what,
            rows,
            columns * self._blocks * self._lanes,
            "Take fewer samples a cycle, a shorter run, or fewer parameters at a time.",
        )

    def tangents(self, segments: Segments, first: int, count: int) -> Tangents:
        """What the driver needs for `segments`, whose samples are `first` ... `first + count`.

        Raises
        ------
        RequestError
            It would not fit into memory.
        """
        starts = segments.times[:-1]
        self._check_memory(
            f"{len(starts)} segments in one call, with derivatives of their inputs and starts by {self._count} "
            "parameters, of",
            len(starts),
            self._height + 2,
        )
        u = np.zeros((len(starts), self._blocks, self._height, self._lanes))
        shift, moved = (np.zeros((len(starts), self._blocks, self._lanes)) for _ in range(2))
        first_moved, stretch = (self._blocked(row[None, :])[:, 0] for row in (self.chain.moved, self.chain.stretch))
        for k, inputs in enumerate(self.chain.inputs(segments.times)):
            u[k, :, : len(inputs)] = self._blocked(inputs)
            moved[k] = first_moved + starts[k] * stretch
            if segments.restarts[k] and starts[k] > 0.0:
                switch = self.chain.breakpoint(float(starts[k]))
                if switch is not None:
                    shift[k] = self._blocked(switch[None, :])[:, 0]
        return Tangents(
            p=self._blocked(self.chain.p),
            c=self._blocked(self.chain.c),
            u=u,
            shift=shift,
            moved=moved,
            stretch=stretch,
            x=self._x,
            outputs=self.samples[first : first + count],
            weight=self._weight,
            rtol=self._rtol,
        )

    def growth(self) -> float:
        """Largest change of the states by the moved start, at samples and at the run's end, in the magnitudes [1]."""
        assert self._magnitude is not None
        lane = self._count % self._lanes
        followed = np.vstack([self.samples[:, -1, :, lane], self._x[-1, :, lane]])
        return float(np.max(np.abs(followed) / self._magnitude))

    def states(self, finished: int) -> np.ndarray:
        """Derivatives of the states at the samples, shape (finished, states, parameters)."""
        found = np.empty((finished, self.samples.shape[2], self._count))
        # block by block: a transposed array would be copied on the way
        for block, first in enumerate(range(0, self._count, self._lanes)):
            columns = found[:, :, first : first + self._lanes]
            columns[:] = self.samples[:finished, block, :, : columns.shape[2]]
        return found
