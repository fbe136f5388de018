"""``ballpass select``: each row is what `life` says of the scene with that bearing."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.app.cli import app

SCENES = Path(__file__).parents[2] / "scenes"


def asked(*words: str) -> dict[str, dict[str, float]]:
    done = CliRunner().invoke(app, ["select", *words, "--json"])
    assert done.exit_code == 0, done.stderr
    return {one["designation"]: one for one in json.loads(done.stdout)["candidates"]}


@pytest.mark.long
def test_a_candidate_is_the_scene_with_its_bearing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """6004 and 6204 in the place of the rotor's bearing, against files that were edited by hand."""
    monkeypatch.chdir(tmp_path)
    scene = SCENES / "rotor.toml"
    length = ("--cycles", "4", "--transient", "2")
    found = asked(str(scene), "--designation", "6204,6004", "--life", "1e4 h", "--of", "rms:inner.y", *length)
    assert list(found) == ["6004", "6204"]  # by bore, then by room
    text = scene.read_text(encoding="utf-8")
    for name, row in found.items():
        (tmp_path / "by_hand.toml").write_text(text.replace('designation = "6204"', f'designation = "{name}"'))
        model = load(generate(tmp_path / "by_hand.toml", tmp_path / name))
        (bearing,) = model.life(4, transient=2).bearings
        assert bearing.life is not None
        assert row["hours"] == pytest.approx(bearing.hours(bearing.life), rel=1e-12)
        assert row["static_safety"] == pytest.approx(bearing.static_safety, rel=1e-12)
        assert row["peak_force"] == pytest.approx(bearing.peak_force, rel=1e-12)
        rms = model.quantities("rms:inner.y", 4, transient=2)["rms:inner.y"].value
        assert row["of"]["rms:inner.y"] == pytest.approx(rms, rel=1e-12)
        short, weak = row["hours"] < 1e4, row["static_safety"] < 1.0
        assert (("life:" in row["lacks"]), ("s_0:" in row["lacks"])) == (short, weak)


@pytest.mark.long
def test_axial_force_and_states_at_rest_count(tmp_path: Path) -> None:
    """The life with the axial force, over a cycle in which the rotor rests for half of the time."""
    text = (SCENES / "rotor.toml").read_text(encoding="utf-8")
    text = text.replace('designation = "6204"', 'designation = "6204"\naxial_force = "500 N"')
    text += '[duty.turning]\nshare = 0.5\n[duty.resting]\nshare = 0.5\nset.shaft.speed = "0 rpm"\n'
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    row = asked(str(tmp_path / "scene.toml"), "--designation", "6204", "--cycles", "4", "--transient", "2")["6204"]
    report = load(generate(tmp_path / "scene.toml", tmp_path / "model")).life(4, transient=2)
    (bearing,) = report.states[0].bearings
    assert bearing.combined is not None
    assert bearing.life is not None
    assert bearing.combined.life is not None
    assert row["hours"] == pytest.approx(2.0 * bearing.hours(bearing.combined.life), rel=1e-12)
    assert row["hours"] < 0.1 * 2.0 * bearing.hours(bearing.life)
    assert row["peak_force"] == pytest.approx(bearing.combined.peak_force, rel=1e-12)


@pytest.mark.parametrize(
    ("words", "allowed"),
    [
        (("--set", "bearing.clearance=5 um"), "no designation gives"),
        (("--designation", "9999"), "ballpass bearings"),
        (("--bore", "1 mm:2 mm"), "ballpass bearings"),
        (("--bore", "20 kg"), "--bore"),
        (("--bearing", "left"), "no such bearing"),
    ],
)
def test_what_no_table_has_is_refused(words: tuple[str, str], allowed: str) -> None:
    done = CliRunner().invoke(app, ["select", str(SCENES / "rotor.toml"), *words])
    assert done.exit_code == 2
    assert allowed in " ".join(done.stderr.split())


@pytest.mark.long
def test_a_life_is_refused_at_the_first_bearing_where_nothing_turns(tmp_path: Path) -> None:
    """All bearings of the tables were run before it said so.  Static safety is found without a life."""
    text = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^speed = .*", 'speed = "0 rpm"', text)
    text = re.sub(r"(?m)^cycles = .*\ntransient_cycles = .*", 'duration = "1 ms"', text)
    (tmp_path / "still.toml").write_text(text, encoding="utf-8")
    done = CliRunner().invoke(app, ["select", str(tmp_path / "still.toml"), "--life", "1 h"])
    assert done.exit_code == 2
    assert "The bearing does not turn. Allowed: a bearing that turns, or static safety without --life" in done.stderr
    row = asked(str(tmp_path / "still.toml"), "--designation", "6204")["6204"]
    assert row["static_safety"] > 1.0


def test_a_sweep_over_designations_names_the_question_that_does_it() -> None:
    done = CliRunner().invoke(app, ["sweep", str(SCENES / "rotor.toml"), "--vary", "bearing.designation=6204,6205"])
    assert done.exit_code == 2
    assert "select --designation 6204,6205" in " ".join(done.stderr.split())
