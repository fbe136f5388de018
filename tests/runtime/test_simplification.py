"""Claims about what a simpler model costs: the paper's one-way bearings beside two-way ones of the same scene."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import SceneError, generate, read_scene
from ballpass.derive.scene.bearing_records import EquivalentMass
from ballpass.derive.scene.records import Scene, quantities_of
from ballpass.runtime import Model, RequestError, load
from ballpass.runtime.certify.simplification import measure_simplification
from ballpass.runtime.report.report import ReportTable

SCENES = Path(__file__).resolve().parents[2] / "scenes"
TWO_WAY = SCENES / "punching_press_two_way.toml"
PEAK = "peak_ball_force"


def numbers(scene: Scene) -> dict[str, float]:
    return {quantity.path: quantity.value for quantity in quantities_of(scene)}


def test_the_paper_s_press_coupled_two_way_is_the_shipped_scene() -> None:
    assert numbers(read_scene(SCENES / "punching_press.toml", coupling="two-way")) == numbers(read_scene(TWO_WAY))


def test_the_press_coupled_one_way_is_the_paper_s_but_for_ring_and_crankpin() -> None:
    found, paper = (
        numbers(scene)
        for scene in (read_scene(TWO_WAY, coupling="one-way"), read_scene(SCENES / "punching_press.toml"))
    )
    parts = {f"bearing.inner_ring.equivalent_mass.{name}" for name in ("ring", "crankpin")}
    assert found.keys() == paper.keys()
    assert {name for name, value in found.items() if value != paper[name]} == parts
    assert all(found[name] <= 1e-6 for name in parts)


def test_bearings_elsewhere_become_ideal_joints_one_way() -> None:
    scene = read_scene(SCENES / "punching_press_hinges.toml", coupling="one-way")
    (left,) = scene.bearings
    assert (left.name, left.joint, left.coupling) == ("main", "A", "one-way")
    assert left.inner is not None
    assert isinstance(left.inner.mass, EquivalentMass)


def test_bearings_side_by_side_are_coupled_both_ways_and_share_the_load_one_way(tmp_path: Path) -> None:
    """Two of one joint that differ: 0.3 and 0.7 of the reaction are no numbers of bearings."""

    def beside(name: str, key: str, numbers: tuple[float, float]) -> Path:
        text = (SCENES / f"{name}.toml").read_text(encoding="utf-8")
        start, end = text.index("[bearing]"), text.index("# ---", text.index("[bearing.initial]"))
        first, second = (
            re.sub(f"(?m)^{key} = [0-9.]+", f"{key} = {number}", text[start:end]).replace(
                "[bearing", f"[bearings.{one}"
            )
            for one, number in zip("ab", numbers, strict=True)
        )
        if key == "count":  # its inner ring starts as that of the first
            second = re.sub(r"(?m)^inner(_velocity)? = .*\n", "", second)
        path = tmp_path / f"{name}.toml"
        path.write_text(text[:start] + first + second + text[end:], encoding="utf-8")
        return path

    both = read_scene(beside("punching_press", "share", (0.3, 0.7)), coupling="two-way").bearings
    assert [(b.count.value if b.count else 0, b.beside) for b in both] == [(1.0, ""), (1.0, "a")]
    both = read_scene(beside("punching_press_two_way", "count", (3, 7)), coupling="one-way").bearings
    assert [b.share.value if b.share else 0 for b in both] == [0.1, 0.1]


@pytest.mark.parametrize(
    ("name", "coupling", "words"),
    [
        ("punching_press", "one-way", "no bearing of the scene is coupled otherwise"),
        ("varying_compliance", "two-way", "no bearing of the scene is coupled otherwise"),
        ("andrews", "one-way", "no bearing of the scene is coupled otherwise"),
    ],
)
def test_scenes_without_such_a_variant_are_refused(name: str, coupling: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        read_scene(SCENES / f"{name}.toml", coupling=coupling)  # type: ignore[arg-type]


@pytest.mark.long
def test_changes_are_those_of_single_runs(make_model: Callable[..., Model], tmp_path: Path) -> None:
    """Of members that hardly differ: numbers of `reduce` by another method."""
    model = make_model("punching_press_two_way")
    simpler = load(generate(read_scene(TWO_WAY, coupling="one-way"), tmp_path / "one_way"))
    quantities = [PEAK, "rms:inner.vy"]
    found = measure_simplification(model, simpler, quantities, members=5, spread=1e-9)
    with pytest.raises(RequestError, match=r"bearing\.count: the simpler scene has no such"):
        measure_simplification(model, simpler, [PEAK], parameters={"bearing.count": 3.0}, members=2)
    true, other = (one.reduce(method="stepper-dop853", rtol=1e-9) for one in (model, simpler))
    expected = {
        PEAK: (true["ball.force"].maximum, other["ball.force"].maximum),
        "rms:inner.vy": (true["inner.vy"].rms, other["inner.vy"].rms),
    }
    for name, pair in expected.items():
        assert (found.values[name], found.simpler_values[name]) == pytest.approx(pair, rel=1e-4)
        assert found.change[name] == pytest.approx(pair[1] / pair[0] - 1.0, abs=2e-4)
        assert found.error[name] == pytest.approx(abs(found.change[name]), abs=1e-4)
    assert found.change[PEAK] < -0.1  # the paper's model is too low
    assert ("times as fast" in found.words) == (found.gain >= 1.0)  # which, depends on the machine's other work
    table = found.report().parts[0]
    assert isinstance(table, ReportTable)
    assert np.shape(table.rows) == (2, 6)
    speeds = next(row for row in table.rows if row[0] == "rms:inner.vy")
    assert (speeds[1], float(str(speeds[2]))) == ("mm/s", pytest.approx(1e3 * found.values["rms:inner.vy"], rel=1e-3))
    assert found.meanings["rms:inner.vy"].startswith("Velocity of the centre of the inner ring along y")
    assert found.to_json()["simplification"]["units"] == {PEAK: "N", "rms:inner.vy": "m/s"}
    # life is counted in turns, of a variant whose outputs do not name the ball force as well
    variant = load(generate(read_scene(SCENES / "punching_press.toml", coupling="two-way"), tmp_path / "variant"))
    assert "ball.force" not in variant.outputs
    lives = measure_simplification(variant, simpler, ["life"], members=2, spread=1e-9)
    assert lives.units == {"life": "turns"}
    assert lives.values["life"] == pytest.approx(variant.quantities("life")["life"].value, rel=1e-3)
