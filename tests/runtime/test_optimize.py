"""Least values: kinks against a closed form and an independent program, constraints with multipliers, wrong slopes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pytest
from scipy.optimize import rosen, rosen_der

from ballpass.runtime import Model, QuantityFunction, RequestError
from ballpass.runtime.ask.limits import read_limits
from ballpass.runtime.search.bundle import BundleMinimum, Plane, minimize_by_planes, seen_from_both_sides
from ballpass.runtime.search.interior_point import minimize_by_ipopt
from ballpass.runtime.search.sequential_programs import minimize_by_slsqp

CLEARANCE = "bearing.clearance=0 um:10 um"

Search = Callable[[Callable[[np.ndarray], Plane], np.ndarray], BundleMinimum]
searches = pytest.mark.parametrize("minimized", [minimize_by_planes, minimize_by_slsqp, minimize_by_ipopt])


def _planes(*functions: Callable[[np.ndarray], tuple[float, np.ndarray]]) -> Callable[[np.ndarray], Plane]:
    def evaluate(x: np.ndarray) -> Plane:
        pairs = [one(x) for one in functions]
        return Plane(x=x, values=np.array([v for v, _ in pairs]), slopes=np.array([g for _, g in pairs]))

    return evaluate


@searches
def test_a_kink_in_two_variables_is_hit_from_any_start(minimized: Search) -> None:
    """The goal |x - 0.3| + 2 |y - 0.6|, least 0 at a corner of four smooth parts."""

    def goal(x: np.ndarray) -> tuple[float, np.ndarray]:
        away = x - np.array([0.3, 0.6])
        return float(np.abs(away) @ [1.0, 2.0]), np.where(away >= 0.0, [1.0, 2.0], [-1.0, -2.0])

    for start in ([0.9, 0.1], [0.05, 0.95], [0.31, 0.2]):
        found = minimized(_planes(goal), np.array(start))
        assert found.best.x == pytest.approx([0.3, 0.6], abs=1e-6)
        assert len(found.sides) > 1
        assert found.converged


@pytest.mark.parametrize("start", [0.0, 0.1, 0.9])
def test_a_limit_is_kept_that_costs_much_of_the_goal(start: float) -> None:
    """Least 12 x where x is a half or more: of a toggle clamp that must press, the torque; it was called impossible."""
    found = minimize_by_planes(
        _planes(lambda x: (12.0 * float(x[0]), np.array([12.0])), lambda x: (0.5 - float(x[0]), np.array([-1.0]))),
        np.array([start]),
    )
    assert found.best.x == pytest.approx([0.5], abs=1e-7)
    assert found.multipliers == pytest.approx([12.0])


@pytest.mark.parametrize(
    ("goal", "kind"),
    [
        (lambda x: (1.0 + 1e-3 * abs(x - 0.3), 1e-3 * np.sign(x - 0.3)), "kink"),  # slopes of opposite sign, small
        (
            lambda x: (1.0 + 2.0 * abs(x - 0.3) + 30.0 * (x - 0.3) ** 2, 2.0 * np.sign(x - 0.3) + 60.0 * (x - 0.3)),
            "kink",
        ),
        (lambda x: (1.0 + 30.0 * (x - 0.3) ** 2, 60.0 * (x - 0.3)), "smooth"),
        (lambda x: (1.0 + 0.1 * x + 0.4 * (x < 0.3), 0.1), "jump"),
        (lambda x: (1.0 + abs(x - 0.3) + 0.4 * (x < 0.3), np.sign(x - 0.3)), "jump"),
        (lambda x: (1.0 + x, 1.0), "smooth"),  # held by the end of the range
    ],
)
@searches
def test_both_sides_of_a_least_value_say_whether_it_is_a_kink_or_a_jump(
    minimized: Search, goal: Callable[[float], tuple[float, float]], kind: str
) -> None:
    def evaluate(x: np.ndarray) -> Plane:
        value, slope = goal(float(x[0]))
        return Plane(x=x, values=np.array([value]), slopes=np.array([[float(slope)]]))

    for start in (0.27, 0.9):
        found = seen_from_both_sides(evaluate, minimized(evaluate, np.array([start])))
        if kind != "jump" or start > 0.3:
            assert found.kind == kind
            assert len(found.sides) == (1 if kind == "smooth" else 2)
        if kind == "jump" and start > 0.3:
            assert abs(found.sides[0].values[0] - found.sides[1].values[0]) == pytest.approx(0.4, abs=1e-4)


@searches
def test_a_smooth_minimum_on_a_constraint_has_the_multiplier_of_lagrange(minimized: Search) -> None:
    """x^2 + y^2 with x + y >= 0.8: least at (0.4, 0.4); the goal is 0.32 there and grows by 0.8 of the limit."""

    def goal(x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(x @ x), 2.0 * x

    def limit(x: np.ndarray) -> tuple[float, np.ndarray]:
        return 0.8 - float(x.sum()), -np.ones(2)

    found = minimized(_planes(goal, limit), np.array([0.9, 0.2]))
    assert found.best.values[0] == pytest.approx(0.32, abs=1e-6)
    assert found.best.x == pytest.approx([0.4, 0.4], abs=1e-3)
    assert found.multipliers == pytest.approx([0.8], abs=1e-2)


@pytest.mark.parametrize("minimized", [minimize_by_slsqp, minimize_by_ipopt])
def test_smooth_searches_take_fewer_evaluations_in_a_curved_valley_of_four_variables(minimized: Search) -> None:
    """Rosenbrock's function, least 0 at (0.5, ...)."""

    def goal(x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(rosen(2.0 * x)) / 10.0, rosen_der(2.0 * x) / 5.0

    start = np.array([0.05, 0.9, 0.3, 0.9])
    smooth, planes = (search(_planes(goal), start) for search in (minimized, minimize_by_planes))
    assert smooth.best.values[0] < 0.1 * planes.best.values[0]
    assert len(smooth.trace) < len(planes.trace)


def test_what_ends_an_evaluation_ends_ipopt() -> None:
    def goal(x: np.ndarray) -> tuple[float, np.ndarray]:
        if x[0] != 0.9:
            raise KeyboardInterrupt
        return float(x @ x), 2.0 * x

    with pytest.raises(KeyboardInterrupt):
        minimize_by_ipopt(_planes(goal), np.array([0.9, 0.2]))


@pytest.mark.long
@pytest.mark.parametrize("search", ["planes", "slsqp", "ipopt"])
def test_the_least_peak_of_the_press_over_housing_damping_is_the_kink_of_an_independent_program(
    make_model: Callable[..., Model], search: Literal["planes", "slsqp", "ipopt"]
) -> None:
    found = make_model("punching_press").optimize(
        "peak_ball_force",
        "bearing.outer_ring.damping=1000 N*s/m:10000 N*s/m:log",
        cycles=4,
        transient=2,
        search=search,
        starts=1,
    )
    assert found.value == pytest.approx(3685.164, abs=2e-3)
    assert found.x[0] == pytest.approx(3426.31, abs=0.01)
    assert found.kinked
    per_decade = sorted((found.slopes[:, 0] * found.x[0] * np.log(10.0)).tolist())
    assert per_decade[0] == pytest.approx(-1565.0, rel=0.01)
    assert per_decade[-1] == pytest.approx(700.0, rel=0.01)
    assert "disagrees" not in dict(found.verdicts).values()


def test_hours_of_a_life_are_turns_at_the_speed_of_the_inner_ring(make_model: Callable[..., Model]) -> None:
    press, texts = make_model("punching_press"), ["life >= 20000 h"]
    (limit,) = read_limits(press.manifest, "subject_to", texts, press, None, ["bearing.clearance"])
    assert limit.limit == pytest.approx(20000 * 60 * 500)  # 500 rpm
    with pytest.raises(RequestError, match="not one number"):
        read_limits(press.manifest, "subject_to", texts, press, None, ["mechanism.driver.speed"])


def test_a_candidate_without_a_run_is_none(rotor: Model) -> None:
    """Above some 100 kN a ball is flattened as in no bearing."""
    found = rotor.optimize("peak_ball_force", "load.force.x=100 N:10 MN:log", cycles=2, transient=1, starts=1)
    assert found.bounds == ("first",)
    assert found.converged


def test_a_parameter_without_effect_is_said_to_have_none(rotor: Model) -> None:
    found = rotor.optimize("max:load.x", CLEARANCE, cycles=2, transient=1, progress=False)
    assert found.idle == ("bearing.clearance",)
    assert found.bounds == ("",)
    assert "Without effect on max:load.x" in str(found)
    assert "verified" not in str(found)


def test_a_sweep_over_one_range_comes_first_and_finds_the_valley_that_is_least(rotor: Model) -> None:
    """Of the peak force near a resonance, against a sweep of 301 plain runs; what it takes is said before it begins."""
    given, vary, said = {"bearing.clearance": 2e-6}, "shaft.speed=5700 rpm:5960 rpm", list[str]()
    found = rotor.optimize(
        "peak_ball_force", vary, parameters=given, starts=1, progress=lambda words, _done: said.append(words)
    )
    speeds = np.linspace(5700.0, 5960.0, 301) * np.pi / 30.0
    table = {"shaft.speed": speeds, "bearing.clearance": np.full(301, 2e-6)}
    swept = rotor.simulate_many(table, "peak_ball_force")["peak_ball_force"]
    assert found.value < swept.min() < 1.001 * found.value
    assert found.kinked
    assert len(found.trace) < 40
    assert said[0] == "33 runs without derivatives"
    assert said[1].startswith("some 20 runs with derivatives, ")


@pytest.mark.long
def test_a_jump_is_told_from_a_kink_by_plain_runs_on_both_sides(rotor: Model) -> None:
    given, turns = {"bearing.clearance": 2e-6}, {"cycles": 400, "transient": 390}
    vary = "shaft.speed=5860 rpm:5900 rpm"
    found = rotor.optimize("-peak_ball_force", vary, parameters=given, starts=1, progress=False, **turns)
    assert (found.kind, found.kinked) == ("jump", False)
    low, high = sorted(found.beside)
    for speed, value in ((0.99999, low), (1.00001, high)):
        run = rotor.quantities("peak_ball_force", parameters={**given, "shaft.speed": speed * found.x[0]}, **turns)
        assert run["peak_ball_force"].value == pytest.approx(value, rel=5e-3)
    assert high > 1.4 * low
    assert "A jump" in str(found)
    assert any("jumps at this point" in words for words in found.report().warnings)


@pytest.mark.long
def test_starts_along_a_curved_limit_are_apart_and_take_the_corners(make_model: Callable[..., Model]) -> None:
    """A sweep of 61 by 61 points has 36.27 N, one of 41 by 41 points 42.16; without the corners it was 50.2."""
    found = make_model("rotor").optimize(
        "peak_ball_force",
        ["bearing.clearance=0 um:40 um", "bearing.inner_ring.damping=100 N*s/m:2000 N*s/m"],
        subject_to="range:inner.y >= 1.2 um",
        cycles=10,
        transient=5,
    )
    assert found.value < 40.0
    assert found.limits[0].value == pytest.approx(1.2e-6, rel=1e-4)
    starts = np.array([start for start, _ in found.starts]) / [40e-6, 1900.0]
    assert min(np.max(np.abs(starts[j] - starts[k])) for j in range(3) for k in range(j)) >= 0.2


@pytest.mark.long
def test_the_longest_life_over_clearance_is_that_of_a_fine_sweep(make_model: Callable[..., Model]) -> None:
    """At some preload more balls carry; the worst of a tolerance is then the shortest life within it."""
    press, clearance = make_model("punching_press"), "bearing.clearance"
    length: dict[str, Any] = {"cycles": 4, "transient": 2}
    grid = np.linspace(-20e-6, 40e-6, 151)
    swept = press.simulate_many({clearance: grid}, "life", **length)["life"]
    found = press.optimize("-life", f"{clearance}=-20 um:40 um", starts=1, **length)
    assert found.bounds == ("",)
    assert found.value == pytest.approx(swept.max(), rel=1e-4)
    assert found.x[0] == pytest.approx(grid[np.argmax(swept)], abs=0.6e-6)
    assert max(found.trace) == pytest.approx(found.value, rel=1e-9)
    assert str(found).startswith("Largest life: ")
    boxed = press.optimize(
        "-life", f"{clearance}=-20 um:40 um", tolerance=f"{clearance}=-2 um:2 um", starts=1, **length
    )
    worst = np.minimum(swept[:-10], swept[10:])  # 4 um apart: life has one maximum
    assert boxed.value == pytest.approx(worst.max(), rel=2e-3)
    assert boxed.value < boxed.nominal <= found.value * (1.0 + 1e-6)


@pytest.mark.long
def test_a_wrong_gradient_is_caught(make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch) -> None:
    press = make_model("punching_press")
    slopes = QuantityFunction.jacobian
    monkeypatch.setattr(QuantityFunction, "jacobian", lambda self, x: 1.1 * slopes(self, x))
    found = press.optimize("rms:inner.y", "bearing.clearance=5 um:15 um", cycles=3, starts=1)
    assert "disagree" in found.report().fault


@pytest.mark.long
def test_two_parameters_with_an_active_limit_against_a_fine_sweep(make_model: Callable[..., Model]) -> None:
    press = make_model("punching_press")
    damping, clearance = "bearing.outer_ring.damping", "bearing.clearance"
    found = press.optimize(
        "peak_ball_force",
        [f"{damping}=1000 N*s/m:10000 N*s/m:log", f"{clearance}=5 um:15 um"],
        cycles=4,
        transient=2,
        subject_to="rms:inner.y >= 40 um",
        starts=1,
    )
    (limit,) = found.limits
    assert limit.active
    assert limit.multiplier > 0.0
    assert limit.value == pytest.approx(40e-6, rel=1e-4)
    grid = np.meshgrid(np.geomspace(1e3, 1e4, 25), np.linspace(5e-6, 15e-6, 25))
    table = {damping: grid[0].ravel(), clearance: grid[1].ravel()}
    swept = press.simulate_many(table, ["rms:inner.y", "peak_ball_force"], cycles=4, transient=2)
    within = swept["peak_ball_force"][swept["rms:inner.y"] >= 40e-6]
    assert found.value < within.min() < 1.02 * found.value


@pytest.mark.long
def test_a_limit_of_zero_holds_the_optimum_or_is_said_not_to_be_kept(make_model: Callable[..., Model]) -> None:
    """The goal is the quantity itself, so that its multiplier is one."""
    rotor, sideways = make_model("rotor"), "loads.weight.force.x"
    asked = {"cycles": 12, "transient": 10, "starts": 1, "subject_to": "mean:inner.x >= 0 um"}
    found = rotor.optimize("mean:inner.x", f"{sideways}=-30 N:20 N", **asked)
    (limit,) = found.limits
    assert limit.active
    assert limit.multiplier == pytest.approx(1.0, rel=1e-6)
    assert abs(found.value) < 1e-4 * abs(
        rotor.quantities("mean:inner.y", cycles=12, transient=10)["mean:inner.y"].value
    )
    assert not found.report().fault
    assert found.kept == (True,)
    other = rotor.optimize("mean:inner.x", f"{sideways}=-30 N:-10 N", **asked)
    assert other.kept == (False,)
    assert "(a limit not kept)" in str(other)
    assert "found no values within the bounds that keep the limit of mean:inner.x" in other.report().fault
    assert "limit 0: not kept" in str(other)


@pytest.mark.long
def test_the_worst_within_a_tolerance_that_acts_one_way_is_at_its_end(make_model: Callable[..., Model]) -> None:
    """The motion grows with the clearance: least at 5 um, where the worst is that of 7 um."""
    press = make_model("punching_press")
    options = {"cycles": 3, "starts": 1, "tolerance": "bearing.clearance=-1 um:2 um"}
    found = press.optimize("rms:inner.y", "bearing.clearance=5 um:15 um", **options)
    at = QuantityFunction(press, "rms:inner.y", ["bearing.clearance"], cycles=3)([[5e-6], [7e-6]])
    assert found.bounds == ("first",)
    assert found.worst == pytest.approx([2e-6])
    assert found.value == pytest.approx(at[1], rel=1e-5)
    assert found.nominal == pytest.approx(at[0], rel=1e-5)
    assert found.nominal < found.further < found.value
    assert not found.report().warnings


@pytest.mark.long
def test_the_least_worst_peak_over_a_box_against_a_fine_sweep(make_model: Callable[..., Model]) -> None:
    press = make_model("punching_press")
    damping, clearance, stiffness = "bearing.outer_ring.damping", "bearing.clearance", "bearing.outer_ring.stiffness"
    found = press.optimize(
        "peak_ball_force",
        f"{damping}=1000 N*s/m:10000 N*s/m:log",
        cycles=4,
        transient=2,
        tolerance=[f"{clearance}=-2 um:2 um", f"{stiffness}=-5 MN/m:5 MN/m"],
        starts=1,
    )
    value = {info.name: info.default for info in press.manifest.parameters}
    dampings = np.geomspace(2e3, 5e3, 41)
    grid = np.meshgrid(
        dampings,
        value[clearance] + np.linspace(-2e-6, 2e-6, 7),
        value[stiffness] + np.linspace(-5e6, 5e6, 7),
        indexing="ij",
    )
    table = dict(zip((damping, clearance, stiffness), (one.ravel() for one in grid), strict=True))
    swept = press.simulate_many(table, "peak_ball_force", cycles=4, transient=2)["peak_ball_force"]
    worst = swept.reshape(41, -1).max(axis=1)
    assert found.value < worst.min() < 1.005 * found.value
    assert found.x[0] == pytest.approx(dampings[np.argmin(worst)], rel=0.03)
    assert found.nominal < found.value


@pytest.mark.parametrize(
    ("vary", "limit", "words"),
    [
        ("bearing.clearance=0 um", None, "is no range"),
        ("bearing.clearance=0 um:5 um:log", None, "no logarithm"),
        ("bearing.clearance=1 um:5 um", "rms:inner.y", "is no limit"),
        ("bearing.clearance=1 um:5 um", "rms:inner.y <= 5 N", "rms:inner.y"),
    ],
)
def test_wrong_requests_are_refused(make_model: Callable[..., Model], vary: str, limit: str | None, words: str) -> None:
    with pytest.raises(RequestError, match=words):
        make_model("punching_press").optimize("peak_ball_force", vary, subject_to=limit)
