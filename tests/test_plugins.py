"""A law of a package of the user's own, as the how-to page has it: in every command, fresh, missing, wrong."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from ballpass.derive import derive, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from ballpass.runtime.app.commands.mcp import command_line, tools
from ballpass.runtime.app.commands.skill import skill_text
from ballpass.runtime.ask.kept_parts import kept_parts
from ballpass.runtime.contract import plugins
from ballpass.runtime.contract.errors import RequestError
from ballpass.testing import ConformanceError, check_damping_law, check_quantity, check_scene
from test_agents import ASKED, call, numbers

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/howto/own_law.md").read_text(encoding="utf-8")
LAW, SECOND, TEST = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
PROJECT, TABLE = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
NUMBERS = TABLE.split("\n", 2)[2]
OWN = (ROOT / "tests/machines/own_parts.py").read_text(encoding="utf-8")

#: The press with a part of `OWN` of every kind that a scene names.
OWN_PRESS = (
    ('law = "asynchronous"', 'law = "own-motor"\nno_load_speed = "500 rpm"\nstall_torque = "80 N*m"'),
    *((f"{key} =", f"# {key} =") for key in ("breakdown_torque", "breakdown_slip", "synchronous_speed")),
    ('law = "one-sided"', 'law = "own-damping"\ncubic = "1e4 s^3/m^3"'),
    ('\nratio = "0.25e-5 s*mm^0.5"', ""),
    ("balls = 8 ", 'element = "own-ball"\nballs = 8 '),
    ("[bearing.contact]", '[bearing.swelling]\n2 = "2 um"\n\n[bearing.contact]'),
    ("[bearing]\n", '[mechanism.springs.air]\nbodies = ["frame", "slider"]\npoints = ["A", "C"]\n[bearing]\n'),
    ("[bearing]\n", 'drag = "1e3 N*s^3/m^3"\n\n[bearing]\n'),
)

Run = Callable[..., "subprocess.CompletedProcess[str]"]


POINTS = PROJECT.partition("entry-points.ballpass]\n")[2].partition("\n\n")[0].replace('"', "") + "\n"


def install(site: Path, text: str = LAW, module: str = "cubic_damping", points: str = POINTS) -> None:
    """A package, that of the page, as an installer leaves it."""
    info = site / f"{module}-0.1.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    (site / f"{module}.py").write_text(text, encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[ballpass]\n{points}", encoding="utf-8")
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 0.1\n", encoding="utf-8")


def run_command(place: Path, *words: str, site: str = "site") -> subprocess.CompletedProcess[str]:
    """``ballpass`` in a process of its own."""
    paths = [*([str(place / site)] if site else []), os.environ.get("PYTHONPATH", "")]
    # -P: the folder of the command is no place of modules, as for the installed command
    given = [sys.executable, "-P", "-c", "from ballpass.runtime.app.entry import main; main()", *words]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    return subprocess.run(given, capture_output=True, text=True, check=False, cwd=place, env=env, timeout=300)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the press under the law, and the package installed in ``site``."""
    folder = tmp_path_factory.mktemp("plugin")
    text = (ROOT / "scenes/punching_press.toml").read_text(encoding="utf-8")
    text = text.replace('law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"', f'law = "cubic"\n{NUMBERS}')
    (folder / "press.toml").write_text(text, encoding="utf-8")
    install(folder / "site")
    return folder


@pytest.fixture
def command(place: Path) -> Run:
    return partial(run_command, place)


def highest(done: subprocess.CompletedProcess[str]) -> float:
    assert done.returncode == 0, done.stderr
    (quantity,) = json.loads(done.stdout)["quantities"].values()
    return float(quantity["value"])


RUN = ("run", "press.toml", "--no-figures", "--json", "--cycles", "0.3", "--transient", "0", "--of", "max:ball.force")


@pytest.mark.long
def test_a_law_runs_is_derived_anew_where_it_changes_and_runs_where_it_is_missing(place: Path, command: Run) -> None:
    first = highest(command(*RUN))
    install(place / "site", LAW.replace("rate**3", "9 * rate**3"))
    try:
        folder = command("run", "generated/press", *RUN[2:])
        assert highest(folder) == first
        assert "numbers are those of then" in " ".join(folder.stderr.split())
        assert abs(highest(command(*RUN)) / first - 1.0) > 1e-3
    finally:
        install(place / "site")
    assert highest(command(*RUN)) == first
    missing = command(*RUN, site="")
    assert highest(missing) == first
    assert "cubic_damping" in missing.stderr
    assert "cannot be derived anew" in " ".join(missing.stderr.split())
    refused = command("derive", "press.toml", "--check", site="")
    assert refused.returncode == 2
    assert "--plugin" in refused.stderr
    assert highest(command("--plugin", "site/cubic_damping.py", *RUN, site="")) == first


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('numbers["cubic"]', 'numbers["cubik"]'), ["cubic_damping.py, line 2", "KeyError: 'cubik'"]),
        (('unit = "s^3/m^3"', 'unit = "blorg"'), ["cubic_damping", 'no unit is called "blorg"']),
        (('unit = "s^3/m^3"', 'unit = ""'), ["cubic_damping", 'has the unit "1"']),
    ],
)
def test_a_slip_in_a_law_is_told_with_its_place(place: Path, change: tuple[str, str], said: list[str]) -> None:
    """In words, as other faults, not as the path that Python took."""
    try:
        install(place / "site", LAW.replace(*change))
        refused = run_command(place, *RUN)
    finally:
        install(place / "site")
    assert refused.returncode == 2
    assert "Traceback" not in refused.stderr
    for words in said:
        assert words in refused.stderr


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory, scene_text: Callable[..., str]) -> list[Path]:
    """Two folders with the press under the law, in the second with nine times its force; a data set and a signal."""
    change = ('law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"', f'law = "cubic"\n{NUMBERS}')
    found = []
    for factor in ("1 * ", "9 * "):
        found.append(folder := tmp_path_factory.mktemp("factor"))
        (folder / "press.toml").write_text(scene_text("punching_press", change), encoding="utf-8")
        (folder / "set.toml").write_text(DATA_SET, encoding="utf-8")
        install(folder / "site", LAW.replace("rate**3", f"{factor}rate**3"))
    done = run_command(found[0], "run", "press.toml", "--no-figures", "--cycles", "4", "--out", "first")
    assert done.returncode == 0, done.stderr
    (signal,) = found[0].glob("first/**/*.nc")
    for folder in found:
        shutil.copy(signal, folder / "measured.nc")
    return found


DATA_SET = """
scene = "press.toml"
seed = 1
members = 2
outputs = ["inner.ay"]
sample_rate = "10 kHz"
duration = "0.1 s"
transient = "0.05 s"
parameters = { "bearing.clearance" = { distribution = "uniform", loc = "9 um", scale = "2 um" } }

[classes.one]
"""


@pytest.mark.long
@pytest.mark.parametrize("name", sorted({*ASKED, "equations", "export"} - {"bearings"}))
def test_a_law_changed_by_a_factor_changes_the_numbers_of_every_command(places: list[Path], name: str) -> None:
    """Numbers that are no times of computing; of the catalogue, which has no scene, there are none."""
    given = {**ASKED.get(name, {}), "scene": "press.toml"}
    if name == "dataset":
        given = {"spec": "set.toml"}
    elif name == "export":
        given |= {"c": True, "out": "program"}
    elif name == "fit":
        given |= {"data": ["measured.nc"]}
    elif name == "jacobian":
        given |= {"of": ["ball.force"], "wrt": ["bearing.damping.cubic"]}
    answers = []
    for place in places:
        done = run_command(place, *command_line(name, given))
        assert done.returncode == 0 or name in ("life", "select"), done.stderr
        if name == "dataset":
            answers.append(xarray.open_zarr(place / "results/set.zarr")["inner.ay"].values.tolist())
        elif name == "export":
            answers.append("".join(path.read_text() for path in sorted(place.glob("program/**/*.[ch]"))))
        else:
            answers.append(done.stdout if name == "equations" else plain_numbers(json.loads(done.stdout)))
    assert answers[0] != answers[1]


def plain_numbers(found: Any) -> Any:
    """An answer without its request, and without times of computing, which are never equal."""
    if isinstance(found, dict):
        times = {"request", "uncertainty", "statistics", "promised", "measured", "median", "wall_time"}
        return {name: plain_numbers(value) for name, value in found.items() if name not in times}
    return [plain_numbers(value) for value in found] if isinstance(found, list) else found


# the kit, in this process


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """A module with a text, changed; forgotten after the test."""
    monkeypatch.setattr(plugins, "_used", {})
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(text: str, name: str, *changes: tuple[str, str]) -> str:
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
        importlib.invalidate_caches()
        return name

    return write


@pytest.fixture
def law_of(written: Callable[..., str]) -> Callable[..., str]:
    """A module with the page's law, changed."""
    return partial(written, LAW)


@pytest.fixture
def own_of(written: Callable[..., str]) -> Callable[..., str]:
    """A module with the parts of `OWN`, changed."""
    return partial(written, OWN)


def test_the_kit_passes_the_page_s_law(law_of: Callable[..., str]) -> None:
    assert 'check_damping_law("cubic"' in TEST
    check_damping_law("cubic", NUMBERS, plugins=[law_of("right_law")])


@pytest.mark.long
def test_the_law_of_two_numbers_on_the_page_is_hunt_crossley_s_with_its_factor(written: Callable[..., str]) -> None:
    """8 (1 - 0.8) / (5 · 0.8 · 0.1 m/s) = 4 s/m."""
    numbers = 'restitution = 0.8\nimpact_speed = "0.1 m/s"'
    check_damping_law("flores", numbers, plugins=[written(f"{LAW}\n{SECOND}", "two_laws")])
    text = (ROOT / "scenes/varying_compliance.toml").read_text(encoding="utf-8")
    peaks = []
    for law in (f'law = "flores"\n{numbers}', 'law = "hunt-crossley"\nhysteresis = "4 s/m"'):
        scene = scene_from_text(text.replace('law = "none"', law), "two")
        with tempfile.TemporaryDirectory() as place:
            model = load(generate(scene, Path(place) / "two"))
            peaks.append(model.quantities("peak_ball_force", cycles=1, transient=0)["peak_ball_force"].value)
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-12)


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("wrong_unit", "rate**3", "rate**2 * sp.Piecewise((1, rate > 0), (-1, True))", "has not the unit N"),
        ("two_numbers", "rate**3", "rate**3 * sp.Symbol('speed')", "its force has speed beside"),
        ("no_event", "rate**3", "rate**3 * (1 + sp.tanh((rate - 0.01) / 1e-20)) / 2", "jumps at the rate 0.01"),
        pytest.param("gives_energy", "rate**3", "-(rate**3)", "gives energy", marks=pytest.mark.long),
        pytest.param(
            "not_zero", "rate**3", "(rate**3 + coefficient / coefficient)", "not zero at rest", marks=pytest.mark.long
        ),
        pytest.param(
            "wrong_slope",
            "rate**3",
            "rate**3 * (1 + sp.sin(rate * 1e14) / 2)",
            "its slope by the rate",
            marks=pytest.mark.long,
        ),
    ],
)
def test_the_kit_catches_a_wrong_law(law_of: Callable[..., str], name: str, old: str, new: str, words: str) -> None:
    module = law_of(name, (old, new), ("from types", "import sympy as sp\nfrom types"))
    with pytest.raises(ConformanceError, match=words):
        check_damping_law("cubic", NUMBERS, plugins=[module])


@pytest.mark.parametrize("function", ["Max", "Abs", "floor"])
def test_a_function_with_kinks_is_refused_in_words(law_of: Callable[..., str], function: str) -> None:
    more = ", 0" if function == "Max" else ""
    old, new = ("rate**3", f"sp.{function}(rate{more}) * rate**2"), ("from types", "import sympy as sp\nfrom types")
    with pytest.raises(RequestError, match=rf'"{function}", whose kinks are not located. Allowed: sympy.Piecewise'):
        check_damping_law("cubic", NUMBERS, plugins=[law_of(f"with_{function}", old, new)])


#: Part, what replaces its factor, and words of the refusal.
KINKED = [
    ("force", "action.rate**3", "sp.Max(action.rate, 0)", 'The spring "air" has "Max".*`setting.smoothness`'),
    ("force", "action.rate**3", "sp.Piecewise((1, action.rate > 0), (0, True))", 'The spring "air" has "Piecewise"'),
    ("torque", "super(Motor, self)", "sp.sign(speed) * super(Motor, self)", 'linear characteristic, has "sign"'),
    ("torque", "super(Motor, self)", "abs(speed) * super(Motor, self)", '"Abs".*`smoothness = Smoothness.KINKED`'),
    (
        "effect",
        "* super().term",
        "* sp.Max(0, sp.cos(ball.on_inner)) * super().term",
        'The effect "swelling" has "Max"',
    ),
    (
        "effect",
        "* super().term",
        "* sp.Piecewise((1, sp.cos(ball.on_outer) > 0), (0, True)) * super().term",
        '"swelling" has "Piecewise".*gate of `edges`',
    ),
]


@pytest.mark.parametrize(("part", "old", "new", "words"), KINKED)
def test_a_kink_without_an_event_is_refused_in_every_part(
    own_of: Callable[..., str], scene_text: Callable[..., str], part: str, old: str, new: str, words: str
) -> None:
    plugins.use([own_of(f"kinked_{part}_{KINKED.index((part, old, new, words))}", (old, new))])
    scene = scene_from_text(scene_text("punching_press_motor", *OWN_PRESS), "press")
    with pytest.raises(RequestError, match=words):
        derive(scene)


def test_a_law_may_say_that_it_has_kinks(own_of: Callable[..., str], scene_text: Callable[..., str]) -> None:
    """As ballpass's table over the speed does; a jump stays refused."""
    name = '    name: ClassVar[str] = "own-motor"\n'
    said = (name, f"{name}    smoothness = Smoothness.KINKED\n")
    terms = ("from ballpass.derive.terms import ", "from ballpass.derive.terms import Smoothness, ")
    plugins.use([own_of("says_so", ("super(Motor, self)", "abs(speed) * super(Motor, self)"), said, terms)])
    system = derive(scene_from_text(scene_text("punching_press_motor", *OWN_PRESS), "press"))
    assert ("driver.torque", "kinked") in [(name, word.value) for name, word in system.smoothness]


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("a_class", "(Cubic(),)", "(Cubic,)", r"lists the class Cubic. Allowed: an object"),
        ("no_tuple", "BALLPASS = ", "OTHER = ", "no tuple BALLPASS"),
        ("twice", 'name = "cubic"', 'name = "tangent"', "a damping law 'tangent' already"),
        ("broken", "BALLPASS = ", "BALLPASS = 1 / 0, ", "cannot be imported .ZeroDivisionError"),
    ],
)
def test_a_wrong_plugin_is_refused_in_words(
    law_of: Callable[..., str], name: str, old: str, new: str, words: str
) -> None:
    with pytest.raises(RequestError, match=words):
        check_damping_law("cubic", NUMBERS, plugins=[law_of(name, (old, new))])
    with pytest.raises(RequestError, match="no such file"):
        plugins.use(["none.py"])


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("q_unit", 'name="own",', 'name="own", unit="m",', "sum of power times .* over kg"),
        pytest.param(
            "q_slope", 'slope=FACTORS["quantities"]', "slope=1.01", "differences, first d.own:", marks=pytest.mark.long
        ),
        pytest.param("q_right", "1", "1", "", marks=pytest.mark.long),
    ],
)
def test_the_kit_catches_a_wrong_quantity(
    own_of: Callable[..., str], name: str, old: str, new: str, words: str
) -> None:
    module = own_of(name, (old, new))
    with pytest.raises(ConformanceError, match=words) if words else nullcontext():
        check_quantity("own:ball.force", plugins=[module])


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "new", "words"),
    [
        ("s_right", "action.rate**3", ""),
        ("s_unit", "action.rate**2", "sum of power times .* over m "),
        ("s_jump", "TIP**3 * (1 + sp.tanh((action.rate / TIP - 0.2) * 10**12))", "disagree with their second route"),
    ],
)
def test_the_kit_catches_a_wrong_force_of_a_scene(
    own_of: Callable[..., str], scene_text: Callable[..., str], tmp_path: Path, name: str, new: str, words: str
) -> None:
    """A crank-slider that the own motor drives, with the own force between frame and slider."""
    machine, _, run = re.split(r"\n(?=\[bearing\]|\[run\])", scene_text("offset_slider"))
    torque = 'law = "own-motor"\nno_load_speed = "700 rpm"\nstall_torque = "80 N*m"'
    force = 'bodies = ["frame", "slider"]\npoints = ["A", "C"]\ndrag = "1000 N*s^3/m^3"'
    parts = (
        f"[mechanism.driver.torque]\n{torque}",
        '[mechanism.driver.flywheel]\ninertia = "0.1 kg*m^2"',
        f"[mechanism.springs.air]\n{force}",
        re.sub("outputs = .*", 'outputs = ["drive_torque"]', run),
    )
    (tmp_path / "slider.toml").write_text("\n".join((machine, *parts)), encoding="utf-8")
    tip = 'sp.Symbol("mechanism.driver.speed", real=True) * sp.Symbol("mechanism.bodies.crank.points.B", real=True)'
    module = own_of(name, ("action.rate**3", new), ("#: Of a part", f"TIP = {tip}\n\n#: Of a part"))
    with pytest.raises(ConformanceError, match=words) if words else nullcontext():
        check_scene(tmp_path / "slider.toml", "mean:driver.speed", cycles=0.5, plugins=[module])


# parts of every kind

#: What asks for the numbers of a part; others are those of a run.
ASK_OWN = {
    "rated_elements": ("life", "press.toml", "--cycles", "1", "--transient", "0", "--json"),
    "questions": ("count_states", "press.toml", "--json"),
}
RUN_OWN = (*RUN, "--of", "own:ball.force", "--method", "stepper-ownpair")


@pytest.mark.long
def test_a_part_of_any_kind_changed_by_a_factor_changes_the_numbers(
    tmp_path: Path, scene_text: Callable[..., str]
) -> None:
    """Found by its entry point, and named by ``--plugin``."""
    (tmp_path / "press.toml").write_text(scene_text("punching_press_motor", *OWN_PRESS), encoding="utf-8")
    points = "".join(f"{kind} = own_parts\n" for kind in plugins.GROUPS)

    def answer(kind: str, *first: str, site: str = "site") -> str:
        done = run_command(tmp_path, *first, *ASK_OWN.get(kind, RUN_OWN), site=site)
        assert done.returncode == 0 or kind == "rated_elements", done.stderr
        found = json.loads(done.stdout)
        return repr(found.get("quantities") or found.get("number") or found["states"])

    install(tmp_path / "site", OWN, "own_parts", points)
    before = {kind: answer(kind) for kind in ("effects", *ASK_OWN)}
    for kind in plugins.GROUPS:
        install(tmp_path / "site", OWN.replace(f'"{kind}": 1,', f'"{kind}": 3,'), "own_parts", points)
        assert answer(kind) != before.get(kind, before["effects"]), kind
    install(tmp_path / "site", OWN, "own_parts", points)
    for kind, found in before.items():
        assert answer(kind, "--plugin", "site/own_parts.py", site="") == found, kind


@pytest.mark.long
def test_methods_quantities_and_questions_of_a_module(
    make_model: Callable[..., Model], own_of: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They give what those of ballpass give, which they are; forgotten, none of them is there."""
    model = load(make_model("varying_compliance").folder, plugins=[own_of("own_in_python")])
    assert model.count_states().number == len(model.states)  # type: ignore[operator]
    run = {"cycles": 0.2, "transient": 0}
    own, mine = (model.simulate(method=f"stepper-{name}", **run) for name in ("dp54", "ownpair"))
    assert (own.x == mine.x).all()
    found = model.quantities(["mean:ball.force", "own:ball.force"], **run)
    assert len({value.value for value in found.values()}) == 1
    monkeypatch.setattr(plugins, "_used", {})
    assert not hasattr(model, "count_states")
    with pytest.raises(RequestError, match="no kind of quantity 'own'"):
        model.quantities(["own:ball.force"], **run)


@pytest.mark.long
def test_workers_have_the_plugins_of_the_call(tmp_path: Path, scene_text: Callable[..., str]) -> None:
    (tmp_path / "press.toml").write_text(scene_text("varying_compliance"), encoding="utf-8")
    (tmp_path / "set.toml").write_text('quantities = ["own:inner.y"]' + DATA_SET, encoding="utf-8")
    (tmp_path / "own_parts.py").write_text(OWN, encoding="utf-8")
    done = run_command(tmp_path, "dataset", "set.toml", "--plugin", "own_parts.py", "--workers", "2", site="")
    assert done.returncode == 0, done.stderr
    assert "2 made now, 0 without a signal" in done.stdout


def test_parts_kept_of_a_killed_call_are_not_those_of_a_changed_plugin(
    make_model: Callable[..., Model], own_of: Callable[..., str], tmp_path: Path
) -> None:
    model = load(make_model("varying_compliance").folder, plugins=[own_of("own_kept")])
    key, found = np.zeros(1), []
    for change in ((), (('"quantities": 1,', '"quantities": 3,'),)):
        own_of("own_kept", *change)
        with suppress(KeyboardInterrupt), kept_parts(tmp_path / "kept", model, "own:ball.force") as parts:
            found.append(parts.read(key))
            parts.write(key, (np.ones(1),))
            raise KeyboardInterrupt
    assert found == [None, None]


@pytest.mark.long
def test_a_question_of_a_plugin_is_a_tool_of_agents(
    tmp_path: Path, scene_text: Callable[..., str], monkeypatch: pytest.MonkeyPatch, own_of: Callable[..., str]
) -> None:
    """By ``ballpass mcp`` and in ``ballpass skill``; the unit of every number; the processes of tools know it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    (tmp_path / "rotor.toml").write_text(scene_text("varying_compliance"), encoding="utf-8")
    assert "count_states" not in tools()
    plugins.use([str(tmp_path / f"{own_of('own_tool')}.py")])
    assert "### `ballpass count_states SCENE`" in skill_text()
    answer = call("count_states", scene="rotor.toml")
    assert not answer.is_error, answer.content[0].text
    assert answer.structured_content["number"] == 4
    assert [path for path, unit in numbers(answer.structured_content) if not unit] == []
    assert not call("run", scene="rotor.toml", of=["own:ball.force"], figures=False).is_error


def test_sources_beside_a_module_and_within_a_package_are_in_the_digest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "alone_law.py").write_text("BALLPASS = ()\n")
    (tmp_path / "packed_law").mkdir()
    (tmp_path / "packed_law/__init__.py").write_text("")
    importlib.invalidate_caches()
    assert plugins.digest_of("not_there_law") is None
    for module, helper in (("alone_law", "helper.py"), ("packed_law", "packed_law/numbers.txt")):
        before = plugins.digest_of(module)
        (tmp_path / helper).write_text("1")
        assert plugins.digest_of(module) != before
    shutil.rmtree(tmp_path / "packed_law")
