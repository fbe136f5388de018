"""Stroboscopic values and Lyapunov exponents: those of multipliers, brute force, signs on both sides of chaos."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import t as student

from ballpass.runtime import Model, RequestError
from ballpass.runtime.ask.lyapunov import exponent_of, kind_of_motion, period_of

THREE_EIGHTHS = {"bearing.pitch_diameter": 31.75e-3}
RPM = math.tau / 60.0


@pytest.mark.long
def test_the_exponent_of_a_periodic_motion_is_the_logarithm_of_its_largest_multiplier(rotor: Model) -> None:
    found = rotor.bifurcation("shaft.speed=380 rpm:393.1540342298 rpm:2", readings=120, settling=20)
    multiplier = abs(rotor.steady().multipliers[0])
    motion = found.up[-1]
    assert motion.kind == "periodic 1"
    assert motion.exponent is not None
    assert motion.exponent.mean == pytest.approx(
        math.log(multiplier), abs=3e-3
    )  # the tangent turns on within 60 readings


def test_between_the_doublings_readings_take_two_values(rotor: Model) -> None:
    found = rotor.bifurcation("shaft.speed=1955 rpm:1965 rpm:2", "inner.y", readings=20, settling=3000, exponent=False)
    assert [motion.kind for motion in found.up] == ["periodic 1", "periodic 2"]
    twice = rotor.steady(repeats=2, parameters={"shaft.speed": 1965.0 * RPM})
    readings = found.up[1].states[:, found.row]
    assert np.min(np.abs(readings - twice.start[found.row])) < 1e-9
    assert "periodic 2" in str(found)


@pytest.mark.long
def test_the_press_is_periodic_at_ten_micrometres_and_chaotic_at_thirty(make_model: Callable[..., Model]) -> None:
    found = make_model("punching_press_tangent").bifurcation(
        "bearing.clearance=10 um:30 um:2", parameters=THREE_EIGHTHS, readings=40, settling=10
    )
    assert [motion.kind for motion in found.up] == ["periodic 1", "chaotic"]
    assert found.up[0].exponent.high < 0.0 < found.up[1].exponent.low  # type: ignore[union-attr]


@pytest.mark.long
def test_at_forty_micrometres_the_papers_press_is_chaotic_and_that_of_three_eighths_lies_in_a_periodic_window(
    make_model: Callable[..., Model],
) -> None:
    press = make_model("punching_press_tangent")
    chaotic = press.bifurcation("bearing.clearance=39.9 um:40 um:2", readings=100).up[-1]
    assert chaotic.kind == "chaotic"
    window = press.bifurcation("bearing.clearance=39.9 um:40 um:2", parameters=THREE_EIGHTHS).up[-1]
    assert window.kind == "periodic 1"
    assert window.exponent is not None
    assert window.exponent.high < 0.0


@pytest.mark.long
def test_the_exponent_of_the_papers_press_is_that_of_the_multiplier_of_134_turns(
    make_model: Callable[..., Model],
) -> None:
    found = make_model("punching_press_tangent").bifurcation(
        "bearing.clearance=19.9 um:20 um:2", readings=134, settling=20
    )
    motion = found.up[-1]
    assert motion.exponent is not None
    assert motion.exponent.mean == pytest.approx(-1.7588, abs=2e-3)  # at 1e-7 it is -1.7506
    assert motion.kind == "quasi-periodic"
    assert "balls or loads are elsewhere" in found.every


def test_the_interval_of_batch_means_holds_the_mean_of_a_correlated_series_as_often_as_it_says() -> None:
    draw, hits = np.random.default_rng(1), 0
    for _ in range(400):
        noise = draw.normal(size=400)
        series = np.convolve(noise, [1.0, 0.6, 0.3])[:400] + 0.2  # correlated over three readings, mean 0.2
        found = exponent_of(series)
        hits += found.low < 0.2 < found.high
    assert 0.90 < hits / 400 < 0.99
    assert student.ppf(0.975, 9) == pytest.approx(2.262, abs=1e-3)  # ten batches: printed tables


def test_kinds_of_motion_of_maps_that_are_known() -> None:
    """Logistic map, by its slope: period 2 at 3.2, 4 at 3.5, chaotic with ln 2 at 4; a rotation is neither."""
    kinds = []
    for r in (3.2, 3.5, 4.0):
        x, values, growth = 0.3, [], []
        for k in range(4400):
            growth.append(math.log(abs(r * (1.0 - 2.0 * x)) + 1e-300))
            x = r * x * (1.0 - x)
            values.append([x])
            if k == 399:
                values, growth = [], []
        exponent = exponent_of(np.array(growth))
        kinds.append(kind_of_motion(np.array(values), np.ones(1), exponent, forced=True))
    assert kinds == ["periodic 2", "periodic 4", "chaotic"]
    assert exponent.low < math.log(2.0) < exponent.high
    angles = np.arange(200) * (math.sqrt(5.0) - 1.0) * math.pi
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    assert period_of(circle, np.ones(2)) == 0
    assert kind_of_motion(circle, np.ones(2), exponent_of(1e-3 * np.sin(angles)), forced=True) == "quasi-periodic"


@pytest.mark.parametrize(
    ("vary", "of", "words"),
    [
        ("shaft.speed=1 rpm:2 rpm", None, "PATH=A:B:N"),
        ("shaft.speed=1 rpm:2 rpm:1", None, "is no count"),
        ("shaft.speed=1 rpm:2 rpm:3", "inner.z", "inner.y"),
    ],
)
def test_wrong_requests_are_refused(rotor: Model, vary: str, of: str | None, words: str) -> None:
    with pytest.raises(RequestError, match=words):
        rotor.bifurcation(vary, of)
