"""Fixtures of the runtime's tests: models in the virtual machine, and the two scenes that most claims are about."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from virtual import virtual_model

from ballpass.runtime import Model


@pytest.fixture(scope="session")
def make_virtual(tmp_path_factory: pytest.TempPathFactory, scene_text: Callable[..., str]) -> Callable[..., Model]:
    """Model of a shipped scene with replacements, generated once and run by CasADi's virtual machine."""

    @cache
    def make(name: str, *changes: tuple[str, str]) -> Model:
        return virtual_model(scene_text(name, *changes), tmp_path_factory.mktemp(name) / name)

    return make


@pytest.fixture(scope="session")
def press(make_model: Callable[..., Model]) -> Model:
    """The punching press, its bearing in elastic housing, with tangent damping."""
    return make_model("punching_press_tangent")


@pytest.fixture(scope="session")
def rotor(make_model: Callable[..., Model]) -> Model:
    """20 kg in a bearing with a fixed outer ring and damping of 200 N s/m to the frame."""
    return make_model("varying_compliance")
