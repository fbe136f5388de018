"""Claims about scene files: what they say is what the record holds, and what is wrong is said, all of it at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import FrozenInstanceError, fields, is_dataclass
from pathlib import Path

import pytest
from scene_texts import PRESS, ROTOR, SCENES, edited

from ballpass.derive.emit.signature import folder_of, source_key
from ballpass.derive.reading.read import parse_override, read_scene, scene_from_text, with_values
from ballpass.derive.scene.bearing_records import EquivalentMass, GivenContact, HertzContact
from ballpass.derive.scene.errors import SceneError
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.records import Scene
from ballpass.derive.scene.shaft_records import HarmonicLoad, TableLoad
from ballpass.derive.scene.units import parse_quantity

FILES = ("punching_press", "punching_press_tangent", "offset_slider", "four_bar", "crank_shaper", "varying_compliance")


def values(scene: Scene) -> dict[str, float]:
    return {quantity.path: quantity.value for quantity in scene.quantities}


def quantities_in(record: object) -> list[SceneNumber]:
    """All quantities of a record, found without the code under test."""
    if isinstance(record, SceneNumber):
        return [record]
    if isinstance(record, tuple):
        return [quantity for item in record for quantity in quantities_in(item)]
    if is_dataclass(record):
        return [quantity for field in fields(record) for quantity in quantities_in(getattr(record, field.name))]
    return []


# ----------------------------------------------------------------------------------------------------- what a file says


@pytest.mark.parametrize("name", FILES)
def test_every_shipped_scene_can_be_read(name: str) -> None:
    scene = read_scene(SCENES / f"{name}.toml")
    assert scene.name == name
    assert scene == read_scene(str(SCENES / f"{name}.toml"))
    assert scene.title
    assert all(math.isfinite(quantity.value) for quantity in scene.quantities)


@pytest.mark.parametrize("name", FILES)
def test_every_number_of_a_record_is_listed_once_and_is_the_same_object(name: str) -> None:
    scene = read_scene(SCENES / f"{name}.toml")
    found = quantities_in((scene.mechanism, scene.shaft, scene.loads, scene.bearing))
    assert [id(quantity) for quantity in found] == [id(quantity) for quantity in scene.quantities]
    assert len({quantity.path for quantity in found}) == len(found)
    assert len({quantity.latex for quantity in found}) == len(found), "two quantities share a symbol"
    for quantity in found:
        assert quantity.latex
        assert quantity.description[0].isupper() or quantity.description[0] in "xy"


def test_the_press_holds_the_papers_data_in_si() -> None:
    """Section 4 of the paper, converted by hand."""
    scene = read_scene(SCENES / "punching_press.toml")
    paper = {
        "mechanism.driver.speed": 500 * 2 * math.pi / 60,
        "mechanism.bodies.crank.mass": 0.3567,
        "mechanism.bodies.crank.inertia": 6.117e-4,
        "mechanism.bodies.crank.points.B": 0.006,
        "mechanism.bodies.crank.center_of_mass.distance": 0.0,
        "mechanism.bodies.crank.center_of_mass.angle": 0.0,
        "mechanism.bodies.rod.mass": 2.55,
        "mechanism.bodies.rod.inertia": 7.517545e-3,
        "mechanism.bodies.rod.points.C": 0.1,
        "mechanism.bodies.rod.center_of_mass": 0.05,
        "mechanism.bodies.slider.mass": 16.7965,
        "mechanism.forces.punch.force.x": 0.0,
        "mechanism.forces.punch.force.y": 8964.8,
        "mechanism.forces.punch.window.start": math.radians(237),
        "mechanism.forces.punch.window.end": math.radians(267),
        "bearing.share": 0.5,
        "bearing.clearance": 1e-5,
        "bearing.ball_angle": 0.0,
        "bearing.damping.ratio": 0.25e-5 * math.sqrt(1e-3),
        "bearing.outer_ring.mass": 0.555,
    }
    held = values(scene)
    for path, value in paper.items():
        assert held[path] == pytest.approx(value, rel=1e-15, abs=0.0), path
    assert scene.bearing is not None
    assert scene.bearing.balls == 8
    assert isinstance(scene.bearing.contact, HertzContact)
    assert isinstance(scene.bearing.inner.mass, EquivalentMass)
    assert scene.bearing.inner.mass.crank == "whole"
    assert scene.mechanism is not None
    joint = scene.mechanism.joint("D")
    assert (joint.kind, joint.bodies, joint.points) == ("prismatic", ("frame", "slider"), ("guide", "C"))


def test_the_two_presses_differ_in_damping_and_in_nothing_else() -> None:
    one, other = (read_scene(SCENES / f"{name}.toml") for name in ("punching_press", "punching_press_tangent"))
    first, second = values(one), values(other)
    first.pop("bearing.damping.ratio")
    second.pop("bearing.damping.ratio")
    assert first == second
    assert (one.mechanism, one.run, one.outputs) == (other.mechanism, other.run, other.outputs)


def test_varying_compliance_runs_at_a_ball_pass_frequency_of_20_hz() -> None:
    """8 balls times the cage ratio (1 - D_w/D_pw)/2 times the shaft's frequency."""
    held = values(read_scene(SCENES / "varying_compliance.toml"))
    cage = (1 - held["bearing.ball_diameter"] / held["bearing.pitch_diameter"]) / 2
    assert 8 * cage * held["shaft.speed"] / (2 * math.pi) == pytest.approx(20.0, rel=1e-11)


def test_a_fixed_outer_ring_has_no_quantities() -> None:
    scene = read_scene(SCENES / "varying_compliance.toml")
    assert scene.bearing is not None
    assert scene.bearing.outer is None
    assert len(scene.bearing.initial.position) == len(scene.bearing.initial.velocity) == 2
    assert isinstance(scene.bearing.contact, GivenContact)
    assert not any("outer" in quantity.path for quantity in scene.quantities)


@pytest.mark.parametrize("name", ["four_bar", "offset_slider"])
def test_defaults_stand_for_what_a_file_leaves_out(name: str) -> None:
    scene = read_scene(SCENES / f"{name}.toml")
    held = values(scene)
    assert held["bearing.initial.inner.x"] == held["bearing.initial.outer_velocity.y"] == 0.0
    assert scene.run.samples_per_cycle == 2000
    assert scene.run.method == "auto"
    assert scene.run.rtol == 1e-6


def test_the_form_of_a_vector_decides_its_paths() -> None:
    held = values(read_scene(SCENES / "offset_slider.toml"))
    assert held["mechanism.frame.points.guide.x"] == 0.004
    assert held["mechanism.frame.points.guide.y"] == -0.09
    assert held["mechanism.bodies.crank.center_of_mass.angle"] == pytest.approx(math.radians(150))
    assert held["mechanism.bodies.rod.points.C"] == 0.095
    assert held["mechanism.forces.tool.force.magnitude"] == 3500.0
    assert held["mechanism.forces.tool.force.direction"] == pytest.approx(math.radians(85))
    assert not any(path.startswith("mechanism.bodies.crank.points.A") for path in held)


def test_several_windows_are_counted_from_one() -> None:
    text = edited(PRESS, 'window = { start = "237 deg", end = "267 deg" }', WINDOWS)
    held = values(scene_from_text(text, "press"))
    assert held["mechanism.forces.punch.window.1.end"] == pytest.approx(math.radians(20))
    assert held["mechanism.forces.punch.window.2.start"] == pytest.approx(math.radians(237))


WINDOWS = """window = [
    { start = "350 deg", end = "20 deg" },   # through zero
    { start = "237 deg", end = "267 deg" },
]"""


def test_loads_without_a_mechanism() -> None:
    constant = ROTOR[ROTOR.index('type = "constant"') : ROTOR.index("[bearing]")]
    harmonic = """type = "harmonic"
mean = ["196 N", "0 N"]
amplitude = { magnitude = "20 N", direction = "90 deg" }
frequency = "50 Hz"
phase = "0 deg"
"""
    scene = scene_from_text(edited(ROTOR, constant, harmonic), "rotor")
    assert isinstance(scene.loads[0].law, HarmonicLoad)
    assert scene.loads[0].law.frequency.value == 50.0
    table = """type = "table"
time = { values = [0, 1.5, 4], unit = "ms" }
x = ["0 N", "1 kN", "0 N"]
y = { values = [0, 0.5, 0], unit = "kN" }
"""
    scene = scene_from_text(edited(ROTOR, constant, table), "rotor")
    held = scene.loads[0].law
    assert isinstance(held, TableLoad)
    assert [quantity.value for quantity in held.rows] == [0.0, 0.0015, 0.004]
    assert [quantity.value for quantity in held.x] == [0.0, 1000.0, 0.0]
    assert [quantity.value for quantity in held.y] == [0.0, 500.0, 0.0]
    assert held.rows[1].path == "load.time.2"


def test_clearance_may_be_zero_or_preload() -> None:
    for clearance in ("0 um", "-3 um"):
        text = edited(PRESS, 'clearance = "10 um"', f'clearance = "{clearance}"')
        assert values(scene_from_text(text, "press"))["bearing.clearance"] == parse_quantity(clearance, "m")


def test_a_scene_cannot_be_changed_in_place() -> None:
    scene = read_scene(SCENES / "four_bar.toml")
    with pytest.raises(FrozenInstanceError):
        scene.title = "other"  # type: ignore[misc]


def test_the_structure_of_a_scene_knows_no_numbers() -> None:
    """Law 1: changing a number never changes what is compiled; another ball count does."""
    scene = scene_from_text(PRESS, "press")
    heavier = scene_from_text(edited(PRESS, '"0.3567 kg"', '"0.4 kg"'), "press")
    longer = scene_from_text(edited(PRESS, "cycles = 4", "cycles = 5"), "press")
    fewer = scene_from_text(edited(PRESS, "balls = 8", "balls = 7"), "press")
    assert scene.structure() == heavier.structure() == longer.structure()
    assert scene.structure() != fewer.structure()
    assert scene != heavier


# --------------------------------------------------------------------------------------------------------- other values


def test_an_override_is_what_the_file_would_have_said() -> None:
    scene = scene_from_text(PRESS, "press")
    path, value = parse_override(scene, " bearing.clearance = 20 um ")
    changed = with_values(scene, {path: value})
    assert changed == scene_from_text(edited(PRESS, 'clearance = "10 um"', 'clearance = "20 um"'), "press")
    assert changed.structure() == scene.structure()
    assert [id(q) for q in quantities_in((changed.mechanism, changed.bearings))] == [id(q) for q in changed.quantities]
    assert with_values(scene, {}) == scene


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("bearing.clearanc=20 um", "bearing.clearanc", 'did you mean "bearing.clearance"?'),
        ("clearance=20 um", "clearance", "bearing.clearance"),
        ("mechanism.bodies.crank.points.C=1 mm", "mechanism.bodies.crank.points.C", "mechanism.bodies.crank.points.B"),
        ("bearing.clearance=20", "bearing.clearance", "add the unit"),
        ("bearing.clearance=20 kg", "bearing.clearance", "SI: m"),
        ("bearing.clearance=", "bearing.clearance", "write a number"),
        ("bearing.clearance", "bearing.clearance", "PATH=VALUE"),
        ("bearing.clearance=nan um", "bearing.clearance", "finite"),
        ("bearing.balls=9", "bearing.balls", "derive the model again"),
        ("run.cycles=9", "run.cycles", "scene file"),
        ("=", "", "such as"),
    ],
)
def test_a_wrong_override_is_refused(text: str, key: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        parse_override(scene_from_text(PRESS, "press"), text)
    assert caught.value.faults[0].key == key
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("mechanism.bodies.crank.mass", 0.0, "has a mass"),
        ("bearing.pitch_diameter", 0.001, "check both"),
        ("bearing.pitch_diameter", 0.02, "do not fit"),
        ("bearing.contact.poisson_ratio", 0.5, "0.3"),
        ("mechanism.driver.speed", 0.0, "duration"),
        ("mechanism.forces.punch.window.end", math.radians(237), "always acts"),
        ("bearing.clearance", math.nan, "finite"),
        ("bearing.clearance", math.inf, "finite"),
        ("bearing.clearence", 1e-5, 'did you mean "bearing.clearance"?'),
    ],
)
def test_other_values_meet_the_checks_of_a_file(path: str, value: float, words: str) -> None:
    with pytest.raises(SceneError, match="fault") as caught:
        with_values(scene_from_text(PRESS, "press"), {path: value})
    assert words in str(caught.value)


def test_all_faults_of_other_values_are_raised_together() -> None:
    bad = {"mechanism.bodies.crank.mass": -1.0, "bearing.ball_diameter": 0.0, "bearing.contact.poisson_ratio": 2.0}
    with pytest.raises(SceneError) as caught:
        with_values(scene_from_text(PRESS, "press"), bad)
    assert [fault.key for fault in caught.value.faults] == [
        "mechanism.bodies.crank.mass",
        "bearing.ball_diameter",
        "bearing.contact.poisson_ratio",
    ]


CUT = """[mechanism.forces.cut]
body = "slider"
point = "C"
direction = "90 deg"
table = {{ angle = {angle}, force = {force} }}
"""


def press_with_cut(scene_text: Callable[..., str], angle: str, force: str) -> str:
    return scene_text("punching_press", ("[bearing]\n", CUT.format(angle=angle, force=force) + "[bearing]\n"))


def test_columns_of_a_csv_file_are_the_numbers_in_it(scene_text: Callable[..., str], tmp_path: Path) -> None:
    pairs = (("a", "deg"), ("F", "kN"))
    columns = [f'{{ file = "cut.csv", column = "{name}", unit = "{unit}" }}' for name, unit in pairs]
    place = tmp_path / "press.toml"
    place.write_text(press_with_cut(scene_text, *columns), encoding="utf-8")
    (tmp_path / "cut.csv").write_text("# measured\na, t, F\n230, 0, 0\n250, 1, 9.5\n267, 2, 0\n", encoding="utf-8")
    read = read_scene(place)
    lists = ('["230 deg", "250 deg", "267 deg"]', '["0 kN", "9.5 kN", "0 kN"]')
    written = scene_from_text(press_with_cut(scene_text, *lists), "press")
    assert [(q.path, q.value, q.unit) for q in read.quantities] == [
        (q.path, q.value, q.unit) for q in written.quantities
    ]
    before = source_key(place)
    (tmp_path / "cut.csv").write_text("a, F\n230, 0\n250, 9.6\n267, 0\n", encoding="utf-8")
    assert source_key(place) != before


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "the file cannot be read"),
        ("a, f\n1, 2\n", "has no such column"),
        ("a, F\n230, 1\n240, 1 kN\n", 'line 3 of cut.csv has no number in the column "F"'),
        ("a, F\n230, 1\n240,\n", "line 3 of cut.csv has no number there"),
        ("a, F [N]\n230, 1\n240, 2\n", "different units"),
    ],
)
def test_a_csv_file_without_the_column_is_refused(
    scene_text: Callable[..., str], tmp_path: Path, content: str | None, words: str
) -> None:
    place = tmp_path / "press.toml"
    column = '{ file = "cut.csv", column = "F", unit = "kN" }'
    place.write_text(press_with_cut(scene_text, '["230 deg", "240 deg"]', column), encoding="utf-8")
    if content is not None:
        (tmp_path / "cut.csv").write_text(content, encoding="utf-8")
    with pytest.raises(SceneError, match=words) as caught:
        read_scene(place)
    assert all(fault.line for fault in caught.value.faults)


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("my-press", "my_press"),
        ("my press", "my_press"),
        ("2nd", "scene_2nd"),
        ("Prüfung", "Pruefung"),
        ("café", "cafe"),
        ("机", "scene_"),
    ],
)
def test_a_file_of_any_name_is_a_scene(tmp_path: Path, file: str, name: str) -> None:
    """The name in code is mapped; folders have the name of the file, so that two files never share one."""
    path = tmp_path / f"{file}.toml"
    path.write_text(PRESS, encoding="utf-8")
    assert read_scene(path).name == name
    assert folder_of(path).name == file
