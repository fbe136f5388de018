"""Claims about files that are not what was written: each is said, none is used, none ends the process."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from profiles import LONG
from typer.testing import CliRunner

from ballpass.derive import check, generate
from ballpass.derive.emit.generate import GENERATED
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import CacheWarning, CompileError, RequestError, load, load_solution
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.contract.folder import read_manifest
from ballpass.runtime.contract.manifest import DIGEST, FILE_NAME, digest_of
from ballpass.runtime.native import compile as compiling

SOURCE = "double twice(double x) { return 2.0 * x; }\n"
SCENES = Path(__file__).resolve().parents[2] / "scenes"


def torn(content: bytes, random: random.Random) -> bytes:
    """The content cut short, with changed bits, with a piece missing, or with foreign bytes in it."""
    place = random.randrange(len(content))
    kind = random.randrange(4)
    if kind == 0:
        return content[:place]
    if kind == 1:
        return content[:place] + bytes([content[place] ^ 1 << random.randrange(8)]) + content[place + 1 :]
    if kind == 2:
        return content[:place] + content[place + random.randrange(1, 40) :]
    return content[:place] + random.randbytes(random.randrange(1, 9)) + content[place:]


# ------------------------------------------------------------------------------------------------- the generated folder


def means_the_same(content: bytes, whole: bytes) -> bool:
    try:
        return bool(json.loads(content) == json.loads(whole))
    except (ValueError, RecursionError):
        return False


@pytest.mark.parametrize("name", ["model.c", "kernels.h", "model.casadi", "EQUATIONS.md", "manifest.json"])
def test_an_edited_file_of_an_artefact_is_named_and_refused(rotor: Path, name: str) -> None:
    whole, draw, original = (rotor / name).read_bytes(), random.Random(name), load(rotor).manifest
    for _ in range(200 if LONG else 12):
        content = torn(whole, draw)
        if content == whole:
            continue
        (rotor / name).write_bytes(content)
        if name == "manifest.json" and means_the_same(content, whole):  # a space more: every number is as it was
            assert load(rotor).manifest == original
            continue
        with pytest.raises(ArtefactError) as caught:
            load(rotor)
        assert name in str(caught.value)
        assert "ballpass derive" in str(caught.value)
        assert (rotor / name).read_bytes() == content
    (rotor / name).write_bytes(whole)
    load(rotor)


def test_a_default_changed_by_hand_is_told_and_taken_only_where_it_is_meant(rotor: Path) -> None:
    """The manifest has no digest of another file to stand against: it carries its own."""
    document = json.loads((rotor / "manifest.json").read_text(encoding="utf-8"))
    clearance = next(item for item in document["parameters"] if item["name"] == "bearing.clearance")
    clearance["default"] = 5e-6
    (rotor / "manifest.json").write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    with pytest.raises(ArtefactError, match=r"manifest\.json: the digest in it, .* edited or cut short.*verify=False"):
        load(rotor)
    assert load(rotor, verify=False).parameters["bearing.clearance"] == 5e-6


def test_an_edit_of_the_code_is_taken_where_it_is_meant(rotor: Path) -> None:
    with (rotor / "model.c").open("a", encoding="utf-8") as stream:
        stream.write("/* a remark */\n")
    with pytest.raises(ArtefactError, match=r"model\.c: sha256 .* expected: edited or cut short"):
        load(rotor)
    assert load(rotor, verify=False).simulate(cycles=0.1).status.name == "DONE"


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("schema", 99, "schema 99 was given, this version of ballpass reads schema"),
        ("schema", "2", "this version of ballpass reads schema"),
        ("versions", [["casadi", "3.7.1"]], r"written with CasADi 3\.7\.1, while 3\.\d+\.\d+ is installed"),
        ("versions", [], "written with CasADi none, while"),
    ],
)
def test_a_manifest_of_something_else_is_refused_with_a_remedy(
    rotor: Path, key: str, value: object, words: str
) -> None:
    """The digest is right: another version wrote it."""
    from ballpass.runtime.contract.manifest import DIGEST, digest_of

    document = json.loads((rotor / "manifest.json").read_text(encoding="utf-8"))
    del document[DIGEST]
    document[key] = value
    document[DIGEST] = digest_of(document)
    (rotor / "manifest.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ArtefactError, match=words) as caught:
        load(rotor)
    assert "ballpass derive" in str(caught.value)


@pytest.mark.parametrize(
    "text", ["", "{", "null", "[" * 100_000, '{"schema": ' + "9" * 5000 + "}", '{"a": ' * 5000, "\ud800", "\0"]
)
def test_texts_that_are_no_manifest_are_refused(rotor: Path, text: str) -> None:
    (rotor / "manifest.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(ArtefactError, match=r"manifest\.json"):
        load(rotor)


@pytest.mark.parametrize(
    "change",
    [
        {"title": "press\x1b]0;owned\x07"},
        {"scene": "../../outside"},
        {"files": [["../outside.c", "0" * 64]]},
        {"files": [["..\\outside.c", "0" * 64]]},
    ],
    ids=str,
)
def test_a_manifest_with_escape_sequences_or_paths_is_refused(rotor: Path, change: dict[str, Any]) -> None:
    """Also where its digest is right: whoever writes a folder can compute it."""
    path = rotor / FILE_NAME
    document = json.loads(path.read_text(encoding="utf-8")) | change
    document.pop(DIGEST)
    document[DIGEST] = digest_of(document)
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ArtefactError, match="load only folders you trust") as caught:
        load(rotor)
    assert str(caught.value).isprintable()


def test_a_manifest_that_is_a_folder_or_a_path_that_is_none_is_refused(rotor: Path) -> None:
    (rotor / "manifest.json").unlink()
    (rotor / "manifest.json").mkdir()
    with pytest.raises(ArtefactError, match="cannot be read"):
        load(rotor)
    with pytest.raises(RequestError, match=r"folder: a path is expected, not 'a\\x00b'"):
        load("a\0b")


def test_a_torn_artefact_is_derived_anew_by_the_command(
    rotor: Path, tmp_path: Path, kept: Callable[[Path], dict[str, bytes]]
) -> None:
    whole = kept(rotor)
    scene = scene_from_text((SCENES / "varying_compliance.toml").read_text(encoding="utf-8"), "rotor")
    for name in ("manifest.json", "kernels.h"):
        (rotor / name).write_bytes(whole[name][:100])
        assert generate(scene, rotor) == rotor
        assert kept(rotor) == whole
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rotor"]


def test_functions_cut_short_are_an_error_and_no_crash(rotor: Path) -> None:
    """CasADi's reader of serialised functions is not made for torn files: it runs only on files that were verified."""
    stored = (rotor / "model.casadi").read_bytes()
    (rotor / "model.casadi").write_bytes(stored[: len(stored) // 2])
    code = (
        "import sys; from ballpass.runtime import load; from ballpass.runtime.contract.errors import ArtefactError\n"
        "try: load(sys.argv[1], verify=False).symbolic('outputs')\n"
        "except ArtefactError as fault: print(fault); sys.exit(2)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(rotor)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 2, done.stderr
    assert "model.casadi: no functions can be read from it. Write the folder again" in done.stdout


# -------------------------------------------------------------------------------------------- a folder with other files


def test_deriving_into_a_folder_with_other_files_deletes_nothing(
    tmp_path: Path, kept: Callable[[Path], dict[str, bytes]]
) -> None:
    """Once, `ballpass derive SCENE --out .` emptied the folder it was called in."""
    home = tmp_path / "home"
    (home / "photos").mkdir(parents=True)
    (home / "photos" / "one.jpg").write_bytes(b"precious")
    (home / "thesis.tex").write_text("precious", encoding="utf-8")
    before = kept(home)
    result = CliRunner().invoke(app, ["derive", str(SCENES / "varying_compliance.toml"), "--out", str(home)])
    assert result.exit_code == 2
    assert "holds other files (photos, thesis.tex), and none written by ballpass derive" in result.stderr
    assert "Allowed: a folder that is empty, new, or was written by ballpass derive" in result.stderr
    assert kept(home) == before


def test_files_of_others_in_a_generated_folder_stay(rotor: Path, kept: Callable[[Path], dict[str, bytes]]) -> None:
    whole = kept(rotor)
    (rotor / "notes").mkdir()
    (rotor / "notes" / "mine.txt").write_text("mine", encoding="utf-8")
    (rotor / "todo").write_text("mine", encoding="utf-8")
    (rotor / "model.c").write_text("torn", encoding="utf-8")
    scene = scene_from_text((SCENES / "varying_compliance.toml").read_text(encoding="utf-8"), "rotor")
    generate(scene, rotor)
    assert kept(rotor) == {**whole, "notes/mine.txt": b"mine", "todo": b"mine"}
    assert check(scene, rotor).stale == ("todo",)


def test_a_link_to_a_folder_and_the_permissions_of_a_folder_stay(rotor: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(rotor)
    rotor.chmod(0o750)
    (rotor / "model.c").write_text("torn", encoding="utf-8")
    generate(scene_from_text((SCENES / "varying_compliance.toml").read_text(encoding="utf-8"), "rotor"), link)
    assert link.is_symlink()
    assert rotor.stat().st_mode & 0o777 == 0o750
    load(rotor)


def test_a_file_in_the_way_of_a_generated_folder_is_refused_and_stays(tmp_path: Path) -> None:
    target = tmp_path / "notes.txt"
    target.write_text("mine", encoding="utf-8")
    result = CliRunner().invoke(app, ["derive", str(SCENES / "varying_compliance.toml"), "--out", str(target)])
    assert result.exit_code == 2
    assert "it is no folder" in result.stderr
    assert target.read_text(encoding="utf-8") == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_every_file_that_a_derivation_writes_is_known_to_it(rotor: Path) -> None:
    written = {path.name for path in rotor.glob("[!.]*")}
    assert written <= set(GENERATED)
    assert {name for name, _ in read_manifest(rotor).files} == written - {"manifest.json"}


# ------------------------------------------------------------------------------------------------------------ the cache


def compiled(folder: Path) -> compiling.CompiledLibrary:
    compiler = compiling.find_compiler()
    assert compiler is not None
    source = folder / "twice.c"
    source.write_text(SOURCE, encoding="utf-8")
    return compiling.compile_sources((source,), compiler)


DAMAGE: dict[str, Callable[[Path], object]] = {
    "cut in half": lambda path: os.truncate(path, path.stat().st_size // 2),
    "cut within a page": lambda path: os.truncate(path, path.stat().st_size - 100),
    "no bytes": lambda path: os.truncate(path, 0),
    "text": lambda path: path.write_text("this is no library", encoding="utf-8"),
    "zeros": lambda path: path.write_bytes(b"\0" * path.stat().st_size),
    "one bit": lambda path: path.write_bytes(path.read_bytes()[:-9] + b"X" + path.read_bytes()[-8:]),
    "unreadable link": lambda path: (path.unlink(), path.symlink_to(path.name)),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_library_is_said_and_compiled_anew(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    """Mapping a library that was cut short ends the process: its bytes are compared with its name before."""
    first = compiled(tmp_path)
    moved = cache.parent / "other"  # another place and other files: this process has the first one mapped until its end
    shutil.copytree(cache, moved)
    shutil.rmtree(cache)
    monkeypatch.setenv(compiling.CACHE_VARIABLE, str(moved))
    path = moved / first.path.name
    DAMAGE[damage](path)
    if damage == "a folder":
        # nothing of anybody is deleted; with a folder in the way there is no place for the library
        with (
            pytest.warns(CacheWarning, match="is damaged"),
            pytest.raises(CompileError, match=r"is in the way.*Delete it"),
        ):
            compiled(tmp_path)
        assert path.is_dir()
        return
    with pytest.warns(CacheWarning, match=r"The library .* in the cache is damaged .* compiled anew"):
        second = compiled(tmp_path)
    assert not second.cached
    assert second.path == path
    assert compiled(tmp_path).cached
    assert [item.name for item in moved.iterdir()] == [path.name]


def test_a_damaged_library_never_ends_a_process(cache: Path, rotor: Path, tmp_path: Path) -> None:
    model = load(rotor)
    expected = model.simulate(cycles=0.2).x[-1]
    for path in cache.iterdir():
        content = path.read_bytes()
        path.unlink()  # this process goes on with what it has mapped
        path.write_bytes(content[: len(content) // 2])
    code = (
        "import sys, warnings; from ballpass.runtime import load; warnings.simplefilter('always')\n"
        "print(load(sys.argv[1]).simulate(cycles=0.2).x[-1].tobytes().hex())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(rotor)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "is damaged" in done.stderr
    assert bytes.fromhex(done.stdout.strip()) == expected.tobytes()


@pytest.mark.long
def test_a_cache_emptied_while_it_is_used_is_no_trouble(cache: Path, rotor: Path) -> None:
    """Functions are looked up when they are first called, the stepper is compiled when it is first asked for."""
    expected = load(rotor).simulate(cycles=0.2, method="cvodes").x
    code = (
        "import shutil, sys; from ballpass.runtime import load; model = load(sys.argv[1]); shutil.rmtree(sys.argv[2])\n"
        "print(model.simulate(cycles=0.2, method='cvodes').x.tobytes().hex()); shutil.rmtree(sys.argv[2])\n"
        "load(sys.argv[1]).simulate(cycles=0.2)"
    )
    command = [sys.executable, "-W", "error", "-c", code, str(rotor), str(cache)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert bytes.fromhex(done.stdout.strip()) == expected.tobytes()


def test_what_killed_compilers_left_behind_is_deleted_after_a_day(cache: Path, tmp_path: Path) -> None:
    cache.mkdir()
    old, new = (cache / f".model-{32 * digit}-abcdefgh.tmp" for digit in "01")
    others = cache / ".notes-x.tmp"  # the user's
    for path in (old, new, others):
        path.write_bytes(b"half a library")
    for path in (old, others):
        os.utime(path, (0, 0))
    library = compiled(tmp_path)
    assert {path.name for path in cache.iterdir()} == {new.name, others.name, library.path.name}


# ------------------------------------------------------------------------------------------------------------ solutions


def test_a_saved_solution_with_any_change_is_refused(rotor: Path, tmp_path: Path) -> None:
    solution = load(rotor).simulate(cycles=0.2)
    path = solution.save(tmp_path / "solution.nc")
    whole, draw = path.read_bytes(), random.Random(3)
    np.testing.assert_array_equal(load_solution(path).x, solution.x)
    for length in (0, 1, 7, 100, 4096, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(RequestError, match="cut short, edited, or written by something else"):
            load_solution(path)
    for _ in range(3000 if LONG else 100):
        content = torn(whole, draw)
        if content != whole:
            path.write_bytes(content)
            with pytest.raises(
                RequestError, match=r"solution\.nc: .*Give a file that it wrote, or run the scene again"
            ):
                load_solution(path)
    with pytest.raises(RequestError, match="no such file"):
        load_solution(tmp_path / "missing.nc")
    with pytest.raises(RequestError, match="cannot be read"):
        load_solution(tmp_path)
    with pytest.raises(RequestError, match=r"path: a path is expected, not 'a\\x00b'"):
        load_solution("a\0b")


def test_other_readers_of_netcdf_read_a_saved_solution(rotor: Path, tmp_path: Path) -> None:
    import h5py
    import xarray

    solution = load(rotor).simulate(cycles=0.2)
    path = solution.save(tmp_path / "solution.nc")
    with xarray.open_dataset(path, engine="h5netcdf") as dataset:
        np.testing.assert_array_equal(dataset["inner.y"].values, solution["inner.y"])
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["inner.y"][:], solution["inner.y"])
