"""Forward sensitivities: exact for the discrete solution, right for the motion, with loads that switch at moving
times."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

from raceway.runtime import Model, RequestError, clock
from raceway.runtime.sensitivity import Directions
from raceway.runtime.stepper import End, Family, Segments

# preload: every ball stays in contact, and the motion is smooth in every parameter
SMOOTH = {"bearing.clearance": -60e-6, "mechanism.driver.start_angle": 4.2, "bearing.initial.inner.y": 2e-6}
FAMILIES = (Family.DP54, Family.DOP853, Family.RODAS4, Family.RODAS5P)


def fixed_steps(
    model: Model, family: Family, parameters: Mapping[str, float], names: Sequence[str], *, step: float, duration: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """States at eight times with steps that no parameter changes, and their derivatives along `names`."""
    numbers = model.numbers(parameters)
    u = clock.inputs_at(model.manifest.inputs, numbers.values, 0.0)[None, :]
    segments = Segments(times=np.array([0.0, duration]), inputs=u, restarts=np.array([True]))
    times = duration * np.arange(1, 9) / 8 - 0.3 * step  # off the steps: dense output takes part
    states = np.zeros((len(times), len(model.states)))
    directions = Directions(model, numbers, names, len(times)) if names else None
    stepper = model.differentiating_stepper if directions else model.stepper
    outcome = stepper.run(
        family=family,
        tolerance=np.full(len(model.states), 1e3),
        p=numbers.p,
        c=numbers.c,
        x=model.initial(parameters),
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


@pytest.mark.parametrize("family", FAMILIES, ids=lambda f: f.name.lower())
def test_every_method_differentiates_its_own_steps_exactly(make_model: Callable[..., Model], family: Family) -> None:
    """All parameters in one pass, against differences of the same discrete map, which show no more than 1e-6."""
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
    assert max(disagreement.values()) < 3e-6, max(disagreement, key=lambda n: disagreement[n])
    assert float(np.median(list(disagreement.values()))) < 1e-8


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


def test_static_deflection_follows_the_two_thirds_power(make_model: Callable[..., Model]) -> None:
    """At rest with zero clearance delta = const (F/k)^(2/3), so d(delta)/dF = 2 delta/(3 F), d/dk = -2 delta/(3 k)."""
    model = make_model("varying_compliance")
    parameters = {"shaft.speed": 0.0, "bearing.initial.inner.y": 0.0, "bearing.inner_ring.damping": 4e5}
    names = ["load.force.x", "bearing.contact.stiffness"]
    result = model.sensitivities(names, duration=1.0, parameters=parameters, rtol=1e-9, samples_per_cycle=16)
    deflection = result.solution["inner.x"][-1]
    force, stiffness = model.parameters["load.force.x"], model.parameters["bearing.contact.stiffness"]
    assert result["inner.x", "load.force.x"][-1] == pytest.approx(2 * deflection / (3 * force), rel=1e-6)
    assert result["inner.x", "bearing.contact.stiffness"][-1] == pytest.approx(
        -2 * deflection / (3 * stiffness), rel=1e-6
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


def test_two_loads_that_switch_together_have_no_derivative(
    make_model: Callable[..., Model],
) -> None:
    second = """[mechanism.forces.stripper]
body = "slider"
point = "C"
force = ["0 N", "-500 N"]
window = { start = "267 deg", end = "280 deg" }

[mechanism.forces.punch]"""
    model = make_model("punching_press_tangent", ("[mechanism.forces.punch]", second))
    with pytest.raises(RequestError, match="several loads switch at once"):
        model.sensitivities("mechanism.forces.punch.window.end", cycles=1)
    shifted = {"mechanism.forces.stripper.window.start": math.radians(268)}
    assert model.sensitivities("mechanism.forces.punch.window.end", cycles=1, parameters=shifted).x.shape[2] == 1
