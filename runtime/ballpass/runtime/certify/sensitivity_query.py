"""Sensitivities of quantities of interest, each with its certificate.

In: a model, names of quantities and parameters.  Out: a `SensitivityReport`.

Derivatives are those of the stepper's own steps, whose sizes are chosen by the error of the derivatives too.  A second
run with a looser tolerance gives their uncertainty.  The certificate compares each with a second route
(`certificate.py`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.certify.certificate import (
    AGREEMENT,
    FLOOR,
    UNCHECKED,
    Verdict,
    better_known,
    by_differences,
    compare,
)
from ballpass.runtime.certify.derivative_runs import derivative_run, differentiate, refuse_chaos
from ballpass.runtime.certify.dimensions import BASES, Identity, identities, power
from ballpass.runtime.certify.grazing import Grazing, find_grazing
from ballpass.runtime.certify.member_runs import member_runs
from ballpass.runtime.certify.sensitivity_report import STEPS, Sensitivity, SensitivityReport
from ballpass.runtime.contract.defaults import DERIVATIVE_RTOL
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, parameters_named
from ballpass.runtime.contract.units import ratio_unit
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import DEFLECTION
from ballpass.runtime.quantity.grammar import default_quantities, quantities_of, quantity_words
from ballpass.runtime.quantity.panels import ROUGH
from ballpass.runtime.quantity.quantity_run import EvaluatedQuantities, QuantityRun
from ballpass.runtime.quantity.records import Estimate, Quantity
from ballpass.runtime.quantity.track import ChannelValues
from ballpass.runtime.quantity.values import value_of
from ballpass.runtime.request.direction_scales import ANGLE
from ballpass.runtime.request.locating import refuse_jumps
from ballpass.runtime.request.request import Request, asked_length
from ballpass.runtime.request.resolve import Run, asked_transient
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN, past

Array = NDArray[np.float64]

#: How much rougher panels of quadratures may be in the looser run beside.
COARSER = 4.0

#: A place at a time or a frequency, which a quantity has beside the parameters.
_TIMED = re.compile(r"[\d.]\s*(s|Hz)")

#: Relative change of speed and start that shows the noise of a run, and how often it is made [1].
JITTER, JITTERED = 1e-7, 5

#: A change of the start by this share of the motion is a large one: it stays near, so that its effect is linear.
START_SHARE = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """The request; None takes the scene's run settings.

    Attributes
    ----------
    of, wrt : names, in `wrt` shell-style patterns too; None for the sensible ones, and for all parameters
    request : how long to run
    method : of the derivatives: ``auto`` or one of the stepper's
    check : whether each derivative is compared with differences
    rtol, sensitivity_rtol : tolerances of states and derivatives
    kinks : what the steps do at the kinks of the laws; None locates them
    agreement : relative disagreement that is allowed [1]
    progress : called with words and a finished fraction
    """

    of: str | Sequence[str] | None
    wrt: str | Sequence[str] | None
    request: Request
    method: str = "auto"
    check: bool = True
    rtol: float = DERIVATIVE_RTOL
    sensitivity_rtol: float = DERIVATIVE_RTOL
    kinks: str | None = None
    agreement: float = AGREEMENT
    progress: Callable[[str, float], None] | None = None


def length_request(
    model: LoadedModel, cycles: float | None, duration: float | None, transient: float | None
) -> Request:
    """How long to run: as given, else as the scene's run settings say.

    Raises
    ------
    RequestError
        Both cycles and duration, or numbers that are none.
    """
    turns, time = asked_length(model, cycles, duration)
    return Request(cycles=turns, duration=time, transient_cycles=asked_transient(model, transient))


def answer(model: LoadedModel, numbers: Numbers, query: Query) -> SensitivityReport:
    """Run a model and differentiate quantities by parameters, with certificates.

    Raises
    ------
    RequestError
        Unknown names, a law whose force jumps, a run without steady turns.
    SimulationError
        The computation failed.
    """
    manifest = model.manifest
    refuse_jumps(manifest, "sensitivity")
    quantities = quantities_of(model, _listed("of", query.of, default_quantities(manifest)))
    names = parameters_named(_listed("wrt", query.wrt, tuple(numbers.parameters)), numbers.parameters)
    request = replace(query.request, method=query.method, rtol=query.rtol, kinks=query.kinks)
    run, fine = derivative_run(model, numbers, request)
    tell = query.progress or (lambda _words, _fraction: None)
    refuse_chaos(model, numbers, quantities, replace(request, progress=partial(tell, "looking for growth")))
    tell("differentiating", 0.0)
    along = QuantityRun(model, quantities)
    course, tolerance = differentiate(along, run, names, query.sensitivity_rtol)
    values = np.array([item.value for item in course.estimates])
    slopes = np.array([item.slope for item in course.estimates])
    own = np.zeros_like(slopes)
    if query.check and model.states:
        tell("differentiating", 0.5)
        looser = replace(run, rtol=min(10.0 * query.rtol, 1e-3))
        found, _ = differentiate(along.with_panels(COARSER * ROUGH), looser, names, 10.0 * tolerance)
        own = np.abs(slopes - np.array([item.slope for item in found.estimates]))
    difference_scales = _difference_scales(run, names)
    with np.errstate(invalid="ignore", divide="ignore"):
        quantum = FLOOR * np.abs(values)[:, None] / difference_scales[None, :]
    second = None
    if query.check:
        tell("checking", 0.0)
        members = member_runs(run, query.request, quantities, fine=fine, progress=partial(tell, "checking"))
        second = by_differences(
            members,
            {name: numbers.parameters[name] for name in names},
            difference_scales,
            quantum=quantum,
            jitter=_jittered(run),
            agreement=query.agreement,
            expected=slopes,
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            # the difference of the routes gives the uncertainty of quadratures and extremes
            apart = np.nan_to_num(np.abs(values - second.quantities) / np.abs(values))
        own = own + apart[:, None] * np.abs(slopes)
    pairs = []
    units = {info.name: info.unit for info in manifest.parameters}
    for row, (quantity, estimate) in enumerate(zip(quantities, course.estimates, strict=True)):
        for column, name in enumerate(names):
            derivative, at = float(slopes[row, column]), numbers.parameters[name]
            check = UNCHECKED
            if second is not None:
                check = compare(
                    derivative,
                    float(own[row, column]),
                    float(second.value[row, column]),
                    float(second.uncertainty[row, column]),
                    route=second.route,
                    quantum=float(quantum[row, column]),
                    agreement=query.agreement,
                    sides=second.sides(row, column),
                )
                if check.verdict is Verdict.NOT_CHECKED and estimate.kink and check.sides is None:
                    check = replace(check, reason=estimate.kink)
            derivative, known, by_second = better_known(derivative, float(own[row, column]), check)
            pairs.append(
                Sensitivity(
                    quantity=quantity.name,
                    parameter=name,
                    value=estimate.value,
                    parameter_value=at,
                    quantity_unit=quantity.unit,
                    parameter_unit=units[name],
                    derivative=derivative,
                    unit=ratio_unit(quantity.unit, units[name]),
                    dimensionless=at * derivative / estimate.value if at * estimate.value != 0.0 else math.nan,
                    scale=float(difference_scales[column]),
                    uncertainty=known if query.check else None,
                    route=check.route if by_second else STEPS,
                    by_steps=float(slopes[row, column]),
                    check=check,
                )
            )
    whole = {info.name for info in manifest.parameters if any(power(info.unit, base) for base in BASES)} <= set(names)
    return SensitivityReport(
        scene=manifest.scene,
        quantities=tuple(value_of(item, found) for item, found in zip(quantities, course.estimates, strict=True)),
        parameters=tuple(names),
        words={
            **{item.name: quantity_words(manifest, item) for item in quantities},
            **{info.name: info.description for info in manifest.parameters if info.name in names},
        },
        pairs=tuple(pairs),
        grazing=_grazing(model, numbers, course),
        identities=tuple(_identities(run, quantities, course.estimates, pairs, units) if whole else ()),
        settings={
            "cycles": query.request.cycles,
            "duration": run.duration,
            "transient_cycles": run.span.transient,
            "method": run.method,
            "kinks": run.kinks,
            "rtol": query.rtol,
            "sensitivity_rtol": tolerance,
            "agreement": query.agreement,
            "steps": course.steps,
            "parameters": {name: numbers.parameters[name] for name in names},
            "units": {name: units[name] for name in names},
        },
        elements=tuple(bearing.element for bearing in manifest.bearings),
    )


def _listed(option: str, given: str | Sequence[str] | None, default: Sequence[str]) -> list[str]:
    names = [given] if isinstance(given, str) else list(dict.fromkeys(default if given is None else given))
    if not names:
        raise RequestError(f"sensitivity: {option} names nothing. Name at least one.")
    return names


def _identities(
    run: Run,
    quantities: Sequence[Quantity],
    estimates: Sequence[Estimate],
    pairs: Sequence[Sensitivity],
    units: Mapping[str, str],
) -> Iterator[Identity]:
    """Those of smooth quantities, in the units in which nothing else than parameters has a dimension."""
    count = len(pairs) // max(len(quantities), 1)
    for row, (quantity, estimate) in enumerate(zip(quantities, estimates, strict=True)):
        own = pairs[row * count : (row + 1) * count]
        timed = run.span.asked is None or _TIMED.search(quantity.place) is not None
        if not estimate.kink and all(pair.check.sides is None for pair in own):
            terms = [(pair.parameter, pair.parameter_value, pair.derivative, pair.uncertainty or 0.0) for pair in own]
            bases = [base for base in BASES if not (timed and base == "second")]
            yield from identities(quantity.name, estimate.value, quantity.unit, terms, units, bases)


def _difference_scales(run: Run, names: Sequence[str]) -> Array:
    """Change of each parameter that is a large one: its value; a radian, or what the run turns through; what its state
    or length is measured in."""
    manifest, numbers, magnitude = run.model.manifest, run.numbers, run.magnitude
    units = {info.name: info.unit for info in manifest.parameters}
    at_start = dict(zip(manifest.initial, magnitude.tolist(), strict=False))
    position = float(np.max(magnitude[: len(magnitude) // 2])) if len(magnitude) else 1e-3
    scales = []
    for name in names:
        value = abs(numbers.parameters[name])
        if name in at_start:
            value = max(value, START_SHARE * at_start[name])
        elif units[name] == ANGLE:
            value = min(1.0, TURN * run.span.cycles) or 1.0
        elif value == 0.0:
            alike = [abs(numbers.parameters[other]) for other, unit in units.items() if unit == units[name]]
            value = position if units[name] == "m" else max(alike, default=0.0)
        scales.append(value or 1.0)
    return np.array(scales)


def _jittered(run: Run) -> list[dict[str, float]]:
    """Tiny changes of speed and start, whatever is differentiated: they move every step."""
    manifest, parameters = run.model.manifest, run.numbers.parameters
    scales = dict(zip(manifest.initial, run.magnitude.tolist(), strict=False))
    speed = timeline.speed_name(manifest)
    if speed is not None and speed in parameters:
        scales[speed] = abs(parameters[speed])
    moves = JITTER * np.arange(-(JITTERED // 2), JITTERED // 2 + 1)
    return [{name: parameters[name] + move * scale for name, scale in scales.items()} for move in moves.tolist()]


def _grazing(model: LoadedModel, numbers: Numbers, course: EvaluatedQuantities) -> tuple[Grazing, ...]:
    """Where the run grazes a kink, whether or not the scene's outputs name the balls' deflections."""
    manifest, track = model.manifest, course.track
    # without a step the quantities need no motion
    if track is None or course.steps == 0 or not manifest.bearings:
        return ()
    names = [bearing.prefix + DEFLECTION for bearing in manifest.bearings]
    state = manifest.mechanism.angle if manifest.mechanism is not None else ""
    signals = ChannelValues(model, [*names, *([state] if state else [])]).along(track, numbers)
    order = np.lexsort((track.nodes.t, track.nodes.segment))
    times = track.nodes.t[order]
    known = timeline.driver(manifest, numbers.values)
    angles = past(signals[state].value[order, 0] if state else known.at(times)[0])
    found = [
        item
        for bearing, name in zip(manifest.bearings, names, strict=True)
        for item in find_grazing(
            times,
            track.nodes.segment[order],
            signals[name].value[order],
            angles,
            one_sided=bearing.damping.corner_at_rest,
            bearing=bearing.name,
        )
    ]
    return tuple(sorted(found, key=lambda item: item.time))
