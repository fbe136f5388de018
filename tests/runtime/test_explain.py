"""What `explain` says of a model against what the contacts' formulas say."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from typer.testing import CliRunner

from ballpass.derive.features import cost
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Explanation, Manifest, Model, RequestError, load
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.explain import _report
from ballpass.runtime.point.explain import _knot

ROOT = Path(__file__).resolve().parents[2]


def test_breakpoints_are_the_edges_of_the_punch_window(make_model: Callable[..., Model]) -> None:
    said = make_model("punching_press").explain()
    assert [(round(math.degrees(b.angle), 9), b.cause) for b in said.breakpoints] == [
        (237.0, "punch on"),
        (267.0, "punch off"),
    ]


def test_an_edge_at_the_start_of_the_turn_counts_once(make_model: Callable[..., Model]) -> None:
    said = make_model("punching_press").explain({"mechanism.driver.start_angle": math.radians(237.0)})
    assert [b.cause for b in said.breakpoints] == ["punch on", "punch off"]


def test_an_engine_is_explained_over_the_two_turns_of_its_cycle_whichever_comes_first(
    make_virtual: Callable[..., Model],
) -> None:
    """It fires at 90 degrees, in the second turn of a crank that starts at 180."""
    engine = make_virtual("engine")
    first, other = (engine.explain({"mechanism.driver.start_angle": math.radians(start)}) for start in (0.0, 180.0))
    knots = [sorted(round(math.degrees(b.angle), 6) for b in said.breakpoints) for said in (first, other)]
    rows = [f"mechanism.forces.gas.table.angle.{k}" for k in range(1, 29)]
    assert knots == [sorted(round(math.degrees(engine.parameters[row]), 6) for row in rows)] * 2
    for one, same in zip(first.scales, other.scales, strict=True):
        assert math.degrees(one.angle) == pytest.approx(math.degrees(same.angle), abs=2.0)
        assert one.acceleration == pytest.approx(same.acceleration, rel=0.02)
    assert "Breakpoints of the first 2 turns" in str(other)
    assert "28 from 0° to 710°: knot of gas 28 times" in " ".join(str(first).split())


def test_a_knot_of_a_table_is_named_in_the_scenes_words() -> None:
    assert [_knot(name) for name in ("force.punch_slope", "torque.my_brake_slope", "load.x_rate")] == [
        "knot of punch",
        "knot of my_brake",
        "knot of the load",
    ]


def test_of_two_bearings_the_shares_and_the_rest_are_all_of_the_right_hand_side(scene_text: Callable[..., str]) -> None:
    text = scene_text("varying_compliance", ("[bearing", "[bearings.left"))
    start, end = text.index("[bearings.left]"), text.index("[run]")
    more = text[start:end].replace("[bearings.left", "[bearings.right")
    text = re.sub(r"outputs = \[.*\]", 'outputs = ["*.inner.x"]', text[:end] + more + text[end:])
    scene = scene_from_text(text, "two")
    said = Explanation(
        **dict.fromkeys(("states", "outputs", "breakpoints", "smoothness", "scales", "unsupported"), ()),
        turn=1.0,
        method="stepper",
        reason="",
    )
    counted = cost(scene)
    parts = _report(Path(__file__), scene, counted, said, cast(Manifest, SimpleNamespace(functions=())))["modelled"]
    rests = [part["rest"] for part in parts if part["rest"] is not None]
    assert len(rests) == 1
    assert rests[0] > 0
    shares = [part["operations"].get("rhs", 0) for part in parts if part["operations"]]
    assert rests[0] + sum(shares) == counted.functions["rhs"]


def test_frequency_is_that_of_the_hertz_springs_at_equilibrium(make_model: Callable[..., Model]) -> None:
    """Stiffness of a ring on balls by hand: the sum of 3/2 k sqrt(delta) n n^T over those that touch."""
    model = make_model("varying_compliance")
    scale = model.explain().scales[-1]
    found = model.static_equilibrium(t=scale.time)
    parameters, constants = model.parameters, model.constants()
    balls = model.manifest.bearing.balls if model.manifest.bearing else 0
    cage = model.inputs_at(scale.time)[[i.name for i in model.manifest.inputs].index("phase.cage")]
    angle = cage + 2.0 * np.pi * np.arange(balls) / balls
    direction = np.array([np.cos(angle), np.sin(angle)])
    depth = direction.T @ found.x[:2] - 0.5 * parameters["bearing.clearance"]
    k = constants.get("bearing.k_b", parameters.get("bearing.contact.stiffness"))
    slopes = 1.5 * k * np.sqrt(np.maximum(depth, 0.0))
    matrix = (direction * slopes) @ direction.T / parameters["bearing.inner_ring.mass"]
    assert scale.frequency == pytest.approx(math.sqrt(np.max(np.linalg.eigvalsh(matrix))), rel=1e-9)


def test_damping_of_the_two_presses_is_told_apart(make_model: Callable[..., Model]) -> None:
    """One-sided damping of 683 N*s/m outlives the contacts' own oscillation; the tangent law is light."""
    one_sided, tangent = (make_model(name).explain() for name in ("punching_press", "punching_press_tangent"))
    assert max(s.stiffness for s in one_sided.scales) > 3.0 * max(s.stiffness for s in tangent.scales)
    assert dict(one_sided.smoothness)["damping"] == "kinked"


@pytest.mark.long
def test_command_names_the_line_that_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scene = ROOT / "scenes/punching_press.toml"
    done = CliRunner().invoke(app, ["explain", str(scene), "--json"])
    assert done.exit_code == 0, done.stderr
    report = json.loads(done.stdout)
    lines = scene.read_text(encoding="utf-8").splitlines()
    by_name = {part["name"]: part for part in report["modelled"]}
    assert lines[by_name["outer ring"]["line"] - 1] == "[bearing.outer_ring]"
    assert lines[by_name["gravity"]["line"] - 1].startswith("gravity")
    assert any("inner_ring.damping" in text for text in report["not_modelled"])
    assert not any("bearing.outer_ring" in text for text in report["not_modelled"])
    assert report["step"]["all"] == sum(v for k, v in report["step"].items() if k != "all")
    assert report["method"]["auto"] == "stepper"


def test_a_constant_load_has_one_state_of_rest(make_model: Callable[..., Model]) -> None:
    assert [s.name for s in make_model("varying_compliance").explain().scales] == ["at rest under the load"]
    assert [s.name for s in make_model("punching_press").explain().scales] == ["lightest load", "heaviest load"]


def test_shares_of_the_right_hand_side_and_the_rest_are_all_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the parts share nothing; gravity and the punch are within the mechanism."""
    monkeypatch.chdir(tmp_path)
    for name, inner in (("punching_press", ("gravity", "force punch")), ("varying_compliance", ())):
        done = CliRunner().invoke(app, ["explain", str(ROOT / f"scenes/{name}.toml"), "--json"])
        assert done.exit_code == 0, done.stderr
        report = json.loads(done.stdout)
        parts = {p["name"]: p for p in report["modelled"]}
        rest = parts["ball contacts"]["rest"]
        shares = [p["operations"].get("rhs", 0) for n, p in parts.items() if p["operations"] and n not in inner]
        assert rest > 0
        assert rest + sum(shares) == report["functions"]["rhs"]["operations"]


def test_a_mechanism_without_bearings_is_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its parts add nothing to a right-hand side that there is not: a traceback."""
    text = (ROOT / "scenes/four_bar.toml").read_text(encoding="utf-8")
    scene = tmp_path / "linkage.toml"
    scene.write_text(
        text[: text.index("[bearing]")] + '[run]\ncycles = 2\noutputs = ["reaction.*"]\n', encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["explain", str(scene), "--json"])
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["states"] == []
    linkage = load(tmp_path / "generated/linkage")
    with pytest.raises(RequestError, match=r"this scene has no states.* quantities"):
        linkage.reduce()  # it advised to write the folder again
    assert math.isfinite(linkage.quantities(["max:reaction.A.x"])["max:reaction.A.x"].value)


def test_hertz_is_not_called_smooth_where_people_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["explain", str(ROOT / "scenes/varying_compliance.toml")])
    assert done.exit_code == 0, done.stderr
    words = " ".join(done.stdout.split())
    assert "elastic: once continuously differentiable (second derivative unbounded at contact onset)" in words
    assert "shaft angle" in words
    assert "crank angle" not in words
    assert "_quantities" not in words


def test_a_slow_turn_is_said_to_need_linearly_implicit_steps_and_takes_them(make_model: Callable[..., Model]) -> None:
    """At one revolution a minute a quarter of a million oscillations fit into a turn; no explicit method steps over
    them."""
    model = make_model("punching_press")
    slow = {"mechanism.driver.speed": 2.0 * math.pi / 60.0}
    assert "explicit steps suit" in model.explain().reason
    assert "linearly implicit" not in model.explain().reason
    explanation = model.explain(slow)
    assert "linearly implicit" in explanation.reason
    oscillations = max(s.frequency for s in explanation.scales) * explanation.turn / (2.0 * math.pi)
    run = model.simulate(1, parameters=slow, method="stepper", rtol=1e-4, samples_per_cycle=100)
    assert run.statistics.steps is not None
    assert run.statistics.steps < 0.1 * oscillations
    assert "rodas" in run.statistics.reason
