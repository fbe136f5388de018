"""Fixtures of the runtime's tests: the two scenes that most claims are about."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ballpass.runtime import Model


@pytest.fixture(scope="session")
def press(make_model: Callable[..., Model]) -> Model:
    """The punching press, its bearing in elastic housing, with tangent damping."""
    return make_model("punching_press_tangent")


@pytest.fixture(scope="session")
def rotor(make_model: Callable[..., Model]) -> Model:
    """20 kg in a bearing with a fixed outer ring and damping of 200 N s/m to the frame."""
    return make_model("varying_compliance")
