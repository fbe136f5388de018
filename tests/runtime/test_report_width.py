"""Tables of answers fit 80 columns, and say in words what their numbers are."""

from __future__ import annotations

import re
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


@pytest.mark.parametrize(
    ("scene", "state", "what"),
    [
        ("punching_press", "inner.y", "inner.y: inner ring, y"),
        ("rotor_two_bearings", "free_end.inner.y", "free_end.inner.y: inner ring of free_end, y"),
    ],
)
def test_modes_and_matrices_fit_80_columns_and_have_names(
    make_model: Callable[..., Model], scene: str, state: str, what: str
) -> None:
    text = to_text(make_model(scene).linearize()._report())
    assert max(map(len, text.splitlines())) <= 80
    assert all(word in text for word in ("natural", "damping", "stiffness", "mass", state))
    assert what in " ".join(text.split())


def test_tables_of_states_fit_80_columns_and_say_what_the_states_are(make_model: Callable[..., Model]) -> None:
    section = make_model("rotor_two_bearings").section(readings=40, settling=5)
    for text in (to_text(section._report()), to_text(make_model("varying_compliance").steady()._report())):
        assert max(map(len, text.splitlines())) <= 80
        (row,) = [line for line in text.splitlines() if re.match(r" (free_end\.)?inner\.vx ", line)]
        assert "Velocity of the inner ring" in row
