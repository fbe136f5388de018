"""Tables of answers fit 80 columns, and say in words what their numbers are."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ballpass.runtime import Model
from ballpass.runtime.report.text import to_text

LONGEST = "mechanism.bodies.crank.center_of_mass.distance"


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press")


@pytest.mark.long
def test_derivatives_by_parameters_with_long_names_fit_80_columns(press: Model) -> None:
    report = press.sensitivity(["peak_ball_force"], [LONGEST, "bearing.damping.ratio", "bearing.clearance"], 4)
    lines = to_text(report._report()).splitlines()
    assert max(map(len, lines)) <= 80
    assert any(line.split()[:3] == ["parameter", "%", "per"] for line in lines)
    (row,) = [line for line in lines if line.startswith(f" {LONGEST}")]
    assert row.split()[1] == "–"  # a parameter that is 0


def test_modes_and_matrices_of_the_press_fit_80_columns_and_have_names(press: Model) -> None:
    text = to_text(press.linearize()._report())
    assert max(map(len, text.splitlines())) <= 80
    assert all(word in text for word in ("natural", "damping", "stiffness", "mass"))
