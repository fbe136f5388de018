"""Periodic states by shooting: Newton on what a period changes in the state, with the stepper's own tangents.

In: a model, a period, states to start from.  Out: `PeriodicState`.

A period falls into segments of equal time.  Unknown are the states at their starts; what must vanish is the state at
the end of each less the start of the next.  One segment is single shooting; more keep a motion that repels from leaving
its neighbourhood within a period.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.ask.kept_parts import Arrays, KeptParts
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.motion.forcing_period import ForcingPeriod
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.start import state_at
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.solution.integration_error import IntegrationError
from ballpass.runtime.solution.sensitivity import sensitivities
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import Repetition, alike_from_slope
from ballpass.runtime.time.turning import TURN

#: Most iterations, and halvings of a step that does not lessen what is left.
ITERATIONS, HALVINGS = 20, 5

#: Done where a step is below this share of the magnitudes, or what is left is [1].
CLOSE = 1e-9

#: Tolerance of the iterations until they are this close; the last ones have the tight one.
ROUGH, NEAR = 1e-8, 0.1

#: Behind a tight step below this the state is there, for what Newton leaves is of the order of its square.
#: A period from it confirms it, and gives its multipliers: in winding motion they change a thousand times as much [1].
SURE = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residual:
    """What a period leaves, in shares of the states' magnitudes, and its derivatives.

    Attributes
    ----------
    left : shape (unknowns,)
    by_states : shape (unknowns, unknowns)
    by_parameter : by the varied parameter, shape (unknowns,) [1/unit]; zero without one
    monodromy : derivative of the state after a period by that at its start, SI, shape (states, states)
    """

    left: np.ndarray
    by_states: np.ndarray
    by_parameter: np.ndarray
    monodromy: np.ndarray

    @property
    def size(self) -> float:
        return float(np.max(np.abs(self.left)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeriodicState:
    """A state that repeats.

    Attributes
    ----------
    nodes : states at the starts of the segments, the first at t = 0, shape (segments, states)
    multipliers : eigenvalues of the derivative of the state after all periods by that at the start, largest first
    left : what is left, for each iteration, in shares of the states' magnitudes [1]
    periods : integrated in all
    """

    nodes: np.ndarray
    multipliers: np.ndarray
    left: tuple[float, ...]
    periods: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shooting:
    """What shooting needs of a model.

    Attributes
    ----------
    model : the model
    parameters : overrides, SI
    period : of the equations
    repeats : periods after which the state must be there again
    segments : into which this time falls
    magnitude : of each state, shape (states,)
    rtol : of the runs; None: that of derivatives
    over : parameter that varies, "" for none
    parts : keeps what is computed
    progress : called with the finished fraction of each run
    """

    model: LoadedModel
    parameters: Mapping[str, float]
    period: ForcingPeriod
    repeats: int = 1
    segments: int = 1
    magnitude: np.ndarray
    rtol: float | None = None
    over: str = ""
    parts: KeptParts
    progress: Callable[[float], None] | None = None

    def numbers(self, value: float | None = None) -> Numbers:
        """Numbers of the model with this value of the varied parameter."""
        given = dict(self.parameters) if value is None else {**self.parameters, self.over: value}
        return self.model.numbers(given)

    def begin(self, numbers: Numbers) -> float:
        """Time of the first state [s]: turns are alike from then on."""
        return Repetition.of(self.model.manifest, numbers.values).alike_from

    def residual(self, nodes: np.ndarray, value: float | None = None, rtol: float | None = None) -> Residual:
        """What a period leaves from these states at the segments' starts, shape (segments, states).

        Raises
        ------
        IntegrationError
            A run failed.
        """
        tight = self.rtol if rtol is None else rtol
        found = self.once("residual", nodes, value, tight, lambda: self._residual(nodes, value, tight))
        return Residual(left=found[0], by_states=found[1], by_parameter=found[2], monodromy=found[3])

    def once(
        self, what: str, nodes: np.ndarray, value: float | None, rtol: float | None, compute: Callable[[], Arrays]
    ) -> Arrays:
        """Arrays of these states, kept where the call keeps what it computes."""
        given = (value, rtol, self.repeats, self.segments)
        key = np.array([*nodes.ravel(), *(np.nan if number is None else number for number in given)])
        return self.parts.once(key, compute, f"{what} {dict(self.parameters)}")

    def _residual(self, nodes: np.ndarray, value: float | None, rtol: float | None) -> Arrays:
        model, count = self.model, nodes.shape[1]
        numbers = self.numbers(value)
        length = self.repeats * self.period.time(numbers.values)
        begin, piece = self.begin(numbers), length / self.segments
        names = [*model.manifest.initial, *([self.over] if self.over else [])]
        first = later = 0.0
        if self.over:  # where the period is a function of the parameter, so are the ends of all segments
            (moved,) = Chain(model, numbers, [self.over]).moved_numbers
            later = self.repeats * self.period.slope(numbers.values, moved)
            first = alike_from_slope(model.manifest, numbers.values, moved)
        left = np.empty_like(nodes)
        by_parameter = np.zeros_like(nodes)
        by_states = np.zeros((self.segments, count, self.segments, count))
        monodromy = np.eye(count)
        for k in range(self.segments):
            start = state_at(model, numbers, begin + k * piece, nodes[k])
            request = Request(
                duration=piece, initial=start, samples_per_cycle=1, outputs=[], rtol=rtol, progress=self.progress
            )
            found = sensitivities(model, numbers, request, names, with_jumps=True)
            end, slopes = found.solution.x[-1], found.x[-1]
            flow, nxt = slopes[:, :count], (k + 1) % self.segments
            left[k] = (end - nodes[nxt]) / self.magnitude
            by_states[k, :, k] += flow * self.magnitude / self.magnitude[:, None]
            by_states[k, :, nxt] -= np.eye(count)
            if self.over:
                ends = [begin + (k + j) * length / self.segments for j in (0, 1)]
                rates = [
                    _rate(model, numbers, t, x, inside)
                    for t, x, inside in zip(ends, (nodes[k], end), (1.0, -1.0), strict=True)
                ]
                shift = [first + (k + j) / self.segments * later for j in (0, 1)]
                by_value = slopes[:, count] + rates[1] * shift[1] - flow @ rates[0] * shift[0]
                by_parameter[k] = by_value / self.magnitude
            monodromy = flow @ monodromy
        return left.ravel(), by_states.reshape(nodes.size, nodes.size), by_parameter.ravel(), monodromy

    def solve(self, nodes: np.ndarray) -> PeriodicState:
        """Newton's iteration from these states, with shorter steps where a whole one lessens nothing.

        Raises
        ------
        SimulationError
            It does not converge, a multiplier is 1, or a run failed.
        """
        rough = ROUGH if self.rtol is None else max(self.rtol, ROUGH)
        tight = self.rtol is not None and self.rtol >= ROUGH
        close = max(CLOSE, 10.0 * (self.rtol or 0.0))  # a run is no more exact than its tolerance
        now = self.residual(nodes, None, rough)
        left, runs = [now.size], 1
        for _ in range(ITERATIONS):
            try:
                step = -np.linalg.solve(now.by_states, now.left).reshape(nodes.shape) * self.magnitude
            except np.linalg.LinAlgError:
                raise SimulationError(
                    "steady: a multiplier is 1, the state is one of many, and no step is defined. Add damping or a "
                    "load."
                ) from None
            share, small = 1.0, float(np.max(np.abs(step / self.magnitude)))
            if tight and small < SURE:
                runs += 1
                final = self.residual(nodes + step)
                if final.size < close or small < close:
                    multipliers = np.linalg.eigvals(final.monodromy)
                    return PeriodicState(
                        nodes=nodes + step,
                        multipliers=multipliers[np.argsort(-np.abs(multipliers), kind="stable")],
                        left=(*left, final.size),
                        periods=runs * self.repeats,
                    )
            tight = tight or small < NEAR
            for _ in range(HALVINGS):
                runs += 1
                with contextlib.suppress(IntegrationError):  # too long a step may end where no bearing can be
                    then = self.residual(nodes + share * step, None, None if tight else rough)
                    if then.size < now.size or small < NEAR:
                        break
                share /= 2.0
            else:
                break
            nodes, now = nodes + share * step, then
            left.append(now.size)
        raise SimulationError(
            f"steady: Newton's iteration ended at a change of {left[-1]:.2g} of the states' magnitudes in a period "
            f"(begun at {left[0]:.2g}). Take a longer transient, more segments, or another start; chaotic motion has "
            "no state nearby that repeats."
        )


def _rate(model: LoadedModel, numbers: Numbers, t: float, x: np.ndarray, side: float) -> np.ndarray:
    """Derivative of the state by time, just behind (side above 0) or just before a time at which a load may switch."""
    aside = t + side * 1e-9 * max(t, 1e-9 * TURN)
    there = point(model, numbers, t, x)
    there["u"] = timeline.inputs_at(model.manifest, numbers.values, t, aside)
    return np.array(model.kernel("rhs")(there))
