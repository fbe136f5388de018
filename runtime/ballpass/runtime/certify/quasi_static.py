"""The quasi-static model of a scene: the rings in equilibrium with the load at each instant.

In: numbers and segments of a run.  Out: states at the requested times, on-line reductions.  The accelerations are the
generated ones, those that every other method integrates, with the rings at rest; the driver (``driver/equilibrium.c``)
finds where they vanish by Newton's method with the generated Jacobian and follows that position from instant to
instant.  Velocities are its time derivative by the implicit function theorem.  Where the load jumps, so does the
equilibrium; what the rings do between two equilibria (overshoot, vibration, impact) is what this model leaves out.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.compile import CompiledLibrary
from ballpass.runtime.native.compilers import Compiler
from ballpass.runtime.native.driver_library import (
    ENSEMBLE_HEADERS,
    address,
    check_headers,
    compile_driver,
    input_columns,
    open_driver,
    padded,
)
from ballpass.runtime.native.stepper import Segments

#: The name of the method.
NAME = "quasi-static"

#: Most instants of a run, accepted and rejected.
MAX_STEPS = 100_000_000


class End(IntEnum):
    """How a run of the driver ended; the numbers are those of equilibrium.h."""

    DONE = 0
    TOO_MANY_STEPS = 1
    NO_EQUILIBRIUM = 2
    FREE_RING = 3
    BAD_ARGUMENT = 4


#: What the ways to end mean to people.
STATUS_OF_END = {
    End.TOO_MANY_STEPS: Status.TOO_MANY_STEPS,
    End.NO_EQUILIBRIUM: Status.NO_EQUILIBRIUM,
    End.FREE_RING: Status.FREE_RING,
    End.BAD_ARGUMENT: Status.NOT_FINITE,
}


class _Options(ctypes.Structure):
    _fields_ = (
        ("max_steps", ctypes.c_long),
        ("tolerance", ctypes.c_void_p),
        ("reduction", ctypes.c_void_p),
    )


class _Result(ctypes.Structure):
    _fields_ = (
        ("status", ctypes.c_int),
        ("segment", ctypes.c_long),
        ("written", ctypes.c_long),
        ("steps", ctypes.c_long),
        ("rejected", ctypes.c_long),
        ("iterations", ctypes.c_long),
        ("jumps", ctypes.c_long),
        ("time", ctypes.c_double),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a run of the driver tells.

    Attributes
    ----------
    end : how it ended
    written : output times reached
    steps, rejected : distances between instants
    iterations : of Newton's method
    jumps : instants within segments at which the equilibrium jumps
    time : reached [s]
    """

    end: End
    written: int
    steps: int
    rejected: int
    iterations: int
    jumps: int
    time: float


def compile_quasi_static(folder: Path, manifest: Manifest, compiler: Compiler) -> CompiledLibrary:
    """Library with the driver of the quasi-static model.

    Raises
    ------
    ArtefactError
        The folder was written before reductions were.
    CompileError
        The compiler failed.
    """
    check_headers(folder, ENSEMBLE_HEADERS)
    return compile_driver(folder, manifest, compiler, ("equilibrium.c",), kind="equilibrium", headers=ENSEMBLE_HEADERS)


class QuasiStatic:
    """The compiled driver of one model.

    Raises
    ------
    ArtefactError
        The library's sizes are not those of the manifest, or its records not those of this module.
    """

    def __init__(self, library: CompiledLibrary, manifest: Manifest) -> None:
        self.library = library
        records = (_Options, _Result)
        code, (self.row,) = open_driver(library, manifest, "ballpass_equilibrium_sizes", records, others=1)
        self._inputs = input_columns(manifest)
        self._run = code.ballpass_equilibria
        self._run.restype = ctypes.c_int
        pointer, long = ctypes.c_void_p, ctypes.c_long
        self._run.argtypes = (
            *(ctypes.POINTER(_Options), pointer, pointer, pointer, long, pointer, pointer),
            *(long, pointer, pointer, ctypes.POINTER(_Result)),
        )

    def run(
        self,
        *,
        tolerance: np.ndarray,
        p: np.ndarray,
        c: np.ndarray,
        x: np.ndarray,
        segments: Segments,
        output_times: np.ndarray,
        output_states: np.ndarray | None,
        reduction: np.ndarray | None = None,
        max_steps: int = MAX_STEPS,
    ) -> Outcome:
        """Follow the equilibrium over all segments.

        Parameters
        ----------
        tolerance : error allowed between the instants, shape (states,)
        p, c : parameters and derived constants
        x : a state to start the search from, shape (states,); on return the last one
        output_times : increasing, shape (n,) [s]
        output_states : C-contiguous, shape (n, states), or None
        reduction : row of on-line reductions to add to, or None
        """
        inputs = padded(segments.inputs, self._inputs)
        if reduction is not None and len(reduction) != self.row:
            raise ValueError(f"a reduction of {self.row} numbers is expected, not of {len(reduction)}")
        reduced = None if reduction is None else address("reduction", reduction)
        options = _Options(max_steps, address("tolerance", tolerance), reduced)
        result = _Result()
        self._run(
            ctypes.byref(options),
            address("p", p),
            address("c", c),
            address("x", x),
            len(inputs),
            address("times", segments.times),
            address("inputs", inputs),
            len(output_times),
            address("output_times", output_times),
            None if output_states is None else address("output_states", output_states),
            ctypes.byref(result),
        )
        return Outcome(
            end=End(result.status),
            written=result.written,
            steps=result.steps,
            rejected=result.rejected,
            iterations=result.iterations,
            jumps=result.jumps,
            time=result.time,
        )
