"""Claims about refined peaks: those of densely sampled runs, spikes that samples miss, and what is not smooth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from ballpass.runtime import IntegrationError, Model, load_solution
from ballpass.runtime.app.summary import summarize

ModelMaker = Callable[..., Model]


@pytest.mark.parametrize("name", ["punching_press", "punching_press_tangent"])
@pytest.mark.parametrize("output", ["ball.force", "ball.elastic_force"])
def test_refined_peak_equals_that_of_the_reduction_at_equal_tolerance(
    make_model: ModelMaker, name: str, output: str
) -> None:
    """The driver searches its steps' polynomials, `refine_peak` grids of the same steps around what it found."""
    model = make_model(name)
    peak = model.refine_peak(model.simulate(3, transient=1, rtol=1e-9, outputs=[output]).steady(), output)
    reduced = model.reduce(3, transient=1, rtol=1e-9)[output]
    assert peak.value == pytest.approx(reduced.maximum, rel=1e-8)
    assert peak.time == pytest.approx(reduced.maximum_time, abs=1e-8)
    assert peak.ball == reduced.maximum_ball


def test_summary_tells_the_peak_that_the_reduction_finds(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    found = summarize(model, model.simulate(3, transient=1))["peak_ball_force"]
    assert found["total"] == pytest.approx(model.reduce(3, transient=1)["ball.force"].maximum, rel=2e-6)


def test_a_few_samples_find_the_peak_that_many_find(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    few, many = (
        model.refine_peak(model.simulate(2, transient=0, rtol=1e-9, samples_per_cycle=n), "ball.force")
        for n in (500, 7001)
    )
    assert few.sampled < many.value * (1.0 - 1e-4)
    assert few.value == pytest.approx(many.value, rel=1e-8)


def test_a_load_that_jumps_peaks_at_the_edge_itself(make_model: ModelMaker) -> None:
    """The reaction's limit at the window's end, reached from within; where the reaction falls there is no parabola."""
    model = make_model("punching_press")
    solution = model.simulate(1, transient=0, samples_per_cycle=307, outputs=["reaction.A.y"])
    peak = model.refine_peak(solution, "reaction.A.y")
    turn = model.period()
    edge = next(t for t in model.breakpoints(0.0, turn) if abs(t - peak.time) < turn / 307)
    sides = [model.evaluate(edge + s * turn, outputs=["reaction.A.y"])["reaction.A.y"] for s in (-1e-11, 1e-11)]
    assert peak.value == pytest.approx(max(float(side) for side in sides), rel=1e-8)
    assert math.isclose(peak.time, edge, abs_tol=1e-9)


#: Rings of the offset slider so light and so loose that a ball's blow lasts a fraction of a sample interval: parameters
#: of runs whose highest spike is not next to any of the highest samples.
SPIKES = (
    {"bearing.inner_ring.mass": 0.025, "bearing.clearance": 100e-6},
    {"bearing.inner_ring.mass": 0.0167, "bearing.clearance": 169e-6},
    {"bearing.inner_ring.mass": 0.0153684, "bearing.clearance": 20.994e-6},
)


def densely(model: Model, span: tuple[float, float], name: str, sign: float = 1.0, **run: Any) -> tuple[float, float]:
    """Largest value of an output over a span, and its time: 200 000 samples of the same steps, then 4001 around the
    three best."""

    def sampled(times: np.ndarray) -> np.ndarray:
        found = model.simulate(times=times, outputs=[name], **run)[name]
        highest: np.ndarray = np.max(sign * found.reshape(len(times), -1), axis=1)
        return highest

    times = np.linspace(*span, 200_001)
    values, best = sampled(times), (-math.inf, 0.0)
    for k in np.argsort(-values)[:3]:
        fine = np.linspace(times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)], 4001)
        closely = sampled(fine)
        best = max(best, (float(np.max(closely)), float(fine[np.argmax(closely)])))
    return sign * best[0], best[1]


@pytest.mark.parametrize("parameters", SPIKES)
def test_a_spike_between_samples_is_found_wherever_it_is(make_model: ModelMaker, parameters: dict[str, float]) -> None:
    model = make_model("offset_slider")
    steady = model.simulate(4, transient=2, parameters=parameters).steady()
    peak = model.refine_peak(steady, "ball.force")
    span = (float(steady.t[0]), float(steady.t[-1]))
    value, time = densely(model, span, "ball.force", cycles=4, parameters=parameters)
    assert peak.sampled < 0.75 * value
    assert peak.value == pytest.approx(value, rel=1e-8)
    assert peak.time == pytest.approx(time, abs=1e-9)
    assert (peak.searched, peak.unsearched) == ("every step", 0)
    assert peak.value == pytest.approx(
        model.reduce(4, transient=2, parameters=parameters)["ball.force"].maximum, rel=1e-8
    )


def test_the_summary_tells_a_spike_between_samples_and_where_was_looked(make_model: ModelMaker) -> None:
    model = make_model("offset_slider")
    told = summarize(model, model.simulate(4, transient=2, parameters=SPIKES[0]))["peak_ball_force"]
    reduced = model.reduce(4, transient=2, parameters=SPIKES[0])
    for key, name in (("total", "ball.force"), ("elastic", "ball.elastic_force")):
        assert told[key] == pytest.approx(reduced[name].maximum, rel=1e-8)
        assert told["ball"][key] == reduced[name].maximum_ball
    assert told["searched"] == {"elastic": "every step", "total": "every step"}
    assert told["unsearched"] == {"elastic": 0, "total": 0, "unit": "1"}


@pytest.mark.parametrize("method", ["erk", "cvodes", "rosenbrock"])
def test_rates_at_the_samples_of_other_methods_show_a_spike_between_them(make_model: ModelMaker, method: str) -> None:
    """Against the stepper, at a tighter tolerance."""
    model = make_model("offset_slider")
    steady = model.simulate(4, transient=2, parameters=SPIKES[0], method=method).steady()
    peak = model.refine_peak(steady, "ball.force")
    tight = model.reduce(4, transient=2, parameters=SPIKES[0], rtol=1e-10)["ball.force"]
    assert peak.sampled < 0.75 * tight.maximum
    assert peak.value == pytest.approx(tight.maximum, rel=1e-3)
    assert peak.ball == tight.maximum_ball
    assert peak.searched == "samples"


def test_a_spike_of_a_run_that_does_not_begin_or_end_with_a_turn_is_found(make_model: ModelMaker) -> None:
    """The samples start amid a turn, and end before the run does; what comes later does not count."""
    model = make_model("offset_slider")
    turn = model.period()
    for begin, end in ((2.3, 3.8), (2.3, 2.6)):
        times = turn * np.linspace(begin, end, 2001)
        part = model.simulate(4, times=times, parameters=SPIKES[0], transient=0)
        peak = model.refine_peak(part, "ball.force")
        value, _ = densely(model, (times[0], times[-1]), "ball.force", cycles=4, parameters=SPIKES[0])
        assert peak.value == pytest.approx(value, rel=1e-8)
        assert peak.searched == "dense samples"
        assert times[0] <= peak.time <= times[-1]


def test_a_lowest_force_between_samples_is_found(make_model: ModelMaker) -> None:
    """Of any ball, not of the most loaded one, whose force the driver reduces: damping pulls where a contact ends."""
    model = make_model("offset_slider")
    steady = model.simulate(3, transient=2, parameters=SPIKES[0]).steady()
    lowest = model.refine_peak(steady, "ball.force", kind="min")
    span = (float(steady.t[0]), float(steady.t[-1]))
    value, _ = densely(model, span, "ball.force", -1.0, cycles=3, parameters=SPIKES[0])
    assert value < 0.9 * lowest.sampled < 0.0
    assert lowest.value == pytest.approx(value, rel=1e-6)


def test_a_spike_of_a_solution_read_from_a_file_is_found(make_model: ModelMaker, tmp_path: Path) -> None:
    """Its steady part alone: where the run started is in the file as well."""
    model = make_model("offset_slider")
    run = model.simulate(4, transient=2, parameters=SPIKES[0], initial=np.full(8, 1e-6))
    back = load_solution(run.save(tmp_path / "run.nc"))
    peaks = [model.refine_peak(solution.steady(), "ball.force") for solution in (run, back)]
    assert peaks[0] == peaks[1]
    assert peaks[0].searched == "every step"


def test_a_run_that_is_not_met_again_is_searched_from_its_samples(make_model: ModelMaker) -> None:
    """A state that is another one in the last bit belongs to steps that nobody knows."""
    model = make_model("offset_slider")
    run = model.simulate(4, transient=2, parameters=SPIKES[0])
    x = np.array(run.x)
    x[-1, 0] = np.nextafter(x[-1, 0], 1.0)
    peaks = [model.refine_peak(solution.steady(), "ball.force") for solution in (run, replace(run, x=x))]
    assert [peak.searched for peak in peaks] == ["every step", "samples"]
    assert peaks[1].value == pytest.approx(peaks[0].value, rel=1e-3)
    # an earlier version did not tell where a run starts; it was where the parameters say
    old = replace(run, statistics=replace(run.statistics, initial=None, duration=None))
    assert model.refine_peak(old.steady(), "ball.force") == peaks[0]


def test_a_spike_in_a_long_run_of_several_calls_is_found(make_model: ModelMaker) -> None:
    model = make_model("offset_slider")
    run = model.simulate(130, transient=2, parameters=SPIKES[0], samples_per_cycle=40)
    assert run.statistics.calls > 1
    peak = model.refine_peak(run.steady(), "ball.force")
    near = (peak.time - 1e-4, peak.time + 1e-4)
    value, time = densely(model, near, "ball.force", cycles=130, parameters=SPIKES[0])
    assert peak.value == pytest.approx(value, rel=1e-8)
    assert peak.time == pytest.approx(time, abs=1e-9)
    span = (model.period() * 2, model.period() * 130)
    highest = model.simulate(130, parameters=SPIKES[0], times=np.linspace(*span, 200_001), outputs=["ball.force"])
    assert highest["ball.force"].max() <= peak.value


def test_a_run_that_failed_has_the_peak_of_what_there_is(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = make_model("offset_slider")
    whole = model.simulate(2, transient=0, parameters=SPIKES[0])
    monkeypatch.setattr("ballpass.runtime.run.stepping.STEPS_A_CALL", 2500)
    monkeypatch.setattr("ballpass.runtime.run.stepping.step_limit", lambda *_: 5000)
    with pytest.raises(IntegrationError) as caught:
        model.simulate(2, transient=0, parameters=SPIKES[0])
    partial = caught.value.partial
    peak = model.refine_peak(partial, "ball.force")
    told = summarize(model, partial)["peak_ball_force"]
    assert (told["total"], told["time"]["total"]) == (peak.value, peak.time)
    monkeypatch.undo()
    assert 1000 < len(partial) < len(whole)
    # cut into calls, it is another run of the same motion
    value, _ = densely(model, (0.0, float(partial.t[-1])), "ball.force", cycles=2, parameters=SPIKES[0])
    assert peak.value == pytest.approx(value, rel=1e-4)


@pytest.mark.parametrize("kind", ["max", "min"])
def test_reactions_peak_where_they_do_however_few_the_samples(
    make_model: ModelMaker, kind: Literal["max", "min"]
) -> None:
    """They follow from time alone, and no step is needed to see them."""
    model = make_model("offset_slider")
    few, many = (
        model.refine_peak(model.simulate(2, transient=0, samples_per_cycle=n), "reaction.A.y", kind=kind)
        for n in (23, 20_000)
    )
    assert few.value == pytest.approx(many.value, rel=1e-8)
    assert many.value == pytest.approx(many.sampled, rel=1e-4)
    assert few.searched == "dense samples"


def test_a_load_that_rises_and_falls_between_two_samples_is_found(make_model: ModelMaker) -> None:
    """A row of the load's table, 1 µs from those around it; samples are 76 µs apart."""
    time, x = ["0 s", "9.999 ms", "10 ms", "10.001 ms", "1 s"], ["196 N", "196 N", "900 N", "196 N", "196 N"]
    rows = f"time = {time}\nx = {x}\ny = {['0 N'] * 5}".replace("'", '"')
    changes = (('type = "constant"', 'type = "table"'), ('force = ["196 N", "0 N"]', rows))
    model = make_model("varying_compliance", *changes)
    peak = model.refine_peak(model.simulate(1, transient=0), "load.x")
    assert peak.sampled == 196.0
    assert peak.value == pytest.approx(900.0, rel=1e-6)
    assert peak.time == pytest.approx(0.01, abs=1e-9)
