"""The quasi-static model: equilibria against SciPy's root finder, closed forms, slow dynamic runs; honest refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import optimize

from ballpass.runtime import IntegrationError, Model
from ballpass.runtime.certify.quasi_static_runs import QuasiStaticFailed
from ballpass.runtime.contract.status import Status

SCENES = ("varying_compliance", "punching_press", "four_bar", "offset_slider")


def accelerations(model: Model, t: float, q: np.ndarray) -> np.ndarray:
    """Of the rings at rest at positions q, from the generated right-hand side."""
    numbers = model.numbers()
    x = np.concatenate([q, np.zeros(len(q))])
    return model.function("rhs")(0.0, x, model.inputs_at(t), numbers.p, numbers.c).full().ravel()[len(q) :]


@pytest.mark.parametrize("scene", SCENES)
def test_equilibria_are_those_that_scipy_finds(make_model: Callable[..., Model], scene: str) -> None:
    model = make_model(scene)
    run = model.simulate(cycles=1, method="quasi-static", rtol=1e-6, samples_per_cycle=60, transient=0)
    n = run.x.shape[1] // 2
    for k in range(0, 60, 7):
        q = run.x[k, :n]
        size = np.abs(q).max()

        def residual(z: np.ndarray, k: int = k, size: float = size) -> np.ndarray:
            return accelerations(model, float(run.t[k]), z * size)

        found = optimize.root(residual, q / size * 1.05, method="hybr", options={"xtol": 1e-13})
        np.testing.assert_allclose(q / size, found.x, atol=1e-7)


def test_balls_balance_the_load_at_every_sample(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press", ('"ball.*", "reaction.A.*"', '"ring_force.*", "load.*"'))
    run = model.simulate(cycles=1, method="quasi-static", rtol=1e-6, samples_per_cycle=500, transient=0)
    size = max(np.abs(run["load.x"]).max(), np.abs(run["load.y"]).max())
    for axis in "xy":
        np.testing.assert_allclose(run[f"ring_force.{axis}"], run[f"load.{axis}"], atol=1e-8 * size)


def test_velocities_are_the_slopes_of_the_positions(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    run = model.simulate(cycles=1, method="quasi-static", rtol=1e-8, samples_per_cycle=20_000, transient=0)
    y, slope = run["inner.y"], run["inner.vy"]
    by_difference = (y[2:] - y[:-2]) / (run.t[2:] - run.t[:-2])
    # the slope has corners where a ball takes or leaves the load: compare in the mean
    assert np.median(np.abs(by_difference - slope[1:-1])) < 1e-5 * np.abs(slope).max()


def test_deflection_grows_with_load_to_two_thirds(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    x = [
        model.simulate(cycles=0.25, method="quasi-static", parameters={"load.force.x": force}, transient=0)["inner.x"]
        for force in (100.0, 800.0)
    ]
    np.testing.assert_allclose(x[1], 4.0 * x[0], rtol=1e-9)  # Hertz: (800/100)^(2/3)


def test_static_deflection_is_that_of_the_closed_form(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    run = model.simulate(cycles=0.01, method="quasi-static", transient=0)
    # one ball on the load line: F = k delta^1.5 (1 + 2 cos^2.5 45 deg), zero clearance
    expected = (196.0 / (13.34e9 * (1.0 + 2.0 * np.cos(np.pi / 4) ** 2.5))) ** (2.0 / 3.0)
    assert run["inner.x"][0] == pytest.approx(expected, rel=1e-9)


def test_slow_motion_is_a_chain_of_equilibria(make_model: Callable[..., Model]) -> None:
    """The dynamic run leaves the equilibria by an amount that falls with the square of the speed."""
    model = make_model("varying_compliance")
    departures = []
    for speed in (2.0, 1.0):
        numbers = {"shaft.speed": speed}
        settings = {"parameters": numbers, "samples_per_cycle": 400, "transient": 1}
        still = model.simulate(cycles=2, method="quasi-static", rtol=1e-9, **settings)
        moving = model.simulate(cycles=2, method="stepper", rtol=1e-10, initial=still.x[0], **settings)
        half = len(still.t) // 2
        departures.append(np.sqrt(np.mean((moving["inner.x"] - still["inner.x"])[half:] ** 2)))
        assert departures[-1] < 1e-3 * np.ptp(still["inner.x"])
    assert departures[1] < departures[0] / 1.8


def test_the_equilibrium_jumps_where_the_load_does(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    edges = model.breakpoints(0.0, model.period())
    run = model.simulate(cycles=1, method="quasi-static", rtol=1e-6, samples_per_cycle=720, transient=0)
    k = int(np.searchsorted(run.t, edges[0] - 1e-9))
    assert run.t[k] == pytest.approx(edges[0], abs=1e-12)  # 237 deg lies on the grid, and shows what follows
    steps = np.abs(np.diff(run["inner.y"]))
    assert int(np.argmax(steps[: k + 10])) == k - 1
    assert steps[k - 1] > 20.0 * np.median(steps)


def test_reductions_agree_with_dense_samples(make_model: Callable[..., Model]) -> None:
    model = make_model("offset_slider")
    dense = model.simulate(cycles=2, method="quasi-static", rtol=1e-6, samples_per_cycle=40_000, transient=1).steady()
    kept = model.reduce(cycles=2, method="quasi-static", rtol=1e-6, transient=1)
    assert kept["ball.force"].maximum == pytest.approx(dense["ball.force"].max(), rel=1e-4)
    assert kept["inner.y"].range == pytest.approx(np.ptp(dense["inner.y"]), rel=1e-4)
    assert kept["inner.y"].rms == pytest.approx(np.sqrt(np.mean(dense["inner.y"] ** 2)), rel=1e-3)


def test_a_ring_that_nothing_loads_is_refused_with_time_and_remedy(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    numbers = {"load.force.x": 0.0, "bearing.clearance": 20e-6}
    with pytest.raises(IntegrationError, match=r"nothing holds a ring(.|\n)*crank angle 0\.0000 deg") as refused:
        model.simulate(cycles=1, method="quasi-static", parameters=numbers, initial=np.zeros(4))
    assert refused.value.status is Status.FREE_RING
    with pytest.raises(QuasiStaticFailed, match="take method stepper"):
        model.reduce(cycles=1, transient=0, method="quasi-static", parameters=numbers, initial=np.zeros(4))


def test_a_ring_that_one_ball_carries_is_refused(make_model: Callable[..., Model]) -> None:
    """One loaded ball leaves the displacement across the load undetermined."""
    model = make_model("varying_compliance")
    numbers = {"load.force.x": 10.0, "bearing.clearance": 100e-6}
    with pytest.raises(IntegrationError) as refused:
        model.simulate(cycles=0.01, method="quasi-static", parameters=numbers, initial=np.zeros(4), transient=0)
    assert refused.value.status is Status.FREE_RING
    assert refused.value.time == 0.0
