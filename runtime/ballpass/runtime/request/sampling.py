"""When a run is sampled, and which outputs are evaluated there.

In: a `Request` and the `Run` made of it.  Out: a `Sampling`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers, real, vector, whole, wrong_unit
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.request import Request, check_memory, no_output
from ballpass.runtime.request.resolve import asked_span
from ballpass.runtime.request.start import start_time
from ballpass.runtime.time import timeline
from ballpass.runtime.time.span import Span


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampling:
    """Samples of a run.

    Attributes
    ----------
    span : of the run, which sample times may give
    times : increasing, from the start of the run on, shape (samples,) [s]
    even : whether they are the ends of equal intervals of the whole run
    outputs : names of the outputs to evaluate
    """

    span: Span
    times: np.ndarray
    even: bool
    outputs: tuple[str, ...]


def sampling_of(model: LoadedModel, request: Request, numbers: Numbers) -> Sampling:
    """Check samples and outputs of a request.

    Raises
    ------
    RequestError
        The request is wrong; the message says what is allowed.
    """
    outputs = output_names(model.manifest, request.outputs)
    span, times = _sample_times(model, request, numbers, outputs)
    even = request.times is None and request.sample_rate is None
    return Sampling(span=span, times=times, even=even, outputs=outputs)


def _sample_times(
    model: LoadedModel, request: Request, numbers: Numbers, outputs: Sequence[str]
) -> tuple[Span, np.ndarray]:
    """The time of the run, and those of its samples."""
    begin = start_time(request.initial)
    given = ("samples_per_cycle", "times", "sample_rate")
    several = [f"{name} = {getattr(request, name)!r:.40}" for name in given if getattr(request, name) is not None]
    if len(several) > 1:
        raise RequestError(f"{' and '.join(several)} were both given: give one of them.")
    if request.sample_rate is not None:
        span, rate = asked_span(model, numbers, request), checked_rate(request.sample_rate)
        _check_memory(model, span.duration * rate, outputs)
        times = times_at(rate, begin, span.end)
        if not times.size:
            raise RequestError(
                f"sample_rate: {rate:g} Hz has no sample within the run of {span.duration:g} s. Give a higher rate, or "
                "run longer."
            )
        return span, times
    if request.times is None:
        span, asked = asked_span(model, numbers, request), request.samples_per_cycle
        per_cycle = whole("samples_per_cycle", model.manifest.run.samples_per_cycle if asked is None else asked)
        # where its speed changes the driver may be slow on the mean
        turns = max(span.duration / timeline.stretch(model.manifest, numbers.values), span.cycles)
        wanted = np.rint(float(per_cycle) * turns) if turns > 0.0 else float(per_cycle)
        _check_memory(model, wanted, outputs)
        count = max(1, int(wanted))
        return span, begin + span.duration * (np.arange(count + 1) / count)
    if wrong := wrong_unit(request.times, "s"):
        raise RequestError(f"times: {wrong}")
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
        span = asked_span(model, numbers, replace(request, duration=duration))
    else:
        span = asked_span(model, numbers, request)
        if times[-1] > span.end * (1.0 + timeline.TIME_RESOLUTION):
            raise RequestError(
                f"times: the run ends at {span.end!r} s, and {float(times[-1])!r} s lies after it. Run longer, or "
                "leave cycles and duration out: the run then ends at the last time."
            )
    if times[0] < begin:
        raise RequestError(
            f"times: the run starts at {begin:g} s, and {float(times[0])!r} s lies before it. Leave earlier times out."
        )
    _check_memory(model, len(times), outputs)
    return span, times


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


def output_names(manifest: Manifest, asked: Sequence[str] | None) -> tuple[str, ...]:
    """Names of outputs, each once; None: all of the scene.

    Raises
    ------
    RequestError
        There is no such output.
    """
    known = tuple(info.name for info in manifest.outputs)
    if asked is None:
        return known
    names = (asked,) if isinstance(asked, str) else tuple(dict.fromkeys(asked))
    faults = [no_output(manifest, name, known) for name in names if name not in known]
    if faults:
        raise RequestError("\n".join(faults))
    return names
