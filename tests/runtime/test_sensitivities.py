"""Forward sensitivities: exact for the discrete solution, right for the motion, with loads that switch at moving
times."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import IntegrationError, Model, RequestError, Sensitivities
from ballpass.runtime.contract.method_registry import METHODS
from ballpass.runtime.native.stepper import End, Outcome, Segments
from ballpass.runtime.point.evaluate import neighbour
from ballpass.runtime.request.direction_scales import direction_scales
from ballpass.runtime.run.directions import Directions
from ballpass.runtime.time import timeline

# preload: every ball stays in contact, and the motion is smooth in every parameter
SMOOTH = {"bearing.clearance": -60e-6, "mechanism.driver.start_angle": 4.2, "bearing.initial.inner.y": 2e-6}


def fixed_steps(
    model: Model, family: str, parameters: Mapping[str, float], names: Sequence[str], *, step: float, duration: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """States at eight times with steps that no parameter changes, and their derivatives along `names`."""
    # differences look slightly beyond values at their bounds
    numbers = neighbour(model, model.numbers(), parameters)
    u = timeline.inputs_at(model.manifest, numbers.values, 0.0)[None, :]
    segments = Segments(times=np.array([0.0, duration]), inputs=u, restarts=np.array([True]))
    times = duration * np.arange(1, 9) / 8 - 0.3 * step  # off the steps: dense output takes part
    states = np.zeros((len(times), len(model.states)))
    directions = Directions(model, numbers, names, len(times)) if names else None
    stepper = model.differentiating_stepper if directions else model.stepper
    outcome = stepper.run(
        method=family,
        tolerance=np.full(len(model.states), 1e3),
        p=numbers.p,
        c=numbers.c,
        x=np.array([numbers.values[name] for name in model.manifest.initial]),
        segments=segments,
        output_times=times,
        output_states=states,
        tangents=directions.tangents(segments, 0, len(times)) if directions else None,
        first_step=step,
        largest_step=step,
    )
    assert outcome.end is End.DONE
    assert outcome.written == len(times)
    return states, directions.states(len(times)) if directions else None


def extrapolated(function: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Central difference, Richardson-extrapolated once."""
    narrow = (function(step) - function(-step)) / (2 * step)
    wide = (function(2 * step) - function(-2 * step)) / (4 * step)
    return np.asarray((4 * narrow - wide) / 3)


@pytest.mark.parametrize("family", METHODS)
def test_every_method_differentiates_its_own_steps_exactly(make_model: Callable[..., Model], family: str) -> None:
    """All parameters in one pass, against differences of the same discrete map, which show no more than 1e-6.

    By speed and start angle steps move with the times at which an angle is reached, and agree with unmoved ones to the
    method's own error.
    """
    model = make_model("punching_press_tangent")
    names = list(model.parameters)
    plain, _ = fixed_steps(model, family, SMOOTH, [], step=4e-6, duration=1e-3)
    states, derivatives = fixed_steps(model, family, SMOOTH, names, step=4e-6, duration=1e-3)
    assert np.array_equal(plain, states)
    assert derivatives is not None
    defaults = {**model.parameters, **SMOOTH}
    half = len(model.states) // 2
    disagreement = {}
    for k, name in enumerate(names):
        value = defaults[name]

        def moved(change: float, name: str = name, value: float = value) -> np.ndarray:
            return fixed_steps(model, family, {**SMOOTH, name: value + change}, [], step=4e-6, duration=1e-3)[0]

        found = []
        for relative in (1e-3, 1e-4, 1e-5):
            difference = extrapolated(moved, relative * (abs(value) if value else 1e-5 if "initial" in name else 1.0))
            size = np.max(np.abs(difference), axis=0)
            scale = np.repeat([size[:half].max(), size[half:].max()], half)
            found.append(np.max(np.abs(difference - derivatives[:, :, k]) / np.where(scale > 0, scale, 1.0)))
        disagreement[name] = min(found)
    moving = [disagreement.pop(name) for name in ("mechanism.driver.speed", "mechanism.driver.start_angle")]
    assert max(disagreement.values()) < 3e-6, max(disagreement, key=lambda n: disagreement[n])
    assert float(np.median(list(disagreement.values()))) < 1e-8
    assert max(moving) < (1e-3 if METHODS[family].order < 5 else 3e-5)


def test_derivatives_by_moving_edges_of_a_load(make_model: Callable[..., Model]) -> None:
    """The window's edges, the start angle and the speed move the times at which the punch strikes and leaves."""
    model = make_model("punching_press_tangent")
    parameters = {**SMOOTH, "mechanism.driver.start_angle": 4.0}
    windows = [f"mechanism.forces.punch.window.{edge}" for edge in ("start", "end")]
    names = [*windows, "mechanism.driver.start_angle", "mechanism.driver.speed", "mechanism.forces.punch.force.y"]
    steps = [1e-4, 1e-4, 1e-4, 1e-4, 1.0]
    assert len(model.breakpoints(0.0, 0.016, parameters)) == 2

    def run(change: Mapping[str, float]) -> np.ndarray:
        return model.simulate(
            duration=0.016, parameters={**parameters, **change}, method="stepper-dop853", rtol=1e-11
        ).x[-1]

    result = model.sensitivities(names, duration=0.016, parameters=parameters, method="stepper-dop853", rtol=1e-11)
    defaults = {**model.parameters, **parameters}
    for name, step in zip(names, steps, strict=True):
        difference = extrapolated(lambda d, name=name: run({name: defaults[name] + d}), step)
        error = np.abs(result.x[-1, :, result.names.index(name)] - difference)
        assert np.max(error) < 1e-6 * np.max(np.abs(difference)), name


@pytest.mark.parametrize("method", ["stepper-dp54", "stepper-dop853", "stepper-rodas4", "stepper-rodas5p"])
def test_errors_of_derivatives_fall_with_their_own_tolerance(make_model: Callable[..., Model], method: str) -> None:
    """Contact opens and closes, where the derivative's rate jumps: the states' own error control does not see it."""
    model = make_model("punching_press")
    names = ["bearing.clearance", "mechanism.driver.speed", "mechanism.forces.punch.force.y", "bearing.damping.ratio"]
    parameters = {"mechanism.driver.start_angle": 4.0}  # the punch strikes and leaves

    def run(rtol: float, sensitivity_rtol: float, by: str = method) -> tuple[np.ndarray, np.ndarray]:
        found = model.sensitivities(
            names,
            cycles=0.2,
            samples_per_cycle=200,
            parameters=parameters,
            method=by,
            rtol=rtol,
            sensitivity_rtol=sensitivity_rtol,
        )
        return found.solution.x, found.x

    x, derivatives = run(1e-11, 1e-9, "stepper-dop853")

    def other(change: float) -> np.ndarray:
        moved = {**parameters, names[0]: model.parameters[names[0]] + change}
        return model.simulate(
            cycles=0.2, samples_per_cycle=200, parameters=moved, method="stepper-rodas5p", rtol=1e-11
        ).x

    # the reference itself: against differences of another method's runs
    moved = extrapolated(other, 2e-9)
    assert np.max(np.abs(moved - derivatives[:, :, 0]) / np.max(np.abs(moved), axis=0)) < 2e-4
    size, extent = np.max(np.abs(derivatives), axis=0), np.max(np.abs(x), axis=0)

    def errors(rtol: float, sensitivity_rtol: float) -> tuple[float, float]:
        states, found = run(rtol, sensitivity_rtol)
        return float(np.max(np.abs(states - x) / extent)), float(np.max(np.abs(found - derivatives) / size))

    free, *controlled = [errors(1e-4, tolerance) for tolerance in (0.1, 1e-3, 1e-5, 1e-7)]
    assert controlled[0][1] > 5.0 * controlled[1][1]
    assert controlled[1][1] > 5.0 * controlled[2][1]
    assert free[1] > 5.0 * controlled[1][1]
    assert free[1] > 50.0 * controlled[2][1]
    assert controlled[1][0] < free[0]
    assert controlled[2][0] < 1e-5


@pytest.mark.parametrize("family", METHODS)
def test_a_rejected_step_leaves_no_trace_in_the_derivatives(make_model: Callable[..., Model], family: str) -> None:
    """Derivatives alone reject here (the states' tolerance is huge): state and derivatives stay the same bits, and the
    next accepted step is that of a run which begins there."""
    model = make_model("punching_press")
    numbers = model.numbers()
    names = ["bearing.clearance", "mechanism.driver.speed", "bearing.initial.inner.y"]
    magnitude = np.repeat([1e-5, 0.1], 4)

    def run(
        begin: float, x: np.ndarray, derivatives: np.ndarray | None, tries: int, first: float, rtol: float
    ) -> tuple[Outcome, np.ndarray, np.ndarray]:
        segments = Segments(
            times=np.array([begin, 0.05]),
            inputs=timeline.inputs_at(model.manifest, numbers.values, begin)[None, :],
            restarts=np.array([True]),
        )
        directions = Directions(model, numbers, names, 0)
        directions.control(rtol, magnitude)
        tangents = directions.tangents(segments, 0, 0)
        if derivatives is not None:
            tangents = replace(tangents, x=derivatives.copy())
        state = x.copy()
        outcome = model.differentiating_stepper.run(
            method=family,
            tolerance=1e3 * magnitude,
            p=numbers.p,
            c=numbers.c,
            x=state,
            segments=segments,
            output_times=np.zeros(0),
            output_states=None,
            tangents=tangents,
            first_step=first,
            max_steps=tries,
        )
        return outcome, state, tangents.x

    start = model.initial()
    ends = [run(0.0, start, None, tries, 2e-4, 1e-5) for tries in range(1, 120)]
    followed = 0
    for (before, x, derivatives), (after, tried, found) in pairwise(ends):
        if after.rejected > before.rejected:
            assert np.array_equal(x, tried)
            assert np.array_equal(derivatives, found)
        elif before.rejected and before.time < after.time:
            step = after.time - before.time
            _, fresh, made = run(before.time, x, derivatives, 1, step, 1e3)
            np.testing.assert_allclose(fresh, tried, rtol=1e-9, atol=1e-12 * magnitude.max())
            scale = np.max(np.abs(found), axis=(0, 2), keepdims=True)
            assert np.max(np.abs(made - found) / scale) < 1e-8
            followed += 1
    assert ends[-1][0].rejected >= 3
    assert followed >= 10


def test_scales_of_directions(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    magnitude = np.repeat([1e-5, 0.1], 4)
    values = {**model.parameters, "mechanism.driver.start_angle": 1e-9, "mechanism.forces.punch.force.x": 0.0}
    names = ["bearing.clearance", "mechanism.driver.start_angle", "mechanism.forces.punch.force.x"]
    names += ["bearing.initial.inner.x", "bearing.initial.inner_velocity.x"]
    forces = [abs(values[info.name]) for info in model.manifest.parameters if info.unit == "N"]
    expected = [values["bearing.clearance"], 1.0, max(forces), 1e-5, 0.1]
    np.testing.assert_array_equal(direction_scales(model.manifest, values, names, magnitude), expected)


def test_static_deflection_follows_the_two_thirds_power(make_model: Callable[..., Model]) -> None:
    """At rest with zero clearance delta = const (F/k)^(2/3), so d(delta)/dF = 2 delta/(3 F), d/dk = -2 delta/(3 k)."""
    model = make_model("varying_compliance")
    parameters = {"shaft.speed": 0.0, "bearing.initial.inner.y": 0.0, "bearing.inner_ring.damping": 4e5}
    names = ["load.force.x", "bearing.contact.stiffness"]
    result = model.sensitivities(names, duration=1.0, parameters=parameters, rtol=1e-9, samples_per_cycle=16)
    deflection = result.solution["inner.x"][-1]
    force, stiffness = model.parameters["load.force.x"], model.parameters["bearing.contact.stiffness"]
    assert result["inner.x", "load.force.x"][-1] == pytest.approx(2 * deflection / (3 * force), rel=1e-6, abs=0.0)
    assert result["inner.x", "bearing.contact.stiffness"][-1] == pytest.approx(
        -2 * deflection / (3 * stiffness), rel=1e-6, abs=0.0
    )


def test_a_jumping_law_is_refused(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press", ('law = "one-sided"', 'law = "two-sided-gated"'))
    with pytest.raises(RequestError, match=r"discontinuous.*tangent"):
        model.sensitivities("bearing.clearance", cycles=1)


def test_wrong_requests_are_refused(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press_tangent")
    with pytest.raises(RequestError, match=r"bearing\.clearance"):
        model.sensitivities("bearing.clearanse", cycles=1)
    with pytest.raises(RequestError, match="cvodes"):
        model.sensitivities("bearing.clearance", cycles=1, method="cvodes")
    with pytest.raises(RequestError, match="no parameter"):
        model.sensitivities([], cycles=1)
    with pytest.raises(RequestError, match=r"sensitivity_rtol.*1e-13 to 0\.1"):
        model.sensitivities("bearing.clearance", cycles=1, sensitivity_rtol=0.0)


@pytest.mark.long
def test_derivatives_of_steps_that_end_on_kinks_reach_tolerances_that_others_do_not(
    make_model: Callable[..., Model],
) -> None:
    """The tangent law's slope has no bound where a contact begins or ends: steps over that place get too short; those
    that end there, in the root of time, are few."""
    model = make_model("crank_shaper")
    names = ["bearing.clearance", "mechanism.driver.speed", "bearing.ball_angle"]

    def run(kinks: str | None, rtol: float, sensitivity_rtol: float | None = None) -> Sensitivities:
        return model.sensitivities(
            *(names, 0.8),
            rtol=rtol,
            sensitivity_rtol=sensitivity_rtol,
            samples_per_cycle=100,
            kinks=kinks,
            method="stepper-dop853",  # type: ignore[arg-type]
        )

    reference = run(None, 1e-12).x
    size = np.max(np.abs(reference), axis=0)
    located, named, over = (run(kinks, 1e-9) for kinks in (None, "located", "stepped-over"))
    assert np.array_equal(located.x, named.x)
    assert located.solution.statistics.kinks == "located"
    for found in (located, over):
        assert np.max(np.abs(found.x - reference) / size) < 1e-4
    assert 2 * located.solution.statistics.steps < over.solution.statistics.steps
    assert np.max(np.abs(run(None, 1e-10).x - reference) / size) < 1e-5
    with pytest.raises(IntegrationError, match="step size fell"):
        run("stepped-over", 1e-10, 1e-9)  # named, it is not loosened
    for ask in (model.sensitivities, partial(model.sensitivity, "peak_ball_force")):
        with pytest.raises(RequestError, match="Did you mean 'located'"):
            ask("bearing.clearance", cycles=1, kinks="locate")  # type: ignore[operator]


@pytest.mark.long
def test_loads_that_switch_together_have_derivatives_along_what_moves_them_together(
    make_model: Callable[..., Model],
) -> None:
    """As edges a little apart have.  Every query was refused, also one by the clearance, which moves no edge."""
    second = """[mechanism.forces.stripper]
body = "slider"
point = "C"
force = ["0 N", "-500 N"]
window = { start = "267 deg", end = "280 deg" }

[mechanism.forces.punch]"""
    model = make_model("punching_press_tangent", ("[mechanism.forces.punch]", second))
    with pytest.raises(RequestError, match=r"at once .*along mechanism\.forces\.punch\.window\.end"):
        model.sensitivities(["mechanism.driver.speed", "mechanism.forces.punch.window.end"], cycles=1)
    together = ["mechanism.driver.speed", "bearing.clearance"]
    start = "mechanism.forces.stripper.window.start"
    found, near = (
        model.sensitivities(together, cycles=1, rtol=1e-9, parameters={start: math.radians(267.0) + gap}).x
        for gap in (0.0, 1e-7)
    )
    size = np.max(np.abs(near), axis=0)
    assert np.all(np.abs(found[-1] - near[-1]) < 1e-4 * size)
    apart = {start: math.radians(268.0)}
    assert model.sensitivities("mechanism.forces.punch.window.end", cycles=1, parameters=apart).x.shape[2] == 1


@pytest.mark.long
def test_tolerance_is_loosened_where_steps_would_fall_below_the_resolution_of_time(
    make_model: Callable[..., Model],
) -> None:
    """The toggle press with tangent damping, by the clearance of its knee."""
    press, name = make_model("toggle_press"), "bearings.knee.clearance"
    run: dict[str, Any] = {"cycles": 0.05, "samples_per_cycle": 100}
    with pytest.raises(IntegrationError, match="a looser sensitivity_rtol may come through"):
        press.sensitivities(name, **run, sensitivity_rtol=1e-10)
    found = press.sensitivities(name, **run)
    assert found.sensitivity_rtol > 1e-10
    value, tight = press.parameters[name], {"rtol": 1e-12, "kinks": "located", "method": "stepper-dop853"}
    above, below = (press.simulate(**run, **tight, parameters={name: value * (1.0 + h)}).x for h in (1e-5, -1e-5))
    differences = (above - below) / (2e-5 * value)
    off = np.abs(found.x[:, :, 0] - differences) / np.max(np.abs(differences), axis=0, initial=1e-300)
    assert np.max(off) < 1e-5
