"""A mechanism's load by its harmonics: coefficients against FFT and adaptive quadrature, slopes against differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import integrate

from ballpass.derive import SceneError
from ballpass.derive.scene.read import scene_from_text
from ballpass.runtime import Model

COUNT = 4
CHANGES = (
    ("balls = 8", f"balls = 8\nload_harmonics = {COUNT}"),
    ('"inner.*", "outer.*"', '"load.*", "inner.*", "outer.*"'),
)


@pytest.fixture(scope="module")
def four_bar(make_model: Callable[..., Model]) -> Model:
    return make_model("four_bar", *CHANGES)


def coefficient(model: Model, axis: str, kind: str, numbers: dict[str, float] | None = None) -> float:
    return model.constants(numbers)[f"load.{axis}.{kind}"]


def reaction(model: Model, axis: str, angles: np.ndarray, numbers: dict[str, float]) -> np.ndarray:
    """Force of the linkage on the bearing, from the outputs, not from the series."""
    speed = model.parameters["mechanism.driver.speed"]
    values = [model.evaluate(a / speed, outputs=[f"reaction.A.{axis}"], parameters=numbers) for a in angles]
    return np.array([float(value[f"reaction.A.{axis}"]) for value in values])


@pytest.mark.parametrize("axis", ["x", "y"])
def test_harmonics_of_the_smooth_load_are_those_of_the_fft(four_bar: Model, axis: str) -> None:
    numbers = {"mechanism.torques.work.torque": 0.0}
    angles = 2.0 * np.pi * np.arange(256) / 256
    found = np.fft.rfft(reaction(four_bar, axis, angles, numbers)) / len(angles)
    size = np.abs(found).max()
    assert coefficient(four_bar, axis, "mean", numbers) == pytest.approx(found[0].real, abs=1e-12 * size)
    for k in range(1, COUNT + 1):
        assert coefficient(four_bar, axis, f"cos{k}", numbers) == pytest.approx(2 * found[k].real, abs=1e-11 * size)
        assert coefficient(four_bar, axis, f"sin{k}", numbers) == pytest.approx(-2 * found[k].imag, abs=1e-11 * size)


def test_jumps_of_the_load_are_integrated_exactly(four_bar: Model) -> None:
    edges = np.radians([70.0, 190.0])  # the window of the working torque

    def weighted(angle: float) -> float:
        return float(reaction(four_bar, "x", np.array([angle]), {})[0]) * np.cos(3.0 * angle) / np.pi

    pieces = [(0.0, edges[0]), (edges[0], edges[1] - 1e-9), (edges[1], 2.0 * np.pi)]
    expected = sum(integrate.quad(weighted, a, b, epsabs=1e-7, epsrel=1e-9)[0] for a, b in pieces)
    assert coefficient(four_bar, "x", "cos3") == pytest.approx(expected, rel=1e-6)


def test_the_model_is_loaded_by_the_series(four_bar: Model) -> None:
    run = four_bar.simulate(cycles=1, rtol=1e-4, transient=0, samples_per_cycle=50)
    angle = four_bar.parameters["mechanism.driver.speed"] * run.t
    for axis in "xy":
        series = coefficient(four_bar, axis, "mean") + sum(
            coefficient(four_bar, axis, f"cos{k}") * np.cos(k * angle)
            + coefficient(four_bar, axis, f"sin{k}") * np.sin(k * angle)
            for k in range(1, COUNT + 1)
        )
        np.testing.assert_allclose(run[f"load.{axis}"], series, rtol=1e-10, atol=1e-8)


def test_a_changed_number_changes_the_coefficients_of_the_same_model(four_bar: Model) -> None:
    """The load of a weightless linkage is linear in the working torque."""
    still = {"mechanism.torques.work.torque": 0.0}
    double = {"mechanism.torques.work.torque": 2.0 * four_bar.parameters["mechanism.torques.work.torque"]}
    for name in ("mean", "cos1", "sin4"):
        none, once, twice = (coefficient(four_bar, "y", name, n) for n in (still, None, double))
        assert twice - none == pytest.approx(2.0 * (once - none), rel=1e-10)
        assert abs(once - none) > 1e-3


def test_coefficients_have_slopes_by_the_parameters(four_bar: Model) -> None:
    names = [info.name for info in four_bar.manifest.constants]
    columns = [info.name for info in four_bar.manifest.parameters]
    slopes = np.asarray(four_bar.kernel("constants_jac")({"p": four_bar.numbers().p}))
    rows = [k for k, name in enumerate(names) if name.startswith("load.")]
    for path in (
        "mechanism.bodies.coupler.mass",
        "mechanism.torques.work.window.start",
        "mechanism.bodies.crank.points.B",
    ):
        value = four_bar.parameters[path]
        step = 1e-5 * abs(value)
        ahead, behind = (four_bar.numbers({path: value + s}).c for s in (step, -step))
        difference = (ahead - behind)[rows] / (2.0 * step)
        np.testing.assert_allclose(
            slopes[rows, columns.index(path)], difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max()
        )


def test_harmonics_without_a_mechanism_are_refused(scene_text: Callable[..., str]) -> None:
    text = scene_text("varying_compliance", ("balls = 8", "balls = 8\nload_harmonics = 4"))
    with pytest.raises(SceneError, match="no mechanism whose load") as refused:
        scene_from_text(text, "x")
    assert 'type = "harmonic"' in str(refused.value)


def test_no_scene_without_harmonics_has_coefficients(make_model: Callable[..., Model]) -> None:
    model = make_model("four_bar")
    assert not [info.name for info in model.manifest.constants if info.name.startswith("load.")]
