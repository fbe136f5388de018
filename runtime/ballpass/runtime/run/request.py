"""What a run is asked for, checked: length, sample times, tolerance, outputs, state at the start.

In: a `Request` as the user gave it.  Out: a `Plan` without open questions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, real, unknown_name, vector
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.start import Start, start_state, start_time

if TYPE_CHECKING:
    from ballpass.runtime.contract import Manifest, RunInfo

#: Smallest and largest relative tolerance [1].
TOLERANCES = (1e-13, 1e-1)

#: Longest run, in turns and in time [s].  A press takes days for so many turns, and an edge of a window within the last
#: of them is known to a thousandth of a turn.
MOST_TURNS, MOST_TIME = 1e9, 1e9

#: Most numbers that the samples of a run may hold, its derivatives, or its segments: 4 GiB.
MAX_NUMBERS = 2**29

#: Outputs that a manifest does not know unless the scene names them.
ON_REQUEST = (
    *("point.*", "body.*.speed", "body.*.acceleration", "reaction.*.magnitude", "*.power", "drive_power", "*.loss"),
    *("*kinetic_energy", "*ball.stiffness", "*ball.*_pressure", "*ball.*_axis", "*ball.*_approach"),
    *("*contact.stiffness.*", "*inner.a[xy]", "*outer.a[xy]"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What to simulate; None takes the scene's run settings.

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
    initial : state at the start, shape (states,), or the end of a run that this one goes on from
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """A request with all that it left to the scene filled in.

    Attributes
    ----------
    turn : time of a turn, infinite where nothing turns [s]
    begin, duration : of the run [s]
    times : of the samples, increasing, from `begin` on, shape (samples,) [s]
    even : whether they are the ends of equal intervals of the whole run
    rtol, sensitivity_rtol : relative tolerances [1]
    outputs : names of the outputs to evaluate
    initial : state at the start, shape (states,)
    transient_cycles : turns from t = 0 on that `Solution.steady` leaves out
    """

    turn: float
    begin: float
    duration: float
    times: np.ndarray
    even: bool
    rtol: float
    sensitivity_rtol: float | None
    outputs: tuple[str, ...]
    initial: np.ndarray
    transient_cycles: float

    @property
    def end(self) -> float:
        """Time at which the run ends [s]."""
        return self.begin + self.duration


def make_plan(model: LoadedModel, numbers: Numbers, request: Request) -> Plan:
    """Check a request and fill it in from the scene's run settings.

    Raises
    ------
    RequestError
        What was asked for is wrong, with what is allowed.
    """
    run = model.manifest.run
    turn = clock.period(model.manifest, numbers.values)
    transient = run.transient_cycles if request.transient_cycles is None else real(request.transient_cycles)
    if not 0.0 <= transient < math.inf:
        raise RequestError(f"transient: a number of cycles from 0 on is expected, not {request.transient_cycles!r}.")
    outputs = output_names(model, request.outputs)
    duration, times = _sample_times(model, request, turn, outputs)
    return Plan(
        turn=turn,
        begin=start_time(request.initial),
        duration=duration,
        times=times,
        even=request.times is None and request.sample_rate is None,
        rtol=tolerance("rtol", run.rtol if request.rtol is None else request.rtol),
        sensitivity_rtol=(
            None if request.sensitivity_rtol is None else tolerance("sensitivity_rtol", request.sensitivity_rtol)
        ),
        outputs=outputs,
        initial=start_state(model, numbers, request.initial),
        transient_cycles=transient,
    )


def _sample_times(
    model: LoadedModel, request: Request, turn: float, outputs: Sequence[str]
) -> tuple[float, np.ndarray]:
    """Length of the run, and the times of its samples."""
    begin = start_time(request.initial)
    given = ("samples_per_cycle", "times", "sample_rate")
    several = [f"{name} = {getattr(request, name)!r:.40}" for name in given if getattr(request, name) is not None]
    if len(several) > 1:
        raise RequestError(f"{' and '.join(several)} were both given: give one of them.")
    if request.sample_rate is not None:
        duration = run_length(model, request, turn)
        check_length(begin + duration, turn)
        rate = checked_rate(request.sample_rate)
        _check_memory(model, duration * rate, outputs)
        times = times_at(rate, begin, begin + duration)
        if not times.size:
            raise RequestError(
                f"sample_rate: {rate:g} Hz has no sample within the run of {duration:g} s. Give a higher rate, or run "
                "longer."
            )
        return duration, times
    if request.times is None:
        duration = run_length(model, request, turn)
        check_length(begin + duration, turn)
        per_cycle = _whole("samples_per_cycle", request.samples_per_cycle, model.manifest.run.samples_per_cycle)
        wanted = np.rint(float(per_cycle) * duration / turn) if math.isfinite(turn) else float(per_cycle)
        _check_memory(model, wanted, outputs)
        count = max(1, int(wanted))
        return duration, begin + duration * (np.arange(count + 1) / count)
    times = vector(request.times)
    if times.ndim != 1 or not times.size or not np.all(np.isfinite(times)):
        raise RequestError(
            f"times: one or more finite times [s] in a row are expected, not an array of shape {times.shape}"
            f"{' with NaN or inf' if times.size and not np.all(np.isfinite(times)) else ''}."
        )
    falls = np.flatnonzero(np.diff(times) <= 0.0)
    if len(falls):
        k = int(falls[0])
        raise RequestError(
            f"times: they must increase, but {float(times[k + 1])!r} s follows {float(times[k])!r} s "
            f"(places {k} and {k + 1}). Sort them, each once: numpy.unique does."
        )
    if request.cycles is None and request.duration is None:
        duration = float(times[-1]) - begin
        if not duration > 0.0:
            raise RequestError(
                f"times: the run ends at the last one, which must be above {begin:g} s, not {float(times[-1])!r}. Or "
                "give cycles."
            )
    else:
        duration = run_length(model, request, turn)
        if times[-1] > (begin + duration) * (1.0 + clock.TIME_RESOLUTION):
            raise RequestError(
                f"times: the run ends at {begin + duration!r} s, and {float(times[-1])!r} s lies behind it. Run "
                "longer, or leave cycles and duration out: the run then ends at the last time."
            )
    check_length(begin + duration, turn)
    if times[0] < begin:
        raise RequestError(
            f"times: the run starts at {begin:g} s, and {float(times[0])!r} s lies before it. Leave earlier times out."
        )
    _check_memory(model, len(times), outputs)
    return duration, times


def checked_rate(given: float) -> float:
    """A sampling rate above zero [Hz]; RequestError for another."""
    if not 0.0 < real(given) < math.inf:
        raise RequestError(f"sample_rate: a frequency above 0 Hz is expected, not {given!r:.80}.")
    return float(given)


def times_at(rate: float, begin: float, end: float) -> np.ndarray:
    """Whole multiples of one over a rate [Hz] within a run, shape (samples,) [s]."""
    return np.maximum(np.arange(math.ceil(begin * rate - 1e-6), math.floor(end * rate + 1e-6) + 1) / rate, begin)


def _check_memory(model: LoadedModel, count: float, outputs: Sequence[str]) -> None:
    wanted = set(outputs)
    columns = len(model.states) + sum(info.size for info in model.manifest.outputs if info.name in wanted)
    columns += len(model.manifest.inputs)
    check_memory(
        f"{count:.10g} samples of",
        count,
        columns,
        "Take fewer samples a cycle or a shorter run, or keep extremes and means only: `Model.reduce` runs without "
        "samples.",
    )


def check_memory(what: str, rows: float, columns: int, remedy: str) -> None:
    """Refuse what would hold more than `MAX_NUMBERS`, before there is memory for any of it.

    Parameters
    ----------
    what : words for the rows, which "... numbers would not fit into memory" follows
    rows : how many there would be; may be infinite
    columns : numbers of a row
    remedy : what to do instead

    Raises
    ------
    RequestError
        It would not fit.
    """
    if not rows * columns <= MAX_NUMBERS:
        raise RequestError(f"{what} {columns} numbers would not fit into memory. {remedy}")


def output_names(model: LoadedModel, asked: Sequence[str] | None) -> tuple[str, ...]:
    """Names of outputs, each once; None: all of the scene.

    Raises
    ------
    RequestError
        There is no such output.
    """
    if asked is None:
        return model.outputs
    names = (asked,) if isinstance(asked, str) else tuple(dict.fromkeys(asked))
    faults = [no_output(model.manifest, name, model.outputs) for name in names if name not in model.outputs]
    if faults:
        raise RequestError("\n".join(faults))
    return names


def on_request(name: object) -> str:
    """What to do about a name of an output that a model has on request only; "" for another name."""
    if not any(fnmatchcase(str(name), pattern) for pattern in ON_REQUEST):
        return ""
    return (
        f"{name!r} is computed only for a scene that names it: add it to run.outputs; the model is then derived anew. "
        "Points, bodies and joints have the scene's names."
    )


def no_output(manifest: Manifest, name: object, known: Sequence[str], what: str = "output") -> str:
    """Why a name is no output, and what to do: the scene may not ask for it, or there is no such thing.

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


def asked_length(run: RunInfo, cycles: float | None, duration: float | None) -> tuple[float | None, float | None]:
    """Turns or time [s] to run, one of them None: as given, else as the scene's run settings say.

    Raises
    ------
    RequestError
        Both were given, or one that is no number above 0.
    """
    if cycles is not None and duration is not None:
        raise RequestError(f"cycles = {cycles!r} and duration = {duration!r} were both given: give one of them.")
    if cycles is None and duration is None:
        cycles, duration = run.cycles, run.duration
    if cycles is not None:
        if not 0.0 < real(cycles) < math.inf:
            raise RequestError(f"cycles: a number above 0 is expected, not {cycles!r:.80}.")
        return float(cycles), None
    if duration is None or not 0.0 < real(duration) < math.inf:
        raise RequestError(f"duration: a time above 0 s is expected, not {duration!r:.80}.")
    return None, float(duration)


def run_length(model: LoadedModel, request: Request, turn: float) -> float:
    """Length of the run that is asked for [s]; RequestError as for `asked_length`, or for turns of what never turns."""
    cycles, duration = asked_length(model.manifest.run, request.cycles, request.duration)
    if duration is not None:
        return duration
    assert cycles is not None
    if not math.isfinite(turn):
        raise RequestError("cycles: nothing turns in this model (its speed is zero). Give duration in seconds.")
    return cycles * turn


def check_length(duration: float, turn: float) -> None:
    """Refuse a run that would not come to its end.

    Parameters
    ----------
    duration, turn : of the run, and of a turn, infinite where nothing turns [s]

    Raises
    ------
    RequestError
        It is longer than `MOST_TURNS` or `MOST_TIME`.
    """
    turns = duration / turn
    if not (turns <= MOST_TURNS * (1.0 + 1e-9) and duration <= MOST_TIME):
        words = f"{duration:g} s, {turns:.3g} turns," if turns else f"{duration:g} s"
        raise RequestError(
            f"A run of {words} is too long to be computed. Allowed: up to {MOST_TURNS:g} turns and {MOST_TIME:g} s. "
            "Give fewer cycles or a shorter duration."
        )


def tolerance(name: str, given: float) -> float:
    """A relative tolerance that the methods can keep [1]; RequestError for one beyond `TOLERANCES`."""
    rtol = real(given)
    if not TOLERANCES[0] <= rtol <= TOLERANCES[1]:
        raise RequestError(
            f"{name}: a number from {TOLERANCES[0]:g} to {TOLERANCES[1]:g} is expected, not {given!r:.80}."
        )
    return rtol


def _whole(name: str, given: int | None, default: int) -> int:
    value = default if given is None else given
    if not (1.0 <= real(value) < math.inf and int(value) == value):
        raise RequestError(f"{name}: a whole number from 1 on is expected, not {value!r:.80}.")
    return int(value)
