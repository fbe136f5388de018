"""Claims about the two distributions: what their archives hold, and that they run where the repository is not."""

from __future__ import annotations

import email
import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Callable
from email.message import Message
from pathlib import Path

import numpy as np
import pytest
from scripts.sizes import build_wheels, install, installed_megabytes, make_environment

from ballpass import derive, runtime
from ballpass.runtime import Model, load_solution

ROOT = Path(__file__).resolve().parent.parent
PROJECT, RUNTIME = (tomllib.loads((ROOT / f).read_text("utf-8")) for f in ("pyproject.toml", "runtime/pyproject.toml"))


def test_there_is_one_version() -> None:
    assert runtime.__version__ == derive.__version__
    for path, pattern in {
        "CITATION.cff": r"^version: (\S+)$",
        "packaging/recipe/recipe.yaml": r'^  version: "(\S+)"$',
    }.items():
        (found,) = re.findall(pattern, (ROOT / path).read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert found == runtime.__version__, path


def test_what_the_runtime_needs_is_said_once_more_by_the_whole_and_by_the_recipe() -> None:
    needed = RUNTIME["project"]["dependencies"]
    assert set(needed) <= set(PROJECT["project"]["dependencies"])
    both = set(RUNTIME["project"]["optional-dependencies"]) & set(PROJECT["project"]["optional-dependencies"])
    assert {"compiler", "labelled", "scale"} <= both
    for extra in both:  # SciPy is no extra of the whole
        small = {item for item in RUNTIME["project"]["optional-dependencies"][extra] if not item.startswith("scipy")}
        assert small == set(PROJECT["project"]["optional-dependencies"][extra])
    names = {re.split(r"\W", item)[0] for item in needed}
    assert not names & {"sympy", "pint", "matplotlib", "pandas", "scipy", "xarray"}
    recipe = (ROOT / "packaging" / "recipe" / "recipe.yaml").read_text(encoding="utf-8")
    for item in PROJECT["project"]["dependencies"]:
        name, bounds = re.fullmatch(r"([\w-]+)(.*)", item).groups()  # type: ignore[union-attr]
        assert f"- {'matplotlib-base' if name == 'matplotlib' else name} {bounds}\n" in recipe
    assert (ROOT / "runtime" / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_every_package_has_types_for_its_users() -> None:
    for half in ("derive", "runtime"):
        packages = [path.parent for path in (ROOT / half / "ballpass").glob("*/__init__.py")]
        assert packages
        assert [package.name for package in packages if not (package / "py.typed").is_file()] == []


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Source distributions, and the wheels that they give."""
    return build_wheels(tmp_path_factory.mktemp("archives"))


def wheel(archives: Path, name: str) -> tuple[set[str], Message]:
    """Names in a wheel, and its metadata."""
    (path,) = archives.glob(f"{name}-*.whl")
    with zipfile.ZipFile(path) as file:
        (metadata,) = (n for n in file.namelist() if n.endswith("METADATA"))
        return set(file.namelist()), email.message_from_bytes(file.read(metadata))


def below(folder: Path) -> set[str]:
    """Files of the repository, as they are called in a package."""
    found = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(folder).as_posix() for path in found}


@pytest.mark.long
def test_wheels_hold_code_driver_scenes_types_and_licence_and_no_file_twice(archives: Path) -> None:
    whole, facts = wheel(archives, "ballpass")
    small, small_facts = wheel(archives, "ballpass_runtime")
    assert below(ROOT / "runtime") <= small | {"LICENSE", "README.md", "pyproject.toml"}
    assert below(ROOT / "derive") <= whole
    assert {f"ballpass/derive/scenes/{name}" for name in below(ROOT / "scenes")} <= whole
    assert not whole & small
    assert sum(name.endswith("/licenses/LICENSE") for name in whole | small) == 2
    assert {facts["Version"], small_facts["Version"]} == {runtime.__version__}
    assert f"ballpass-runtime=={runtime.__version__}" in facts.get_all("Requires-Dist", [])
    # an index shows neither pictures nor files beside the text
    for text in (facts.get_payload(), small_facts.get_payload()):
        assert not re.findall(r"\]\((?!https:)|!\[", str(text))


@pytest.mark.long
def test_source_distribution_is_the_checkout(archives: Path) -> None:
    listed = subprocess.run(("git", "ls-files"), cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("this is no checkout of git")
    with tarfile.open(archives / f"ballpass-{runtime.__version__}.tar.gz") as file:
        held = {name.partition("/")[2] for name in file.getnames()}
    there = {name for name in listed.stdout.splitlines() if (ROOT / name).is_file()}
    assert there - held <= {name for name in there if name.startswith(".ci/")}


@pytest.mark.long
def test_wheels_run_from_elsewhere_first_the_runtime_alone_then_the_whole(
    archives: Path, make_model: Callable[..., Model], tmp_path: Path
) -> None:
    """By the programs' paths, as pipx's links do: no active environment, another home, no cache of compiled code."""
    programs = make_environment(tmp_path / "environment")
    work = tmp_path / "far away"
    work.mkdir()
    system = {key: value for key, value in os.environ.items() if key in ("LANG", "TMPDIR")}
    environment = {**system, "HOME": str(tmp_path), "PATH": os.defpath}

    def call(*words: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            tuple(map(str, words)), cwd=work, env=environment, capture_output=True, text=True, check=False, timeout=300
        )

    def ballpass(*words: str | Path) -> str:
        done = call(programs / "ballpass", *words)
        assert done.returncode == 0, done.stderr
        return done.stdout

    install(programs, archives, "ballpass-runtime")
    sizes = {"ballpass-runtime": installed_megabytes(programs)}
    for name in ("ballpass.derive", "sympy", "pint", "scipy", "matplotlib", "pandas"):
        assert f"No module named {name!r}" in call(programs / "python", "-c", f"import {name}").stderr
    model = make_model("rotor")
    ballpass("run", model.folder, "--cycles", "3", "--transient", "2", "--set", "bearing.clearance=12 um")
    ran = load_solution(work / "results" / model.folder.name / "solution.nc")
    assert np.array_equal(ran.x, model.simulate(cycles=3, transient=2, parameters={"bearing.clearance": 12e-6}).x)
    vary = ("--vary", "bearing.clearance=5 um:20 um:3", "--of", "peak_ball_force")
    swept = json.loads(ballpass("sweep", model.folder, *vary, "--cycles", "3", "--transient", "2", "--json"))
    table = {"bearing.clearance": swept["varied"][0]["values"]}
    peaks = model.simulate_many(table, ["peak_ball_force"], cycles=3, transient=2)["peak_ball_force"]
    assert swept["quantities"]["peak_ball_force"]["values"] == peaks.tolist()
    refused = call(programs / "ballpass", "run", ROOT / "scenes" / "rotor.toml")
    assert (refused.returncode, "pip install ballpass" in refused.stderr) == (2, True)

    install(programs, archives, "ballpass")
    sizes["ballpass"] = installed_megabytes(programs)
    assert ballpass("--version") == f"ballpass {runtime.__version__}\n"
    ballpass("new", "press", "my machines")
    scene = "my machines/punching_press.toml"
    ballpass("run", scene, "--cycles", "3", "--transient", "2")
    assert {"solution.nc", "summary.json", "orbit.png"} <= {p.name for p in (work / "results/punching_press").iterdir()}
    life = json.loads(ballpass("life", scene, "--cycles", "3", "--transient", "2", "--json"))
    assert life["title"] == "Punching machine of the paper"
    ballpass("animate", scene, "--cycles", "3", "--transient", "2")
    assert (work / "results/punching_press/animation.html").stat().st_size > 10_000
    assert (tmp_path / ".cache" / "ballpass").is_dir()

    page = (ROOT / "docs" / "howto" / "install.md").read_text(encoding="utf-8")
    for what, megabytes in sizes.items():
        (told,) = re.findall(rf"^\| `{what}` \|.*\| (\d+) \|$", page, flags=re.MULTILINE)
        if sys.platform == "linux":
            assert megabytes == pytest.approx(float(told), rel=0.1), what

    # the package of the page about a law of one's own, from its wheel
    page = (ROOT / "docs" / "howto" / "own_law.md").read_text(encoding="utf-8")
    (law, second, test), (project, table) = (
        re.findall(rf"```{kind}\n(.*?)```", page, re.DOTALL) for kind in ("python", "toml")
    )
    package = tmp_path / "cubic-damping"
    package.mkdir()
    (package / "cubic_damping.py").write_text(f"{law}\n{second}", encoding="utf-8")
    (package / "pyproject.toml").write_text(project, encoding="utf-8")
    subprocess.run((sys.executable, "-m", "build", "--wheel", "--outdir", archives, package), check=True)
    install(programs, archives, "cubic-damping")
    text = (work / scene).read_text(encoding="utf-8")
    own = re.sub(r"\[bearing\.damping\]\n(.+\n)+", lambda _: table, text)
    assert own != text
    (work / "my_press.toml").write_text(own, encoding="utf-8")
    short, vary = ("--cycles", "3", "--transient", "2"), ("--vary", "bearing.damping.cubic=1e4 s^3/m^3:2e4 s^3/m^3:2")
    run = ("run", "my_press.toml", *short, "--json", "--no-figures")
    peak = json.loads(ballpass(*run))["peak_ball_force"]
    assert peak != json.loads(ballpass(*run, "--set", "bearing.damping.cubic=1e5 s^3/m^3"))["peak_ball_force"]
    ballpass("sweep", "my_press.toml", *vary, "--of", "peak_ball_force", *short, "--no-figures")
    ballpass("sensitivity", "my_press.toml", "--of", "peak_ball_force", "--wrt", "bearing.damping.cubic", *short)
    ballpass("export", "my_press.toml", "--fmu", "--out", "my_press.fmu")
    for command in ("equations", "explain", "linearize", "steady"):
        ballpass(command, "my_press.toml")
    checked = call(programs / "python", "-c", f"{test}\n\ntest_the_cubic_law()")
    assert checked.returncode == 0, checked.stderr
