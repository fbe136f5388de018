"""Claims about on-line reductions: they tell of a run what dense sampling, closed forms and the outputs tell."""

from __future__ import annotations

import cmath
import gc
import math
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from press_laws import LAWS, press

from ballpass.runtime import Model, RequestError, SimulationError
from ballpass.runtime.native.driver_library import PLAIN
from ballpass.runtime.run.reductions import Reduction

ModelMaker = Callable[..., Model]
BALLS = ("ball.force", "ball.elastic_force", "ball.damping_force", "ball.deflection")


@pytest.fixture
def one_library(monkeypatch: pytest.MonkeyPatch) -> Callable[[Model], Model]:
    """Lets `simulate` run the driver that `reduce` runs: two compilations may round a sum over the balls differently,
    and a force that jumps makes that a different motion within the tolerance."""

    def share(model: Model) -> Model:
        monkeypatch.setitem(model._drivers, PLAIN, model.ensemble_driver.stepper)
        return model

    return share


@pytest.mark.parametrize("method", ["stepper-dp54", "stepper-dop853", "stepper-rodas4", "stepper-rodas5p"])
@pytest.mark.parametrize("law", ["one-sided", "one-sided-gated"])
def test_reductions_equal_those_of_fifty_thousand_samples_a_cycle(
    make_model: ModelMaker, one_library: Callable[[Model], Model], law: str, method: str
) -> None:
    model = one_library(press(make_model, law))
    # the same steps: what differs is that samples miss the top of a peak, by half their distance at most
    found = model.reduce(cycles=1.5, transient=1, method=method, rtol=1e-6)
    samples = model.simulate(cycles=1.5, transient=1, method=method, rtol=1e-6, samples_per_cycle=50_000).steady()
    assert set(found) == {*model.states, *BALLS}
    for name, reduction in found.items():
        values = samples[name]
        most = values if values.ndim == 1 else values.max(axis=1)
        size = np.max(np.abs(most))
        # where the gated law jumps at contact, its peak lies within a thirtieth of a quarter step
        short = 5e-3 if (law, name) == ("one-sided-gated", "ball.damping_force") else 1e-6
        assert reduction.maximum >= most.max() - short * size, name
        if name not in BALLS:
            assert reduction.minimum <= most.min() + 1e-6 * size, name
        assert reduction.maximum == pytest.approx(most.max(), abs=max(short, 2e-4) * size), name
        # the most loaded ball is least loaded where two balls change rank: a kink, met to a part of a quarter step
        near = 3e-3 if name in BALLS else 2e-4
        assert reduction.minimum == pytest.approx(most.min(), abs=near * size), name
        length = samples.t[-1] - samples.t[0]
        assert found.duration == pytest.approx(length, rel=1e-12)
        # Boole's rule is exact for the states of all but DOP853, whose long steps also hold more kinks of the forces
        long = method == "stepper-dop853"
        jumps = law == "one-sided-gated"
        close = (3e-3 if jumps and long else 1e-3 if jumps else 1e-4) if name in BALLS else 3e-4 if long else 1e-6
        assert reduction.mean == pytest.approx(np.trapezoid(most, samples.t) / length, abs=close * size), name
        rms = math.sqrt(np.trapezoid(most**2, samples.t) / length)
        assert reduction.rms == pytest.approx(rms, rel=10 * close if name in BALLS else 1e-4), name


@pytest.mark.parametrize("law", LAWS)
def test_extremes_are_values_the_model_has_at_their_times(make_model: ModelMaker, law: str) -> None:
    model = press(make_model, law)
    found = model.reduce(cycles=1, transient=0.25, rtol=1e-9)
    run = model.simulate(cycles=1, rtol=1e-9, samples_per_cycle=2_000)
    for name in BALLS:
        told = found[name]
        # from the sample before the peak on, the model is integrated to its very time
        k = int(np.searchsorted(run.t, told.maximum_time)) - 1
        near = model.simulate(duration=told.maximum_time, rtol=1e-9, samples_per_cycle=max(2, k + 1), transient=0)
        balls = near.outputs[name][-1]
        assert told.maximum_ball is not None
        assert balls[told.maximum_ball - 1] == pytest.approx(told.maximum, rel=2e-6), name
        assert np.argmax(balls) == told.maximum_ball - 1, name


def free_ring(make_model: ModelMaker, mean: float = 0.0) -> tuple[Model, complex, float, float]:
    """A ring that no ball touches, under a harmonic load: model, complex amplitude, circular frequency, offset."""
    mass, damping, force, frequency, phase, offset = 20.0, 200.0, 196.0, 50.0, 0.4, mean
    omega = 2.0 * math.pi * frequency
    response = force * cmath.exp(1j * phase) / (mass * complex(-(omega**2), omega * damping / mass))
    start = (response.real + offset, (1j * omega * response).real)
    model = make_model(
        "varying_compliance",
        (
            'type = "constant"                       # or "harmonic" (mean, amplitude, frequency, phase), '
            'or "table" (time, x, y)\nforce = ["196 N", "0 N"] ',
            'type = "harmonic"\nmean = ["0 N", "0 N"]\namplitude = ["196 N", "0 N"]\nfrequency = "50 Hz"\n'
            'phase = "0.4 rad"\n',
        ),
        ('clearance = "0 um" ', 'clearance = "2 mm" '),
        ('["3.9937 um", "0.1 um"]', f'["{start[0]!r} m", "0 m"]'),
        ('["0 m/s", "0 m/s"]', f'["{start[1]!r} m/s", "0 m/s"]'),
    )
    return model, response, omega, offset


@pytest.mark.parametrize("method", ["stepper-dp54", "stepper-dop853", "stepper-rodas5p"])
def test_harmonic_motion_has_the_extremes_mean_and_rms_of_its_closed_form(make_model: ModelMaker, method: str) -> None:
    model, response, omega, offset = free_ring(make_model, mean=5e-5)
    found = model.reduce(duration=0.4, transient=0, method=method, rtol=1e-10)["inner.x"]
    amplitude = abs(response)
    assert found.maximum == pytest.approx(offset + amplitude, rel=1e-8)
    assert found.minimum == pytest.approx(offset - amplitude, rel=1e-8)
    assert found.mean == pytest.approx(offset, rel=1e-7)
    assert found.rms == pytest.approx(math.sqrt(offset**2 + 0.5 * amplitude**2), rel=1e-7)
    for time, angle in ((found.maximum_time, 0.0), (found.minimum_time, math.pi)):
        phase = (omega * time + cmath.phase(response) - angle) / (2.0 * math.pi)
        # at the top a relative error e of the value is an error of sqrt(e) of the phase
        assert phase - round(phase) == pytest.approx(0.0, abs=1e-3)
    assert found.maximum_ball is None


def test_means_of_parts_of_a_run_add_up_to_that_of_the_whole(make_model: ModelMaker) -> None:
    model = press(make_model, "one-sided")
    whole = model.reduce(cycles=2, transient=0, rtol=1e-8)
    head = model.reduce(cycles=1.3, transient=0, rtol=1e-8)
    tail = model.reduce(cycles=2, transient=1.3, rtol=1e-8)
    assert tail.cycle_length is not None
    assert tail.start == pytest.approx(1.3 * tail.cycle_length)
    for name in whole:
        parts = (1.3 * head[name].mean + 0.7 * tail[name].mean) / 2.0
        scale = whole[name].rms
        assert parts == pytest.approx(whole[name].mean, abs=1e-6 * scale), name
        assert max(head[name].maximum, tail[name].maximum) == pytest.approx(whole[name].maximum, abs=1e-4 * scale)


def test_reductions_do_not_change_the_run(make_model: ModelMaker, one_library: Callable[[Model], Model]) -> None:
    model = one_library(press(make_model, "one-sided"))
    found = model.reduce(cycles=2, transient=1)
    run = model.simulate(cycles=2, method="stepper", samples_per_cycle=10)
    assert [found.end[name] for name in model.states] == run.x[-1].tolist()
    assert found.steps == run.statistics.steps


def test_memory_does_not_grow_with_the_run(make_model: ModelMaker) -> None:
    model = press(make_model, "stiff")
    model.reduce(cycles=2, transient=1)
    peaks = []
    for cycles in (250, 1_000):
        gc.collect()
        tracemalloc.start()
        model.reduce(cycles=cycles, transient=1, rtol=1e-4)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # the states of 1 000 cycles, each sampled once a step, would take 40 MB
    assert peaks[1] < 1.5 * peaks[0] + 100_000, peaks


def test_progress_is_told_and_ends_at_one(make_model: ModelMaker) -> None:
    told: list[float] = []
    press(make_model, "stiff").reduce(cycles=130, transient=1, rtol=1e-4, progress=told.append)
    assert told == sorted(told)
    assert len(told) > 2
    assert told[-1] == 1.0


def test_a_channel_without_damping_law_has_no_damping_force(make_model: ModelMaker) -> None:
    model = make_model("varying_compliance")
    found = model.reduce(cycles=1, transient=0)
    assert "ball.damping_force" not in found
    assert isinstance(found["ball.elastic_force"], Reduction)
    assert found["ball.elastic_force"].maximum == found["ball.force"].maximum
    with pytest.raises(KeyError, match=r"ball\.force"):
        found["ball_force"]


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"cycles": 2, "transient": 2}, "nothing is left"),
        ({"cycles": 2, "transient": -1}, "from 0 on"),
        ({"cycles": 2, "transient": 1, "method": "cvodes"}, "stepper-dp54"),
        ({"cycles": 2, "transient": 1, "rtol": 0.5}, "rtol"),
        ({"cycles": 2, "duration": 1.0}, "give one"),
    ],
)
def test_wrong_requests_are_refused_with_a_remedy(
    make_model: ModelMaker, request_: dict[str, float], message: str
) -> None:
    with pytest.raises(RequestError, match=message):
        press(make_model, "one-sided").reduce(**request_)  # type: ignore[arg-type]


def test_a_run_that_diverges_says_when(make_model: ModelMaker, boundless: Callable[[Model], Model]) -> None:
    model = boundless(press(make_model, "one-sided"))
    with pytest.raises(SimulationError, match=r"t = [0-9.e-]+ s, crank angle [0-9.]+ deg, step size"):
        model.reduce(cycles=2, transient=1, parameters={"bearing.outer_ring.stiffness": -1e13})
