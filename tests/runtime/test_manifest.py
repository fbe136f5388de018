"""Claims about the contract's file: it survives a round trip, and each fault is named."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from artefact import manifest as made_manifest

from ballpass.runtime.contract import manifest as mf
from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.contract.folder import check_files, read_manifest, write_manifest


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "model.c").write_text("int x;\n")
    (tmp_path / "model.casadi").write_text("functions\n")
    write_manifest(tmp_path, made_manifest((), tmp_path, {}, True, True))
    return tmp_path


def document(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "manifest.json").read_text())


def test_round_trip_gives_the_same_record_and_the_same_bytes(folder: Path) -> None:
    written = (folder / "manifest.json").read_bytes()
    manifest = read_manifest(folder)
    assert manifest == made_manifest((), folder, {}, True, True)
    write_manifest(folder, manifest)
    assert (folder / "manifest.json").read_bytes() == written
    assert [path.name for path in sorted(folder.iterdir())] == ["manifest.json", "model.c", "model.casadi"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.update(colour="red"), r"unknown keys colour"),
        (lambda d: d.pop("inputs"), r"missing .*'inputs'"),
        (lambda d: d["parameters"][2].update(default="4 kg"), r"parameters\[2\]\.default: .*float.*'4 kg'"),
        (lambda d: d["parameters"][2].update(default=True), r"parameters\[2\]\.default: .*True"),
        (lambda d: d["inputs"][0].update(kind="wave"), r"inputs\[0\]\.kind: .*'gate'.*'wave'"),
        (lambda d: d["inputs"][1].update(windows=[["push.window.start"]]), r"inputs\[1\]\.windows\[0\]: "),
        (lambda d: d.update(mechanism=3), "mechanism: .*3"),
    ],
)
def test_a_fault_of_an_edit_that_is_meant_is_named(folder: Path, change: Any, words: str) -> None:
    content = document(folder)
    change(content)
    with pytest.raises(ArtefactError, match=words):
        mf.Manifest.from_json(json.dumps(content), verify=False)


def test_missing_folder_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(ArtefactError, match="ballpass derive SCENE"):
        read_manifest(tmp_path / "nowhere")


def test_edited_and_missing_files_are_all_named(folder: Path) -> None:
    manifest = read_manifest(folder)
    check_files(folder, manifest)
    (folder / "model.c").write_text("int y;\n")
    (folder / "model.casadi").unlink()
    with pytest.raises(ArtefactError) as caught:
        check_files(folder, manifest)
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
