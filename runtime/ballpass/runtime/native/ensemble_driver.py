"""The driver of ensembles: C of `driver/ensemble.c` compiled with a model's kernels and called through ctypes.

In: numbers and segments of many members.  Out: their states at the end, on-line reductions, and how each ended.  A long
run is cut into several calls: `Carried` is what members carry from one to the next, and the bits are those of one call.
The library also holds the driver of single runs, there with reductions; plain runs pay for neither.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.native.c_calls import BYTES, DOUBLES, LONGS, ArrayOf, address, declare, padded
from ballpass.runtime.native.compile import CompiledLibrary
from ballpass.runtime.native.driver_library import check_sizes, open_driver
from ballpass.runtime.native.member_schedule import SCHEDULE_RECORDS, MemberSchedule
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.native.stepper import MAX_STEPS, RESULT, method_numbers

#: Status of members that were under way when the caller asked to stop; the others are those of `stepper.End`.
STOPPED = 5


class _EnsembleOptions(ctypes.Structure):
    _fields_ = (
        ("method", ctypes.c_int),
        ("resume", ctypes.c_int),
        ("max_steps", ctypes.c_void_p),
        ("stop", ctypes.POINTER(ctypes.c_int)),
        ("reached", ctypes.c_void_p),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MemberNumbers:
    """Parameters and constants of the members of one call, shape (members, .)."""

    p: np.ndarray
    c: np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class MemberArrays(MemberNumbers):
    """The same with their segments, row after row.

    Attributes
    ----------
    first : first segment of each member, shape (members + 1,)
    times : ends of the segments, one more than segments for each member, shape (segments + members,) [s]
    inputs : of each segment at its start, shape (segments, inputs)
    restarts : where the load jumps at a segment's start, shape (segments,)
    """

    first: np.ndarray
    times: np.ndarray
    inputs: np.ndarray
    restarts: np.ndarray


@dataclass(slots=True, kw_only=True)
class Carried:
    """What members carry from one call to the next: step sizes, error of the last step, methods, rates seen, counts.

    Attributes
    ----------
    results : how each ended so far, shape (members,) of `RESULT`; counts are those of all calls
    work : records of the driver, which read as C wrote them
    begun : whether there was a call
    """

    results: np.ndarray
    work: np.ndarray
    begun: bool = False


class EnsembleDriver:
    """The compiled driver of a model's ensembles.

    Attributes
    ----------
    rows : layout of the reductions
    lanes : members that advance together
    schedule : segments of many members

    Raises
    ------
    ArtefactError
        The library's sizes are not those of the manifest or of this module.
    """

    def __init__(self, library: CompiledLibrary, manifest: Manifest) -> None:
        self.rows = reduction_rows(manifest)
        code, (row, channels, self.lanes) = open_driver(
            library, "ballpass_ensemble_sizes", 3, (_EnsembleOptions, *SCHEDULE_RECORDS)
        )
        expected = (self.rows.size, len(self.rows.channels))
        check_sizes(library, "numbers of a reduction and channels", (row, channels), expected)
        self.library, self._code = library, code
        self.schedule = MemberSchedule(code, manifest)
        integer, long = ctypes.c_int, ctypes.c_long
        states = (DOUBLES, DOUBLES, DOUBLES)
        declare(code, "ballpass_ensemble_work", long, long)
        declare(code, "ballpass_ensemble_magnitudes", None, long, *states, LONGS, DOUBLES, DOUBLES, DOUBLES)
        segments = (LONGS, DOUBLES, DOUBLES, BYTES)
        results = (DOUBLES, DOUBLES, ArrayOf(RESULT))
        options = ctypes.POINTER(_EnsembleOptions)
        declare(code, "ballpass_ensemble", integer, options, long, *states, DOUBLES, *segments, *results)

    def carry(self, members: int) -> Carried:
        """What so many members carry, before their first call."""
        size = self._code.ballpass_ensemble_work(members)
        return Carried(results=np.zeros(members, dtype=RESULT), work=np.empty(size // 8 + 1))

    def run(
        self,
        method: str,
        members: MemberArrays,
        x: np.ndarray,
        tolerance: np.ndarray,
        reductions: np.ndarray | None,
        stop: ctypes.c_int,
        *,
        max_steps: np.ndarray | int = MAX_STEPS,
        carried: Carried | None = None,
        reached: np.ndarray | None = None,
    ) -> np.ndarray:
        """Advance members in lanes.

        Parameters
        ----------
        method : its name, or ``auto``
        x : states at the start, shape (members, states); on return those reached
        tolerance : error allowed in a step, shape (members, states)
        reductions : rows to add to, or None
        stop : the call ends soon after this becomes nonzero
        max_steps : allowed to all members, or to each, shape (members,); accepted and rejected, in all calls
        carried : from `carry`; with it a second call continues, with the same `x` and `reductions`
        reached : how far each member has come, written while the call is under way, shape (members,) [s]

        Returns
        -------
        array of `RESULT`, shape (members,)
        """
        count = len(x)
        carried = self.carry(count) if carried is None else carried
        limits = np.full(count, max_steps, dtype=ctypes.c_long)
        options = _EnsembleOptions(
            method=method_numbers().index(method),
            resume=int(carried.begun),
            max_steps=address(limits, ctypes.c_long),
            stop=ctypes.pointer(stop),
            reached=address(reached),
        )
        carried.begun = True
        self._code.ballpass_ensemble(
            *(ctypes.byref(options), count, members.p, members.c, tolerance, x, members.first, members.times),
            *(padded(members.inputs), members.restarts.view(np.uint8)),
            *(reductions, carried.work, carried.results),
        )
        return carried.results

    def magnitudes(
        self,
        members: MemberNumbers,
        initial: np.ndarray,
        first: np.ndarray,
        inputs: np.ndarray,
        horizons: np.ndarray,
    ) -> np.ndarray:
        """Magnitudes of the states of each member (see `ballpass.runtime.request.magnitudes`), shape (members, states).

        Parameters
        ----------
        initial : states at the start, shape (members, states)
        first : first moment of each member, shape (members + 1,)
        inputs : inputs at the moments, shape (moments, inputs)
        horizons : a turn, or the run, of each member [s]
        """
        found = np.empty_like(initial)
        moments = padded(inputs)
        self._code.ballpass_ensemble_magnitudes(
            len(initial), members.p, members.c, initial, first, moments, horizons, found
        )
        return found
