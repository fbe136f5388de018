"""Claims about scenes of several bearings: each moves as it does alone, in every way to compute."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stepper_methods import NAMES
from typer.testing import CliRunner
from virtual import virtual_model

from ballpass.derive import SceneError, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.records import Scene
from ballpass.runtime import KinkWarning, Model, RequestError, load, load_solution
from ballpass.runtime.app.cli import app
from ballpass.runtime.run.failure_location import locate_failure

#: What the right bearing has other than the left one: law, number of balls, clearance, a fixed outer ring.
OTHER = (
    ("balls = 8", "balls = 9"),
    ('clearance = "10 um"', 'clearance = "6 um"'),
    ('law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"', 'law = "hunt-crossley"\nhysteresis = "5 s/m"'),
    ('support = "elastic"\nmass', 'support = "fixed"\n#mass'),
    ('stiffness = "5e7 N/m"', "#"),
    ('damping = "500 N*s/m"', "#"),
    ('outer = ["0 um", "0 um"]\nouter_velocity = ["0 m/s", "0 m/s"]', ""),
)


def pair_text(scene_text: Callable[..., str]) -> str:
    text, other = scene_text("punching_press"), scene_text("punching_press", *OTHER)
    start, end = (text.index(mark) for mark in ("[bearing]", "[run]"))
    named = [
        re.sub(r"^\[bearing(?=[.\]])", f"[bearings.{name}", of[of.index("[bearing]") : of.index("[run]")], flags=re.M)
        for name, of in (("left", text), ("right", other))
    ]
    outputs = ('"inner.*", "outer.*", "ball.*"', '"left.*", "right.*"')
    return (text[:start] + "".join(named) + text[end:]).replace(*outputs)


def row_text(scene_text: Callable[..., str], count: int, changes: tuple[tuple[str, str], ...]) -> str:
    """So many bearings like that of the press, side by side."""
    text = scene_text("punching_press", *changes, ("share = 0.5", f"share = {1.0 / count}"))
    start, end = (text.index(mark) for mark in ("[bearing]", "[run]"))
    names = [f"b{k}" for k in range(count)]
    named = [re.sub(r"^\[bearing(?=[.\]])", f"[bearings.{n}", text[start:end], flags=re.M) for n in names]
    outputs = ", ".join(f'"{n}.inner.*", "{n}.ball.force"' for n in names)
    return (
        text[:start] + "".join(named) + re.sub(r"outputs = \[.*?\]", f"outputs = [{outputs}]", text[end:], flags=re.S)
    )


@pytest.fixture(scope="module")
def pair(scene_text: Callable[..., str], tmp_path_factory: pytest.TempPathFactory) -> Model:
    return load(generate(scene_from_text(pair_text(scene_text), "pair"), tmp_path_factory.mktemp("pair") / "pair"))


@pytest.fixture(scope="module")
def alone(make_model: Callable[..., Model]) -> dict[str, Model]:
    fixed = (*OTHER, ('"outer.*", ', ""))
    return {"left": make_model("punching_press"), "right": make_model("punching_press", *fixed)}


@pytest.mark.parametrize(
    ("method", "bound"),
    [*((method, 1e-4) for method in NAMES), ("stepper", 1e-5), pytest.param("cvodes", 1e-3, marks=pytest.mark.long)],
)
def test_each_moves_as_it_does_alone(pair: Model, alone: dict[str, Model], method: str, bound: float) -> None:
    """Six coordinates, which fill no vector, and four and two."""
    both = pair.simulate(cycles=0.15, transient=0, method=method, rtol=1e-9)
    for name, model in alone.items():
        own = model.simulate(cycles=0.15, transient=0, method=method, rtol=1e-9)
        for output in ("inner.x", "inner.y", "ball.force"):
            found, expected = both[f"{name}.{output}"], own[output]
            assert np.max(np.abs(found - expected)) < bound * np.max(np.abs(expected)), (name, output)


@pytest.mark.parametrize(
    ("count", "changes"),
    [
        pytest.param(7, OTHER[3:], marks=pytest.mark.long),
        pytest.param(5, (), marks=pytest.mark.long),
        pytest.param(20, OTHER[3:], marks=pytest.mark.long),
    ],
    ids=lambda value: f"{value} bearings" if isinstance(value, int) else "fixed" if value else "elastic",
)
def test_bearings_alike_read_alike_however_many_there_are(
    scene_text: Callable[..., str], tmp_path: Path, count: int, changes: tuple[tuple[str, str], ...]
) -> None:
    """In a run, in reductions and in lanes; beyond 53 channels the first bearings once read zero."""
    model = load(generate(scene_from_text(row_text(scene_text, count, changes), "row"), tmp_path / "row"))
    run = {"cycles": 0.2, "transient": 0, "rtol": 1e-8}
    alone, solution = model.reduce(**run), model.simulate(**run)
    kinds = ("min:{}.inner.y", "rms:{}.inner.y", "max:{}.ball.force")
    each = [[kind.format(f"b{k}") for kind in kinds] for k in range(count)]
    many = model.simulate_many({"bearings.b0.clearance": [10e-6] * 2}, [name for row in each for name in row], **run)
    for found in (alone, solution.reductions):
        assert found is not None
        for k in range(count):
            ring, force = found[f"b{k}.inner.y"], found[f"b{k}.ball.force"]
            assert ring.minimum == pytest.approx(np.min(solution["b0.inner.y"]), rel=1e-3)
            assert ring.rms == pytest.approx(alone["b0.inner.y"].rms, rel=1e-9)
            assert force.maximum == pytest.approx(alone["b0.ball.force"].maximum, rel=1e-9)
            lanes = [float(many[name][1]) for name in each[k]]
            assert lanes == pytest.approx([ring.minimum, ring.rms, force.maximum], rel=1e-4)


def test_reductions_and_lanes_tell_the_bearings_apart(pair: Model, alone: dict[str, Model]) -> None:
    run = {"cycles": 0.15, "transient": 0, "rtol": 1e-9}
    both = pair.reduce(**run)
    names = [f"max:{name}.ball.force" for name in alone]
    many = pair.simulate_many({"bearings.right.clearance": [6e-6] * 3}, names, **run)
    for name, model in alone.items():
        own = model.reduce(**run)
        for channel in ("ball.force", "ball.deflection", "inner.y"):
            found = both[f"{name}.{channel}"]
            assert found.maximum == pytest.approx(own[channel].maximum, rel=1e-5)
            assert found.maximum_ball == own[channel].maximum_ball
        assert many[f"max:{name}.ball.force"] == pytest.approx(own["ball.force"].maximum, rel=1e-4)


@pytest.mark.long
def test_derivatives_by_one_bearing_move_that_bearing_alone(pair: Model, alone: dict[str, Model]) -> None:
    run = {"cycles": 0.05, "rtol": 1e-10, "method": "stepper-dp54"}
    both = pair.sensitivities(["bearings.left.share", "bearings.right.clearance"], **run)
    own = alone["right"].sensitivities(["bearing.clearance"], **run)
    columns = [pair.states.index(f"right.{state}") for state in alone["right"].states]
    scale = np.max(np.abs(own.x[-1]))
    assert np.max(np.abs(both.x[-1][columns, 1] - own.x[-1][:, 0])) < 1e-3 * scale
    # times that move with the left bearing's contacts leave the error of the steps in the right one
    others = np.delete(both.x[-1][:, 0], columns)
    assert np.max(np.abs(both.x[-1][columns, 0])) < 1e-6 * np.max(np.abs(others))


def test_the_manifest_lists_them_and_their_coordinates(pair: Model) -> None:
    assert [(b.name, b.balls, b.outer_ring) for b in pair.manifest.bearings] == [("left", 8, True), ("right", 9, False)]
    assert [c.name for c in pair.manifest.coordinates] == [
        *(f"left.{ring}.{axis}" for ring in ("inner", "outer") for axis in "xy"),
        *(f"right.inner.{axis}" for axis in "xy"),
    ]
    assert len(pair.states) == 12


@pytest.mark.long
@pytest.mark.parametrize("smooth_first", [False, pytest.param(True, marks=pytest.mark.extreme)])
def test_kinks_are_located_beside_a_bearing_that_has_none(
    scene_text: Callable[..., str], alone: dict[str, Model], tmp_path: Path, smooth_first: bool
) -> None:
    smoothing = ("[bearings.right.contact]\n", '[bearings.right.contact]\nsmoothing = "0.05 um"\n')
    text = pair_text(scene_text).replace(*smoothing)
    if smooth_first:  # in the order of their tables
        start, middle, end = (text.index(mark) for mark in ("[bearings.left]", "[bearings.right]", "[run]"))
        text = text[:start] + text[middle:end] + text[start:middle] + text[end:]
    model = load(generate(scene_from_text(text, "pair"), tmp_path / "pair"))
    assert [b.name for b in model.manifest.bearings] == sorted(("left", "right"), reverse=smooth_first)
    both = model.simulate(cycles=0.15, transient=0, rtol=1e-9)
    own = alone["left"].simulate(cycles=0.15, transient=0, rtol=1e-9)
    assert both.statistics.located
    assert np.max(np.abs(both["left.ball.force"] - own["ball.force"])) < 1e-5 * np.max(own["ball.force"])


@pytest.mark.long
def test_a_corner_of_a_law_is_told_of_its_bearing(scene_text: Callable[..., str], tmp_path: Path) -> None:
    """An odd number of balls has a corner at rest under the left one's law, and none under the right one's."""
    odd = pair_text(scene_text).replace("balls = 8", "balls = 7", 1)
    model = load(generate(scene_from_text(odd, "odd"), tmp_path / "odd"))
    with pytest.warns(KinkWarning, match=r"bearings\.left\.damping\.smoothing") as caught:
        model.linearize(x=np.zeros(12))
    assert not any("bearings.right" in str(item.message) for item in caught)


def test_messages_name_the_bearing_they_speak_of(pair: Model) -> None:
    """The right one's balls are pressed."""
    state = np.zeros(12)
    state[4] = 2e-5  # right.inner.x
    place = locate_failure(pair, pair.numbers(), 0.0, state)
    assert (place.bearing, place.ball) == ("right", 1)
    assert place.deflection == pytest.approx(2e-5 - 3e-6, rel=1e-12, abs=0.0)  # less half its clearance, Eq. (6)
    assert "ball 1 of right" in place.words


@pytest.mark.long
def test_a_static_quantity_is_of_the_bearing_it_names(pair: Model, alone: dict[str, Model]) -> None:
    kinds = ("deflection", "peak_ball_force")
    for name, model in alone.items():
        asked = [f"static_{name}_{kind}@240deg" for kind in kinds]
        both = pair.sensitivity(asked, f"bearings.{name}.clearance", check=False)
        own = model.sensitivity([f"static_{kind}@240deg" for kind in kinds], "bearing.clearance", check=False)
        for mine, other in zip(both.pairs, own.pairs, strict=True):
            assert mine.value == pytest.approx(other.value, rel=1e-9, abs=0.0)
            assert mine.derivative == pytest.approx(other.derivative, rel=1e-6, abs=0.0)
        assert [item.ball for item in both.quantities] == [item.ball for item in own.quantities]
    with pytest.raises(RequestError, match="static_left_deflection or static_right_deflection"):
        pair.sensitivity("static_deflection@240deg", "bearings.left.clearance", check=False)


@pytest.mark.long
def test_a_peak_is_asked_for_as_the_summary_names_it(pair: Model) -> None:
    run = {"cycles": 0.05, "transient": 0}
    names = ["left.peak_ball_force", "peak_left_ball_force"]
    many = pair.simulate_many({"bearings.left.clearance": [10e-6]}, names, **run)
    report = pair.sensitivity(names, "bearings.left.clearance", check=False, **run)
    assert many[names[0]] == many[names[1]]
    assert report.quantities[0].value == report.quantities[1].value
    for ask in (lambda of: pair.sensitivity(of, check=False), lambda of: pair.simulate_many({}, of)):
        with pytest.raises(RequestError, match=r"peak_left_ball_force.*peak_right_ball_force"):
            ask("peak_ball_force")


def refused(text: str) -> Scene:
    return scene_from_text(text, "pair")


def test_bearings_in_two_places_are_refused(scene_text: Callable[..., str], tmp_path: Path) -> None:
    text = scene_text("punching_press")
    one = text[text.index("[bearing]") : text.index("[run]")]
    with pytest.raises(SceneError, match="bearings are given in two places"):
        refused(text.replace("[run]", one.replace("[bearing", "[bearings.other") + "[run]"))
    with pytest.raises(SceneError, match=r"bearings\.left\.clearance"):
        refused(pair_text(scene_text).replace('clearance = "10 um"', 'clearance = "10 s"'))


def test_a_solution_keeps_the_balls_of_each_bearing(pair: Model, tmp_path: Path) -> None:
    run = pair.simulate(cycles=0.05, transient=0, samples_per_cycle=200)
    kept = load_solution(run.save(tmp_path / "pair.nc"))
    labelled = kept.to_xarray()
    for name, balls in (("left", 8), ("right", 9)):
        assert np.array_equal(kept[f"{name}.ball.force"], run[f"{name}.ball.force"])
        assert labelled[f"{name}.ball.force"].sel({f"{name}.ball": balls}).shape == run.t.shape


@pytest.mark.long
def test_explain_says_of_each_bearing_what_is_not_modelled(
    scene_text: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pair.toml").write_text(pair_text(scene_text), encoding="utf-8")
    done = CliRunner().invoke(app, ["explain", "pair.toml", "--json"])
    told = "\n".join(json.loads(done.stdout)["not_modelled"])
    assert "bearings.right.outer_ring" in told
    assert "bearings.left.outer_ring" not in told
    assert told.count("waviness of the outer raceway") == 1
    assert "waviness of the outer raceway (bearings.NAME.outer_waviness; NAME: left, right)" in told


def test_bearings_on_a_shaft_carry_their_shares_of_its_load(
    scene_text: Callable[..., str], tmp_path: Path, make_virtual: Callable[..., Model]
) -> None:
    """Each rests where one alone does under that part; without shares each carries all, and that is said."""
    alone, text = make_virtual("varying_compliance"), scene_text("varying_compliance")
    start, end = text.index("[bearing]"), text.index("[run]")
    for shares, words in (((0.25, 0.75), 0), ((0.25, 0.5), 0), ((None, None), 1)):
        named = [
            re.sub(r"^\[bearing(?=[.\]])", f"[bearings.{name}", text[start:end], flags=re.M).replace(
                "balls = 8", "balls = 8" if share is None else f"balls = 8\nshare = {share}"
            )
            for name, share in zip("ab", shares, strict=True)
        ]
        outputs = ('"inner.*", "ball.*", "load.*"', '"a.*", "b.*"')
        folder = tmp_path / f"pair_{len(list(tmp_path.iterdir()))}"
        whole = (text[:start] + "".join(named) + text[end:]).replace(*outputs)
        model = virtual_model(whole, folder)
        found = model.static_equilibrium().x
        for k, share in enumerate(shares):
            load = 196.0 * (1.0 if share is None else share)
            expected = alone.static_equilibrium(parameters={"load.force.x": load}).x[0]
            assert found[2 * k] == pytest.approx(expected, rel=1e-9, abs=0.0)
        assert sum("carries the whole load of the shaft" in limit for limit in model.explain().limits) == words
        unusual = " ".join(model.explain().unusual)
        assert ("whole load together" in unusual) == (shares == (0.25, 0.5))
