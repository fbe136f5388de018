"""Claims about runs of bearings coupled both ways: what all scenes can do, the press with coupled bearings can too."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.point.evaluate import point

SHORT = {"cycles": 0.3, "transient": 0}


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_two_way")


@pytest.fixture(scope="module")
def hinges(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_hinges")


@pytest.mark.parametrize(
    ("method", "bound"),
    [("stepper-rodas5p", 1e-5), ("stepper-dp54", 1e-5), pytest.param("cvodes", 1e-3, marks=pytest.mark.long)],
)
def test_methods_agree(press: Model, method: str, bound: float) -> None:
    one = press.simulate(method="stepper-dop853", rtol=1e-10, **SHORT)
    other = press.simulate(method=method, rtol=1e-10, **SHORT)
    for name in ("inner.y", "outer.y", "reaction.A.y"):
        assert np.max(np.abs(other[name] - one[name])) < bound * np.max(np.abs(one[name]))


@pytest.mark.long
def test_methods_agree_where_balls_turn_with_the_state(hinges: Model) -> None:
    one, other = (hinges.simulate(method=f"stepper-{name}", rtol=1e-10, **SHORT) for name in ("dop853", "rodas5p"))
    for name in ("pin.inner.y", "big_end.inner.x", "reaction.B.y"):
        assert np.max(np.abs(other[name] - one[name])) < 1e-5 * np.max(np.abs(one[name]))


def test_the_reaction_is_the_force_of_the_housing(press: Model) -> None:
    """Newton and Euler's balance of all bodies, and spring and damper: two ways to one force."""
    run = press.simulate(rtol=1e-9, **SHORT)
    count, stiffness, damping = (
        press.numbers().parameters[f"bearing.{name}"]
        for name in ("count", "outer_ring.stiffness", "outer_ring.damping")
    )
    for axis in "xy":
        housing = count * (stiffness * run[f"outer.{axis}"] + damping * run[f"outer.v{axis}"])
        assert np.max(np.abs(run[f"reaction.A.{axis}"] - housing)) < 1e-11 * np.max(np.abs(run["reaction.A.y"]))


def test_the_bearing_carries_the_linkage(press: Model) -> None:
    """Along the guide a pair of bearings feels slider, rod and crank, not twice Eq. (3)'s 0.41 kg."""
    mass = press.linearize().mass
    bodies = press.numbers().parameters
    along = sum(bodies[f"mechanism.bodies.{name}.mass"] for name in ("crank", "rod", "slider"))
    assert mass[1, 1] == pytest.approx(along, rel=1e-3)  # the rod's tilt adds its turning inertia
    assert np.allclose(mass, mass.T, rtol=0.0, atol=1e-12)


@pytest.mark.long
def test_members_in_lanes_are_single_runs(hinges: Model) -> None:
    clearances = np.linspace(5e-6, 15e-6, 9)
    names = ["peak_pin_ball_force", "rms:main.inner.y"]
    many = hinges.simulate_many({"bearings.pin.clearance": clearances}, names, rtol=1e-9, kinks="stepped-over", **SHORT)
    for k in (0, 8):
        one = hinges.reduce(parameters={"bearings.pin.clearance": clearances[k]}, rtol=1e-9, **SHORT)
        assert many[names[0]][k] == pytest.approx(one["pin.ball.force"].maximum, rel=1e-5)
        assert many[names[1]][k] == pytest.approx(one["main.inner.y"].rms, rel=1e-5)


@pytest.mark.long
def test_sensitivities_are_verified(press: Model) -> None:
    wrt = [
        "bearing.clearance",
        "bearing.count",
        "mechanism.bodies.*.mass",
        "mechanism.driver.speed",
        "bearing.outer_ring.*",
    ]
    report = press.sensitivity(["peak_ball_force", "rms:inner.y", "max:reaction.C.y"], wrt, **SHORT)
    assert len(report.pairs) >= 27
    assert {pair.check.verdict.value for pair in report.pairs} == {"verified"}


def test_modes_are_those_of_differences_of_the_motion(press: Model) -> None:
    found = press.linearize(t=0.05)
    half = len(found.coordinates)

    def rate(x: np.ndarray) -> np.ndarray:
        return np.asarray(press.kernel("rhs")(point(press, press.numbers(), 0.05, x)))

    step = np.repeat([1e-9, 1e-5], half)
    columns = [
        (8.0 * (rate(found.x + h) - rate(found.x - h)) - (rate(found.x + 2.0 * h) - rate(found.x - 2.0 * h)))
        / (12.0 * size)
        for h, size in zip(np.diag(step), step, strict=True)
    ]
    values = np.linalg.eigvals(np.array(columns).T)
    values = values[values.imag > 0.0]
    for mode in found.modes:
        assert np.min(np.abs(values - mode.eigenvalue)) < 1e-6 * abs(mode.eigenvalue)
