"""Files that ballpass did not write are neither deleted nor executed."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ballpass.derive import generate
from ballpass.runtime import Model, RequestError, load
from ballpass.runtime.app.cli import app
from ballpass.runtime.ask.kept_parts import KeptParts, kept_parts
from ballpass.runtime.contract.folder import file_digest, read_manifest, write_manifest

ROOT = Path(__file__).resolve().parent.parent.parent
SCENE = ROOT / "scenes" / "rotor.toml"
CLEARANCE = "bearing.clearance=2 um:15 um"

#: Questions that keep parts of what they compute.
KEEPING: dict[str, Callable[[Model, Path], object]] = {
    "optimize": lambda model, keep: model.optimize("rms:inner.y", CLEARANCE, cycles=2, transient=1, keep=keep),
    "sobol": lambda model, keep: model.sobol(CLEARANCE, "rms:inner.y", cycles=2, transient=1, samples=16, keep=keep),
    "morris": lambda model, keep: model.morris(CLEARANCE, "rms:inner.y", cycles=2, transient=1, base=16, keep=keep),
    "bifurcation": lambda model, keep: model.bifurcation("bearing.clearance=5 um:6 um:3", readings=20, keep=keep),
}


def ask(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


@pytest.mark.parametrize("question", KEEPING)
def test_a_folder_with_files_of_others_is_refused_before_anything_is_computed(
    question: str, make_model: Callable[..., Model], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once the whole folder was deleted at the end."""
    model = make_model("rotor")
    monkeypatch.setattr(KeptParts, "once", lambda *_: pytest.fail("something was computed"))
    for name in ("thesis.txt", "0.npz", ".hidden"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_text("mine", encoding="utf-8")
        (folder / "below").mkdir()
        with pytest.raises(RequestError, match="Nothing was changed"):
            KEEPING[question](model, folder)
        assert (folder / name).read_text(encoding="utf-8") == "mine"
        assert (folder / "below").is_dir()
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for place in ("file", "link"):
        with pytest.raises(RequestError, match="Nothing was changed"):
            KEEPING[question](model, tmp_path / place)
    assert (tmp_path / "file").read_text(encoding="utf-8") == "mine"


def test_only_the_parts_of_this_request_are_deleted(make_virtual: Callable[..., Model], tmp_path: Path) -> None:
    """Parts of another request stay, a file that came meanwhile stays, and a link to a folder stays."""
    model, real, link = make_virtual("rotor"), tmp_path / "real", tmp_path / "link"
    real.mkdir()
    link.symlink_to(real)
    KeptParts(link, ("another request",)).once(np.ones(1), lambda: (np.ones(1),))
    (left,) = real.iterdir()
    with kept_parts(link, model, "this") as parts:
        parts.once(np.ones(1), lambda: (np.ones(1),))
        (real / "late.txt").write_text("mine", encoding="utf-8")
    assert sorted(path.name for path in real.iterdir()) == sorted([left.name, "late.txt"])
    assert link.is_symlink()


def test_no_part_that_was_cut_or_changed_is_taken(tmp_path: Path) -> None:
    """Power loss leaves files that are empty, of zeros, or another's; 1000 mutations are all made again."""
    key, random = np.arange(5.0), np.random.default_rng(0)
    parts = KeptParts(tmp_path, ("rtol", 1e-8))
    parts.once(key, lambda: (key,))
    KeptParts(tmp_path, ("rtol", 1e-9)).once(key, lambda: (np.zeros((2, 2)),))
    path = next(path for path in tmp_path.iterdir() if path.name.partition(".")[0] in parts.used)
    (other,) = (one for one in tmp_path.iterdir() if one != path)
    whole = path.read_bytes()
    for trial in range(1000):
        content = bytearray(whole)
        how = random.integers(5)
        if how == 0:
            content = content[: random.integers(len(whole))]
        elif how == 1:
            content = bytearray(len(whole))
        elif how == 2:
            content = bytearray(other.read_bytes())
        else:
            for place in random.integers(len(whole), size=random.integers(1, 5)):
                content[place] ^= 1 + random.integers(255)
        path.write_bytes(bytes(content))
        computed = []
        (found,) = parts.once(key, lambda: computed.append(1) or (key,))  # noqa: B023 (called at once)
        assert found.tolist() == key.tolist()
        assert computed == ([] if bytes(content) == whole else [1]), trial


@pytest.fixture
def planted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path, Callable[[], None]]:
    """A scene, a marker, and what puts a program of somebody else in the place of the scene's folder."""
    monkeypatch.chdir(tmp_path)
    scene, marker = tmp_path / "rotor.toml", tmp_path / "executed"
    scene.write_text(SCENE.read_text(encoding="utf-8"), encoding="utf-8")

    def plant() -> None:
        folder = generate(scene)
        code = folder / "model.c"
        mark = (
            f'#include <stdio.h>\n__attribute__((constructor)) static void m(void) {{fclose(fopen("{marker}","w"));}}\n'
        )
        code.write_text(mark + code.read_text(encoding="utf-8").replace(mark, ""), encoding="utf-8")
        manifest = read_manifest(folder)
        files = tuple((name, file_digest(folder / name)) for name, _ in manifest.files)
        write_manifest(folder, replace(manifest, files=files))

    return scene, marker, plant


COMMANDS = {
    "run": ("--cycles", "2", "--transient", "1", "--no-figures"),
    "explain": (),
    "animate": ("--cycles", "2", "--transient", "1"),
    "export": ("--c",),
    "jacobian": ("--of", "rhs", "--wrt", "states"),
    "life": ("--cycles", "2", "--transient", "1"),
    "linearize": (),
    "sensitivity": ("--of", "mean:inner.y", "--wrt", "bearing.clearance", "--cycles", "2", "--transient", "1"),
    "spectrum": ("--of", "inner.y", "--cycles", "4", "--transient", "1", "--no-figures"),
    "sweep": ("--vary", "bearing.clearance=5 um:6 um:2", "--of", "mean:inner.y", "--cycles", "2", "--transient", "1"),
}


@pytest.mark.skipif(sys.platform != "linux", reason="the constructor is written for GCC and clang on Linux")
@pytest.mark.parametrize(
    "name", [name if name in ("run", "explain") else pytest.param(name, marks=pytest.mark.long) for name in COMMANDS]
)
def test_no_command_executes_a_program_that_lies_in_the_place_of_a_scene(
    name: str, planted: tuple[Path, Path, Callable[[], None]]
) -> None:
    """Its digests are right: they are public formulas."""
    scene, marker, plant = planted
    plant()
    done = ask(name, scene, *COMMANDS[name])
    assert done.exit_code == 0, done.output
    assert "was not written by your ballpass" in done.stderr
    assert not marker.exists()
    if name == "run":  # who names the folder trusts it, and the planted program is one that runs
        plant()
        load(Path("generated") / "rotor")
        assert marker.exists()


def test_ones_own_folder_stays_fresh_where_it_is_copied_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, planted: tuple[Path, Path, Callable[[], None]]
) -> None:
    scene, _, _ = planted
    folder = generate(scene)
    before = (folder / "manifest.json").stat().st_mtime_ns
    assert generate(scene).joinpath("manifest.json").stat().st_mtime_ns == before
    there = tmp_path / "elsewhere"
    there.mkdir()
    (tmp_path / "generated").rename(there / "generated")
    monkeypatch.chdir(there)
    assert generate(scene).joinpath("manifest.json").stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("words", "taken"),
    [
        (("run", "--cycles", "2", "--transient", "1"), "summary.json"),
        (("sensitivity", "--of", "mean:inner.y", "--wrt", "bearing.clearance", "--cycles", "2"), "sensitivity.json"),
        (("sweep", "--vary", "bearing.clearance=5 um:6 um:2", "--of", "mean:inner.y", "--cycles", "2"), "sweep.csv"),
        (("morris", "--vary", CLEARANCE, "--of", "mean:inner.y", "--cycles", "2"), "morris.parts"),
        (("export", "--c"), "README.md"),
    ],
)
def test_what_stands_in_the_place_of_results_is_still_there(
    words: tuple[str, ...], taken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder with files in the place of a file, and a user's file in that of a folder or program: refused, kept."""
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    mine = {"thesis.txt": "mine", "notes/a.txt": "mine"}
    mine |= {taken: "mine"} if taken == "README.md" else {f"{taken}/deep.txt": "mine"}
    for name, text in mine.items():
        (out / name).parent.mkdir(exist_ok=True)
        (out / name).write_text(text, encoding="utf-8")
    done = ask(words[0], SCENE, *words[1:], "--out", out)
    assert done.exit_code == 2, done.output
    assert {name: (out / name).read_text(encoding="utf-8") for name in mine} == mine


def test_a_users_files_in_a_folder_of_results_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    for name in ("thesis.txt", "orbit.png", "sweep_mine.png"):
        (out / name).write_text("mine", encoding="utf-8")
    length = ("--cycles", "2", "--transient", "1", "--no-figures", "--out", out)
    assert ask("run", SCENE, *length).exit_code == 0
    vary = ("--vary", "bearing.clearance=5 um:6 um:2", "--of", "mean:inner.y")
    assert ask("sweep", SCENE, *vary, *length).exit_code == 0
    assert all((out / name).read_text(encoding="utf-8") == "mine" for name in ("thesis.txt", "sweep_mine.png"))
    assert (out / "orbit.png").read_text(encoding="utf-8") == "mine"
    assert json.loads((out / "summary.json").read_text(encoding="utf-8"))
