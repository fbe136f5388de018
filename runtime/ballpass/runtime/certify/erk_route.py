"""Derivatives through CasADi's ``erk`` with fixed steps: another integrator, differentiated by other code.

In: a study, numbers, names of parameters.  Out: derivatives of all quantities, with an uncertainty.

Between neighbouring nodes the motion is integrated over a normalised time, so that the length of the interval is a
parameter like any other.  The state is then followed along nodes that move, and no jump term is needed anywhere: where
a load switches, intervals end.  The stepper's derivatives, taken at fixed time with jumps at the edges, are compared
with that.  "forward" carries all directions along the run; "adjoint" goes back once for each quantity.

The uncertainty is the distance to the result with half as many steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.track import Stepping, Track
from ballpass.runtime.certify.certificate import Second
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import Family
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.sensitivity import Chain

if TYPE_CHECKING:
    from ballpass.runtime.ask.study import Course, Prepared, Study
    from ballpass.runtime.run.scales import Scales

Array = NDArray[np.float64]

#: Step size times the fastest rate of the model, at most, in the run that is told; the other's steps are twice as long.
REACH = 0.3

#: Directions carried in one pass.
TOGETHER = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Intervals:
    """Stretches between neighbouring nodes.

    Attributes
    ----------
    times : their ends, shape (n + 1,) [s]
    numbers : parameter vector of each, length, scale, u, p, c; shape (rows, n)
    slopes : derivatives of these along the directions, shape (rows, n, directions)
    """

    times: Array
    numbers: Array
    slopes: Array


def by_erk(
    study: Study,
    numbers: Numbers,
    names: Sequence[str],
    scales: Scales,
    *,
    direction: Literal["forward", "adjoint"],
    progress: Callable[[float], None] | None = None,
) -> Second:
    """Derivatives of a study's quantities along parameters, shape (quantities, parameters).

    Raises
    ------
    RequestError
        Quantities at which two balls change rank, which the adjoint does not follow.
    SimulationError
        The computation failed.
    """
    told = progress or (lambda _fraction: None)
    chain = Chain(study.model, numbers, names)
    magnitude = scales.magnitude
    # extremes and kinks are located by the stepper: where they are is no derivative
    stepping = Stepping(family=Family.AUTO, rtol=1e-11, magnitude=magnitude)
    found = []
    prepared = study.prepare(numbers, chain, stepping, from_start=True)
    longest = float(np.max(np.diff(np.unique(prepared.nodes.t)))) if prepared is not None else 0.0
    steps = max(1, math.ceil(longest * max(scales.frequency, scales.decay) / (2.0 * REACH)))
    for part, finer in enumerate((1, 2)):
        follow = _Follower(study.model, numbers, chain, magnitude, steps * finer)
        if prepared is None:
            course = study.differentiate(numbers, names, stepping)
            found.append(np.array([item.slope for item in course.estimates]))
        elif direction == "forward":
            course = study.finish(prepared, follow.forward(prepared))
            found.append(np.array([item.slope for item in course.estimates]))
        else:
            found.append(_adjoint(study, prepared, follow))
        told(0.5 * (part + 1))
    return Second(route=f"erk {direction}", value=found[1], uncertainty=np.abs(found[1] - found[0]))


def _adjoint(study: Study, prepared: Prepared, follow: _Follower) -> Array:
    """Derivatives of all quantities: explicit parts, and the states' part by going back."""
    plain = follow.plain(prepared)
    course: Course = study.finish(prepared, plain)
    slopes = np.array([item.slope for item in course.estimates])
    for row, quantity in enumerate(study.quantities):
        weights = study.state_weights(prepared, plain, quantity)
        if weights is not None:
            slopes[row] += follow.back(prepared, plain, weights)
    return slopes


class _Follower:
    """Runs of one model along nodes with a number of fixed steps between neighbours."""

    def __init__(self, model: LoadedModel, numbers: Numbers, chain: Chain, magnitude: Array, steps: int) -> None:
        self._model, self._numbers, self._chain, self._magnitude = model, numbers, chain, magnitude
        self._integrator = make_fixed_erk(model, steps)

    def _intervals(self, prepared: Prepared) -> tuple[Intervals, NDArray[np.int_]]:
        """Intervals between the nodes' distinct times, from the run's start on, and the place of each node."""
        nodes = prepared.nodes
        times, first, back = np.unique(nodes.t, return_index=True, return_inverse=True)
        if times[0] > 0.0:
            raise RequestError("erk: the nodes do not begin with the run.")
        slopes = nodes.slope[first]
        manifest, values, chain = self._model.manifest, self._numbers.values, self._chain
        begin, end = times[:-1], times[1:]
        inputs = manifest.inputs
        u = clock.inputs_over(inputs, values, begin, 0.5 * (begin + end))
        rates = np.array([_input_rates(inputs, values, 0.5 * (a + b)) for a, b in zip(begin, end, strict=True)])
        count, directions = len(begin), len(chain.names)
        rates = rates.reshape(count, len(inputs))
        by_names = np.array([chain.inputs(float(a)) for a in begin]).reshape(count, len(inputs), directions)
        moved = by_names + rates[:, :, None] * slopes[:-1, None, :]
        fixed = np.concatenate([self._numbers.p, self._numbers.c])
        fixed_slopes = np.concatenate([chain.p, chain.c])
        rows = np.concatenate(
            [
                (end - begin)[None, :],
                np.repeat(self._magnitude[:, None], count, axis=1),
                u.T,
                np.repeat(fixed[:, None], count, axis=1),
            ]
        )
        row_slopes = np.concatenate(
            [
                np.diff(slopes, axis=0)[None],
                np.zeros((len(self._magnitude), count, directions)),
                moved.transpose(1, 0, 2),
                np.repeat(fixed_slopes[:, None, :], count, axis=1),
            ]
        )
        return Intervals(times=times, numbers=rows, slopes=row_slopes), back

    def _start(self) -> Array:
        names = self._model.manifest.initial
        return np.array([self._numbers.values[name] for name in names]) / self._magnitude

    def _run(self, intervals: Intervals) -> tuple[casadi.Function, Array]:
        chained = self._integrator.mapaccum("chained", intervals.numbers.shape[1])
        try:
            return chained, np.asarray(chained(self._start(), intervals.numbers).full())
        except RuntimeError as fault:
            raise SimulationError(
                "erk: fixed steps do not follow this motion; it is stiff, or grows without bound. Take the route "
                "differences."
            ) from fault

    def _track(self, prepared: Prepared, x: Array, slope: Array, back: NDArray[np.int_]) -> Track:
        nodes, edges = prepared.nodes, prepared.edges
        inputs, values = self._model.manifest.inputs, self._numbers.values
        u = clock.inputs_over(inputs, values, edges.times[:-1], 0.5 * (edges.times[:-1] + edges.times[1:]))
        u = u[nodes.segment]
        moved = slope[back]
        still = np.zeros((len(nodes), x.shape[1]))
        local = nodes.t - edges.times[nodes.segment]
        return Track(
            nodes=nodes, edges=edges, x=x[back], slope=moved, fixed=moved, rate=still, local=local, u=u, steps=0
        )

    def plain(self, prepared: Prepared) -> Track:
        """The run with states that do not move."""
        intervals, back = self._intervals(prepared)
        _, ends = self._run(intervals)
        x = np.column_stack([self._start(), ends]).T * self._magnitude
        return self._track(prepared, x, np.zeros((*x.shape, len(self._chain.names))), back)

    def forward(self, prepared: Prepared) -> Track:
        """The run with all directions."""
        intervals, back = self._intervals(prepared)
        chained, ends = self._run(intervals)
        count, directions = ends.shape[1], len(self._chain.names)
        x = np.column_stack([self._start(), ends]).T * self._magnitude
        slope = np.zeros((count + 1, len(self._magnitude), directions))
        slope[0] = self._chain.initial
        for first in range(0, directions, TOGETHER):
            some = range(first, min(first + TOGETHER, directions))
            seeds = np.concatenate([intervals.slopes[:, :, k] for k in some], axis=1)
            at_start = self._chain.initial[:, list(some)] / self._magnitude[:, None]
            moved = chained.forward(len(some))(self._start(), intervals.numbers, ends, at_start, seeds).full()
            for place, k in enumerate(some):
                slope[1:, :, k] = moved[:, place * count : (place + 1) * count].T * self._magnitude
        return self._track(prepared, x, slope, back)

    def back(self, prepared: Prepared, track: Track, weights: Array) -> Array:
        """Sum over nodes of weights times the states' derivatives, shape (directions,), by the adjoint."""
        intervals, back = self._intervals(prepared)
        chained, ends = self._run(intervals)
        seeds = np.zeros((ends.shape[1] + 1, ends.shape[0]))
        np.add.at(seeds, back, weights * self._magnitude)
        adjoint = chained.reverse(1)(self._start(), intervals.numbers, ends, seeds[1:].T)
        by_start, by_numbers = (np.asarray(item.full()) for item in adjoint)
        start = self._chain.initial / self._magnitude[:, None]
        total = (by_start[:, 0] + seeds[0]) @ start
        return np.asarray(total + np.einsum("ri,rid->d", by_numbers, intervals.slopes))


def make_fixed_erk(model: LoadedModel, steps: int) -> casadi.Function:
    """``erk`` over one interval in `steps` equal steps: (scaled state, parameter vector) to scaled state at the end."""
    manifest = model.manifest
    sizes = {"u": len(manifest.inputs), "p": len(manifest.parameters), "c": len(manifest.constants)}
    symbols = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
    count = len(model.states)
    time, length = casadi.SX.sym("s"), casadi.SX.sym("length")
    scaled, scale = casadi.SX.sym("z", count), casadi.SX.sym("scale", count)
    rhs = model.symbolic("rhs")
    given: dict[str, Any] = {"t": length * time, "x": scaled * scale, **symbols}
    (rate,) = rhs.call([given[name] for name in rhs.name_in()])
    vector = casadi.vertcat(length, scale, *symbols.values())
    equations = {"t": time, "x": scaled, "p": vector, "ode": length * rate / scale}
    integrator = casadi.integrator("erk_fixed", "erk", equations, 0.0, [1.0], {"step_size": 1.0 / steps})
    x, p = casadi.MX.sym("x", count), casadi.MX.sym("p", vector.numel())
    return casadi.Function("step", [x, p], [integrator(x0=x, p=p)["xf"]], ["x", "p"], ["end"])


def _input_rates(inputs: Sequence[Any], values: Any, inside: float) -> list[float]:
    """Time derivatives of the inputs at a time: phases turn, tables slope, gates stand."""
    rates = []
    for info in inputs:
        if info.kind == "phase":
            rates.append(float(values[info.rate]))
        elif info.kind == "table":
            near = 1e-9 * max(abs(inside), 1e-9)
            ahead, here = (clock.inputs_at([info], values, inside + d, inside)[0] for d in (near, 0.0))
            rates.append(float(ahead - here) / near)
        else:
            rates.append(0.0)
    return rates
