"""The request of a run, and its bounds: length, tolerance, memory, names of outputs.

`request/resolve.py` makes a `Run` of a request; `request/sampling.py` the times of its samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.defaults import TOLERANCES
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import real, unknown_name
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.start import Start

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import Manifest

#: Most numbers that the samples of a run may hold, its derivatives, or its segments: 4 GiB.
MAX_NUMBERS = 2**29

#: Outputs that a manifest does not know unless the scene names them.
ON_REQUEST = (
    *("point.*", "body.*.speed", "body.*.acceleration", "reaction.*.magnitude", "*.power", "drive_power", "*.loss"),
    *("*.energy", "cage.moment", "*.cage.moment", "applied_power", "dissipated_power", "total_energy"),
    *("*kinetic_energy", "*ball.stiffness", "*ball.*_pressure", "*ball.*_axis", "*ball.*_approach"),
    *("*contact.stiffness.*", "*inner.a[xy]", "*outer.a[xy]"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """The request of a run; None takes the scene's run settings.

    Attributes
    ----------
    cycles, duration : turns of the driver or shaft, or time [s]; one of them
    method : a name of a method, or "auto"
    rtol : relative tolerance [1]
    sensitivity_rtol : that of the derivatives, where a run has some; None lets the states alone choose the steps [1]
    samples_per_cycle : samples in a turn; in the whole run where nothing turns
    times : sample times instead, increasing, shape (samples,) [s]
    sample_rate : samples at whole multiples of one over this, instead [Hz]
    outputs : names of the outputs to evaluate; None: all of the scene
    initial : state at the start, shape (states,), or the end of a run that this one continues
    transient_cycles : turns from t = 0 on that `Solution.steady` leaves out
    kinks : "stepped-over" or "located"; None: as the tolerance is
    progress : called with the finished fraction of the run
    """

    cycles: float | None = None
    duration: float | None = None
    method: str | None = None
    rtol: float | None = None
    sensitivity_rtol: float | None = None
    samples_per_cycle: int | None = None
    times: Sequence[float] | np.ndarray | None = None
    sample_rate: float | None = None
    outputs: Sequence[str] | None = None
    initial: Start = None
    transient_cycles: float | None = None
    kinks: str | None = None
    progress: Callable[[float], None] | None = None


def check_memory(what: str, rows: float, columns: int, remedy: str) -> None:
    """Refuse arrays of more than `MAX_NUMBERS` in all, before memory is allocated.

    Parameters
    ----------
    what : words for the rows, which "... numbers would not fit into memory" follows
    rows : their number; may be infinite
    columns : numbers of a row
    remedy : what to do instead

    Raises
    ------
    RequestError
        It would not fit.
    """
    if not rows * columns <= MAX_NUMBERS:
        raise RequestError(f"{what} {columns} numbers would not fit into memory. {remedy}")


def on_request(name: object) -> str:
    """Remedy for the name of an output that a model has on request only; "" for another name."""
    if not any(fnmatchcase(str(name), pattern) for pattern in ON_REQUEST):
        return ""
    return (
        f"{name!r} is computed only for a scene that names it: write outputs = ['*', '{name}'] into [run], or add it "
        "to those there; the model is then derived anew. Points, bodies and joints have the scene's names."
    )


def no_output(manifest: Manifest, name: object, known: Sequence[str], what: str = "output") -> str:
    """Why a name is not an output, and the remedy: the scene does not name it, or it does not exist.

    Parameters
    ----------
    known : the names to choose from
    what : word for them
    """
    if any(name == info.name for info in manifest.quantities):
        part, dot, _ = str(name).rpartition(".")
        return (
            f'{name!r} is not among this scene\'s run.outputs: add "{f"{part}.*" if dot else name}" there; the model '
            "is then derived anew."
        )
    return on_request(name) or f"{unknown_name(what, name, known)} The scene's run.outputs says which are computed."


def refuse_two_lengths(cycles: float | None, duration: float | None) -> None:
    """Raise `RequestError` where both turns and a time [s] are given."""
    if cycles is not None and duration is not None:
        raise RequestError(f"cycles = {cycles!r} and duration = {duration!r} were both given: give one of them.")


def asked_length(model: LoadedModel, cycles: float | None, duration: float | None) -> tuple[float | None, float | None]:
    """Turns or time [s] to run, one of them None: as given, else from the model's run settings.

    Raises
    ------
    RequestError
        Both were given, or one is not a number above 0.
    """
    refuse_two_lengths(cycles, duration)
    if cycles is None and duration is None:
        cycles, duration = model.run_settings.cycles, model.run_settings.duration
    if cycles is not None:
        if not 0.0 < real(cycles) < math.inf:
            raise RequestError(f"cycles: a number above 0 is expected, not {cycles!r:.80}.")
        return float(cycles), None
    if duration is None or not 0.0 < real(duration) < math.inf:
        raise RequestError(f"duration: a time above 0 s is expected, not {duration!r:.80}.")
    return None, float(duration)


def tolerance(name: str, given: float) -> float:
    """A relative tolerance that the methods can keep [1]; RequestError for one beyond `TOLERANCES`."""
    rtol = real(given)
    if not TOLERANCES[0] <= rtol <= TOLERANCES[1]:
        raise RequestError(
            f"{name}: a number from {TOLERANCES[0]:g} to {TOLERANCES[1]:g} is expected, not {given!r:.80}."
        )
    return rtol
