"""Claims about refined peaks: those of densely sampled runs, spikes that samples miss, and what is not smooth."""

from __future__ import annotations

import math
from collections.abc import Callable
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
    """A run with samples carries the reductions of one without, to the bit."""
    model = make_model(name)
    peak = model.refine_peak(model.simulate(3, transient=1, rtol=1e-9, outputs=[output]).steady(), output)
    reduced = model.reduce(3, transient=1, rtol=1e-9)[output]
    assert (peak.value, peak.time, peak.ball) == (reduced.maximum, reduced.maximum_time, reduced.maximum_ball)
    assert peak.searched == "every step"


def test_the_summary_has_motions_and_peak_of_the_reduction(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    told, reduced = summarize(model, model.simulate(3, transient=1)), model.reduce(3, transient=1)
    assert told["peak_ball_force"]["total"] == reduced["ball.force"].maximum
    for name in model.states:
        found = reduced[name]
        assert (told[name]["min"], told[name]["max"]) == (found.minimum, found.maximum)
        assert (told[name]["mean"], told[name]["rms"]) == (found.mean, found.rms)


def test_the_whole_run_has_the_extremes_and_means_of_a_run_without_transient(make_model: ModelMaker) -> None:
    """What is reduced before and behind the end of the transient, which lies amid a turn, belongs together."""
    model = make_model("punching_press")
    found = model.simulate(3, transient=1.3, rtol=1e-9).reductions
    whole = model.reduce(3, transient=0, rtol=1e-9)
    assert found is not None
    for name in whole:
        assert found[name].maximum == pytest.approx(whole[name].maximum, rel=1e-7, abs=0.0)
        # damping, and the force with it, jumps where a ball touches: Boole's rule over such a step is off by 1e-6
        jumps = name.endswith(("damping_force", "ball.force"))
        assert found[name].rms == pytest.approx(whole[name].rms, rel=1e-6 if jumps else 1e-7, abs=0.0)
    assert found.duration == pytest.approx(whole.duration)


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
    assert peak.searched == "every step"
    assert peak.value == pytest.approx(
        model.reduce(4, transient=2, parameters=parameters)["ball.force"].maximum, rel=1e-8
    )


@pytest.mark.parametrize(("method", "kind"), [("cvodes", "max"), ("stepper", "min")])
def test_what_the_samples_alone_show_is_told_as_such(
    make_model: ModelMaker, method: str, kind: Literal["max", "min"]
) -> None:
    """CasADi's integrator reduces nothing, and the stepper not the smallest force of any ball."""
    model = make_model("offset_slider")
    steady = model.simulate(3, transient=2, parameters=SPIKES[0], method=method).steady()
    peak = model.refine_peak(steady, "ball.force", kind=kind)
    extreme = np.max if kind == "max" else np.min
    assert (peak.value, peak.searched) == (extreme(steady["ball.force"]), "samples")
    assert peak.value == peak.sampled


def test_a_spike_of_a_solution_read_from_a_file_is_found(make_model: ModelMaker, tmp_path: Path) -> None:
    """Its steady part alone: where the run started is in the file as well."""
    model = make_model("offset_slider")
    run = model.simulate(4, transient=2, parameters=SPIKES[0], initial=np.full(8, 1e-6))
    back = load_solution(run.save(tmp_path / "run.nc"))
    peaks = [model.refine_peak(solution.steady(), "ball.force") for solution in (run, back)]
    assert peaks[0] == peaks[1]
    assert peaks[0].searched == "every step"


@pytest.mark.long
def test_a_spike_in_a_long_run_of_several_calls_is_found(make_model: ModelMaker) -> None:
    model = make_model("offset_slider")
    run = model.simulate(130, transient=2, parameters=SPIKES[0], samples_per_cycle=40)
    assert run.statistics.calls > 1
    peak = model.refine_peak(run.steady(), "ball.force")
    near = (peak.time - 1e-4, peak.time + 1e-4)
    value, time = densely(model, near, "ball.force", cycles=130, parameters=SPIKES[0])
    assert peak.value == pytest.approx(value, rel=1e-8, abs=0.0)
    assert peak.time == pytest.approx(time, abs=1e-9)
    span = (model.period() * 2, model.period() * 130)
    highest = model.simulate(130, parameters=SPIKES[0], times=np.linspace(*span, 200_001), outputs=["ball.force"])
    assert highest["ball.force"].max() <= peak.value


def test_a_run_that_failed_has_the_peak_of_what_there_is(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = make_model("offset_slider")
    whole = model.simulate(2, transient=0, parameters=SPIKES[0])
    monkeypatch.setattr("ballpass.runtime.run.loop.STEPS_A_CALL", 2500)
    monkeypatch.setattr("ballpass.runtime.run.limits.step_limit", lambda *_: 5000)
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
