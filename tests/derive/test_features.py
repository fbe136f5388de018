"""A scene pays only for what it names: operations and bytes of scenes with and without a feature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from ballpass.derive import generate, read_scene
from ballpass.derive.features import cost, count_operations, features
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.records import Scene

ROOT = Path(__file__).resolve().parents[2]
SCENES = ("punching_press", "punching_press_tangent", "offset_slider", "four_bar", "crank_shaper", "varying_compliance")
MODEL = ("model.c", "model.h", "kernels.h", "tangents.h", "ensemble_kernels.h", "model.casadi")


def press(scene_text: Callable[..., str], *changes: tuple[str, str]) -> Scene:
    return scene_from_text(scene_text("punching_press", *changes), "punching_press")


def test_every_feature_adds_operations_where_it_acts_and_none_where_it_does_not() -> None:
    scene = read_scene(ROOT / "scenes/punching_press.toml")
    counted = cost(scene)
    assert counted.functions == count_operations(scene)
    for feature, added in counted.added.items():
        if feature != "load":  # a constant load is a number: it costs nothing
            assert added["rhs"] > 0, feature
        if feature in ("contact damping",):
            assert added["kernel.ball.forces"] > 0
            assert added["kernel.stage"] == 0
        if feature == "mechanism" or feature.startswith(("force", "torque", "gravity")):
            # loads depend on time only: the contact law of a ball, called for each ball, is not touched
            assert added["kernel.ball.forces"] == added["kernel.ball.slopes"] == 0
            assert added["kernel.stage"] > 0


@pytest.mark.long
def test_parts_are_counted_whose_outputs_nobody_could_ask_for_without_them(scene_text: Callable[..., str]) -> None:
    """Outputs on request of linkage, gravity and damping, and a pattern of two parts."""
    outputs = ("point.slider.C.ay", "weight.power", "contact.loss", "*.power")
    scene = replace(press(scene_text), outputs=outputs)
    added = cost(scene).added
    (gravity,) = (f.without for f in features(press(scene_text)) if f.name == "gravity")
    assert gravity is not None
    counts = [count_operations(one)["rhs"] for one in (press(scene_text), gravity)]
    assert added["gravity"]["rhs"] == counts[0] - counts[1] > 0
    alone = cost(replace(scene, outputs=("point.slider.C.ay",))).added["mechanism"]
    assert alone["rhs"] == added["mechanism"]["rhs"] > 0


@pytest.mark.long
@pytest.mark.parametrize("name", ["punching_press_motor", "punching_press_two_way"])
def test_what_is_left_of_a_machine_without_one_of_its_parts_is_a_scene(name: str) -> None:
    """Without its coupling that of a motor had no equations, and explain ended in an error of Python."""
    scene = read_scene(ROOT / f"scenes/{name}.toml")
    added = cost(scene).added
    assert ("coupling" in added) is (name == "punching_press_two_way")


def test_a_ball_more_costs_nothing_in_the_steppers_text() -> None:
    scene = read_scene(ROOT / "scenes/punching_press.toml")
    (bearing,) = scene.bearings
    few, many = (
        {
            k: v
            for k, v in count_operations(replace(scene, bearings=(replace(bearing, balls=z),))).items()
            if k.startswith("kernel")
        }
        for z in (9, 41)
    )
    assert few == many


@pytest.mark.long
def test_features_of_one_scene_change_no_byte_of_another(tmp_path: Path) -> None:
    """Nothing is remembered from scene to scene: a plain scene generated behind a rich one is the same plain scene."""
    plain, rich = ROOT / "scenes/varying_compliance.toml", ROOT / "scenes/offset_slider.toml"
    first = generate(plain, tmp_path / "first")
    generate(rich, tmp_path / "rich")
    second = generate(plain, tmp_path / "second")
    for path in sorted(first.iterdir()):
        assert path.read_bytes() == (second / path.name).read_bytes(), path.name


def test_unrequested_outputs_vanish(tmp_path: Path) -> None:
    """From the step altogether (no output is in it), and from the outputs' function."""
    scene = read_scene(ROOT / "scenes/punching_press.toml")
    bare = replace(scene, outputs=("inner.x",))
    assert count_operations(bare)["outputs"] == 0
    many, few = generate(scene, tmp_path / "many"), generate(bare, tmp_path / "few")
    for name in ("kernels.h", "tangents.h"):
        assert (many / name).read_bytes() == (few / name).read_bytes(), name
    assert (few / "model.c").stat().st_size < (many / "model.c").stat().st_size


def test_a_moment_nobody_asked_for_is_not_solved_for() -> None:
    """The guide's moment is one unknown of Eq. (1) more; it is there where an output names it."""
    scene = replace(read_scene(ROOT / "scenes/offset_slider.toml"), outputs=("inner.*",))
    asked = replace(scene, outputs=("inner.*", "reaction.D.moment"))
    assert count_operations(asked)["reaction_system"] > count_operations(scene)["reaction_system"]
    assert count_operations(asked)["rhs"] == count_operations(scene)["rhs"]


#: Operations of the right-hand side, of one ball's force and its share of the sums in the step, and of what depends on
#: time only in it.  They grow when someone makes a scene pay for a feature that it does not name, and shrink when a
#: derivation gets leaner: then this table follows.
PLAIN = {
    "punching_press": (360, 18, 109),
    "punching_press_tangent": (371, 18, 109),
    "offset_slider": (379, 18, 116),
    "four_bar": (406, 18, 142),
    "crank_shaper": (368, 18, 105),
    "varying_compliance": (149, 12, 4),
}


@pytest.mark.parametrize("name", SCENES)
def test_shipped_scenes_cost_what_they_cost(name: str) -> None:
    counts = count_operations(read_scene(ROOT / "scenes" / f"{name}.toml"))
    assert (counts["rhs"], counts["kernel.ball.forces"], counts["kernel.stage"]) == PLAIN[name]


CONTACT = ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n')
RATE = ('ratio = "0.25e-5 s*mm^0.5"\n', 'ratio = "0.25e-5 s*mm^0.5"\nsmoothing = "1 mm/s"\n')
GRAVITY = "[mechanism]\n"


@pytest.mark.long
@pytest.mark.parametrize(
    ("path", "change", "others"),
    [
        ("bearing.contact.smoothing", CONTACT, ()),
        ("bearing.damping.smoothing", RATE, (CONTACT,)),
        ("mechanism.gravity", (GRAVITY, f'{GRAVITY}gravity = "9.81 m/s^2"\n'), ()),
    ],
)
def test_a_line_left_out_costs_what_a_scene_costs_that_never_had_it(
    scene_text: Callable[..., str], path: str, change: tuple[str, str], others: tuple[tuple[str, str], ...]
) -> None:
    """Variants that `features` makes in memory; tests/conformance says the same of all parts with a registry."""
    line = next(line for line in scene_text("punching_press").splitlines() if line.startswith("gravity"))
    plain = press(scene_text, (f"{line}\n", ""), *others)
    given = {f.path: f for f in features(press(scene_text, (f"{line}\n", ""), *others, change))}
    without = given[path].without
    assert without is not None
    assert count_operations(without) == count_operations(plain)
    assert path not in {f.path for f in features(without)}
