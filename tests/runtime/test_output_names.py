"""Claims about names of outputs: one that the scene could have is not denied, but told where to ask for it."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from virtual import virtual_model

from ballpass.runtime import Model, RequestError


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory, scene_text: Callable[..., str]) -> Model:
    return virtual_model(scene_text("punching_press"), tmp_path_factory.mktemp("names") / "press")


@pytest.mark.parametrize(
    ("name", "pattern"),
    [("ring_force.x", "ring_force.*"), ("body.rod.angle", "body.rod.*"), ("load.y", "load.*")],
)
def test_what_the_scene_did_not_ask_for_is_told_with_the_line_that_asks(model: Model, name: str, pattern: str) -> None:
    told = re.escape(f'{name!r} is not among this scene\'s run.outputs: add "{pattern}" there')
    solution = model.simulate(0.01, method="cvodes", outputs=[])
    for ask in (
        lambda: model.simulate(0.01, outputs=[name]),
        lambda: solution[name],
        lambda: model.evaluate(0.0, outputs=[name]),
    ):
        with pytest.raises(RequestError, match=told):
            ask()


@pytest.mark.parametrize("name", ["point.slider.C.ay", "ball.inner_pressure", "force.punch.power", "kinetic_energy"])
def test_outputs_on_request_are_told_with_their_own_names(model: Model, name: str) -> None:
    with pytest.raises(RequestError, match=re.escape(f"{name!r} is computed only for a scene that names it")):
        model.sensitivity(of=[f"max:{name}"], wrt=["bearing.clearance"])
    with pytest.raises(RequestError, match="computed only for a scene that names it"):
        model.jacobian(name)
    with pytest.raises(RequestError, match=re.escape(f"{name!r} is computed only for a scene that names it")):
        model.simulate_many({"bearing.clearance": [1e-5]}, [f"max:{name}"], cycles=1)


def test_the_remedy_works(
    model: Model, scene_text: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = scene_text("punching_press", ('"drive_torque"]', '"drive_torque", "ring_force.*", "body.rod.*"]'))
    richer = virtual_model(text, tmp_path_factory.mktemp("richer") / "press")
    assert {"ring_force.x", "body.rod.angle"} <= set(richer.outputs)


def test_what_this_run_did_not_keep_is_told_apart_from_what_does_not_exist(model: Model) -> None:
    solution = model.simulate(0.01, method="cvodes", outputs=[])
    with pytest.raises(RequestError, match="not kept in this run"):
        solution["ball.force"]
    with pytest.raises(RequestError, match=r"There is no output or state 'ball\.farce'"):
        solution["ball.farce"]
