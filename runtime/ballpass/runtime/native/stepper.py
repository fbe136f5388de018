"""The project's own stepper: generated kernels and the C driver, compiled together and called through ctypes.

In: numbers and segments of a run.  Out: states at the requested times, and what the run cost.  One call integrates
any number of segments; the interpreter is free meanwhile, and calls from several threads do not share anything.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.method_registry import METHODS
from ballpass.runtime.native.c_calls import BYTES, DOUBLES, address, declare, padded
from ballpass.runtime.native.compile import CompiledLibrary
from ballpass.runtime.native.driver_library import check_sizes, open_driver

#: Most steps of a call, accepted and rejected, unless the caller says otherwise: some seconds, during which the
#: interpreter is deaf to an interrupt.
MAX_STEPS = 20_000_000


def method_numbers() -> tuple[str, ...]:
    """Names of the methods by their numbers in C."""
    return ("auto", *METHODS)


class End(IntEnum):
    """How a run of the driver ended; the numbers are those of stepper.h."""

    DONE = 0
    TOO_MANY_STEPS = 1
    STEP_TOO_SMALL = 2
    NOT_FINITE = 3
    BAD_ARGUMENT = 4
    STALLED = 5
    VOID = 7  # by the reductions of a run that reached its end


class _Options(ctypes.Structure):
    _fields_ = (
        ("method", ctypes.c_int),
        ("max_steps", ctypes.c_long),
        ("first_step", ctypes.c_double),
        ("smallest_step", ctypes.c_double),
        ("largest_step", ctypes.c_double),
        ("tolerance", ctypes.c_void_p),
        ("reduction", ctypes.c_void_p),
        ("work", ctypes.c_void_p),
        ("resume", ctypes.c_int),
        ("before", ctypes.c_void_p),
        ("pause", ctypes.c_int),
        ("kept", ctypes.c_void_p),
        ("keeps", ctypes.c_void_p),
    )


class _TangentRecord(ctypes.Structure):
    _fields_ = (
        ("blocks", ctypes.c_long),
        *(
            (name, ctypes.c_void_p)
            for name in ("p", "c", "u", "shift", "moved", "stretch", "x", "outputs", "work", "weight")
        ),
        ("rtol", ctypes.c_double),
    )


class _Result(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("status", "method", "state")),
        *((name, ctypes.c_long) for name in ("segment", "written", "steps", "rejected", "evaluations")),
        *((name, ctypes.c_long) for name in ("factorizations", "pivoted", "switches", "kinks")),
        *((name, ctypes.c_double) for name in ("time", "step")),
    )


#: The same for arrays: what is reported of every member of an ensemble.
RESULT = np.dtype(_Result)


@dataclass(frozen=True, slots=True, kw_only=True)
class Segments:
    """The run as the driver sees it.

    Attributes
    ----------
    times : ends of the segments, shape (segments + 1,), increasing [s]
    inputs : inputs of each segment at its start, shape (segments, inputs)
    restarts : where the load jumps at a segment's start, shape (segments,)
    """

    times: np.ndarray
    inputs: np.ndarray
    restarts: np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a run of the driver reports.

    Attributes
    ----------
    end : how it ended
    method : name of the method of the last segment
    state : index of the state that ended it, -1 if none
    written : output times reached
    steps, rejected, evaluations, factorizations, pivoted, switches, kinks : counts
    time : reached [s]
    step : last step size tried [s]
    kept : steps kept in this call
    """

    end: End
    method: str
    state: int
    written: int
    steps: int
    rejected: int
    evaluations: int
    factorizations: int
    pivoted: int
    switches: int
    kinks: int
    time: float
    step: float
    kept: int


#: Fields of an outcome that are those of C.
_REPORTED = tuple(field.name for field in fields(Outcome) if field.name not in ("end", "method", "kept"))


@dataclass(slots=True, kw_only=True)
class Held:
    """A run that is made in several calls, between two of them.

    Attributes
    ----------
    work : records of the driver, which read as C wrote them
    result : what the calls so far tell; its counts are those of all
    begun : whether there was a call
    """

    work: np.ndarray
    result: _Result
    begun: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Tangents:
    """Directions along which a run is differentiated, in blocks of `Stepper.lanes`.

    Attributes
    ----------
    p, c : derivatives of parameters and constants along the directions, shapes (blocks, parameters, lanes),
        (blocks, constants, lanes)
    u : of the inputs at each segment's start, shape (segments, blocks, inputs, lanes)
    shift : of the time at which a load switches at each segment's start, shape (segments, blocks, lanes) [s]
    moved, stretch : of the times along which it is differentiated (`driver/sensitivity.h`): at each segment's start,
        shape (segments, blocks, lanes) [s], and how fast they grow, shape (blocks, lanes) [1]
    x : of the states at fixed time, at the start, on return at the end, shape (blocks, states, lanes)
    outputs : filled with those at the output times, shape (outputs, blocks, states, lanes)
    weight, rtol : where the derivatives take part in the choice of step sizes, 1 / error allowed in a step, shape
        (blocks, states, lanes), zero for directions that do not count, and the relative tolerance that is in it; a
        derivative that outgrows 1 / (rtol weight) is followed relative to its size
    """

    p: np.ndarray
    c: np.ndarray
    u: np.ndarray
    shift: np.ndarray
    moved: np.ndarray
    stretch: np.ndarray
    x: np.ndarray
    outputs: np.ndarray
    weight: np.ndarray | None = None
    rtol: float = 0.0


class Stepper:
    """The compiled driver of one model.

    Attributes
    ----------
    library : what was compiled
    lanes : directions that the driver differentiates along at once
    kept : numbers of a step that is kept

    Raises
    ------
    ArtefactError
        The library's sizes are not those of the manifest, or its records not those of this module.
    """

    def __init__(self, library: CompiledLibrary, manifest: Manifest) -> None:
        self.library = library
        code, sizes = open_driver(library, "ballpass_sizes", 8, (_Options, _Result, _TangentRecord))
        self._states = len(manifest.states)
        expected = (self._states, max(len(manifest.inputs), 1), len(manifest.parameters), len(manifest.constants))
        check_sizes(library, "states, inputs, parameters and constants", sizes[:4], expected)
        self.lanes, self._work, self.kept = sizes[5:]
        self._code = code
        integer, long, result = ctypes.c_int, ctypes.c_long, ctypes.POINTER(_Result)
        run = (
            *(ctypes.POINTER(_Options), DOUBLES, DOUBLES, DOUBLES, long, DOUBLES, DOUBLES, BYTES),
            *(long, DOUBLES, DOUBLES),
        )
        declare(code, "ballpass_run", integer, *run, result)
        declare(code, "ballpass_run_tangents", integer, *run, ctypes.POINTER(_TangentRecord), result)
        declare(code, "ballpass_tangent_work", long, long)
        declare(code, "ballpass_states_at", None, DOUBLES, long, long, DOUBLES, DOUBLES)
        magnitudes = (DOUBLES, DOUBLES, DOUBLES, long, DOUBLES, ctypes.c_double, DOUBLES)
        declare(code, "ballpass_magnitudes", None, *magnitudes)

    def hold(self) -> Held:
        """What a run in several calls is kept in, before its first."""
        return Held(work=np.empty(self._work // 8 + 1), result=_Result())

    def run(
        self,
        *,
        method: str,
        tolerance: np.ndarray,
        p: np.ndarray,
        c: np.ndarray,
        x: np.ndarray,
        segments: Segments,
        output_times: np.ndarray,
        output_states: np.ndarray | None,
        tangents: Tangents | None = None,
        reduction: np.ndarray | None = None,
        before: np.ndarray | None = None,
        max_steps: int = MAX_STEPS,
        first_step: float = 0.0,
        smallest_step: float = 0.0,
        largest_step: float = np.inf,
        held: Held | None = None,
        kept: np.ndarray | None = None,
    ) -> Outcome:
        """Integrate over all segments.

        Parameters
        ----------
        method : its name, or ``auto``
        tolerance : error allowed in a step, shape (states,)
        p, c : parameters and derived constants
        x : state at the start, shape (states,); on return that at the end
        output_times : increasing, shape (n,) [s]
        output_states : C-contiguous, shape (n, states), or None
        tangents : directions to differentiate along; the library must have been compiled with sensitivities
        reduction : row of on-line reductions to add to; the library must have been compiled with reductions
        before : row that segments before the first one of `reduction` are added to
        max_steps : accepted and rejected
        held : from `hold`; where a call with it has taken all its steps, another continues with the same arguments and
            more `max_steps`, which then count those of all calls, as the reported counts do.  The bits are those of one
            call.  Not with `tangents`
        kept : filled with each accepted step for `read`, shape (steps, `self.kept`) with room for those of this call;
            `Outcome.kept` says how many they are.  The first two numbers of each are its end [s] and 1.0 where it lies
            on a kink, else 0.0
        """
        inputs = padded(segments.inputs)
        restarts = np.ascontiguousarray(segments.restarts, dtype=np.uint8)
        keeps = ctypes.c_long(0)
        options = _Options(
            *(method_numbers().index(method), max_steps, first_step, smallest_step, largest_step),
            tolerance=address(tolerance),
            reduction=address(reduction),
            before=address(before),
            kept=address(kept),
            keeps=ctypes.addressof(keeps),
        )
        result = _Result()
        if held is not None:
            result, options.work, options.resume = held.result, address(held.work), int(held.begun)
            held.begun = True
        given = (
            *(ctypes.byref(options), p, c, x, len(restarts), segments.times, inputs, restarts),
            *(len(output_times), output_times, output_states),
        )
        if tangents is None:
            self._code.ballpass_run(*given, ctypes.byref(result))
        else:
            blocks = len(tangents.x)
            work = np.empty(self._code.ballpass_tangent_work(blocks) // 8 + 8)
            names = ("p", "c", "u", "shift", "moved", "stretch", "x", "outputs", "weight")
            directions = _TangentRecord(
                blocks=blocks,
                work=address(work),
                rtol=tangents.rtol,
                **{name: address(getattr(tangents, name)) for name in names},
            )
            self._code.ballpass_run_tangents(*given, ctypes.byref(directions), ctypes.byref(result))
        reported = {name: getattr(result, name) for name in _REPORTED}
        return Outcome(end=End(result.status), method=method_numbers()[result.method], kept=keeps.value, **reported)

    def read(self, kept: np.ndarray, times: np.ndarray) -> np.ndarray:
        """States at times of a run whose steps were kept, the same bits as its outputs there, shape (times, states).

        Parameters
        ----------
        kept : all steps of the run, one at least
        times : increasing, within the run [s]
        """
        found = np.empty((len(times), self._states))
        self._code.ballpass_states_at(kept, len(kept), len(times), times, found)
        return found

    def magnitudes(
        self, p: np.ndarray, c: np.ndarray, initial: np.ndarray, inputs: np.ndarray, horizon: float
    ) -> np.ndarray:
        """Magnitudes of the states of a run (see `ballpass.runtime.request.magnitudes`), shape (states,).

        The library that locates kinks has none: they are those of the plain one.

        Parameters
        ----------
        initial : state at the start, shape (states,)
        inputs : inputs at moments spread over the run, shape (moments, inputs)
        horizon : a turn, or the run [s]
        """
        moments = padded(inputs)
        found = np.empty_like(initial)
        self._code.ballpass_magnitudes(p, c, initial, len(moments), moments, horizon, found)
        return found
