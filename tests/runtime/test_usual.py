"""Numbers that are allowed and absurd do not pass in silence, wherever they come from; those of shipped scenes do."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from ballpass.derive import Scene, generate, read_scene
from ballpass.derive.reading.plausible_ranges import usual_ranges
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Manifest, Model, SimulationError, UnusualWarning, load
from ballpass.runtime.app.summary import summarize
from ballpass.runtime.contract.plausible_ranges import unusual

SCENES = ("crank_shaper", "four_bar", "offset_slider", "punching_press", "punching_press_tangent", "varying_compliance")
WINDOW = "mechanism.forces.punch.window"

#: A slip, the numbers it makes, and words of what is said.
SLIPS = {
    "a radius for a diameter": ({"bearing.ball_diameter": 3.96875e-3}, "groove_radius .* 1.04 of bearing.ball_diam"),
    "grooves far too open": ({"bearing.contact.outer_groove_radius": 4.6e-3}, "0.58 of .* 0.505 to 0.56"),
    "mm for um": ({"bearing.clearance": 10e-3}, r"clearance = 0.01 m, 1.26 of .* -0.01 to 0.01"),
    "a preload in mm": ({"bearing.clearance": -0.1e-3}, "clearance"),
    "Pa for GPa": ({"bearing.contact.young_modulus": 207.0}, r"207 Pa: .* 5e\+10 to 4e\+11 Pa"),
    "radians for degrees": (
        {f"{WINDOW}.start": math.radians(4.1), f"{WINDOW}.end": math.radians(4.6)},
        "whether radians were given as degrees",
    ),
    "degrees for radians": ({f"{WINDOW}.start": 237.0, f"{WINDOW}.end": 241.0}, "degrees were given as radians"),
}


@pytest.mark.parametrize(("numbers", "words"), SLIPS.values(), ids=SLIPS.keys())
def test_a_slip_is_said_before_a_run(make_model: Callable[..., Model], numbers: dict[str, float], words: str) -> None:
    model = make_model("punching_press")
    with pytest.warns(UnusualWarning, match=words):
        model.constants(numbers)


def said(scene: Scene) -> list[str]:
    """What is said of a scene's own numbers, without deriving it."""
    return unusual(
        cast(Manifest, SimpleNamespace(usual=usual_ranges(scene), parameters=numbers(scene), constants=())),
        values(scene),
    )


def numbers(scene: Scene) -> list[SimpleNamespace]:
    return [SimpleNamespace(name=q.path, unit=q.unit) for q in scene.quantities]


def values(scene: Scene) -> dict[str, float]:
    return {q.path: q.value for q in scene.quantities}


@pytest.mark.parametrize("name", SCENES)
def test_numbers_of_shipped_scenes_are_usual(scene_text: Callable[..., str], name: str) -> None:
    assert said(scene_from_text(scene_text(name), name)) == []


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
def test_runs_of_shipped_scenes_are_usual(make_model: Callable[..., Model], name: str) -> None:
    model = make_model(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnusualWarning)
        assert summarize(model, model.simulate())["warnings"] == []


def test_numbers_of_the_file_meet_the_same_ranges(scene_text: Callable[..., str]) -> None:
    """A smoothing wider than the clearance, waves of a tenth of a millimetre, shares of a joint that are too much."""
    text = scene_text(
        "punching_press",
        ("poisson_ratio = 0.3", 'poisson_ratio = 0.3\nsmoothing = "20 um"'),
        ("[bearing.inner_ring", '[bearing.outer_waviness]\n8 = { amplitude = "0.1 mm" }\n\n[bearing.inner_ring'),
    )
    start, end = text.index("[bearing]"), text.index("[run]")
    both = "\n".join(text[start:end].replace("[bearing", f"[bearings.{name}") for name in ("left", "right"))
    scene = scene_from_text(text[:start] + both.replace("share = 0.5", "share = 0.6", 1) + text[end:], "press")
    shares, *rest = sorted(said(scene), key=lambda text: "together" not in text)
    assert shares.startswith("bearings.left.share = 0.6 and bearings.right.share = 0.5, together 1.1: unusual")
    assert [text.split(" = ")[0] for text in rest] == [
        f"bearings.{name}.{key}"
        for name in ("left", "right")
        for key in ("contact.smoothing", "outer_waviness.8.amplitude")
    ]


def test_an_ensemble_warns_once_and_says_how_many(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    with pytest.warns(UnusualWarning) as caught:
        model.simulate_many({"bearing.clearance": [1e-5, 1e-4, 2e-4, 3e-4]}, ["peak_ball_force"], cycles=3)
    assert len(caught) == 1
    assert "(member 1, the first of 3 among 4)" in str(caught[0].message)


def test_what_a_run_shows_is_said(make_model: Callable[..., Model]) -> None:
    """A tenfold punch presses balls by Hertz's law beyond a hundredth of them; one downwards drives, like an engine."""
    model = make_model("punching_press")
    run = model.simulate(cycles=3, parameters={"mechanism.forces.punch.force.y": 89648.0})
    with pytest.warns(UnusualWarning, match="a ball is deflected by"):
        summary = summarize(model, run)
    assert any("a ball is deflected by" in text for text in summary["warnings"])
    engine = model.simulate(cycles=3, parameters={"mechanism.forces.punch.force.y": -8964.8})
    summary = summarize(model, engine)
    assert summary["drive_work"]["value"] < -9.0
    assert summary["warnings"] == []


def test_results_that_no_bearing_could_have_are_errors(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    for numbers, words in (
        ({"mechanism.forces.punch.force.y": 4e6}, "a ball is flattened by .* of its diameter.*Reduce load"),
        ({"bearing.clearance": 20e-3}, "the rings are displaced by .* more than a ball's diameter"),
    ):
        with pytest.raises(SimulationError, match=words):
            model.simulate(cycles=3, parameters=numbers)
        with pytest.raises(SimulationError, match=words):
            model.simulate(cycles=2.8, parameters=numbers, method="cvodes")


def test_rings_that_are_near_where_no_ball_is_flatten_none(make_model: Callable[..., Model]) -> None:
    """Of four balls two share a load between them: each gives cos 45 deg of what the rings move, here 11 %."""
    model = make_model("varying_compliance", ("balls = 8", "balls = 4"))
    numbers = {"load.force.x": 2.9e5, "bearing.ball_angle": math.radians(45.0)}
    rest = model.static_equilibrium(parameters=numbers)
    assert rest.positions[0] > 0.105 * model.parameters["bearing.ball_diameter"]
    for outputs in (None, []):
        run = model.simulate(0.01, parameters=numbers, initial=rest.x, transient=0, outputs=outputs)
        with pytest.warns(UnusualWarning, match="a ball is deflected by"):
            summarize(model, run)


@pytest.mark.long
def test_a_linkage_that_outweighs_its_ring_and_a_sudden_load_are_said(make_model: Callable[..., Model]) -> None:
    """The press: 19.7 kg on a ring of 0.414 kg."""
    for name in ("punching_press", "punching_press_two_way", "four_bar", "varying_compliance"):
        model = make_model(name)
        said = " ".join(model.explain().limits)
        one_way = name in ("punching_press", "four_bar")
        assert ("is loaded one-way" in said) == one_way
        assert ("--against two-way" in said) == one_way
        assert ("begins and ends at once" in said) == name.startswith("punching_press")
        if name == "punching_press":
            assert "the linkage, 19.7 kg" in said
            assert "48 times as heavy as the ring, 0.414 kg, at 500 rpm" in said
            run = summarize(model, model.simulate(cycles=3))
            assert [words.partition(":")[0] for words in run["limits"]] == ["bearing is loaded one-way", "punch"]


@pytest.mark.long
def test_a_one_way_load_is_not_said_to_matter_where_the_inertia_left_out_is_little(
    scene_text: Callable[..., str], tmp_path: Path
) -> None:
    """A four-bar whose rocker works against a spring: where nothing is said, two-way gives the same peak to 1 %."""
    text = scene_text("four_bar")
    spring = (
        '[mechanism.torsion_springs.work]\nbodies = ["frame", "rocker"]\nstiffness = "20 N*m/rad"\nfree_angle = "0 deg"'
    )
    begin, end = text.index("[mechanism.torques.work]"), text.index("[bearing]")
    file = tmp_path / "spring.toml"
    file.write_text(f"{text[:begin]}{spring}\n{text[end:]}", encoding="utf-8")
    one_way = load(generate(file, tmp_path / "one"))
    two_way = load(generate(read_scene(file, coupling="two-way"), tmp_path / "two"))
    for rpm, words in ((30.0, 0), (1000.0, 0), (4000.0, 1)):
        numbers = {"mechanism.driver.speed": rpm * math.pi / 30.0}
        found = summarize(one_way, one_way.simulate(parameters=numbers))
        assert len(found["limits"]) == words
        peak = two_way.reduce(cycles=4, transient=2, parameters=numbers)["ball.force"].maximum
        if not words:
            assert found["peak_ball_force"]["total"] == pytest.approx(peak, rel=0.01)
    assert "Left out are up to 268 N of inertia; a ball carries up to 2982 N" in found["limits"][0]
