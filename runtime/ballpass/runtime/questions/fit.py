"""Parameters from measurements: values with intervals, and in words what the data do not determine."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ballpass.runtime.contract.defaults import FIT_RTOL
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Cycles, Option, RecordedRate, Rtol, TimeColumn, Transient
from ballpass.runtime.contract.units import QuantityError, parse_quantity
from ballpass.runtime.fit.report import FitAnswer, FittedNumber, FittedSignal
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.show.progress import Progress, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.ask.parameter_range import ParameterRange
    from ballpass.runtime.fit.least_squares import Fitted
    from ballpass.runtime.fit.misfit import Misfit

#: Distance of each start from the bounds, in shares of the range [1].
INSIDE = 0.05

#: Counts nearer than this are the same: a search ends so far from the least misfit [1].
SAME = 1e-8

#: Candidates of which each start is the best; the scene's values are the first.
CANDIDATES = 8

Data = Annotated[
    str | Path | Mapping[str, Any] | Sequence[Any],
    Option(
        words="Files of measured signals, spectra or quantities: CSV or NetCDF, one for each trial.",
        shown="DATA",
        positional=True,
        names=option_names.measured_quantities,
    ),
]
Vary = Annotated[
    str | Sequence[str],
    option_names.ranged(
        "Parameter to find and its bounds; `:log` behind them for equal factors. May be repeated.",
        'bearing.clearance="5 um:30 um"',
    ),
]
SignalColumns = Annotated[
    str | Sequence[str] | None,
    Option(
        words="Output that a column holds; else columns are named as outputs. May be repeated.",
        shown="OUTPUT=COLUMN",
        example="outer.y=probe_2",
        names=option_names.measured,
    ),
]
Begin = Annotated[
    float | None,
    Option(
        words="Time of the run at which the data's time is zero; its start if none is given.",
        example='"0.24 s"',
        shown="TIME",
        unit="s",
    ),
]
Shift = Annotated[
    str | None,
    Option(
        words="Bounds of an unknown shift of the data's time, one for each trial.",
        shown="A:B",
        example='"-1 ms:1 ms"',
    ),
]
Gain = Annotated[bool, Option(words="Find a gain of each signal.", flags=("--gain/--no-gain",))]
Offset = Annotated[bool, Option(words="Find an offset of each signal.", flags=("--offset/--no-offset",))]
Loss = Annotated[
    str,
    Option(
        words="`linear` for normal noise; `huber` or `cauchy` where some samples are wrong.",
        shown="NAME",
        choices=("linear", "huber", "cauchy"),
    ),
]
FitStarts = Annotated[
    int,
    Option(
        words="Starts, each the best of eight candidates; the scene's values are the first.",
        shown="N",
        least=1,
        most=100,
    ),
]
Profile = Annotated[
    bool,
    Option(words="Intervals by profiles of the misfit, not by its curvature.", flags=("--profile/--no-profile",)),
]


def _figures(_model: AnyModel, found: FitAnswer, _parameters: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.residuals import draw_residuals

    for k, one in enumerate(found.signals, start=1):
        words = (one.name, one.unit, one.axis, one.noise)
        yield ("residuals" if k == 1 else f"residuals_{k}"), draw_residuals(*words, one.t, one.measured, one.model)


@Question(stage="fit", figures=_figures, needs="scipy")
def fit(
    model: AnyModel,
    data: Data,
    vary: Vary,
    signal: SignalColumns = None,
    *,
    time: TimeColumn = None,
    rate: RecordedRate = None,
    begin: Begin = None,
    shift: Shift = None,
    gain: Gain = False,
    offset: Offset = False,
    loss: Loss = "linear",
    profile: Profile = False,
    starts: FitStarts = 3,
    cycles: Cycles = None,
    transient: Transient = None,
    parameters: Mapping[str, float] | None = None,
    rtol: Rtol = None,
    keep: str | Path | None = None,
    progress: Progress = None,
) -> FitAnswer:
    """Find parameters from measured signals by least squares, with exact derivatives of the run.

    Data are outputs over time, amplitudes over the frequency, or quantities; turns and transient are those of runs for
    the latter two. What the data do not determine is named, not given as a number. In Python, data may be mappings, SI,
    one for each trial: `time` or `frequency` with arrays by output, or quantities, as pairs with their deviations.

    Parameters
    ----------
    parameters : overrides of other parameters, SI
    keep : folder for what is computed, by which a call that was killed continues; what it kept is deleted at the end
    progress : as for `simulate`

    Raises
    ------
    RequestError
        Unknown names, wrong bounds or files, or a law whose force jumps.
    SimulationError
        The run at a start failed, or the motion is chaotic, so that no run repeats the measured one.

    Examples
    --------
    >>> run = model.simulate(duration=0.05, sample_rate=10e3)
    >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
    >>> data = {"time": run.t, "inner.y": 2.0 * run["inner.y"] + noise}
    >>> found = model.fit(data, "bearing.clearance=5 um:30 um", gain=True)
    >>> [one.kind for one in found.numbers], f"{found.numbers[1].value:.2f}"
    (['parameter', 'gain'], '2.00')
    """
    from scipy.stats.qmc import Halton

    from ballpass.runtime.ask.kept_parts import kept_parts
    from ballpass.runtime.ask.parameter_range import parameter_range
    from ballpass.runtime.fit.least_squares import best_of, fit_unknowns
    from ballpass.runtime.fit.measured import columns_by_output, read_trial
    from ballpass.runtime.fit.misfit import Misfit
    from ballpass.runtime.request.locating import refuse_jumps

    refuse_jumps(model.manifest, "fit")
    texts = [vary] if isinstance(vary, str) else list(vary)
    ranges = [parameter_range(model.manifest.parameters, "vary", text) for text in texts]
    sources = list(data) if isinstance(data, Sequence) and not isinstance(data, str) else [data]
    columns = columns_by_output(signal)
    tolerance = FIT_RTOL if rtol is None else rtol
    trials = [read_trial(model.manifest, one, columns, k, time, rate) for k, one in enumerate(sources, start=1)]
    misfit = Misfit(
        model,
        trials,
        ranges,
        begin=0.0 if begin is None else begin,
        shift=_shift(shift),
        gain=gain,
        offset=offset,
        parameters=dict(parameters or {}),
        rtol=tolerance,
        cycles=cycles,
        transient=transient,
    )
    shares = Halton(len(misfit.ranged), scramble=False).random(CANDIDATES * starts)
    shares[0] = misfit.shares_of(model.numbers(parameters).parameters)  # in place of a corner
    shares = np.clip(shares, INSIDE, 1.0 - INSIDE)
    found = []
    decides = (texts, *misfit.decides)
    with kept_parts(keep, model, *decides) as misfit.parts, shown("fitting", progress) as tell:
        for k in range(starts):
            begun = best_of(misfit, shares[CANDIDATES * k : CANDIDATES * (k + 1)])
            report = None if tell is None else lambda done, k=k: tell((k + done) / starts)
            found.append((begun, fit_unknowns(misfit, begun, loss, report)))
        # all in the noise of the best, for their noises differ
        best = min((one for _, one in found), key=lambda one: float(np.sum(np.log(one.noise))))
        _refuse_chaos(model, misfit, best)
        notes = tuple(note for trial in trials for note in trial.notes)
        return _answer(misfit, best, found, notes=notes, loss=loss, profile=profile, rtol=tolerance)


def _shift(text: str | None) -> ParameterRange | None:
    """Bounds of a shift of time."""
    from ballpass.runtime.ask.parameter_range import ParameterRange

    if text is None:
        return None
    ends = text.split(":")
    try:
        low, high = (parse_quantity(end.strip(), "s") for end in ends)
    except (QuantityError, ValueError):
        low = high = 0.0
    if not low < high:
        raise RequestError(f'shift: {text!r:.80} is no range of times. Allowed: A:B, as in "-1 ms:1 ms".')
    words = "Shift of the data's time"
    return ParameterRange(name="shift", unit="s", words=words, low=low, high=high, shown_unit="ms", factor=1e-3)


def _refuse_chaos(model: AnyModel, misfit: Misfit, fitted: Fitted) -> None:
    from ballpass.runtime.certify.growth import refuse_growth
    from ballpass.runtime.request.request import Request

    if not (model.states and model.has_stepper):
        return
    for k, run in enumerate(misfit.runs(fitted.counts)):
        names = list(dict.fromkeys(name for one in misfit.records if one.trial == k for name in one.channels))
        refuse_growth(model, run.numbers, Request(duration=run.duration, transient_cycles=0.0), names)


def _answer(
    misfit: Misfit,
    best: Fitted,
    found: Sequence[tuple[np.ndarray, Fitted]],
    *,
    notes: tuple[str, ...],
    loss: str,
    profile: bool,
    rtol: float,
) -> FitAnswer:
    """The answer from the best search."""
    from ballpass.runtime.fit.least_squares import profile_end
    from ballpass.runtime.fit.undetermined import undetermined_groups

    values = misfit.values(best.counts)
    groups = undetermined_groups(misfit, best)
    unknown = {name for group in groups for name in group.names}
    deviations = np.sqrt(np.diag(best.covariance))
    numbers = []
    for k, one in enumerate(misfit.unknowns):
        ends = [best.counts[k] - best.spread * deviations[k], best.counts[k] + best.spread * deviations[k]]
        blind = one.name in unknown
        if profile and not blind and not best.held[k]:
            ends = [profile_end(misfit, best, loss, k, side) for side in (-1.0, 1.0)]
        slope = one.slope(float(best.counts[k]))
        low, high = sorted(
            float(one.value(end)) if profile else values[k] + slope * (end - best.counts[k]) for end in ends
        )
        none = blind or bool(best.held[k])
        numbers.append(
            FittedNumber(
                name=one.name,
                unit=one.unit,
                kind=one.kind,
                value=math.nan if blind else float(values[k]),
                deviation=math.nan if none else float(abs(slope) * deviations[k]),
                low=math.nan if none else float(low),
                high=math.nan if none else float(high),
                held=best.held[k],
                shown_unit=one.range.shown_unit if one.range is not None else one.unit,
                factor=one.range.factor if one.range is not None else 1.0,
            )
        )
    sizes = np.where([math.isnan(one.deviation) for one in numbers], np.nan, np.where(deviations > 0, deviations, 1.0))
    signals = [
        FittedSignal(
            name=record.name,
            unit=record.unit,
            axis=record.axis,
            t=record.t,
            measured=record.values,
            model=record.values + difference,
            noise=float(noise),
            correlation=_correlation(difference),
        )
        for record, difference, noise in zip(misfit.records, best.differences, best.noise, strict=True)
    ]
    parts = len(misfit.ranges)
    return FitAnswer(
        numbers=tuple(numbers),
        correlations=best.covariance / np.outer(sizes, sizes),
        undetermined=groups,
        signals=tuple(signals),
        starts=tuple(
            (
                tuple(misfit.values(begun)[:parts].tolist()),
                float(np.mean(np.concatenate([d / n for d, n in zip(one.differences, best.noise, strict=True)]) ** 2)),
            )
            for begun, one in found
        ),
        rivals=tuple(
            tuple(misfit.values(one.counts)[:parts].tolist()) for _, one in found if _is_rival(misfit, best, one)
        ),
        loss=loss,
        profile=profile,
        rtol=rtol,
        converged=best.converged,
        notes=notes,
    )


def _is_rival(misfit: Misfit, best: Fitted, other: Fitted) -> bool:
    """Whether another search ended elsewhere, and as well within the noise."""
    samples = np.array([len(record.values) for record in misfit.records])
    worse = 2.0 * float(samples @ np.log(other.noise / best.noise))
    reach = np.maximum(best.spread * np.sqrt(np.diag(best.covariance)), SAME)
    away = np.abs(other.counts - best.counts) > reach
    return worse < best.spread**2 and bool(np.any(away & (np.array(best.held) == "")))


def _correlation(differences: np.ndarray) -> float:
    """Of each difference with the next one, about their mean."""
    away = differences - np.mean(differences)
    return float(np.sum(away[1:] * away[:-1]) / max(float(np.sum(away**2)), 1e-300))
