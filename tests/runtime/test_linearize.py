"""Claims about small vibrations: closed forms, a second route to the eigenvalues, a simulated vibration."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ballpass.runtime import Model
from ballpass.runtime.app.cli import app
from ballpass.runtime.point.equilibrium import FreeRingWarning
from ballpass.runtime.point.linearize import KinkWarning

ROOT = Path(__file__).resolve().parent.parent.parent
AT_REST = {"shaft.speed": 0.0}

ELASTIC_OUTER = (
    'support = "fixed"',
    'support = "elastic"\nmass = "3 kg"\nstiffness = "4e7 N/m"\ndamping = "300 N*s/m"',
)


def test_one_loaded_ball_is_a_single_degree_of_freedom(rotor: Model) -> None:
    """k = (3/2) k_b delta^(1/2), f = sqrt(k/m)/(2 pi), zeta = c/(2 sqrt(k m)); sideways nothing holds the ring."""
    parameters = {**AT_REST, "bearing.clearance": 1e-3}
    with pytest.warns(FreeRingWarning):
        result = rotor.linearize(parameters=parameters)
    k_b, m, c = rotor.constants()["bearing.k_b"], 20.0, 200.0
    k = 1.5 * k_b * (196.0 / k_b) ** (1 / 3)
    assert result.stiffness == pytest.approx(np.diag([k, 0.0]), rel=1e-10, abs=1e-9 * k)
    assert result.damping == pytest.approx(np.diag([c, c]), rel=1e-12)
    bounce = result.modes[-1]
    assert bounce.natural_frequency == pytest.approx(math.sqrt(k / m) / (2 * math.pi), rel=1e-10)
    assert bounce.damping_ratio == pytest.approx(c / (2 * math.sqrt(k * m)), rel=1e-9)
    assert np.abs(bounce.shape) == pytest.approx([1.0, 0.0], abs=1e-9)
    rigid, creep = result.modes[:2]  # free to go sideways, and a velocity that decays with c/m
    assert rigid.rigid
    assert creep.eigenvalue == pytest.approx(-c / m, rel=1e-6)


def test_two_masses_in_a_row_have_the_roots_of_the_quadratic(make_virtual: Callable[..., Model]) -> None:
    """Ring on one ball on ring on housing: m1 m2 w^4 - (m1 (k1 + k2) + m2 k1) w^2 + k1 k2 = 0 without damping."""
    model = make_virtual("varying_compliance", ELASTIC_OUTER)
    parameters = {**AT_REST, "bearing.clearance": 1e-3, "bearing.inner_ring.damping": 0.0}
    parameters["bearing.outer_ring.damping"] = 0.0
    with pytest.warns(FreeRingWarning):
        result = model.linearize(parameters=parameters)
    k_b, m1, m2, k2 = model.constants()["bearing.k_b"], 20.0, 3.0, 4e7
    k1 = 1.5 * k_b * (196.0 / k_b) ** (1 / 3)
    squares = np.sort(np.roots([m1 * m2, -(m1 * (k1 + k2) + m2 * k1), k1 * k2]).real)
    expected = [*np.sqrt(squares), math.sqrt(k2 / m2)]  # the outer ring alone across the load
    found = [2 * math.pi * m.natural_frequency for m in result.modes if not m.rigid]
    assert sorted(found) == pytest.approx(sorted(expected), rel=1e-9)


@pytest.mark.parametrize(
    ("scene", "angle"), [("punching_press", 240.0), ("punching_press_tangent", 240.0), ("varying_compliance", 10.0)]
)
def test_eigenvalues_are_those_of_the_right_hand_side(
    make_virtual: Callable[..., Model], scene: str, angle: float
) -> None:
    """M, C, K and the first-order form written out against the Jacobian of the states as it is generated."""
    model = make_virtual(scene)
    result = model.linearize(crank_angle=math.radians(angle))
    matrix = model.jacobian("rhs", "states", t=result.time, x=result.x)
    expected = np.linalg.eigvals(matrix)
    expected = expected[np.lexsort((expected.imag, np.abs(expected).round(6)))]
    found = result.eigenvalues
    assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(expected)), rel=1e-9)
    assert np.sort(found.real) == pytest.approx(np.sort(expected.real), rel=1e-7)
    for mode in result.modes:
        z = np.concatenate([mode.shape, mode.eigenvalue * mode.shape])
        assert np.linalg.norm(matrix @ z - mode.eigenvalue * z) <= 1e-8 * abs(mode.eigenvalue) * np.linalg.norm(z)


def test_mass_matrix_times_acceleration_is_the_load(make_virtual: Callable[..., Model]) -> None:
    """The masses are the model's own: a force on free rings accelerates them by F/m."""
    model = make_virtual("punching_press_tangent")
    parameters = {"bearing.clearance": 7e-3}
    result = model.linearize(crank_angle=1.0, x=np.zeros(8), parameters=parameters)
    numbers = model.numbers(parameters)
    rate = model.kernel("rhs")(
        {"t": 0.0, "x": np.zeros(8), "u": model.inputs_at(result.time, parameters), "p": numbers.p, "c": numbers.c}
    )
    load = model.static_equilibrium(result.time, parameters=parameters).load
    assert (result.mass @ rate[4:])[:2] == pytest.approx(load, rel=1e-12)


def test_frequency_is_that_of_a_simulated_vibration(rotor: Model) -> None:
    """Kicked by a nanometre from equilibrium along the load, the ring passes it twice a period."""
    result = rotor.linearize(parameters=AT_REST)
    along = max(result.modes, key=lambda m: abs(m.shape[0]) - abs(m.shape[1]))
    start = result.x.copy()
    start[0] += 1e-9
    run = rotor.simulate(
        duration=0.05, parameters=AT_REST, initial=start, rtol=1e-10, samples_per_cycle=4001, transient=0
    )
    y = run["inner.x"] - result.x[0]
    k = np.flatnonzero(np.diff(np.signbit(y)))
    crossings = run.t[k] - y[k] * (run.t[k + 1] - run.t[k]) / (y[k + 1] - y[k])
    period = 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert 1.0 / period == pytest.approx(along.damped_frequency, rel=2e-5)


def test_unrestrained_rings_have_rigid_modes_only(rotor: Model) -> None:
    result = rotor.linearize(x=np.zeros(4), parameters={"bearing.clearance": 1e-3, "bearing.inner_ring.damping": 0.0})
    assert not result.at_equilibrium
    assert result.unbalanced == pytest.approx(196.0 / 20.0, rel=1e-12)
    assert all(mode.rigid for mode in result.modes)


def damped_rotor(make_virtual: Callable[..., Model], balls: int) -> Model:
    """The rotor without damping to the frame, which one-sided damping of its balls stops."""
    return make_virtual(
        "varying_compliance",
        ('law = "none"', 'law = "one-sided"\ncoefficient = "2e3 N*s/m"'),
        ("balls = 8", f"balls = {balls}"),
        ('damping = "200 N*s/m"', 'damping = "0 N*s/m"'),
    )


def differences_of_one_side(model: Model, x: np.ndarray, state: int, step: float) -> np.ndarray:
    """Slope of the right-hand side on the side of the step's sign, extrapolated."""
    numbers, u = model.numbers(AT_REST), model.inputs_at(0.0, AT_REST)

    def rate(h: float) -> np.ndarray:
        moved = x.copy()
        moved[state] += h
        return model.kernel("rhs")({"t": 0.0, "x": moved, "u": u, "p": numbers.p, "c": numbers.c})

    one, two = ((rate(h) - rate(0.0)) / h for h in (step, 2.0 * step))
    slope: np.ndarray = 2.0 * one - two
    return slope


def logarithmic_decrement(model: Model, x: np.ndarray, frequency: float, turns: int) -> float:
    """Damping ratio of a free decay from a nanometre beside the equilibrium, by its highest displacements."""
    start = x.copy()
    start[0] += 1e-9
    times = np.linspace(0.0, (turns + 0.3) / frequency, 1001)
    run = model.simulate(times=times, parameters=AT_REST, initial=start, rtol=1e-10, method="cvodes")
    speed = run["inner.vx"]
    k = np.flatnonzero((speed[:-1] > 0.0) & (speed[1:] <= 0.0))
    tops = run["inner.x"][k] - x[0]
    decrement = math.log(tops[0] / tops[-1]) / (len(tops) - 1)
    return decrement / math.hypot(decrement, 2.0 * math.pi)


def test_opposite_balls_at_rest_are_a_linear_dashpot(make_virtual: Callable[..., Model]) -> None:
    """Z/4 c_b each way, and no word about a kink: the sum over the balls has a derivative where no ball's force has."""
    model = damped_rotor(make_virtual, 8)
    result = model.linearize(parameters=AT_REST)
    c_b = 2e3
    assert result.notes == ()
    assert result.damping == pytest.approx(2.0 * c_b * np.eye(2), rel=1e-9, abs=1e-9 * c_b)
    for state in (2, 3):
        expected = model.jacobian("rhs", model.states[state], x=result.x, parameters=AT_REST)
        for step in (1e-4, -1e-4):
            found = differences_of_one_side(model, result.x, state, step)
            assert found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.max(np.abs(expected)))
    along = max(result.modes, key=lambda m: abs(m.shape[0]) - abs(m.shape[1]))
    decay = logarithmic_decrement(model, result.x, along.damped_frequency, 3)
    assert along.damping_ratio == pytest.approx(decay, rel=1e-3)


def test_an_odd_number_of_balls_at_rest_has_two_slopes_and_decays_by_their_mean(
    make_virtual: Callable[..., Model],
) -> None:
    """The sum has a corner as well: both sides are told, those of differences, and a decay goes by their mean."""
    model = damped_rotor(make_virtual, 5)
    with pytest.warns(KinkWarning, match="Damping on either side"):
        result = model.linearize(parameters=AT_REST)
    sides = [-20.0 * differences_of_one_side(model, result.x, 2, step)[2] for step in (-1e-4, 1e-4)]
    told = result.notes[0].split("inner.x ")[1].rstrip(".").split(";")[0].split(" or ")
    assert [float(side) for side in told] == pytest.approx(sides, rel=1e-5)
    assert abs(sides[0] - sides[1]) > 200.0
    assert result.damping[0, 0] == pytest.approx(sum(sides) / 2.0, rel=1e-9)
    along = max(result.modes, key=lambda m: abs(m.shape[0]) - abs(m.shape[1]))
    decay = logarithmic_decrement(model, result.x, along.damped_frequency, 3)
    assert along.damping_ratio == pytest.approx(decay, rel=2e-3)
    with pytest.warns(KinkWarning, match="mean of both sides"):
        model.jacobian("ball.damping_force", "states", x=result.x, parameters=AT_REST)


def test_a_ball_that_parts_slowly_damps_half_of_any_faster_vibration(make_virtual: Callable[..., Model]) -> None:
    """One loaded ball, just behind the load line, that parts: ratio 0, and half of c_b for all that vibrates faster."""
    model = make_virtual(
        "varying_compliance",
        ('law = "none"', 'law = "one-sided-gated"\ncoefficient = "2e3 N*s/m"'),
        ('damping = "200 N*s/m"', 'damping = "0 N*s/m"'),
    )
    numbers = {"shaft.speed": 1e-2, "bearing.clearance": 1e-3}
    behind = [5e-4 + (196.0 / model.constants()["bearing.k_b"]) ** (2 / 3), -1e-9, 0.0, 0.0]
    with pytest.warns(KinkWarning, match="damps half of the time"):
        result = model.linearize(x=behind, parameters=numbers)
    assert 0.0 < result.passing < 1e-5
    bounce, faster = result.modes[-1], result.faster_modes[-1]
    expected = 0.5 * 2e3 / (2.0 * 20.0 * 2.0 * math.pi * bounce.natural_frequency)
    assert abs(bounce.damping_ratio) < 1e-3 * expected
    assert faster.damping_ratio == pytest.approx(expected, rel=1e-3)
    report = result.to_json()
    assert report["faster_modes"][-1]["damping_ratio"]["value"] == faster.damping_ratio
    assert "vibrations faster than" in str(result.report())


def test_command_prints_frequencies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rotor: Model) -> None:
    monkeypatch.chdir(tmp_path)
    scene = str(ROOT / "scenes/varying_compliance.toml")
    result = CliRunner().invoke(app, ["linearize", scene, "--at-angle", "0 deg", "--json"])
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    expected = rotor.linearize()
    found = [mode["natural_frequency"]["value"] for mode in report["modes"]]
    assert found == pytest.approx(list(expected.natural_frequencies), rel=1e-9)
    shown = CliRunner().invoke(app, ["linearize", scene])
    assert f"{expected.natural_frequencies[0]:.6g}" in shown.stdout
    assert CliRunner().invoke(app, ["linearize", scene, "--at-angle", "1 m"]).exit_code == 2
