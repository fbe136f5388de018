"""Claims about Jacobians: generated derivatives against differences, closed forms and each other."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from typer.testing import CliRunner

from ballpass.runtime import Model
from ballpass.runtime.app.cli import app
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.certify.differences import richardson
from ballpass.runtime.certify.jacobian_check import _quotient, checked_jacobian
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.point import slopes
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.point.jacobian import JacobianDirections, directions_of, output_tangents, rows_of, values_of_rows

ROOT = Path(__file__).resolve().parent.parent.parent

TABLE_LOAD = (
    ('type = "constant" ', 'type = "table" '),
    (
        'force = ["196 N", "0 N"] ',
        """time = ["0 s", "10 ms", "20 ms"]
x = ["196 N", "300 N", "150 N"]
y = ["0 N", "80 N", "-40 N"] """,
    ),
)


def loaded_state(model: Model, t: float) -> np.ndarray:
    """A state kicked away from static equilibrium and from every symmetry, with balls in contact."""
    x = model.static_equilibrium(t).x.copy()
    half = len(x) // 2
    rng = np.random.default_rng(7)
    x[:half] *= 1.0 + 0.02 * rng.standard_normal(half)
    x[half:] = 2e-3 * rng.standard_normal(half)
    return x


@pytest.mark.parametrize(
    ("scene", "changes", "t"),
    [
        ("punching_press_tangent", (), 0.0811),
        pytest.param("four_bar", (), 0.0153, marks=pytest.mark.long),
        pytest.param("varying_compliance", TABLE_LOAD, 0.0137, marks=pytest.mark.long),
    ],
    ids=["press", "four_bar", "table_load"],
)
def test_every_derivative_agrees_with_extrapolated_differences(
    make_model: Callable[..., Model],
    make_virtual: Callable[..., Model],
    scene: str,
    changes: tuple[tuple[str, str], ...],
    t: float,
) -> None:
    """Right-hand side and all quantities, by all states, parameters, time and crank angle."""
    model = (make_model if scene == "punching_press_tangent" else make_virtual)(scene, *changes)
    of = ["rhs", "*"]
    wrt = ["states", *model.parameters, "time", "crank_angle"]
    result = checked_jacobian(model, model.numbers(), of, wrt, t=t, x=loaded_state(model, t))
    wrong = [
        f"d({row})/d({column}) = {result.value[i, j]:.6g}, by differences {check.value}: {check.verdict.value}"
        for i, row in enumerate(result.rows)
        for j, column in enumerate(result.columns)
        if (check := result.checks[i][j]).verdict is not Verdict.VERIFIED
    ]
    assert not wrong, "\n".join(wrong[:10])
    moved = np.any(result.value != 0.0, axis=0)
    assert np.count_nonzero(moved) > 0.5 * len(moved)


def test_slope_of_a_contact_is_that_of_hertz(press: Model) -> None:
    """F = k delta^1.5 with delta = x cos + y sin - P_d/2: dF/dP_d = -(3/4) k delta^0.5, dF/dx = 1.5 k delta^0.5 cos."""
    t = 0.0811
    x = loaded_state(press, t)
    k_b = press.constants()["bearing.k_b"]
    delta = values_of_rows(press, rows_of(press, "ball.deflection"), point(press, press.numbers(), t, x))
    slope = 1.5 * k_b * np.sqrt(np.maximum(delta, 0.0))
    by_clearance = press.jacobian("ball.elastic_force", "bearing.clearance", t=t, x=x)
    assert by_clearance == pytest.approx(-0.5 * slope, rel=1e-12)
    cage = press.parameters["bearing.ball_angle"] + press.constants()["bearing.cage_speed"] * t
    directions = np.cos(cage + 2 * np.pi * np.arange(8) / 8)
    by_x = press.jacobian("ball.elastic_force", "inner.x", t=t, x=x)
    assert by_x == pytest.approx(slope * directions, rel=1e-9, abs=1e-9 * float(np.max(slope)))
    assert np.count_nonzero(slope) in range(2, 6)


def test_reactions_are_linear_in_the_punch_force(press: Model) -> None:
    """Within the window; outside, the punch does not act."""
    inside = math.radians(250.0) / press.numbers().values["mechanism.driver.speed"]
    force = "mechanism.forces.punch.force.y"
    numbers, idle = press.numbers(), press.numbers({force: 0.0})
    of = ["reaction.*.x", "reaction.*.y", "drive_torque"]
    rows = rows_of(press, of)
    loaded, unloaded = (values_of_rows(press, rows, point(press, n, inside, None)) for n in (numbers, idle))
    slope = press.jacobian(of, force, t=inside)
    assert slope == pytest.approx((loaded - unloaded) / numbers.values[force], rel=1e-9, abs=1e-12)
    assert not np.any(press.jacobian(of, force, t=0.0))


def test_slope_by_crank_angle_integrates_to_the_drive_torque(press: Model) -> None:
    speed = press.numbers().values["mechanism.driver.speed"]
    first, last = math.radians(20.0), math.radians(200.0)  # the punch does not act there

    def torque(angle: float) -> float:
        there = point(press, press.numbers(), angle / speed, None)
        return float(values_of_rows(press, rows_of(press, "drive_torque"), there)[0])

    total, _ = quad(
        lambda angle: float(press.jacobian("drive_torque", "crank_angle", t=angle / speed)), first, last, epsrel=1e-9
    )
    assert total == pytest.approx(torque(last) - torque(first), rel=1e-9)


def test_start_angle_turns_the_linkage_and_crank_angle_the_balls_as_well(press: Model) -> None:
    t = 0.0811
    x = loaded_state(press, t)
    assert not np.any(press.jacobian("ball.force", "mechanism.driver.start_angle", t=t, x=x))
    assert np.any(press.jacobian("ball.force", "crank_angle", t=t, x=x))
    both = [press.jacobian("reaction.A.*", name, t=t) for name in ("mechanism.driver.start_angle", "crank_angle")]
    assert both[0] == pytest.approx(both[1], rel=1e-11)


@pytest.mark.parametrize(
    ("of", "wrt"),
    [
        ("rhs", "states"),
        ("ball.force", "states"),
        ("ball.force", ["outer.y", "inner.vx"]),
        ("ball.force", "bearing.clearance"),
        ("reaction.A.*", ["crank_angle", "mechanism.bodies.crank.points.B", "mechanism.driver.speed"]),
        ("rhs", ["inner.x", "bearing.contact.inner_groove_radius"]),
    ],
)
def test_prepared_function_gives_the_entries_of_the_matrix(press: Model, of: str, wrt: str | list[str]) -> None:
    prepared = press.jacobian_function(of, wrt, t=0.0811)
    for t in (0.0811, 0.0813):
        prepared.move(t)
        x = loaded_state(press, t)
        dense = press.jacobian(of, wrt, t=t, x=x).reshape(prepared.sparsity.shape)
        entries = prepared(x)
        assert entries.shape == prepared.sparsity.rows.shape
        assert prepared.to_dense() == pytest.approx(dense, rel=1e-12, abs=1e-12 * np.max(np.abs(dense)))
        assert np.array_equal(prepared.to_scipy().toarray(), prepared.to_dense())


def test_pattern_leaves_out_what_cannot_depend(press: Model) -> None:
    assert press.jacobian_function("reaction.A.x", "states").sparsity.rows.size == 0
    elastic = press.jacobian_function("ball.elastic_force", "states").sparsity
    assert elastic.shape == (8, 8)
    assert np.array_equal(np.unique(elastic.columns), [0, 1, 2, 3])  # positions, no velocities
    rhs = press.jacobian_function("rhs", "states").sparsity
    assert np.array_equal(rhs.rows[rhs.starts[4] : rhs.starts[5]][:1], [0])  # d(inner.x)/dt depends on inner.vx
    assert rhs.rows.size == 4 + 4 * 8


def test_tangents_of_many_samples_are_the_matrix_along_each_direction(press: Model) -> None:
    of, names = ["ball.force", "reaction.A.*", "rhs"], ["bearing.clearance", "mechanism.driver.speed", "inner.y"]
    numbers, times = press.numbers(), np.array([0.0805, 0.0811, 0.0822])
    states = np.array([loaded_state(press, t) for t in times])
    moves: list[JacobianDirections] = [directions_of(press, numbers, names, t) for t in times]
    found = output_tangents(
        press,
        numbers,
        of,
        t=np.zeros(3),
        x=states,
        u=np.array([press.inputs_at(t) for t in times]),
        dx=np.array([m.x for m in moves]),
        du=np.array([m.u for m in moves]),
        dp=moves[0].p,
        dc=moves[0].c,
    )
    for k, t in enumerate(times):
        expected = press.jacobian(of, names, t=t, x=states[k])
        assert found[k] == pytest.approx(expected, rel=1e-11, abs=1e-11 * np.max(np.abs(expected)))


def test_tangent_along_time_is_the_derivative_by_time(press: Model) -> None:
    t = 0.0811
    x = loaded_state(press, t)
    found = output_tangents(
        press, press.numbers(), "*", t=np.zeros(1), x=x[None], u=press.inputs_at(t), dt=np.ones((1, 1))
    )
    expected = press.jacobian("*", "time", t=t, x=x)
    assert found[0, :, 0] == pytest.approx(expected, rel=1e-11, abs=1e-11 * np.max(np.abs(expected)))


def test_compiled_blocks_are_those_of_the_virtual_machine(press: Model) -> None:
    x = loaded_state(press, 0.0811)
    numbers = press.numbers()
    point = (0.0, x, press.inputs_at(0.0811), numbers.p, numbers.c)
    for name in ("rhs", "ring_quantities_jac_x", "load_quantities_jac_p", "rhs_jac_c", "static_forces_jac_x"):
        compiled, virtual = (f(*point).full() for f in (press.function(name), press.symbolic(name)))
        assert compiled == pytest.approx(virtual, rel=1e-12, abs=1e-12 * float(np.max(np.abs(virtual))))


@pytest.mark.long
def test_a_run_compiles_no_jacobians(
    make_model: Callable[..., Model], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = make_model("varying_compliance", ("balls = 8", "balls = 7"))
    monkeypatch.setenv("BALLPASS_CACHE_DIR", str(tmp_path))
    model.simulate(duration=0.01, method="cvodes")
    assert not list(tmp_path.glob("*_jacobians-*"))
    model.jacobian("ball.force", "states")
    assert len(list(tmp_path.glob("*_jacobians-*"))) == 1


def test_manifest_says_where_functions_live_and_what_can_be_differentiated(press: Model) -> None:
    where = {info.name: info.library for info in press.manifest.functions}
    assert where["rhs"] == where["rhs_jac_x"] == "equations"
    assert where["rhs_jac_p"] == where["ring_quantities_jac_x"] == where["load_quantities_tangent"] == "jacobians"
    names = {item.name for item in press.manifest.quantities}
    assert set(press.outputs) <= names
    assert {"ring_force.x", "reaction.C.y", "load.x"} <= names - set(press.outputs)


def test_a_standing_shaft_has_no_crank_angle_to_differentiate_by(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    with pytest.raises(RequestError, match="nothing turns"):
        model.jacobian("ball.force", "crank_angle", parameters={"shaft.speed": 0.0})


def test_unknown_names_are_refused_with_the_nearest(press: Model) -> None:
    with pytest.raises(RequestError, match=r"'ball\.force'"):
        press.jacobian("ball.froce", "states")
    with pytest.raises(RequestError, match=r"'bearing\.clearance'"):
        press.jacobian("ball.force", ["inner.x", "bearing.clerance"])
    with pytest.raises(RequestError, match="generated functions"):
        press.jacobian_function(["ball.force", "drive_torque"], "states")


def test_a_wrong_derivative_disagrees(make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch) -> None:
    model = make_model("varying_compliance")
    t = 0.0031  # at the start two balls stand exactly at contact onset, where differences converge slowly
    x = loaded_state(model, t)
    arguments = (model, model.numbers(), "ball.elastic_force", ["inner.x", "bearing.clearance"])
    assert checked_jacobian(*arguments, t=t, x=x).verdict is Verdict.VERIFIED
    right = slopes.contract
    monkeypatch.setattr(slopes, "contract", lambda *a: 1.00001 * right(*a))
    assert checked_jacobian(*arguments, t=t, x=x).verdict is Verdict.DISAGREES
    assert checked_jacobian(*arguments, t=t, x=x, check=False).verdict is Verdict.NOT_CHECKED


def test_command_prints_both_numbers_and_fails_where_they_disagree(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["jacobian", str(ROOT / "scenes/varying_compliance.toml"), "--of", "ball.elastic_force", "--wrt", "inner.x"]
    good = CliRunner().invoke(app, [*words, "--json"])
    assert good.exit_code == 0, good.output
    report = json.loads(good.stdout)
    assert report["verdict"] == "verified"
    entry = report["jacobian"][0]
    k_b, delta = 13.34e9, report["state"][0]  # given in the scene; zero clearance, ball 1 on the load's line
    assert entry["value"] == pytest.approx(1.5 * k_b * math.sqrt(delta), rel=1e-12)
    assert entry["unit"] == "N/m"
    right = slopes.contract
    monkeypatch.setattr(slopes, "contract", lambda *a: 1.1 * right(*a))
    bad = CliRunner().invoke(app, [*words, "--json"])
    assert bad.exit_code == 1
    entry = json.loads(bad.stdout)["jacobian"][0]
    assert entry["verdict"] == "disagrees"
    assert entry["value"] == pytest.approx(1.1 * entry["second"], rel=1e-6)


def test_command_refuses_wrong_names_and_instants(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    scene = str(ROOT / "scenes/varying_compliance.toml")
    for words, hint in (
        (["--of", "ball.fore", "--wrt", "inner.x"], "ball.force"),
        (["--of", "ball.fore", "--wrt", "bearing.claerance"], "bearing.clearance"),
        (["--of", "rhs", "--wrt", "states", "--time", "1 kg"], "wrong dimension"),
        (["--of", "rhs", "--wrt", "states", "--time", "1 s", "--at-angle", "1 deg"], "were both given"),
    ):
        result = CliRunner().invoke(app, ["jacobian", scene, *words])
        assert result.exit_code == 2
        assert hint in result.stderr


@pytest.mark.parametrize("noise", [0.0, 1e-9])
def test_extrapolated_differences_know_their_error(noise: float) -> None:
    """Smooth functions and one with a kink nearby; rounding noise is asked for by name."""
    rng = np.random.default_rng(3)

    def function(x: float) -> np.ndarray:
        return np.array([math.sin(x), math.exp(x), abs(x - 1.02) ** 1.5]) + noise * rng.uniform(-1, 1, 3)

    found = richardson(function, 1.0, 0.1, resolution=noise)
    exact = np.array([math.cos(1.0), math.e, -1.5 * math.sqrt(0.02)])
    assert np.all(np.abs(found.value - exact) <= 3.0 * found.error)
    assert np.all(found.error <= (1e-11 if noise == 0.0 else 1e-5))


@pytest.mark.parametrize(
    ("above", "below", "unit"),
    [
        ("m/s/s", "m", "1/s^2"),
        ("m/s/s", "m/s", "1/s"),
        ("m/s/s", "kg", "m/(s^2*kg)"),
        ("N", "N/m^1.5", "m^1.5"),
        ("N*m", "rad", "N*m/rad"),
        ("m/s", "s", "m/s^2"),
        ("N", "1", "N"),
        ("1", "1", "1"),
    ],
)
def test_the_unit_of_a_derivative_is_a_quotient_in_lowest_terms(above: str, below: str, unit: str) -> None:
    assert _quotient(above, below) == unit
