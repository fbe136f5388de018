"""Claims about samples: when they are taken, which outputs are evaluated at them, and what that costs in Python."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from artefact import write_folder
from test_simulate import exact

from ballpass.runtime import IntegrationError, Model, RequestError, Status, load_solution, read_manifest
from ballpass.runtime.ask.observables import statistics
from ballpass.runtime.native.kernel import Loop
from ballpass.runtime.vibration.spectrum import amplitude_spectrum

ModelMaker = Callable[..., Model]


@pytest.fixture(scope="module")
def oscillator(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """Run by CasADi's virtual machine: this folder has no kernels, and no compiler is asked for."""
    folder = write_folder(tmp_path_factory.mktemp("sampling") / "oscillator")
    return Model(folder, read_manifest(folder), None)


# times


@pytest.mark.parametrize("method", ["stepper", "stepper-rodas5p", "stepper-dop853"])
def test_samples_at_chosen_times_have_the_bits_of_an_even_grid(press: Model, method: str) -> None:
    even = press.simulate(2, method=method, samples_per_cycle=360)  # the punch begins and ends at samples
    chosen = np.unique(np.random.default_rng(3).integers(0, len(even), 200))
    between = np.random.default_rng(4).uniform(0.0, even.t[-1], 50)
    times = np.union1d(even.t[chosen], between)
    found = press.simulate(2, method=method, times=times)
    rows = np.searchsorted(times, even.t[chosen])
    assert np.array_equal(found.t, times)
    assert found.statistics.steps == even.statistics.steps
    assert found.statistics.rejected == even.statistics.rejected
    assert np.array_equal(found.x[rows], even.x[chosen])
    for name in press.outputs:
        assert np.array_equal(found[name][rows], even[name][chosen]), name


def test_a_sample_on_the_edge_of_a_load_shows_the_load_behind_it_however_the_run_is_sampled(press: Model) -> None:
    edges = press.breakpoints(0.0, press.period())
    times = np.sort(np.concatenate([edges, edges - 1e-6, edges + 1e-6]))
    torque = press.simulate(1, times=times)["drive_torque"].reshape(-1, 3)
    before, on, behind = torque.T
    assert np.all(np.abs(on - behind) < 1e-2 * np.abs(before - behind))


def test_casadi_s_method_follows_the_closed_form_at_chosen_times(oscillator: Model) -> None:
    times = np.sort(np.random.default_rng(5).uniform(0.0, 0.6, 23))
    solution = oscillator.simulate(times=times, method="cvodes", rtol=1e-11)
    expected = exact(times)
    error = np.max(np.abs(solution.x - expected), axis=0) / np.max(np.abs(expected), axis=0)
    assert np.all(error < 1e-8), error


def test_the_run_ends_at_the_last_time_unless_its_length_is_given(rotor: Model) -> None:
    ends = []
    turn = rotor.period()
    rotor.simulate(times=[0.1 * turn, 0.5 * turn], progress=ends.append)
    short = rotor.simulate(times=[0.5 * turn])
    whole = rotor.simulate(1, times=[0.5 * turn])
    assert ends[-1] == 1.0
    assert len(short) == len(whole) == 1
    assert (whole.statistics.steps or 0) > 1.5 * (short.statistics.steps or 0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"times": [0.0, 0.2, 0.1]}, r"0\.1 s follows 0\.2 s \(places 1 and 2\)"),
        ({"times": [0.1, 0.1]}, "must increase"),
        ({"times": [-0.1, 0.1]}, "lies before it"),
        ({"times": [0.0, 0.2], "duration": 0.1}, r"0\.2 s lies after it"),
        ({"times": []}, "one or more finite times"),
        ({"times": [[0.1, 0.2]]}, r"shape \(1, 2\)"),
        ({"times": [0.0, np.nan]}, "with NaN or inf"),
        ({"times": [0.0]}, "above 0 s"),
        ({"times": [0.0, 0.1], "samples_per_cycle": 100}, "both given"),
        ({"cycles": 1, "outputs": ["ball.forces"]}, r"Did you mean 'ball\.force'"),
    ],
)
def test_wrong_samples_are_refused_with_a_remedy(rotor: Model, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(RequestError, match=words):
        rotor.simulate(**arguments)


def test_uneven_solutions_are_saved_averaged_and_refined_but_have_no_spectrum(rotor: Model, tmp_path: Path) -> None:
    turn = rotor.period()
    times = turn * np.linspace(0.0, 1.0, 4001) ** 1.3
    uneven, even = rotor.simulate(times=times), rotor.simulate(1)
    back = load_solution(uneven.save(tmp_path / "uneven.nc"))
    assert np.array_equal(back.t, times)
    assert np.array_equal(back["ball.force"], uneven["ball.force"])
    mean = [statistics(found.t, found["inner.x"]).mean for found in (uneven, even)]
    assert mean[0] == pytest.approx(mean[1], rel=1e-4)
    peaks = [rotor.refine_peak(found, "ball.force").value for found in (uneven, even)]
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-6)
    with pytest.raises(RequestError, match="equal, positive steps"):
        amplitude_spectrum(uneven.t, uneven["inner.x"])


# outputs


def test_outputs_asked_for_have_the_bits_they_have_among_all(press: Model) -> None:
    whole = press.simulate(1, samples_per_cycle=500)
    for names in (["ball.force"], ["drive_torque", "inner.y", "ball.deflection"], ["reaction.A.x"]):
        found = press.simulate(1, samples_per_cycle=500, outputs=names)
        assert list(found.outputs) == names
        for name in names:
            assert np.array_equal(found[name], whole[name]), name
        with pytest.raises(RequestError, match="outputs="):
            found["ball.damping_force"]


def test_outputs_in_the_virtual_machine_are_those_asked_for(oscillator: Model) -> None:
    whole = oscillator.simulate(1, samples_per_cycle=300)
    found = oscillator.simulate(1, samples_per_cycle=300, outputs=["push.power"])
    assert isinstance(oscillator.loop("outputs", ("t", "x", "u")), Loop)
    assert list(found.outputs) == ["push.power"]
    assert np.array_equal(found["push.power"], whole["push.power"])


def test_without_outputs_but_states_nothing_is_evaluated(press: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("evaluated although nothing was asked for")

    monkeypatch.setattr(Model, "sample_outputs", refuse)
    assert press.simulate(0.1, outputs=[]).outputs == {}
    states = press.simulate(0.1, outputs=["inner.y"])
    assert np.array_equal(states["inner.y"], states.x[:, 1])


# work


def python_calls(run: Callable[[], object]) -> int:
    """Calls of Python and C functions that `run` makes."""
    calls = 0

    def count(_: FrameType, event: str, __: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        run()
    finally:
        sys.setprofile(before)
    return calls


@pytest.mark.parametrize("scene", ["punching_press_tangent", "varying_compliance"])
def test_no_sample_costs_any_python(make_model: ModelMaker, scene: str) -> None:
    model = make_model(scene)
    model.simulate(1)  # compiles what it needs
    few, many = (python_calls(lambda n=n: model.simulate(1, samples_per_cycle=n)) for n in (50, 20_000))
    assert few == many
    assert few < 2500


def test_no_segment_costs_any_python(press: Model) -> None:
    press.simulate(1)
    few, many = (python_calls(lambda n=n: press.simulate(n, samples_per_cycle=10)) for n in (12, 20))
    # a call of the stepper takes many segments; both runs have more than magnitudes look at, and fit one call
    assert many == few


# long runs


@pytest.mark.parametrize("method", ["stepper", "stepper-rodas5p", "stepper-dp54"])
def test_a_run_in_several_calls_within_a_segment_is_the_same_motion(
    rotor: Model, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    # one segment: the shaft's turn
    run = {"cycles": 1, "method": method, "rtol": 1e-9, "samples_per_cycle": 300}
    whole = rotor.simulate(**run, kinks="stepped-over")
    slope = rotor.sensitivities("bearing.clearance", **run).x
    monkeypatch.setattr("ballpass.runtime.run.loop.STEPS_A_CALL", 250)
    fractions: list[float] = []
    found = rotor.simulate(**run, kinks="stepped-over", progress=fractions.append)
    assert found.statistics.segments == whole.statistics.segments == 1
    assert found.statistics.calls == len(fractions) > 2
    assert np.all(np.diff(fractions) > 0.0)
    assert fractions[-1] == 1.0
    assert np.max(np.abs(found.x - whole.x) / whole.statistics.magnitudes) < 1e-6
    # where balls touch anew derivatives jump, and steps that end elsewhere show that at single samples
    cut = rotor.sensitivities("bearing.clearance", **run).x
    assert np.all(np.sqrt(np.mean((cut - slope) ** 2, axis=0)) < 1e-4 * np.max(np.abs(slope), axis=0))


def test_an_interrupt_is_heard_within_a_segment(rotor: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ballpass.runtime.run.loop.STEPS_A_CALL", 200)
    heard: list[float] = []

    def interrupt(fraction: float) -> None:
        heard.append(fraction)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rotor.simulate(1, rtol=1e-9, progress=interrupt)
    assert 0.0 < heard[0] < 0.5


@pytest.mark.long
def test_a_run_that_crawls_ends_with_its_pace(rotor: Model) -> None:
    # decay 5e9 1/s: an explicit method needs steps of a nanosecond, 4e9 of them
    with pytest.raises(IntegrationError, match="1000000 steps for the first") as caught:
        rotor.simulate(24, method="stepper-dp54", parameters={"bearing.inner_ring.damping": 1e11})
    assert caught.value.status is Status.TOO_MANY_STEPS
    assert caught.value.time < 0.01 * rotor.period()


def test_derivatives_do_not_depend_on_how_a_run_is_cut_into_calls(
    make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The jump at a load's edge needs the rate before the edge: no call may begin there."""
    model = make_model("punching_press")
    name = "mechanism.forces.punch.window.start"
    whole = model.sensitivities(name, cycles=3, rtol=1e-8)
    for segments in (1, 2, 4):  # edges of a turn: punch on, punch off, turn
        monkeypatch.setattr("ballpass.runtime.request.segments.SEGMENTS_A_CALL", segments)
        cut = model.sensitivities(name, cycles=3, rtol=1e-8)
        scale = np.max(np.abs(whole.x), axis=(0, 2))[:, None]
        assert np.max(np.abs(cut.x - whole.x) / scale) < 1e-3
