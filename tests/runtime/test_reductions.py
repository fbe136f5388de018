"""Claims about on-line reductions: they tell of a run what dense sampling, closed forms and the outputs tell."""

from __future__ import annotations

import cmath
import gc
import math
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from press_laws import LAWS, press
from quick_cases import long_but

from ballpass.runtime import Model, RequestError, SimulationError, Solution
from ballpass.runtime.run.reductions import Reduction, Reductions, joined

ModelMaker = Callable[..., Model]
BALLS = ("ball.force", "ball.elastic_force", "ball.damping_force", "ball.deflection")


@pytest.mark.parametrize("method", ["stepper-dp54", "stepper-dop853", "stepper-rodas4", "stepper-rodas5p"])
@pytest.mark.parametrize("law", ["one-sided", pytest.param("one-sided-gated", marks=pytest.mark.long)])
def test_reductions_equal_those_of_fifty_thousand_samples_a_cycle(
    make_model: ModelMaker, law: str, method: str
) -> None:
    model = press(make_model, law)
    # the same steps: what differs is that samples miss the top of a peak, by half their distance at most
    found = model.reduce(cycles=1.5, transient=1, method=method, rtol=3e-7)
    samples = model.simulate(cycles=1.5, transient=1, method=method, rtol=3e-7, samples_per_cycle=50_000).steady()
    assert set(found) == {*model.states, *BALLS}
    for name, reduction in found.items():
        values = samples[name]
        most = values if values.ndim == 1 else values.max(axis=1)
        size = np.max(np.abs(most))
        assert reduction.maximum >= most.max() - 1e-6 * size, name
        assert reduction.minimum <= most.min() + 1e-6 * size, name
        # samples miss the place where the gated law jumps at contact
        missed = 5e-3 if (law, name) == ("one-sided-gated", "ball.damping_force") else 2e-4
        assert reduction.maximum == pytest.approx(most.max(), abs=missed * size), name
        # the most loaded ball is least loaded where two balls change rank: a kink, which samples miss
        near = 3e-3 if name in BALLS else 2e-4
        assert reduction.minimum == pytest.approx(most.min(), abs=near * size), name
        length = samples.t[-1] - samples.t[0]
        assert found.duration == pytest.approx(length, rel=1e-12, abs=0.0)
        # samples do not end where the gated law jumps
        close = 1e-4 if (law, name) == ("one-sided-gated", "ball.damping_force") else 1e-6
        assert reduction.mean == pytest.approx(np.trapezoid(most, samples.t) / length, abs=close * size), name
        rms = math.sqrt(np.trapezoid(most**2, samples.t) / length)
        assert reduction.rms == pytest.approx(rms, rel=10 * close), name


@pytest.mark.parametrize(
    "rtol", [3e-7, 1e-9, *(pytest.param(one, marks=pytest.mark.long) for one in (1e-7, 1e-8, 1e-10))]
)
def test_means_of_the_most_loaded_ball_converge_with_the_tolerance(rotor: Model, rtol: float) -> None:
    """Where another ball became the most loaded one, a step was integrated over its corner: 3e-8 apart at 1e-10."""
    turn = rotor.period()
    times = np.linspace(turn, 2.0 * turn, 200_001)
    force = rotor.simulate(duration=2.0 * turn, transient=turn, times=times, rtol=1e-12, outputs=["ball.force"])
    most = force["ball.force"].max(axis=1)
    mean, square = (float(np.trapezoid(most**power, times)) / turn for power in (1, 2))
    expected = {"mean": mean, "rms": math.sqrt(square), "integral": mean * turn}
    names = [f"{kind}:ball.force" for kind in expected]
    run: dict[str, Any] = {"cycles": 2, "transient": 1, "rtol": rtol}
    table = {"bearing.clearance": [rotor.parameters["bearing.clearance"]]}
    for found in (
        {name: one.value for name, one in rotor.quantities(names, **run).items()},
        {name: float(rotor.simulate_many(table, names, kinks="stepped-over", **run)[name][0]) for name in names},
    ):
        for name, value in zip(names, expected.values(), strict=True):
            # samples themselves are 1e-11 off
            assert found[name] == pytest.approx(value, rel=0.3 * rtol + 2e-11, abs=0.0), name


def test_steps_that_end_on_jumps_of_a_force_take_its_mean_beside_them(make_model: ModelMaker) -> None:
    """Their ends took either side of the jump: mean and rms of the damping force were 1.4e-3 too large."""
    model = press(make_model, "one-sided-gated")
    located, over = (model.reduce(2, transient=1, rtol=1e-8, kinks=kinks) for kinks in ("located", "stepped-over"))
    for moment in ("mean", "rms"):
        expected = getattr(over["ball.damping_force"], moment)
        assert getattr(located["ball.damping_force"], moment) == pytest.approx(expected, rel=1e-4), moment


#: Runs in which the damping force jumps to its extreme between two quarters of a step, or two balls change rank there:
#: law, method, tolerance, parameters.
BETWEEN_QUARTERS = (
    (
        *("one-sided-gated", "stepper-dp54", 1e-4),
        {
            "bearing.damping.coefficient": 2.16e4,
            "bearing.clearance": 2.3060934661519025e-05,
            "bearing.inner_ring.equivalent_mass.ring": 0.07583557060879788,
            "mechanism.driver.speed": 55.80619434108843,
            "bearing.outer_ring.mass": 1.3327981546227927,
        },
    ),
    (
        *("one-sided-gated", "stepper-rodas5p", 1e-4),
        {
            "bearing.damping.coefficient": 2.16e4,
            "bearing.clearance": 1.2565719918271567e-05,
            "bearing.inner_ring.equivalent_mass.ring": 0.011353198378048266,
            "mechanism.driver.speed": 92.88644195422873,
            "bearing.outer_ring.mass": 0.4115569496215322,
        },
    ),
    ("one-sided", "stepper-dp54", 1e-5, {"bearing.clearance": -1e-5}),
    ("one-sided", "stepper-dop853", 1e-6, {"bearing.clearance": -1e-5}),
)


@pytest.mark.long
@pytest.mark.parametrize(("law", "method", "rtol", "parameters"), BETWEEN_QUARTERS)
def test_extremes_beside_jumps_and_changes_of_rank_are_those_of_the_run(
    make_model: ModelMaker, law: str, method: str, rtol: float, parameters: dict[str, float]
) -> None:
    """No sample of the run lies beyond, however close to the extreme samples are taken."""
    model = press(make_model, law)

    def sampled(**samples: Any) -> Solution:
        return model.simulate(
            1, transient=0.25, method=method, rtol=rtol, parameters=parameters, outputs=BALLS, **samples
        ).steady()

    coarse = sampled(samples_per_cycle=20_000)
    for name in BALLS:
        assert coarse.steady_reductions is not None
        told = coarse.steady_reductions[name]
        for sign, value, time in ((1, told.maximum, told.maximum_time), (-1, told.minimum, told.minimum_time)):
            near = sampled(times=np.linspace(time - 1e-6, time + 1e-6, 2001))
            highest = [float(np.max(sign * run[name].max(axis=1))) for run in (coarse, near)]
            size = np.max(np.abs(coarse[name]))
            assert sign * value >= max(highest) - 1e-9 * size, (name, sign)
            assert sign * value == pytest.approx(highest[1], abs=1e-3 * size), (name, sign)


@pytest.mark.parametrize("law", long_but(LAWS, "one-sided", "tangent"))
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
    assert found.minimum == pytest.approx(offset - amplitude, rel=1e-8, abs=0.0)
    assert found.mean == pytest.approx(offset, rel=1e-7)
    assert found.rms == pytest.approx(math.sqrt(offset**2 + 0.5 * amplitude**2), rel=1e-7)
    for time, angle in ((found.maximum_time, 0.0), (found.minimum_time, math.pi)):
        phase = (omega * time + cmath.phase(response) - angle) / (2.0 * math.pi)
        # at the top a relative error e of the value is an error of sqrt(e) of the phase
        assert phase - round(phase) == pytest.approx(0.0, abs=1e-3)
    assert found.maximum_ball is None


def test_of_equal_extremes_of_a_periodic_motion_the_first_is_taken(make_model: ModelMaker) -> None:
    """Rounding and the error of the steps decided in which of twenty periods a member had its extreme."""
    model, _, omega, _ = free_ring(make_model)
    table = {"bearing.inner_ring.damping": 2e4 * (1.0 + 1e-6 * np.arange(6))}
    names = ["peak_time:inner.x", "min_time:inner.x"]
    first = model.period() + 2.0 * math.pi / omega
    for lanes in (True, False):
        found = model.simulate_many(table, names, duration=0.8, transient=1, rtol=1e-6, lanes=lanes)
        for name in names:
            assert np.all(found[name] < first), (name, lanes)


@pytest.mark.parametrize("push", [1e-6, 1e-10, 1e-11])
def test_a_small_vibration_about_a_large_offset_keeps_its_digits(make_model: ModelMaker, push: float) -> None:
    """A ring 4 um from the middle that vibrates down to 3e-15 m; raw squares gave 9e-13 m."""
    model = make_model("varying_compliance")
    still = {"transient": 0, "parameters": {"shaft.speed": 0.0}}
    start = model.simulate(duration=1e-3, times=[0.0], initial="equilibrium", **still).x[0].copy()
    start[model.states.index("inner.vx")] = push
    run = model.simulate(duration=0.02, times=np.linspace(0.0, 0.02, 20_001), rtol=1e-10, initial=start, **still)
    x = run["inner.x"]
    assert run.reductions is not None
    found = run.reductions["inner.x"]
    assert found.mean == pytest.approx(4e-6, rel=0.01)
    assert found.std == pytest.approx(np.std(x - x[0]), rel=1e-4, abs=0.0)


def test_joined_stretches_keep_the_digits_of_their_deviation() -> None:
    both = joined(stretch(mean=1.0, std=3e-9, duration=1.0), stretch(mean=1.0 + 8e-9, std=3e-9, duration=1.0))
    assert both is not None
    assert both["x"].std == pytest.approx(5e-9, rel=1e-6, abs=0.0)
    assert both["x"].mean == pytest.approx(1.0 + 4e-9, rel=1e-15, abs=0.0)


def stretch(*, mean: float, std: float, duration: float) -> Reductions:
    extremes: dict[str, Any] = dict.fromkeys(("maximum", "maximum_time", "minimum", "minimum_time"), 0.0)
    channel = Reduction(**extremes, maximum_ball=None, minimum_ball=None, mean=mean, std=std)
    return Reductions(
        channels={"x": channel}, start=0.0, duration=duration, end={}, steps=1, rejected=0, cycle_length=None
    )


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


def test_reductions_do_not_change_the_run(make_model: ModelMaker) -> None:
    model = press(make_model, "one-sided")
    found = model.reduce(cycles=2, transient=1)
    run = model.simulate(cycles=2, method="stepper", samples_per_cycle=10)
    assert [found.end[name] for name in model.states] == run.x[-1].tolist()
    assert found.steps == run.statistics.steps


@pytest.mark.long
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
    with pytest.raises(SimulationError, match=r"t = [0-9.e-]+ s, crank angle [0-9.]+ deg. Step size"):
        model.reduce(cycles=2, transient=1, parameters={"bearing.outer_ring.stiffness": -1e13})
