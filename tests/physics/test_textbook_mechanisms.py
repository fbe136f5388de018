"""Mechanisms of textbooks: reactions and torque against a second program in maximal coordinates, and in closed form."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable

import pytest
from quick_cases import long_but
from reference import Reference
from scripts.validation.mechanisms import FOLDER, TIMES, numbers_of

from ballpass.runtime import Model

NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))


@pytest.mark.parametrize("name", long_but(NAMES, "quick_return", "wiper", "jansen_leg"))
def test_reactions_and_torque_are_those_of_maximal_coordinates(model_of: Callable[..., Model], name: str) -> None:
    """The program that it is compared with reads the scene file alone, and knows neither dyads nor ballpass."""
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    model, reference = model_of(text, name), Reference(tomllib.loads(text))
    for time in (TIMES.get(name, 0.0), TIMES.get(name, 0.0) + 0.004):
        found, expected = model.evaluate(time), reference.evaluate(time, {})
        forces = [key for key in found if key in expected]
        assert len(forces) == len(found)
        largest = max(abs(expected[key]) for key in forces)
        for key in forces:
            assert found[key] == pytest.approx(expected[key], rel=1e-12, abs=1e-13 * largest), key
        if time == TIMES.get(name, 0.0):  # those of the page are these
            assert numbers_of(name) == pytest.approx({key: expected[key] for key in forces}, rel=1e-12, abs=1e-12)


def test_the_slider_crank_of_equal_links_has_its_torque_in_closed_form(model_of: Callable[..., Model]) -> None:
    """By virtual work: 2 F sin of the force, m g l cos of the weights, 3 m l^2 w^2 sin 2a of the inertia."""
    model = model_of((FOLDER / "equal_links.toml").read_text(encoding="utf-8"), "equal_links")
    for angle in (0.2, math.pi / 4.0, 1.5):
        expected = 200.0 * math.sin(angle) + 10.0 * math.cos(angle) + 3.0 * math.sin(2.0 * angle)
        found = model.evaluate(0.0, parameters={"mechanism.driver.start_angle": angle})["drive_torque"]
        assert found == pytest.approx(expected, rel=1e-13)
