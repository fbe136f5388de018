"""Claims about scenes and overrides of any content: read right, or refused in words that name the place.

Scenes are made by hypothesis: as a tree whose numbers are known, written as TOML in units drawn at random.
"""

from __future__ import annotations

import copy
import json
import math
import random
import re
import signal
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from profiles import LONG, examples

from ballpass.derive import SceneError, derive, generate
from ballpass.derive.reading.read import parse_override, read_scene, scene_from_text, with_values
from ballpass.derive.scene.records import Scene
from ballpass.runtime.export.c_program import export_c

SCENES = Path(__file__).resolve().parents[2] / "scenes"
PRESS = (SCENES / "punching_press.toml").read_text(encoding="utf-8")
ROTOR = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")
NAMES = tuple(sorted(path.stem for path in SCENES.glob("*.toml")))

# --------------------------------------------------------------------------------------------------------- valid scenes

#: Ways to write one SI unit: name, and how many of it make one SI unit, exact as text.
UNITS = {
    "kg": {"kg": 1, "g": 1000},
    "m": {"m": 1, "mm": 1000, "um": 10**6},
    "rad/s": {"rad/s": 1},
    "N": {"N": 1, "mN": 1000},
    "N/m": {"N/m": 1, "mN/m": 1000},
    "N*s/m": {"N*s/m": 1, "mN*s/m": 1000},
    "N/m^1.5": {"N/m^1.5": 1},
    "Pa": {"Pa": 1},
}


def digits(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers of four digits between two bounds: their text in another unit is exact as well."""
    return st.floats(low, high).map(lambda value: float(f"{value:.4g}")).filter(lambda value: low <= value <= high)


@st.composite
def rotors(draw: st.DrawFn) -> dict[str, Any]:
    """A valid scene of a loaded ring: keys as in the file, quantities as (number in SI, SI unit)."""
    balls = draw(st.integers(3, 14))
    ball = draw(digits(1e-3, 2e-2))
    pitch = float(f"{ball / math.sin(math.pi / balls) * draw(st.floats(1.05, 3.0)):.4g}")
    law = draw(st.sampled_from(["none", "one-sided", "one-sided-gated", "two-sided-gated"]))
    damping: dict[str, Any] = {"law": law}
    if law != "none":
        damping["coefficient"] = (draw(digits(0.0, 1e5)), "N*s/m")
    bearing: dict[str, Any] = {
        "balls": balls,
        "ball_diameter": (ball, "m"),
        "pitch_diameter": (pitch, "m"),
        "clearance": (draw(digits(-3e-5, 9e-4)), "m"),
        "damping": damping,
        "inner_ring": {"mass": (draw(digits(1e-3, 1e3)), "kg")},
    }
    if draw(st.booleans()):
        bearing["contact"] = {"stiffness": (draw(digits(1e6, 1e12)), "N/m^1.5")}
    else:
        bearing["contact"] = {
            "inner_groove_radius": (float(f"{0.52 * ball:.4g}"), "m"),
            "outer_groove_radius": (float(f"{0.53 * ball:.4g}"), "m"),
            "young_modulus": (draw(digits(1e10, 5e11)), "Pa"),
            "poisson_ratio": draw(digits(0.0, 0.45)),
        }
    if draw(st.booleans()):
        bearing["outer_ring"] = {"support": "fixed"}
    else:
        bearing["outer_ring"] = {
            "support": "elastic",
            "mass": (draw(digits(1e-3, 1e4)), "kg"),
            "stiffness": (draw(digits(0.0, 1e9)), "N/m"),
            "damping": (draw(digits(0.0, 1e5)), "N*s/m"),
        }
    return {
        "shaft": {"speed": (draw(digits(0.1, 6e3)), "rad/s")},
        "load": {"type": "constant", "force": [(draw(digits(-1e4, 1e4)), "N"), (draw(digits(-1e4, 1e4)), "N")]},
        "bearing": bearing,
        "run": {"cycles": draw(st.integers(1, 100)), "outputs": ["inner.*"]},
    }


def written(value: Any, unit_of: Callable[[str], str], order: Callable[[list[Any]], list[Any]]) -> str:
    """TOML of a tree, in units and an order of keys chosen by the caller."""
    if isinstance(value, tuple):
        number, unit = value
        name = unit_of(unit)
        # exact: the shortest decimal digits, times a power of ten
        mantissa, _, exponent = repr(number).partition("e")
        shift = len(str(UNITS[unit][name])) - 1
        return f'"{mantissa}e{int(exponent or 0) + shift} {name}"'
    if isinstance(value, dict):
        pairs = (f"{key} = {written(item, unit_of, order)}" for key, item in order(list(value.items())))
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(written(item, unit_of, order) for item in value) + "]"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def text_of(tree: dict[str, Any], unit_of: Callable[[str], str], order: Callable[[list[Any]], list[Any]]) -> str:
    return "\n".join(f"{key} = {written(item, unit_of, order)}" for key, item in order(list(tree.items())))


def numbers_of(tree: Any) -> list[float]:
    if isinstance(tree, tuple):
        return [tree[0]]
    items = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else []
    return [number for item in items for number in numbers_of(item)]


@given(tree=rotors(), data=st.data())
@examples(40, 2000)
def test_a_valid_scene_is_read_to_its_numbers_in_any_units_and_any_order(
    tree: dict[str, Any], data: st.DataObject
) -> None:
    plain = scene_from_text(text_of(tree, lambda unit: unit, list), "made")
    other = scene_from_text(
        text_of(
            tree,
            lambda unit: data.draw(st.sampled_from(list(UNITS[unit]))),
            lambda items: data.draw(st.permutations(items)),
        ),
        "made",
    )
    # the decimal digits are exact in the text, so the floats are those of the text
    assert other == plain
    read = {quantity.value for quantity in plain.quantities}
    assert set(numbers_of(tree)) <= read
    assert plain.bearing is not None
    assert plain.bearing.balls == tree["bearing"]["balls"]


@given(tree=rotors())
@examples(4, 40)
def test_a_valid_scene_is_derived_and_its_parameters_are_its_quantities(tree: dict[str, Any]) -> None:
    scene = scene_from_text(text_of(tree, lambda unit: unit, list), "made")
    system = derive(scene)
    assert {p.name: p.default for p in system.parameters} == {q.path: q.value for q in scene.quantities}


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_given_its_own_values_is_itself(name: str) -> None:
    scene = read_scene(SCENES / f"{name}.toml")
    own = {}
    for quantity in scene.quantities:
        unit = "" if quantity.unit == "1" else quantity.unit
        path, value = parse_override(scene, f"{quantity.path}={quantity.value!r} {unit}")
        own[path] = value
    assert with_values(scene, own) == scene


# ------------------------------------------------------------------------------------------------------- mutated scenes

TREES = {name: tomllib.loads((SCENES / f"{name}.toml").read_text(encoding="utf-8")) for name in NAMES}
EVIL = (
    *("__import__('os').system('touch pwned')", "$(touch pwned)", "`touch pwned`", "; touch pwned", "| touch pwned"),
    *(
        "../x",
        "/etc/passwd",
        "..",
        ".",
        "",
        " ",
        "a;b",
        "a b",
        "a/b",
        "a\\b",
        "a\nb",
        "a\0b",
        'a"b',
        "a'b",
        "*/",
        "/*",
        "//",
    ),
    *(
        "#include <x>",
        '*/ #include "x" /*',
        "%s%n",
        "{0}",
        "{title}",
        "${HOME}",
        "${x:-y}",
        "\\input{x}",
        "[bold]x[/bold]",
    ),
    *(
        "\x1b[31m",
        "é",
        "x\u202ey",
        "\u200b",
        "𝒳",
        "i" * 10_000,
        "int",
        "double",
        "for",
        "main",
        "NULL",
        "lambda",
        "None",
    ),
)
NUMBERS = (
    *(0, -1, 1, 2**63, -(2**63), 10**400, 0.0, -0.0, 5e-324, 1e308, -1e308, math.nan, math.inf, -math.inf, True, False),
    *("0", "1e999 m", "-1e999 kg", "nan rpm", "inf N", "1 furlong", "1 m/0", "1 m^1e9", "1e-999 m", "9" * 300 + " mm"),
    *("1 " + "(" * 40 + "m", "1 m" + "*m" * 20, "0x10 m", "1_000 m", "1,5 mm", "½ m", "１ m", "1 K", "1 degC", "1 dB"),
)
JUNK = st.one_of(
    st.sampled_from(EVIL),
    st.sampled_from(NUMBERS),
    st.text(max_size=12),
    st.recursive(
        st.just([]), lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.sampled_from("xyz"), inner)
    ),
    st.sampled_from(EVIL).map(lambda name: {name: {}}),
)


def places(tree: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    pairs = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return [place for key, item in pairs for place in [(*path, key), *places(item, (*path, key))]]


def as_toml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{as_toml(str(key))} = {as_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return (
            '"'
            + "".join(f"\\U{ord(c):08x}" if not c.isalnum() else c for c in value if not 0xD800 <= ord(c) < 0xE000)
            + '"'
        )
    return repr(value)


def read_or_refused(text: str, name: str = "mutant") -> Scene | SceneError:
    """The scene, or the refusal, which names its places, tells what to do, and is as long as people read."""
    try:
        scene = scene_from_text(text, name)
    except SceneError as error:
        message = str(error)
        assert "Traceback" not in message
        assert len(message) < 100_000
        assert "\x1b" not in message
        for fault in error.faults:
            assert fault.problem
            assert fault.remedy
            assert len(fault.render()) < 3000
        return error
    assert all(math.isfinite(quantity.value) for quantity in scene.quantities)
    assert all(re.fullmatch(r"[A-Za-z0-9_.]+", quantity.path) for quantity in scene.quantities)
    return scene


@pytest.mark.long
@given(name=st.sampled_from(NAMES), data=st.data())
@examples(100, 5000)
def test_a_mutated_scene_is_read_or_refused_in_words(name: str, data: st.DataObject) -> None:
    tree = copy.deepcopy(TREES[name])
    for _ in range(data.draw(st.integers(1, 3))):
        found = places(tree)
        if not found:
            break
        path = data.draw(st.sampled_from(found))
        table: Any = tree
        for key in path[:-1]:
            table = table[key]
        kind = data.draw(st.sampled_from(["value", "remove", "rename", "unit"]))
        if kind == "value":
            table[path[-1]] = data.draw(JUNK)
        elif kind == "remove":
            del table[path[-1]]
        elif kind == "rename" and isinstance(table, dict):
            table[data.draw(st.sampled_from(EVIL))] = table.pop(path[-1])
        elif isinstance(table[path[-1]], str):
            number = table[path[-1]].partition(" ")[0]
            table[path[-1]] = (
                f"{number} {data.draw(st.sampled_from(['mm', 'kg', 's', 'rpm', 'N', 'deg', 'Hz', 'N*s/m', '']))}"
            )
    read_or_refused("\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in tree.items()))


#: Faults of which one error makes several, each true by itself: every place that names what is gone, and where
#: something is removed or emptied also keys that are missing, and a linkage that moves.
NAMED = r"there is no |.* has no point"
REPEATED = {"misspell": NAMED, "word": NAMED, "unit": NAMED}


def one_error(rng: random.Random, tree: dict[str, Any]) -> str:
    """Make one mistake somewhere in a scene: something removed or misspelt, a wrong type or unit; say which."""
    path = rng.choice(places(tree))
    table: Any = tree
    for key in path[:-1]:
        table = table[key]
    last, given = path[-1], table[path[-1]]
    kinds = ["remove", "type", *["misspell"] * isinstance(table, dict), *["unit", "word"] * isinstance(given, str)]
    kind = rng.choice(kinds)
    if kind == "remove":
        del table[last]
    elif kind == "misspell":
        at = rng.randrange(len(last))
        new = last[:at] + last[at + 1 :] if len(last) > 4 and rng.random() < 0.5 else f"{last[:at]}x{last[at:]}"
        items = [(new if key == last else key, item) for key, item in table.items()]
        table.clear()
        table.update(items)
    elif kind == "type":
        table[last] = rng.choice([True, 3, 3.5, "text", [], {}])
    else:
        table[last] = given.split(" ")[0] + " rpm" if kind == "unit" else f"{given}x"
    return f"{kind} {'.'.join(map(str, path))}"


def test_one_error_of_a_scene_is_one_fault() -> None:
    """A misspelt table made a fault of every key that names what it holds, a misspelt choice of keys that follow it."""
    rng = random.Random(43)
    single = 0
    for _ in range(400):
        tree = copy.deepcopy(TREES[rng.choice(NAMES)])
        done = one_error(rng, tree)
        found = read_or_refused("\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in tree.items()))
        if isinstance(found, SceneError):
            single += len(found.faults) == 1
            allowed = REPEATED.get(done.split()[0], rf"{NAMED}|this (key|table) is missing|.* mobility")
            others = [fault for fault in found.faults if not re.match(allowed, fault.problem)]
            assert len(found.faults) == 1 or not others, f"{done}\n{found}"
    assert single > 250


@pytest.mark.long
@pytest.mark.parametrize("name", [NAMES[0], *(pytest.param(name, marks=pytest.mark.long) for name in NAMES[1:])])
def test_an_empty_text_is_refused_wherever_a_scene_has_one(name: str) -> None:
    """Empty was taken for a text that is missing and reported: 34 of 428 such scenes ended in StopIteration."""
    for path in places(TREES[name]):
        tree = copy.deepcopy(TREES[name])
        table: Any = tree
        for key in path[:-1]:
            table = table[key]
        if not isinstance(table[path[-1]], str) or path == ("title",):
            continue
        table[path[-1]] = ""
        found = read_or_refused("\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in tree.items()))
        assert isinstance(found, SceneError), path


def test_a_joint_without_bodies_is_one_fault_for_its_bearing_too() -> None:
    tree = copy.deepcopy(TREES["punching_press_hinges"])
    tree["mechanism"]["joints"]["A"]["bodies"] = 5
    found = read_or_refused("\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in tree.items()))
    assert isinstance(found, SceneError)
    assert [fault.key for fault in found.faults] == ["mechanism.joints.A.bodies"]


@given(data=st.data())
@examples(120, 3000)
def test_torn_text_is_read_or_refused_in_words(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from([PRESS, ROTOR]))
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 200)))
    read_or_refused(text[:start] + data.draw(st.text(max_size=6)) + text[end:])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a." * 200_000 + "a = 1", "a key with more than 64 dots"),
        ("[" + "a." * 5000 + "a]", "a key with more than 64 dots"),
        ("x = {" + '"a".' * 5000 + "a = 1}", "a key with more than 64 dots"),
        ("a = " + "9" * 5000, "not TOML"),
        ("a = " + "[" * 100_000, "not TOML"),
        ("a = " + "{a=" * 5000 + "1" + "}" * 5000, "not TOML"),
        ("k" * 1_000_000 + " = 1", "the file describes nothing"),
        ("\n".join(f"k{n} = 1" for n in range(20_000)), "the file describes nothing"),
        ("#" + "'\"" * 1_000_000, "the file is empty"),
        (PRESS.replace("[bearing]\n", "[bearing]\n" + "".join(f"k{n} = 1\n" for n in range(5000))), "unknown key"),
        (PRESS.replace("[mechanism.joints.B]", f"[mechanism.joints.{'B' * 10_000}]"), "this is no name for a joint"),
    ],
    ids=["dots", "header", "inline", "digits", "lists", "tables", "key", "keys", "quotes", "unknown", "name"],
)
def test_texts_made_to_take_long_are_refused_at_once(text: str, words: str) -> None:
    """A key of 200 000 parts once kept the reader for hours; an unknown key of a million letters was printed whole."""

    def too_long(*_: object) -> None:
        raise TimeoutError

    # time of this process on its processor: what else a machine does is not the reader's
    before = signal.signal(signal.SIGPROF, too_long)
    signal.setitimer(signal.ITIMER_PROF, 20.0)
    try:
        with pytest.raises(SceneError) as caught:
            scene_from_text(text, "long")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 100_000


@pytest.mark.parametrize("name", ["\x1b[31m", "a\nb", "i" * 10_000], ids=["escape", "line", "long"])
def test_no_part_of_a_message_carries_what_a_terminal_obeys(name: str) -> None:
    """The remedy named the body that is missing as it stood in the file, with its escape sequences."""
    tree = copy.deepcopy(TREES["punching_press"])
    tree["mechanism"]["joints"]["C"]["bodies"][0] = name
    error = read_or_refused("\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in tree.items()))
    assert isinstance(error, SceneError)
    fault = next(fault for fault in error.faults if "there is no body" in fault.problem)
    assert all(letter.isprintable() for line in fault.render().splitlines() for letter in line)
    assert len(fault.render().splitlines()) == 4


def test_a_message_lists_the_first_hundred_faults_and_counts_the_others() -> None:
    error = read_or_refused(PRESS.replace("[bearing]\n", "[bearing]\n" + "".join(f"k{n} = 1\n" for n in range(250))))
    assert isinstance(error, SceneError)
    assert len(error.faults) == 250
    assert "250 faults" in str(error)
    assert str(error).count("unknown key") == 100
    assert "... and 150 more; correct these first" in str(error)


# ------------------------------------------------------------------------------------------------- a scene file is data


@pytest.mark.parametrize("evil", EVIL)
def test_a_name_that_is_no_name_is_refused_wherever_the_user_chooses_one(evil: str, tmp_path: Path) -> None:
    allowed = re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", evil) is not None
    for table, what in (
        ("bodies.slider", "body"),
        ("joints.C", "joint"),
        ("forces.punch", "force"),
        ("frame.points.guide", "point"),
    ):
        tree = copy.deepcopy(TREES["punching_press"])
        *outer, last = table.split(".")
        holder = tree["mechanism"]
        for key in outer:
            holder = holder[key]
        holder[evil] = holder.pop(last)
        result = read_or_refused("\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in tree.items()))
        named = isinstance(result, SceneError) and any(
            f"this is no name for a {what}" in fault.problem for fault in result.faults
        )
        assert named is not allowed
    result = read_or_refused(PRESS, evil)
    assert isinstance(result, SceneError) is not allowed


@pytest.mark.parametrize("title", [evil for evil in EVIL if evil.isprintable() and 0 < len(evil) <= 200])
def test_any_printable_title_reaches_the_program_as_text(title: str, rotor_model: Callable[[str], Path]) -> None:
    """Into the manifest, the equations and the C of an export, as the very text; no more files than without it."""
    folder = rotor_model(title)
    assert json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["title"] == title
    program = export_c(folder, folder.parent / "program")
    assert not list(folder.parent.rglob("pwned"))
    source = (program / "scene.c").read_text(encoding="utf-8")
    literal = re.search(r'scene_title = "((?:[^"\\\n]|\\[0-7]{3})*)";\n', source)
    assert literal is not None
    plain = re.sub(r"\\([0-7]{3})", lambda match: chr(int(match.group(1), 8)), literal.group(1))
    assert plain.encode("latin-1").decode("utf-8") == title


@pytest.fixture
def rotor_model(rotor: Path) -> Callable[[str], Path]:
    """The folder of the rotor with another title, which is a number of the manifest as others are."""

    def make(title: str) -> Path:
        scene = scene_from_text(f"title = {as_toml(title)}\n" + re.sub(r"(?m)^title = .*$", "", ROTOR), "rotor")
        return generate(scene, rotor)

    return make


WORDS = ("int", "clean", *(("main", "run", "NULL", "all", "Makefile", "stepper", "casadi_real") if LONG else ()))


@pytest.mark.long
@pytest.mark.parametrize("word", WORDS)
def test_words_of_c_and_make_are_names_like_others(word: str, tmp_path: Path) -> None:
    text = PRESS
    for old in ("crank", "rod", "slider", "punch", "guide"):
        text = re.sub(rf"\b{old}\b(?! = \"whole)", f"{word}_{old}" if old != "rod" else word, text)
    text = text.replace(f'{word}_crank = "whole"', 'crank = "whole"').replace(
        'joint = "A"                             # the', 'joint = "A" # the'
    )
    scene = scene_from_text(text, word)
    folder = generate(scene, tmp_path / "generated")
    program = export_c(folder, tmp_path / "program")
    done = subprocess.run(
        ["make", "-s", "CFLAGS=-O0 -std=c99"], cwd=program, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr
    ran = subprocess.run(
        ["make", "-s", "run", "CFLAGS=-O0 -std=c99"],
        cwd=program,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    rows = (program / "out.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) > 100
    subprocess.run(["make", "-s", "clean"], cwd=program, check=True, timeout=300)
    assert (program / "scene.c").exists()
    assert not list(program.glob("*.o"))
