"""Claims about simulations of an oscillator whose motion is known in closed form."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from artefact import DEFAULTS, write_folder

from ballpass.runtime import (
    ArtefactError,
    IntegrationError,
    Model,
    NoKernelsWarning,
    RequestError,
    Status,
    load,
    load_solution,
)
from ballpass.runtime.native import casadi_integrators, compile
from ballpass.runtime.native.casadi_integrators import METHODS
from ballpass.runtime.native.kernel import EvaluationError

# models made by hand here have no kernels
pytestmark = pytest.mark.filterwarnings("ignore::ballpass.runtime.NoKernelsWarning")

TURN = 2.0 * math.pi


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_folder(tmp_path_factory.mktemp("artefact") / "oscillator")


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def model(folder: Path, cache: Path) -> Model:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(compile.CACHE_VARIABLE, str(cache))
        return load(folder)


def exact(times: np.ndarray, parameters: dict[str, float] | None = None) -> np.ndarray:
    """Closed-form states: free decay about the equilibrium of each piece of the gate, plus harmonic response."""
    values = {name: value for name, (_, value) in DEFAULTS.items()} | (parameters or {})
    mass, decay = values["body.weight"] / 2, values["spring.damping"]
    stiffness = values["spring.stiffness"] / mass
    speed, start = values["driver.speed"], values["driver.start_angle"]
    amplitude = values["swing.amplitude"] / mass
    response = amplitude / complex(stiffness - speed**2, 2 * decay * speed)
    ring = math.sqrt(stiffness - decay**2)

    def harmonic(t: float) -> np.ndarray:
        turning = response * np.exp(1j * (start + speed * t))
        return np.array([turning.real, (1j * speed * turning).real])

    def free(state: np.ndarray, rest: float, dt: float) -> np.ndarray:
        x, v = state[0] - rest, state[1]
        c, s, fade = math.cos(ring * dt), math.sin(ring * dt) / ring, math.exp(-decay * dt)
        return np.array([rest + fade * (x * c + (v + decay * x) * s), fade * (v * c - (decay * v + stiffness * x) * s)])

    low, high = values["push.window.start"], values["push.window.end"] % TURN
    edges = sorted((edge - start + TURN * k) / speed for edge in (low, high) for k in range(-40, 40))
    edges = [edge for edge in edges if edge > 0]
    state, now = np.array([values["initial.x"], values["initial.v"]]) - harmonic(0.0), 0.0
    found = []
    for time in times:
        while now < time:
            until = min([time, *[edge for edge in edges if edge > now][:1]])
            middle = (start + speed * 0.5 * (now + until) - low) % TURN
            push = values["push.force"] if middle < (high - low) % TURN else 0.0
            state, now = free(state, push / (stiffness * mass), until - now), until
        found.append(state + harmonic(time))
    return np.array(found)


@pytest.mark.parametrize("method", METHODS)
def test_gated_oscillator_follows_its_closed_form(model: Model, method: str) -> None:
    solution = model.simulate(cycles=3, method=method, rtol=1e-11)
    expected = exact(solution.t)
    assert solution.status is Status.DONE
    # relative to the largest displacement and velocity
    error = np.max(np.abs(solution.x - expected), axis=0) / np.max(np.abs(expected), axis=0)
    assert np.all(error < 1e-8), error


@pytest.mark.parametrize("method", METHODS)
def test_backward_driver_and_harmonic_load_follow_the_closed_form(model: Model, method: str) -> None:
    changes = {"swing.amplitude": 7.0, "driver.speed": -31.0, "driver.start_angle": 5.0, "body.weight": 5.5}
    solution = model.simulate(cycles=4.3, method=method, rtol=1e-11, parameters=changes)
    expected = exact(solution.t, changes)
    error = np.max(np.abs(solution.x - expected), axis=0) / np.max(np.abs(expected), axis=0)
    assert np.all(error < 1e-8), error


def test_tighter_tolerance_means_smaller_error(model: Model) -> None:
    errors = []
    for rtol in (1e-4, 1e-6, 1e-8):
        solution = model.simulate(cycles=3, method="cvodes", rtol=rtol)
        errors.append(float(np.max(np.abs(solution.x[:, 0] - exact(solution.t)[:, 0]))) / 0.01)
    assert errors[0] > 10 * errors[1] > 100 * errors[2]
    assert errors[0] < 30e-4


@pytest.mark.parametrize("method", METHODS)
def test_gates_are_hit_exactly_however_coarse_the_samples(model: Model, method: str) -> None:
    for samples in (1, 3, 7, 64, 200, 333):
        solution = model.simulate(cycles=2, method=method, rtol=1e-11, samples_per_cycle=samples)
        assert len(solution) == 2 * samples + 1
        np.testing.assert_allclose(solution.x[-1], exact(solution.t[-1:])[0], rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_table_load_equals_a_load_integrated_by_scipy(model: Model, method: str) -> None:
    from scipy.integrate import solve_ivp

    changes = {"table.y.1": 3.0, "table.y.2": -9.0, "table.y.3": 20.0, "push.force": 0.0}
    solution = model.simulate(duration=0.9, method=method, rtol=1e-11, parameters=changes, samples_per_cycle=100)

    def rate(t: float, state: np.ndarray) -> list[float]:
        load_now = np.interp(t, [0.1, 0.25, 0.7], [3.0, -9.0, 20.0])
        return [state[1], (load_now - 1000.0 * state[0]) / 2.0 - 4.0 * state[1]]

    reference = solve_ivp(rate, (0, 0.9), [0.01, -0.2], method="DOP853", rtol=1e-11, atol=1e-13, max_step=0.005)
    np.testing.assert_allclose(solution.x[-1], reference.y[:, -1], rtol=1e-7, atol=1e-9)


def test_outputs_at_samples_equal_outputs_evaluated_one_by_one(model: Model) -> None:
    solution = model.simulate(cycles=2, parameters={"swing.amplitude": 4.0, "table.y.2": 8.0}, samples_per_cycle=150)
    for k in range(0, len(solution), 29):
        one = model.evaluate(solution.t[k], solution.x[k], parameters=solution.parameters)
        for name in model.outputs:
            np.testing.assert_allclose(solution[name][k], one[name], rtol=1e-9, atol=1e-12, err_msg=name)
    assert solution["ball.force"].shape == (301, 3)
    assert solution["push.power"].shape == (301,)


def test_sample_on_a_gate_shows_the_load_behind_it(model: Model) -> None:
    # the push starts a quarter turn after the start: sample 50 of 200
    changes = {"driver.start_angle": 0.0, "push.window.start": TURN / 4, "push.window.end": TURN / 2}
    solution = model.simulate(cycles=1, parameters=changes, samples_per_cycle=200)
    acting = np.flatnonzero(solution["push.power"])
    assert (acting[0], acting[-1]) == (50, 99)


@pytest.mark.filterwarnings("error::ballpass.runtime.NoKernelsWarning")
def test_a_folder_without_kernels_runs_with_a_warning_that_names_the_cost(model: Model) -> None:
    with pytest.warns(NoKernelsWarning, match=r"no kernels.*CasADi's functions.*some ten times as long.*no ensembles"):
        model.simulate(cycles=0.1)
    model.simulate(cycles=0.1, method="cvodes")  # asked for: no warning


def test_auto_takes_one_method_for_gentle_and_for_stiff_models_and_says_why(model: Model) -> None:
    gentle = model.simulate(cycles=0.1, method="auto")
    # decays at 1e5 1/s: an explicit method would take a thousand steps
    stiff = model.simulate(cycles=0.1, method="auto", parameters={"spring.damping": 5e4})
    assert gentle.statistics.method == stiff.statistics.method == "cvodes"
    assert "without the project's own stepper" in stiff.statistics.reason
    assert (stiff.statistics.steps or 0) < 300


@pytest.mark.parametrize("name", ["erk", "rosenbrock"])
def test_a_removed_method_is_refused_with_those_to_take_instead(model: Model, name: str) -> None:
    with pytest.raises(RequestError, match=rf"'{name}'.*auto, cvodes"):
        model.simulate(cycles=0.1, method=name)


def test_magnitudes_are_those_of_a_linear_oscillator(model: Model) -> None:
    changes = {"push.force": 40.0, "initial.x": 0.0, "initial.v": 0.0}
    solution = model.simulate(cycles=1, parameters=changes)
    frequency = math.sqrt(1000.0 / 2.0)
    np.testing.assert_allclose(solution.statistics.magnitudes, [0.04, 0.04 * frequency], rtol=1e-3)


def test_run_at_rest_without_load_stays_at_rest(model: Model) -> None:
    solution = model.simulate(cycles=1, parameters={"push.force": 0.0, "initial.x": 0.0, "initial.v": 0.0})
    assert not solution.x.any()


@pytest.mark.long
def test_integration_that_diverges_stops_and_keeps_what_it_has(model: Model) -> None:
    changes = {"spring.damping": -400.0, "spring.stiffness": -1e6}
    with pytest.raises(IntegrationError) as caught:
        model.simulate(cycles=4, method="cvodes", parameters=changes)
    error = caught.value
    assert error.status in (Status.NOT_FINITE, Status.INTEGRATOR_FAILED)
    assert 0 < len(error.partial) < 801
    assert np.isfinite(error.partial.x).all()
    assert error.partial.t[-1] <= error.time
    assert error.crank_angle == pytest.approx((0.3 + 20.0 * error.time) % TURN)
    assert "crank angle" in str(error)
    assert "t = " in str(error)


def test_integrator_that_returns_no_numbers_is_stopped_at_that_piece(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = casadi_integrators.advance

    def broken(*arguments: Any) -> tuple[np.ndarray, int, int]:
        block, steps, rejected = sound(*arguments)
        return block * np.nan if arguments[-1][1] else block, steps, rejected

    monkeypatch.setattr(casadi_integrators, "advance", broken)
    # the push starts at a quarter turn
    changes = {"driver.start_angle": 0.0, "push.window.start": TURN / 4, "push.window.end": TURN / 2}
    with pytest.raises(IntegrationError) as caught:
        model.simulate(cycles=1, method="cvodes", parameters=changes, samples_per_cycle=100)
    assert caught.value.status is Status.NOT_FINITE
    assert caught.value.crank_angle == pytest.approx(TURN / 4)
    assert len(caught.value.partial) == 26
    assert np.isfinite(caught.value.partial["ball.force"]).all()


def test_a_call_that_fails_loses_no_sample_before_its_failure(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    # one call crosses a whole segment; the failure lies amid it
    duration, last = 0.09, 0.0271
    sound = casadi_integrators.advance

    def failing(function: Any, state: np.ndarray, piece: tuple[float, float], *more: Any) -> Any:
        if sum(piece) > last:
            raise EvaluationError("it could not go on")
        return sound(function, state, piece, *more)

    # no load switches meanwhile
    request = {"duration": duration, "rtol": 1e-9, "samples_per_cycle": 800}
    request["parameters"] = {"push.window.start": 1.0, "push.window.end": 1.0}
    whole = model.simulate(method="cvodes", **request)
    assert whole.statistics.segments == 1
    monkeypatch.setattr(casadi_integrators, "advance", failing)
    with pytest.raises(IntegrationError, match="integrator could not go on") as caught:
        model.simulate(method="cvodes", **request)
    kept = caught.value.partial
    assert kept.t[-1] <= last < whole.t[len(kept)]
    assert caught.value.time == kept.t[-1]
    np.testing.assert_allclose(kept.x, whole.x[: len(kept)], atol=1e-6 * np.max(np.abs(whole.x)))


def test_model_without_states_only_evaluates_outputs(tmp_path: Path, cache: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(compile.CACHE_VARIABLE, str(cache))
        model = load(write_folder(tmp_path / "still", states=False))
    solution = model.simulate(cycles=1, samples_per_cycle=20, parameters={"swing.amplitude": 3.0, "push.force": 0.0})
    assert solution.x.shape == (21, 0)
    expected = -1000.0 * 1.0 + 3.0 * np.cos(0.3 + 20.0 * solution.t)
    np.testing.assert_allclose(solution["ball.force"][:, 1], 2 * expected, rtol=1e-12)
    assert model.refine_peak(solution, "ball.force").value == pytest.approx(-997.0, rel=1e-6)


def test_solution_survives_netcdf(model: Model, tmp_path: Path) -> None:
    solution = model.simulate(cycles=2, method="cvodes", transient=0.5)
    path = solution.save(tmp_path / "solution.nc")
    assert [entry.name for entry in tmp_path.iterdir()] == ["solution.nc"]
    back = load_solution(path)
    np.testing.assert_array_equal(back.t, solution.t)
    np.testing.assert_array_equal(back.x, solution.x)
    for name, samples in solution.outputs.items():
        np.testing.assert_array_equal(back[name], samples)
    for name in ("parameters", "constants", "cycle_length", "transient_cycles", "manifest", "statistics", "status"):
        assert getattr(back, name) == getattr(solution, name), name


def test_dataset_has_dimensions_units_and_words(model: Model) -> None:
    data = model.simulate(cycles=0.5).to_xarray()
    assert data["ball.force"].dims == ("time", "ball")
    assert list(data["ball"].values) == [1, 2, 3]
    assert data["body.v"].attrs == {"units": "m/s", "long_name": "Velocity of the body"}
    assert data["time"].attrs["units"] == "s"


def test_a_file_of_somebody_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.nc").write_text("not NetCDF")
    with pytest.raises(RequestError, match="not a NetCDF-4 file"):
        load_solution(tmp_path / "x.nc")
    with pytest.raises(RequestError, match="no such file"):
        load_solution(tmp_path / "y.nc")


def test_steady_part_leaves_the_transient_cycles_out(model: Model) -> None:
    solution = model.simulate(cycles=3, samples_per_cycle=100, transient=1)
    steady = solution.steady()
    assert len(steady) == 201
    assert steady.t[0] == pytest.approx(model.period())
    with pytest.raises(RequestError, match="transient"):
        model.simulate(cycles=1, transient=2).steady()


def test_solution_cannot_be_changed_and_names_near_misses(model: Model) -> None:
    solution = model.simulate(cycles=0.1)
    with pytest.raises(ValueError, match="read-only"):
        solution["body.x"][0] = 1.0
    with pytest.raises(RequestError, match=r"Did you mean 'ball\.force'"):
        solution["ball.forces"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"parameters": {"spring.stiffness": True}}, "one number in N/m"),
        ({"parameters": [1.0]}, "mapping"),
        ({"cycles": 1, "duration": 1.0}, "both"),
        ({"duration": math.inf}, "above 0 s"),
        ({"cycles": 1, "method": "stepper"}, "auto, cvodes"),
        ({"cycles": 1, "initial": [0.0]}, r"body\.x, body\.v"),
        ({"cycles": 1, "transient": -1}, "transient"),
        ({"cycles": 1, "parameters": {"driver.speed": 0.0}}, "duration"),
        ({"cycles": 1, "parameters": {"table.time.2": 0.05}}, "must increase"),
    ],
)
def test_wrong_requests_are_refused_with_a_remedy(model: Model, arguments: dict[str, object], words: str) -> None:
    with pytest.raises(RequestError, match=words):
        model.simulate(**arguments)  # type: ignore[arg-type]


def test_standing_driver_runs_for_a_duration(model: Model) -> None:
    still = {"driver.speed": 0.0, "driver.start_angle": 3.0}
    solution = model.simulate(duration=0.5, parameters=still, samples_per_cycle=50, rtol=1e-10)
    assert solution.cycle_length is None
    assert len(solution) == 51
    # out of the window: free decay
    values = {"push.force": 0.0}
    np.testing.assert_allclose(solution.x, exact(solution.t, values), rtol=1e-7, atol=1e-9)


def test_linkage_that_locks_between_the_angles_looked_at_is_refused(model: Model) -> None:
    # margin 0.7 + 0.1 weight - sin(angle): it vanishes at 90 degrees for 3 kg
    model.check_assembly({"body.weight": 3.0 + 1e-6, "driver.start_angle": 0.1})
    with pytest.raises(RequestError, match=r"joint 'C' at crank angle 90\.00 deg"):
        model.simulate(cycles=1, parameters={"body.weight": 3.0 - 1e-9, "driver.start_angle": 0.1})


def test_jacobian_refuses_what_it_does_not_know(model: Model) -> None:
    with pytest.raises(RequestError, match="rhs"):
        model.jacobian("outputs")
    with pytest.raises(RequestError, match="wrt takes 'states'"):
        model.jacobian("rhs", "state")


def test_parameters_print_as_a_table(model: Model) -> None:
    lines = str(model.parameters).splitlines()
    assert lines[0].split() == ["name", "value", "unit", "description"]
    assert lines[4].split() == ["body.weight", "4", "kg", "body.weight", "of", "the", "test"]
    assert model.constants({"body.weight": 9.0}) == {"mass": 4.5}
    assert model.parameters["body.weight"] == 4.0
    with pytest.raises(KeyError, match=r"body\.weight"):
        model.parameters["body.wieght"]


def test_a_pickled_model_gives_the_same_bits_and_is_refused_where_its_folder_has_changed(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    write_folder(folder)
    sent = pickle.dumps(load(folder))
    assert np.array_equal(pickle.loads(sent).simulate(cycles=1).x, load(folder).simulate(cycles=1).x)
    other = sent.replace(b"0" * 64, b"f" * 64)  # the signature
    with pytest.raises(ArtefactError, match="since the model was pickled"):
        pickle.loads(other)


def test_progress_runs_to_one(model: Model) -> None:
    seen: list[float] = []
    model.simulate(cycles=2, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
