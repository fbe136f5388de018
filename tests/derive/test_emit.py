"""The generated folder: same bytes on every run, stale when the structure changes, untouched when a number does."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ballpass.derive import SceneError, check, generate
from ballpass.derive.emit.signature import signature
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime.contract.folder import read_manifest

ROOT = Path(__file__).resolve().parents[2]


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir())}


def test_committed_artefact_is_reproduced_byte_for_byte() -> None:
    assert check(ROOT / "scenes/punching_press.toml", ROOT / "generated/punching_press").stale == ()


@pytest.mark.parametrize(
    "name", ["punching_press", *(pytest.param(n, marks=pytest.mark.long) for n in ("crank_shaper", "andrews"))]
)
def test_same_bytes_in_another_process_with_another_hash_seed(name: str, tmp_path: Path) -> None:
    scene = ROOT / "scenes" / f"{name}.toml"
    generate(scene, tmp_path / "here")
    code = f"from ballpass.derive import generate; generate({str(scene)!r}, {str(tmp_path / 'there')!r})"
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "PYTHONHASHSEED": "4711"})
    assert contents(tmp_path / "here") == contents(tmp_path / "there")


def test_a_changed_number_rewrites_the_manifests_defaults_and_nothing_else(
    tmp_path: Path, scene_text: Callable[..., str]
) -> None:
    """Law 1: structure is compiled, numbers are parameters."""
    folder = tmp_path / "punching_press"
    generate(scene_from_text(scene_text("punching_press"), "punching_press"), folder)
    before = contents(folder)
    times = {p.name: p.stat().st_mtime_ns for p in folder.iterdir()}
    changes = (
        ('clearance = "10 um"', 'clearance = "20 um"'),
        ('mass = "2.55 kg"', 'mass = "3 kg"'),
        ('B = "6 mm"', 'B = "7 mm"'),
        ('speed = "500 rpm"', 'speed = "600 rpm"'),
        ('start = "237 deg"', 'start = "200 deg"'),
    )
    changed = scene_from_text(scene_text("punching_press", *changes), "punching_press")
    stages: list[str] = []
    generate(changed, folder, progress=stages.append)
    assert stages == []
    after = contents(folder)
    assert {n for n in before if before[n] != after[n]} == {"manifest.json"}
    assert all(times[n] == (folder / n).stat().st_mtime_ns for n in before if n != "manifest.json")
    defaults = {p.name: p.default for p in read_manifest(folder).parameters}
    assert defaults["bearing.clearance"] == pytest.approx(2e-5)
    # a fresh derivation of the changed scene writes the same folder
    generate(changed, tmp_path / "fresh")
    assert contents(tmp_path / "fresh") == after


@pytest.mark.parametrize(
    "change",
    [
        ("balls = 8", "balls = 9"),
        ('law = "one-sided"', 'law = "one-sided-gated"'),
        ('crank = "whole"', 'crank = "half"'),
        ('branch = "ahead"', 'branch = "behind"'),
        ('center_of_mass = "50 mm"', 'center_of_mass = ["50 mm", "0 mm"]'),
    ],
)
def test_a_changed_structure_changes_the_signature(scene_text: Callable[..., str], change: tuple[str, str]) -> None:
    plain = scene_from_text(scene_text("punching_press"), "punching_press")
    changed = scene_from_text(scene_text("punching_press", change), "punching_press")
    assert signature(plain) != signature(changed)


def test_other_deriving_sources_derive_anew_and_change_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A comment in derive makes every folder stale, and branches that each have one write one manifest."""
    scene, derived = ROOT / "scenes/varying_compliance.toml", []
    folder = generate(scene, tmp_path / "vc")
    before = (folder / "manifest.json").read_bytes()
    monkeypatch.setattr("ballpass.derive.emit.signature.deriving_sources", lambda: "others")
    monkeypatch.setattr("ballpass.derive.emit.generate.deriving_sources", lambda: "others")
    generate(scene, folder, progress=derived.append)
    assert "derive" in derived
    assert (folder / "manifest.json").read_bytes() == before


def test_an_edited_or_missing_file_is_derived_again(tmp_path: Path) -> None:
    scene = ROOT / "scenes/varying_compliance.toml"
    folder = generate(scene, tmp_path / "vc")
    whole = contents(folder)
    (folder / "model.c").write_text("/* edited */\n")
    assert check(scene, folder).stale == ("model.c",)
    generate(scene, folder)
    assert contents(folder) == whole
    (folder / "model.casadi").unlink()
    generate(scene, folder)
    assert contents(folder) == whole
    (folder / "stray.txt").write_text("left behind")
    assert check(scene, folder).stale == ("stray.txt",)


def test_a_wrong_number_leaves_the_folder_alone(tmp_path: Path, scene_text: Callable[..., str]) -> None:
    """A crank longer than its rod cannot turn: refused, and the folder of the sound scene stays as it was."""
    folder = tmp_path / "punching_press"
    generate(scene_from_text(scene_text("punching_press"), "punching_press"), folder)
    before = contents(folder)
    locked = scene_from_text(scene_text("punching_press", ('B = "6 mm"', 'B = "101 mm"')), "punching_press")
    with pytest.raises(SceneError, match="C"):
        generate(locked, folder)
    assert contents(folder) == before
    with pytest.raises(SceneError, match="C"):
        generate(locked, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_manifest_tells_where_each_applied_force_acts(tmp_path: Path, scene_text: Callable[..., str]) -> None:
    window = 'window = { start = "237 deg", end = "267 deg" }'
    always = '\n[mechanism.forces.pull]\nbody = "rod"\npoint = "B"\nforce = ["1 N", "2 N"]\n'
    text = scene_text("punching_press", (window, window + always))
    manifest = read_manifest(generate(scene_from_text(text, "press"), tmp_path / "press"))
    assert manifest.mechanism is not None
    assert manifest.mechanism.forces == (("punch", "slider", "C", "gate.punch"), ("pull", "rod", "B", ""))


def test_manifest_prices_every_function(tmp_path: Path) -> None:
    manifest = read_manifest(generate(ROOT / "scenes/punching_press.toml", tmp_path / "press"))
    prices = {f.name: f.operations for f in manifest.functions}
    assert {"constants", "rhs", "rhs_jac_x", "outputs", "contact", "reaction_system"} <= prices.keys()
    assert prices.pop("mass_matrix") == 0  # of the rings alone: constants
    assert all(price > 0 for price in prices.values())
