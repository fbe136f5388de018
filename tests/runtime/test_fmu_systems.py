"""Claims about FMUs by FMI 2.0, and about FMUs and programs for other systems than the one at hand."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError
from ballpass.runtime.export.c_program import export_c
from ballpass.runtime.export.fmu import FMI, export_fmu, universal
from ballpass.runtime.export.targets import TARGETS, targets_of

fmpy = pytest.importorskip("fmpy", reason="needs FMPy: pip install ballpass[dev]")
fmi2 = pytest.importorskip("fmpy.fmi2")

needs_zig = pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed")
WINE = shutil.which("wine64") or shutil.which("wine") or shutil.which("wine64", path="/usr/lib/wine")
needs_wine = pytest.mark.skipif(WINE is None, reason="needs wine: apt-get install wine64")

#: A run of two turns of the press.
END = 0.24


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press")


@pytest.fixture(scope="module")
def of_two(press: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The press by FMI 2.0, for this machine."""
    path = tmp_path_factory.mktemp("fmi2") / "press.fmu"
    return export_fmu(press.folder, path, inputs=["mechanism.forces.punch"], version=2)


def begun(path: Path, folder: str) -> tuple[Any, dict[str, int]]:
    """An instance in its run, and its value references."""
    description = fmpy.read_model_description(str(path))
    one = fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="one",
    )
    one.instantiate()
    one.setupExperiment(startTime=0.0, stopTime=END)
    one.enterInitializationMode()
    one.exitInitializationMode()
    return one, {item.name: item.valueReference for item in description.modelVariables}


def test_fmi_2_has_the_bits_of_simulate_and_all_functions(of_two: Path, press: Model) -> None:
    """FMPy validates it and binds what the standard declares; an array is one variable for each of its numbers."""
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(of_two)) == []
    declared = set(re.findall(r"fmi2[A-Z]\w+(?=\()", Path(fmi2.__file__).read_text(encoding="utf-8")))
    declared = {name for name in declared if hasattr(fmi2.FMU2Slave, name)}
    assert len(declared) > 30
    folder = fmpy.extract(str(of_two))
    try:
        one, *_ = begun(of_two, folder)
        assert [name for name in sorted(declared) if not hasattr(one.dll, name)] == []
        one.freeInstance()
    finally:
        shutil.rmtree(folder)
    result = fmpy.simulate_fmu(str(of_two), stop_time=END, output_interval=END / 60)
    times = [0.0, *(before + (time - before) for before, time in pairwise(result["time"]))]
    solution = press.simulate(method="stepper", times=times, duration=END)
    for name in press.outputs:
        samples = solution.outputs[name].reshape(len(times), -1)
        names = [name] if samples.shape[1] == 1 else [f"{name}[{k + 1}]" for k in range(samples.shape[1])]
        assert np.array_equal(np.column_stack([result[item] for item in names]), samples), name


def test_states_derivatives_and_inputs_by_fmi_2(of_two: Path, press: Model) -> None:
    """A serialized state continues with the same bits; derivatives are those of geometry; an input moves the run."""
    folder = fmpy.extract(str(of_two))
    try:
        one, places = begun(of_two, folder)
        read = [places[name] for name in ("inner.y", "ball.force[3]", "reaction.A.y")]
        one.doStep(0.0, 0.05)
        kept = one.serializeFMUState(one.getFMUState())
        one.doStep(0.05, 0.03)
        expected = one.getReal(read)
        one.setFMUState(one.deserializeFMUState(kept))
        one.doStep(0.05, 0.03)
        assert one.getReal(read) == expected
        balls = [places[f"ball.deflection[{k + 1}]"] for k in range(8)]
        moved = [one.getDirectionalDerivative(balls, [places[f"inner.{axis}"]], [1.0]) for axis in "xy"]
        assert np.allclose(np.sum(np.square(moved), axis=0), 1.0)  # a shift turns into deflection by a unit vector
        assert one.getRealOutputDerivatives([places["inner.y"]], [1]) == one.getReal([places["inner.vy"]])
        force = places["mechanism.forces.punch.force.y"]
        one.setReal([force], [0.0])
        one.doStep(0.08, 0.005)  # in the punch
        without = one.getReal(read)
        one.setFMUState(one.deserializeFMUState(kept))
        one.doStep(0.05, 0.03)
        one.doStep(0.08, 0.005)
        assert abs(one.getReal(read)[2] - without[2]) > 0.1 * abs(without[2])
        one.freeInstance()
    finally:
        shutil.rmtree(folder)


def test_words_of_fmi_2_name_its_own_functions(of_two: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = fmpy.extract(str(of_two))
    try:
        one, places = begun(of_two, folder)
        with pytest.raises(Exception, match="fmi2DoStep"):
            one.doStep(0.1, 0.1)
        with pytest.raises(Exception, match="fmi2SetReal"):
            one.setReal([places["inner.x"]], [0.0])
        one.freeInstance()
    finally:
        shutil.rmtree(folder)
    said = "".join(capfd.readouterr())
    assert "fmi2DoStep: the communication point 0.1 s was given. Allowed: 0 s" in said
    assert "fmi2SetReal: the value reference" in said
    assert "fmi3" not in said


def test_targets_are_named_in_words_and_macos_has_one_file_for_two_processors() -> None:
    with pytest.raises(RequestError, match=r"There is no target 'windwos'. Did you mean 'windows-x86_64'"):
        targets_of(["windwos"])
    if importlib.util.find_spec("ziglang") is not None:
        assert targets_of(["linux", "macos-arm64"]) == ["linux-x86_64", "linux-arm64", "macos-arm64"]
    whole = universal({"x86_64": b"a" * 20000, "aarch64": b"b" * 10})
    assert whole[:8] == bytes.fromhex("cafebabe00000002")
    for k, (processor, content) in enumerate(((0x01000007, b"a" * 20000), (0x0100000C, b"b" * 10))):
        kind, _, at, size, align = (int.from_bytes(whole[8 + 20 * k + 4 * i :][:4], "big") for i in range(5))
        assert (kind, at % (1 << align), whole[at : at + size]) == (processor, 0, content)


@pytest.fixture(scope="module")
def everywhere(press: Model, tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The press by FMI 2.0 and 3.0, for all systems, unpacked."""
    place = tmp_path_factory.mktemp("everywhere")
    for version in (2, 3):
        made = export_fmu(press.folder, place / f"{version}.fmu", version=version, targets=[*TARGETS])
        with zipfile.ZipFile(made) as archive:
            archive.extractall(place / str(version))
    return {version: place / str(version) for version in (2, 3)}


#: First bytes of a library, where its processor stands, and that processor.
KINDS = {
    "x86_64-linux": (b"\x7fELF", 18, b"\x3e\x00"),
    "aarch64-linux": (b"\x7fELF", 18, b"\xb7\x00"),
    "x86_64-windows": (b"MZ", None, b"PE\0\0\x64\x86"),
    "aarch64-darwin": (b"\xcf\xfa\xed\xfe", 4, b"\x0c\x00\x00\x01"),
    "x86_64-darwin": (b"\xcf\xfa\xed\xfe", 4, b"\x07\x00\x00\x01"),
    "linux64": (b"\x7fELF", 18, b"\x3e\x00"),
    "win64": (b"MZ", None, b"PE\0\0\x64\x86"),
    "darwin64": (b"\xca\xfe\xba\xbe", 8, b"\x01\x00\x00\x07"),
}


@pytest.mark.long
@needs_zig
@pytest.mark.parametrize("version", [2, 3])
def test_one_file_has_libraries_for_every_system(everywhere: dict[int, Path], version: int) -> None:
    """Each of its format and processor, with the functions of the standard that FMPy binds."""
    code = Path(fmi2.__file__ if version == 2 else fmi2.__file__.replace("fmi2", "fmi3")).read_text(encoding="utf-8")
    declared = {name.encode() for name in re.findall(rf"fmi{version}(?:DoStep|Instantiate|GetVersion)\b", code)}
    folders = {path.name: path for path in (everywhere[version] / "binaries").iterdir()}
    old = {"linux64", "aarch64-linux", "win64", "darwin64"}
    assert set(folders) == (old if version == 2 else {target.place for target in TARGETS.values()})
    for name, folder in folders.items():
        (library,) = folder.iterdir()
        content, (first, place, processor) = library.read_bytes(), KINDS[name]
        place = int.from_bytes(content[60:64], "little") if place is None else place
        assert content.startswith(first), name
        assert content[place : place + len(processor)] == processor, name
        assert all(function in content for function in declared), name
        assert not re.search(rb"/tmp/|/home/", content), name


def by_wine(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """A program for Windows, in a prefix of its own that is made anew; a process that hangs is ended."""
    env = os.environ | {"WINEPREFIX": str(cwd / "prefix"), "WINEDEBUG": "-all"}
    given = [str(WINE), *words]
    return subprocess.run(given, cwd=cwd, env=env, capture_output=True, text=True, check=True, timeout=300)


@pytest.mark.long
@needs_zig
@needs_wine
def test_the_library_for_windows_has_the_numbers_of_this_machine(everywhere: dict[int, Path], tmp_path: Path) -> None:
    importer = Path(__file__).with_name("importer.c")
    command = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu", f"-I{FMI}"]
    subprocess.run([*command, str(importer), "-o", "importer.exe"], cwd=tmp_path, check=True)
    description = fmpy.read_model_description(str(everywhere[2]))
    outputs = [item for item in description.modelVariables if item.causality == "output"]
    library = everywhere[2] / "binaries" / "win64" / "punching_press.dll"
    shutil.copy(library, tmp_path / "press.dll")
    asked = ["press.dll", description.guid, *(str(item.valueReference) for item in outputs)]
    done = by_wine("importer.exe", *asked, cwd=tmp_path)
    found = np.loadtxt(done.stdout.splitlines())
    result = fmpy.simulate_fmu(str(everywhere[2]), stop_time=END, output_interval=0.01)
    expected = np.column_stack([result[item.name] for item in outputs])[1:]
    assert found.shape == expected.shape == (24, len(outputs))
    assert np.all(np.abs(found - expected) <= 1e-12 * np.max(np.abs(expected), axis=0))


@pytest.mark.long
@needs_zig
@needs_wine
def test_the_program_for_windows_prints_the_numbers_of_this_machine(press: Model, tmp_path: Path) -> None:
    folder = export_c(press.folder, tmp_path / "c", targets=["windows", "linux-x86_64"])
    (program,) = folder.glob("*.exe")
    assert program.name == "punching_press-windows-x86_64.exe"
    asked = ("--cycles", "2")
    done = by_wine(str(program), *asked, cwd=tmp_path)
    here = subprocess.run(
        [str(folder / "punching_press-linux-x86_64"), *asked], capture_output=True, text=True, check=True
    )
    found, expected = (np.loadtxt(text.splitlines(), delimiter=",", skiprows=1) for text in (done.stdout, here.stdout))
    assert np.all(np.abs(found - expected) <= 1e-12 * np.max(np.abs(expected), axis=0))
