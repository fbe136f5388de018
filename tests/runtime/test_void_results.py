"""Results in which a ball is flattened by more than a tenth end every command in words, not only `run`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quick_cases import long_but
from typer.testing import CliRunner

from ballpass.runtime import Model, SimulationError
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.status import Status

#: The load of a rotor, of which 196 N flatten by 4 um: so much flattens by about a millimetre, of 11 mm.
FORCE = "load.force.x"
HEAVY = 1.5e6
SOFT = "--set load.force.x=1500kN"

COMMANDS = (
    *(
        "run SCENE --no-figures --cycles 1 --transient 0",
        "run SCENE --no-figures --cycles 1 --transient 0 --error 1%",
        "life SCENE --cycles 1 --transient 0",
    ),
    *("sensitivity SCENE --cycles 0.5 --transient 0 --of rms:inner.y --wrt bearing.clearance --no-check",),
    *("sweep SCENE --vary bearing.clearance=1um:2um:2 --of rms:inner.y --cycles 1 --transient 0 --no-figures",),
    "optimize SCENE --minimize rms:inner.x --vary bearing.clearance=1um:2um --starts 1 --cycles 0.5 --transient 0",
)


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene_text: Callable[..., str]) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(scene_text("varying_compliance"), encoding="utf-8")
    return path


@pytest.mark.parametrize("words", long_but(COMMANDS, *COMMANDS[:3]))
def test_commands_end_with_what_to_change(words: str, scene: Path) -> None:
    done = CliRunner().invoke(app, [*words.replace("SCENE", scene.name).split(), *SOFT.split()])
    assert done.exit_code == 1
    said = " ".join(done.stderr.split())
    assert "a ball is flattened by" in said
    assert "Reduce load, speed or clearance" in said


def test_lanes_find_the_members_that_are_void_alone(make_model: Callable[..., Model]) -> None:
    """Where nothing of the balls is asked for, their deflection is taken at ends of steps, and near its largest."""
    model = make_model("varying_compliance")
    table = {FORCE: np.geomspace(1e5, 1e6, 40).tolist()}
    given: dict[str, Any] = {"cycles": 1, "transient": 0, "rtol": 1e-6}
    lanes, alone = (model.simulate_many(table, "rms:inner.x", lanes=lanes, **given) for lanes in (True, False))
    assert lanes.statistics.lanes > 1
    void = [failure.member for failure in lanes.failures if failure.status == Status.VOID.name]
    assert 10 < len(void) < 30
    assert void == [failure.member for failure in alone.failures if failure.status == Status.VOID.name]


def test_members_are_void_one_by_one(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    found = model.simulate_many({FORCE: [196.0, HEAVY, 300.0]}, "rms:inner.x", cycles=1, transient=0)
    assert [(failure.member, failure.status) for failure in found.failures] == [(1, Status.VOID.name)]
    assert "a ball is flattened by" in found.failures[0].message
    assert np.isnan(found["rms:inner.x"]).tolist() == [False, True, False]
    alone = model.simulate_many({FORCE: [HEAVY]}, "rms:inner.x", cycles=1, transient=0, lanes=False)
    assert alone.failures[0].status == Status.VOID.name
    with pytest.raises(SimulationError, match="a ball is flattened by"):
        model.simulate(cycles=1, transient=0, parameters={FORCE: HEAVY})
