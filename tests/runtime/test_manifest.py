"""Claims about the contract's file: it survives a round trip, and each fault is named."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from artefact import manifest as made_manifest

from ballpass.runtime import contract as mf
from ballpass.runtime.contract.errors import ArtefactError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "model.c").write_text("int x;\n")
    (tmp_path / "model.casadi").write_text("functions\n")
    mf.write(tmp_path, made_manifest((), tmp_path, {}, True, True))
    return tmp_path


def document(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "manifest.json").read_text())


def test_round_trip_gives_the_same_record_and_the_same_bytes(folder: Path) -> None:
    written = (folder / "manifest.json").read_bytes()
    manifest = mf.read_manifest(folder)
    assert manifest == made_manifest((), folder, {}, True, True)
    mf.write(folder, manifest)
    assert (folder / "manifest.json").read_bytes() == written
    assert [path.name for path in sorted(folder.iterdir())] == ["manifest.json", "model.c", "model.casadi"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.update(schema=99), ["schema 99", "reads schema 3", "ballpass derive"]),
        (lambda d: d.pop("schema"), ["schema None"]),
        (lambda d: d.update(colour="red"), ["colour: unknown key"]),
        (lambda d: d.pop("inputs"), ["inputs: missing"]),
        (lambda d: d["parameters"][2].update(default="4 kg"), ["parameters[2].default", "finite number", "text"]),
        (lambda d: d["parameters"][2].update(default=True), ["parameters[2].default", "true/false"]),
        (lambda d: d["inputs"][0].update(kind="wave"), ["inputs[0].kind", "'gate'", "'wave'"]),
        (lambda d: d["inputs"][1].update(windows=[["push.window.start"]]), ["windows[0]: 2 entries"]),
        (lambda d: d["inputs"][1].update(rate="driver.sped"), ["inputs[gate.push].rate", "'driver.sped'"]),
        (lambda d: d["outputs"].append(d["outputs"][0]), ["outputs: the name 'body.x' occurs 2 times"]),
        (lambda d: d.update(initial=["initial.x"]), ["initial: 2 names"]),
        (lambda d: d["run"].update(duration=1.0), ["exactly one of cycles and duration"]),
        (lambda d: d.update(mechanism=3), ["mechanism: an object", "number 3"]),
        (lambda d: d["mechanism"]["forces"][0].pop(), ["mechanism.forces[0]: 4 entries"]),
        (
            lambda d: d["mechanism"]["forces"][0].__setitem__(2, "Q"),
            ["mechanism.forces[push]: 'Q' of 'pin' is no point"],
        ),
        (lambda d: d["mechanism"]["forces"][0].__setitem__(3, "gate.pull"), ["'gate.pull' is no gate"]),
        (
            lambda d: d["mechanism"]["forces"][0].__setitem__(0, "pull"),
            ["mechanism.forces.pull.force.x and", "missing"],
        ),
    ],
)
def test_each_fault_is_named(folder: Path, change: Any, words: list[str]) -> None:
    content = document(folder)
    change(content)
    (folder / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(ArtefactError) as caught:
        mf.read_manifest(folder)
    for word in words:
        assert word in str(caught.value)


def test_all_faults_are_reported_together(folder: Path) -> None:
    content = document(folder)
    content["title"] = 3
    content["run"]["rtol"] = None
    content["extra"] = 1
    with pytest.raises(ArtefactError, match="3 fault") as caught:
        mf.Manifest.from_json(json.dumps(content))
    assert all(word in str(caught.value) for word in ("title", "run.rtol", "extra"))


@pytest.mark.parametrize("text", ["", "{", "[]", "3", '{"schema": NaN}'])
def test_texts_that_are_no_manifest_are_refused(text: str) -> None:
    with pytest.raises(ArtefactError):
        mf.Manifest.from_json(text)


def test_not_finite_numbers_are_refused(folder: Path) -> None:
    text = (folder / "manifest.json").read_text().replace('"default": 4.0', '"default": NaN')
    with pytest.raises(ArtefactError, match=r"parameters\[2\]\.default: a finite number"):
        mf.Manifest.from_json(text)


def test_missing_folder_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(ArtefactError, match="ballpass derive SCENE"):
        mf.read_manifest(tmp_path / "nowhere")


def test_edited_and_missing_files_are_all_named(folder: Path) -> None:
    manifest = mf.read_manifest(folder)
    mf.check_files(folder, manifest)
    (folder / "model.c").write_text("int y;\n")
    (folder / "model.casadi").unlink()
    with pytest.raises(ArtefactError) as caught:
        mf.check_files(folder, manifest)
    assert "model.c: sha256" in str(caught.value)
    assert "model.casadi: missing" in str(caught.value)


def test_importing_the_manifest_or_the_runtime_loads_nothing_heavy() -> None:
    code = (
        "import sys, ballpass.runtime.contract; "
        "heavy = {'casadi', 'numpy', 'xarray'} & set(sys.modules); assert not heavy, heavy; "
        "from ballpass.runtime import load, Solution; "
        "wrong = {'sympy', 'pint', 'ballpass.derive'} & set(sys.modules); assert not wrong, wrong"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
