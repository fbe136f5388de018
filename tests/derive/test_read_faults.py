"""Claims about wrong scene files: every fault is found, names its key and line, and says what to do.

Each case is an edit of a shipped scene.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from scene_texts import PRESS, ROTOR, SCENES, edited

from ballpass.derive.reading.read import read_scene, scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.derive.system import derive
from ballpass.runtime.contract.errors import BallpassError

SPRING_ON_A_HINGE = """
[mechanism.springs.s]
bodies = ["crank", "rod"]
points = ["B", "B"]
stiffness = "1 N/mm"
free_length = "10 mm"
"""


def faults(text: str, name: str = "press") -> SceneError:
    with pytest.raises(SceneError) as caught:
        scene_from_text(text, name)
    for fault in caught.value.faults:
        assert fault.problem
        assert fault.remedy
        assert fault.render() in str(caught.value)
        assert "Traceback" not in str(caught.value)
    return caught.value


#: Edits of the press: old text, new text, key of the one fault, a part of its remedy.
REFUSED = [
    ('mass = "2.55 kg"', "", "mechanism.bodies.rod.mass", 'add mass = "0.36 kg"'),
    ('title = "P', 'titel = "P', "titel", 'did you mean "title"?'),
    ("[bearing.initial]", "[bearing.inital]", "bearing.inital", 'did you mean "initial"?'),
    ('start = "237 deg"', 'begin = "1 deg", start = "237 deg"', "mechanism.forces.punch.window.begin", "delete it"),
    ('clearance = "10 um"', "clearance = 10", "bearing.clearance", "10 <unit>"),
    ('clearance = "10 um"', 'clearance = "10"', "bearing.clearance", 'as in "6 mm"'),
    ('mass = "2.55 kg"', 'mass = "2.55 mm"', "mechanism.bodies.rod.mass", "SI: kg"),
    ('speed = "500 rpm"', 'speed = "8 Hz"', "mechanism.driver.speed", "rpm"),
    ('mass = "2.55 kg"', 'mass = "nan kg"', "mechanism.bodies.rod.mass", "finite"),
    ('stiffness = "5e7 N/m"', 'stiffness = "inf N/m"', "bearing.outer_ring.stiffness", "finite"),
    ("share = 0.5", "share = nan", "bearing.share", "finite"),
    ('mass = "2.55 kg"', "mass = { a = 1 }", "mechanism.bodies.rod.mass", '"0.36 kg"'),
    ('"0.3567 kg"', '"-0.3567 kg"', "mechanism.bodies.crank.mass", "has a mass"),
    ('"0.3567 kg"', '"0 kg"', "mechanism.bodies.crank.mass", "has a mass"),
    ('"7517.545 kg*mm^2"', '"0 kg*mm^2"', "mechanism.bodies.rod.inertia", "delete the key"),
    ('B = "6 mm"', 'B = "0 mm"', "mechanism.bodies.crank.points.B", "positive length"),
    ('B = "6 mm"', 'B = "-6 mm"', "mechanism.bodies.crank.points.B", "[x, y]"),
    ('distance = "0 mm"', 'distance = "-1 mm"', "mechanism.bodies.crank.center_of_mass.distance", "180 deg"),
    ('"7.9375 mm"', '"0 mm"', "bearing.ball_diameter", "positive"),
    ('"33.5 mm"', '"-33.5 mm"', "bearing.pitch_diameter", "positive"),
    ('"33.5 mm"', '"7 mm"', "bearing.pitch_diameter", "check both"),
    ("balls = 8 ", "balls = 14 ", "bearing.balls", "check ball count"),
    ("balls = 8 ", "balls = 2 ", "bearing.balls", "balls = 8"),
    ("balls = 8 ", "balls = 8.5 ", "bearing.balls", "balls = 8"),
    ("balls = 8 ", 'balls = "8" ', "bearing.balls", "balls = 8"),
    ("balls = 8 ", "balls = true ", "bearing.balls", "balls = 8"),
    ('"4.1275 mm"', '"3.96 mm"', "bearing.contact.inner_groove_radius", "0.51 to 0.54"),
    ('"4.206875 mm"', '"3.96875 mm"', "bearing.contact.outer_groove_radius", "0.51 to 0.54"),
    ('"207 GPa"', '"0 GPa"', "bearing.contact.young_modulus", "positive"),
    ("poisson_ratio = 0.3", "poisson_ratio = 0.5", "bearing.contact.poisson_ratio", "0.3"),
    ("poisson_ratio = 0.3", "poisson_ratio = -1.0", "bearing.contact.poisson_ratio", "0.3"),
    ('"0.555 kg"', '"0 kg"', "bearing.outer_ring.mass", "fixed"),
    ('"5e7 N/m"', '"-5e7 N/m"', "bearing.outer_ring.stiffness", "zero or a positive"),
    ('"500 N*s/m"', '"-500 N*s/m"', "bearing.outer_ring.damping", "zero or a positive"),
    ('"0.032 kg"', '"0 kg"', "bearing.inner_ring.equivalent_mass.ring", "positive"),
    ('"0.05 kg"', '"-0.05 kg"', "bearing.inner_ring.equivalent_mass.crankpin", "zero or a positive"),
    ('crank = "whole"', 'crank = "third"', "bearing.inner_ring.equivalent_mass.crank", '"whole"'),
    ('["crank", "rod"]', '["crank", "rodd"]', "mechanism.joints.B.bodies", 'did you mean "rod"?'),
    ('["guide", "C"]', '["guid", "C"]', "mechanism.joints.D.points", 'did you mean "guide"?'),
    ('["crank", "rod"]', '["crank", "crank"]', "mechanism.joints.B.bodies", "other body"),
    ('["crank", "rod"]', '["crank", "rod", "slider"]', "mechanism.joints.B.bodies", "write bodies ="),
    ('type = "prismatic"', 'type = "prismatc"', "mechanism.joints.D.type", '"prismatic"'),
    ('direction = "270 deg"', "", "mechanism.joints.D.direction", 'direction = "270 deg"'),
    (
        "[mechanism.forces.punch]",
        '[mechanism.torques.punch]\nbody = "rod"\ntorque = "1 N*m"\n\n[mechanism.forces.punch]',
        "mechanism.torques.punch",
        "rename",
    ),
    ('branch = "ahead"', 'branch = "before"', "mechanism.joints.C.branch", "branch"),
    ('joint = "A"                             # the', 'joint = "Q" # the', "mechanism.driver.joint", "name one"),
    ('joint = "A"                             # the', 'joint = "D" # the', "mechanism.driver.joint", "motor"),
    (
        'joint = "A"                             # the',
        'joint = "B" # the',
        "mechanism.driver.joint",
        "joint of the frame",
    ),
    ('joint = "A"\nshare', 'joint = "AA"\nshare', "bearing.joint", 'did you mean "A"?'),
    ('joint = "A"\nshare', 'joint = "B"\nshare', "bearing.joint", 'write joint = "A"'),
    ('joint = "A"\nshare', "share", "bearing.joint", 'add joint = "A"'),
    ("share = 0.5", "", "bearing", "add share = 0.5"),
    ("[mechanism.forces.punch]", "[mechanism.forces.p-1]", "mechanism.forces.p-1", "rename the force"),
    ('body = "slider"', 'body = "slidr"', "mechanism.forces.punch.body", 'did you mean "slider"?'),
    ('body = "slider"', 'body = "frame"', "mechanism.forces.punch.body", "moving body"),
    ('point = "C"', 'point = "tip"', "mechanism.forces.punch.point", "mechanism.bodies.slider.points"),
    ('force = ["0 N", "8964.8 N"]', 'force = "8964.8 N"', "mechanism.forces.punch.force", "x and y"),
    ('force = ["0 N", "8964.8 N"]', 'force = ["0 N", "1 N", "2 N"]', "mechanism.forces.punch.force", "x and y"),
    (', end = "267 deg"', "", "mechanism.forces.punch.window.end", 'add end = "267 deg"'),
    ('end = "267 deg"', 'end = "237 deg"', "mechanism.forces.punch.window.end", "always acts"),
    ('end = "267 deg"', 'end = "597 deg"', "mechanism.forces.punch.window.end", "always acts"),
    ('window = { start = "237 deg", end = "267 deg" }', "window = []", "mechanism.forces.punch.window", "always acts"),
    ('law = "one-sided"\n', 'law = "onesided"\n', "bearing.damping.law", 'did you mean "one-sided"'),
    ('ratio = "0.25e-5 s*mm^0.5"', "", "bearing.damping", "add coefficient"),
    (
        'ratio = "0.25e-5 s*mm^0.5"',
        'ratio = "0.25e-5 s*mm^0.5"\ncoefficient = "683 N*s/m"',
        "bearing.damping",
        "delete one",
    ),
    ('ratio = "0.25e-5 s*mm^0.5"', 'ratio = "0.25e-5 s"', "bearing.damping.ratio", '"0.25e-5 s*mm^0.5"'),
    ('law = "one-sided"\n', 'law = "tangent"\n', "bearing.damping.ratio", '"0.25e-5 s"'),
    ('law = "one-sided"\n', 'law = "none"\n', "bearing.damping.ratio", "delete the key"),
    ('"0.25e-5 s*mm^0.5"\n\n', '"-1e-5 s*mm^0.5"\n\n', "bearing.damping.ratio", "zero or a positive"),
    (
        'young_modulus = "207 GPa"',
        'stiffness = "8e9 N/m^1.5"\nyoung_modulus = "207 GPa"',
        "bearing.contact.stiffness",
        "delete stiffness",
    ),
    ('young_modulus = "207 GPa"', "", "bearing.contact.young_modulus", "207 GPa"),
    (
        "[bearing.inner_ring.equivalent_mass]",
        '[bearing.inner_ring]\nmass = "1 kg"\n[bearing.inner_ring.equivalent_mass]',
        "bearing.inner_ring",
        "delete one",
    ),
    ('inner = ["0 um", "0 um"]', 'inner = ["0 um"]', "bearing.initial.inner", "write inner"),
    ('inner = ["0 um", "0 um"]', 'inner = ["0 um", "1 deg"]', "bearing.initial.inner.y", "SI: m"),
    ("cycles = 4 ", 'duration = "1 s"\ncycles = 4 ', "run", "delete one"),
    ("cycles = 4 ", "cycles = 0 ", "run.cycles", "positive"),
    ('speed = "500 rpm"', 'speed = "0 rpm"', "run.cycles", "duration"),
    ("transient_cycles = 2", "transient_cycles = 4", "run.transient_cycles", "run longer"),
    ("transient_cycles = 2", "transient_cycles = -1", "run.transient_cycles", "write 0"),
    ("cycles = 4 ", 'duration = "0.2 s" ', "run.transient_cycles", "run longer"),
    ("samples_per_cycle = 2000", "samples_per_cycle = 15", "run.samples_per_cycle", "2000"),
    ("samples_per_cycle = 2000", "samples_per_cycle = 1000001", "run.samples_per_cycle", "2000"),
    ('method = "auto"', 'method = "leapfrog"', "run.method", 'method = "auto"'),
    ("rtol = 1e-6", "rtol = 0.5", "run.rtol", "1e-6"),
    ("rtol = 1e-6", "rtol = 1e-16", "run.rtol", "1e-6"),
    ('"drive_torque"]', '""]', "run.outputs", "delete the entry"),
    ('"drive_torque"]', "3]", "run.outputs", "delete the entry"),
    (
        'outputs = ["inner.*", "outer.*", "ball.*", "reaction.A.*", "drive_torque"]',
        'outputs = "inner.*"',
        "run.outputs",
        "write outputs = [",
    ),
    ("[run]", '[shaft]\nspeed = "1 rpm"\n[run]', "shaft", "delete [shaft]"),
    ('title = "P', 'title = "a\\nP', "title", "shorten"),
    ('gravity = "9.81 m/s^2"', 'gravity = "9.81"', "mechanism.gravity", "9.81 m/s^2"),
    ('center_of_mass = "50 mm"', "center_of_mass = true", "mechanism.bodies.rod.center_of_mass", "6 mm"),
]

#: The same where two lines contradict each other, or one misspelt key is missing as well.
CONTRADICTING = [
    ('mass = "2.55 kg"', 'mas = "2.55 kg"', "mechanism.bodies.rod.mas", 'did you mean "mass"?'),
    ("rtol = 1e-6", "tol = 1e-6", "run.tol", 'did you mean "rtol"?'),
    ("[bearing.initial]", "[bearing]\ninitial = 3\n[bearing.x]", "", "quotes"),
    (
        'points = { B = "origin", C = "100 mm" }',
        'points = { E = "origin", C = "100 mm" }',
        "mechanism.joints.B.points",
        "[mechanism.bodies.rod.points]",
    ),
    ('branch = "ahead"', 'direction = "0 deg"', "mechanism.joints.C.direction", "delete the key"),
    ('["frame", "crank"]', '["crank", "frame"]', "mechanism.driver.joint", 'bodies = ["frame", "crank"]'),
    ("[mechanism.bodies.slider]", '[mechanism.bodies."a b"]', "mechanism.bodies.a b", "rename the body"),
    ("[mechanism.bodies.slider]", "[mechanism.bodies.frame]", "mechanism.bodies.frame", "another name"),
    ('C = "100 mm"', '"1C" = "100 mm"', "mechanism.bodies.rod.points.1C", "rename the point"),
    ("[mechanism.joints.B]", f"[mechanism.joints.B{'b' * 64}]", f"mechanism.joints.B{'b' * 64}", "rename"),
    (
        'law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"',
        'law = "tangent"\ncoefficient = "683 N*s/m"',
        "bearing.damping.coefficient",
        'ratio = "0.25e-5 s"',
    ),
    ('support = "elastic"', 'support = "fixed"', "bearing.outer_ring.mass", 'support = "elastic"'),
    ('support = "elastic"', 'support = "rubber"', "bearing.outer_ring.support", '"elastic"'),
]


#: Edits of the scene without a mechanism.
REFUSED_ROTOR = [
    ("[bearing]\n", '[bearing]\njoint = "A"\n', "bearing.joint", "delete the key"),
    ('[load]\ntype = "constant"', '[weight]\ntype = "constant"', "load", "add the table [load]"),
    ("[shaft]", "[motor]", "shaft", "add the table [shaft]"),
    ('type = "constant"', 'type = "constnt"', "load.type", 'did you mean "constant"?'),
    ('type = "constant"', 'type = "harmonic"', "load.frequency", "50 Hz"),
    (
        'mass = "20 kg"',
        'equivalent_mass = { ring = "1 kg", crankpin = "0 kg", crank = "half" }',
        "bearing.inner_ring.equivalent_mass",
        "0.4 kg",
    ),
    ('mass = "20 kg"', "", "bearing.inner_ring", "add mass"),
    ('stiffness = "13.34e9 N/m^1.5"', "", "bearing.contact", "stiffness ="),
    ('"13.34e9 N/m^1.5"', '"0 N/m^1.5"', "bearing.contact.stiffness", "positive"),
    ('"13.34e9 N/m^1.5"', '"13.34e9 N/m"', "bearing.contact.stiffness", "N/m^1.5"),
    ('"200 N*s/m"', '"-200 N*s/m"', "bearing.inner_ring.damping", "zero or a positive"),
    ("[bearing.initial]", '[bearing.initial]\nouter = ["1 um", "0 um"]', "bearing.initial.outer", "elastic"),
    ('"393.1540342298 rpm"', '"0 rpm"', "run.cycles", 'duration = "0.5 s"'),
    ('type = "constant"', 'type = "table"\ntime = ["0 s"]\nx = ["0 N"]\ny = ["0 N"]', "load.time", "add rows"),
    (
        'type = "constant"',
        'type = "table"\ntime = ["0 s", "1 s"]\nx = ["0 N"]\ny = ["0 N", "0 N"]',
        "load",
        "every row",
    ),
    (
        'type = "constant"',
        'type = "table"\ntime = ["1 s", "1 s"]\nx = ["0 N", "0 N"]\ny = ["0 N", "0 N"]',
        "load.time.2",
        "sort",
    ),
    (
        'type = "constant"',
        'type = "table"\ntime = "load.csv"\nx = ["0 N"]\ny = ["0 N"]',
        "load.time",
        "one value for each row",
    ),
]


@pytest.mark.parametrize(
    ("scene", "case"),
    [*(("press", case) for case in (*REFUSED, *CONTRADICTING)), *(("rotor", case) for case in REFUSED_ROTOR)],
    ids=lambda value: value if isinstance(value, str) else value[2],  # the key
)
def test_a_wrong_scene_is_refused_with_key_and_remedy(scene: str, case: tuple[str, str, str, str]) -> None:
    old, new, key, remedy = case
    error = faults(edited({"press": PRESS, "rotor": ROTOR}[scene], old, new))
    hits = [fault for fault in error.faults if fault.key == key]
    assert hits, f"no fault at {key!r} in\n{error}"
    assert any(remedy in fault.remedy for fault in hits), str(error)
    assert len(error.faults) == 1 or case not in REFUSED, str(error)


@pytest.mark.parametrize("name", ["reaction", "body", "spring", "torsion_spring", "friction", "stop", "load", "phase"])
def test_a_bearing_is_not_named_like_a_group_of_outputs(name: str) -> None:
    error = faults(PRESS.replace("[bearing", f"[bearings.{name}"))
    assert [fault.key for fault in error.faults] == [f"bearings.{name}"]
    assert "another name" in error.faults[0].remedy


def test_all_faults_of_a_file_are_raised_together() -> None:
    text = edited(PRESS, '"0.3567 kg"', '"-0.3567 kg"')
    text = edited(text, 'clearance = "10 um"', "clearance = 10")
    text = edited(text, 'method = "auto"', 'metod = "auto"')
    error = faults(text)
    assert [fault.key for fault in error.faults] == ["mechanism.bodies.crank.mass", "bearing.clearance", "run.metod"]
    assert "3 faults" in str(error)
    lines = text.splitlines()
    for fault, start in zip(error.faults, ["mass", "clearance", "metod"], strict=True):
        assert fault.line is not None
        assert lines[fault.line - 1].startswith(start)


@pytest.mark.parametrize(
    ("old", "new", "start"),
    [
        ('mass = "2.55 kg"', 'mass = "2.55 m"', 'mass = "2.55 m"'),
        ('mass = "16.7965 kg"', 'mass = "0 kg"', 'mass = "0 kg"'),
        ('end = "267 deg"', 'end = "267 m"', "window ="),
        ('speed = "500 rpm"', "", "[mechanism.driver]"),
        ('law = "one-sided"\n', 'law = "x"\n', 'law = "x"'),
        ("[bearing.initial]", "[bearing.inital]", "[bearing.inital]"),
        (
            '[mechanism.driver]\njoint = "A" ',
            'driver.start_angle = "1 m"\n[[ignored]]\nx = 1\n[mechanism.driver_]\njoint = "A" ',
            "driver.start_angle",
        ),
        (
            'outputs = ["inner.*"',
            'notes = """a " mark\n[bearing]\nrtol = 3\n"""\nlist = [\n  ["x"],\n  ["r"],\n]\noutputs = ["inner.*", 4',
            'outputs = ["inner.*", 4',
        ),
    ],
)
def test_a_fault_names_its_line(old: str, new: str, start: str) -> None:
    text = edited(PRESS, old, new)
    error = faults(text)
    named = [text.splitlines()[fault.line - 1] for fault in error.faults if fault.line is not None]
    assert any(line.startswith(start) for line in named), str(error)


def test_arrays_of_tables_are_found_by_their_number() -> None:
    text = edited(PRESS, 'window = { start = "237 deg", end = "267 deg" }', "")
    text += """
[[mechanism.forces.punch.window]]
start = "0 deg"
end = "10 deg"
[[mechanism.forces.punch.window]]
start = "20 deg"
end = "30 m"
"""
    error = faults(text)
    (fault,) = error.faults
    assert fault.key == "mechanism.forces.punch.window.2.end"
    assert fault.line is not None
    assert text.splitlines()[fault.line - 1] == 'end = "30 m"'


@pytest.mark.parametrize(
    ("text", "problem", "line"),
    [
        ("", "empty", None),
        ("# nothing\n", "empty", None),
        ('title = "x"\n', "describes nothing", None),
        ("a = 1\nb = = 2\n", "not TOML", 2),
        ('[bearing]\nclearance = "10 um\n', "not TOML", 2),
        ("[run]\n[run]\n", "not TOML", 2),
        ("a = " + "[" * 3000, "not TOML", 1),
        ("a = " + "9" * 5000, "not TOML", 1),
        ("\x00", "not TOML", 1),
        ("# one line to TOML: \u2028\x85\nb = = 2\n", "not TOML", 2),
        ("bearing.clearance" + ".a" * 60 + " = 1", "is missing", None),
        ("bearing.clearance" + ".a" * 60 + " = 1", "a table instead of a length", 1),
        ("bearing.clearance" + ".a" * 5000 + " = 1", "a key with more than 64 dots", 1),
    ],
)
def test_a_text_that_is_no_scene_is_refused(text: str, problem: str, line: int | None) -> None:
    error = faults(text)
    assert any(problem in fault.problem and fault.line == line for fault in error.faults), str(error)


def test_a_scene_describes_a_mechanism_or_a_bearing() -> None:
    error = faults('[load]\ntype = "constant"\n[run]\ncycles = 4\noutputs = ["x"]\n')
    (fault,) = error.faults
    assert "neither a mechanism nor a bearing" in fault.problem
    assert "[load]" in fault.remedy


@pytest.mark.parametrize("name", ["1press", "my press", "", "a" * 65, "press-2", "frame", "../x", "préss"])
def test_a_scene_has_a_name_that_files_and_code_can_bear(name: str) -> None:
    error = faults(PRESS, name)
    assert any("rename the scene" in fault.remedy or "another name" in fault.remedy for fault in error.faults)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    latin = tmp_path / "latin.toml"
    latin.write_bytes('# ok\ntitle = "Kurbel für"'.encode("latin-1"))
    for path, word in [
        (tmp_path / "none.toml", "none.toml"),
        (tmp_path, tmp_path.name),
        (latin, "UTF-8"),
    ]:
        with pytest.raises(SceneError, match=word) as caught:
            read_scene(path)
        assert isinstance(caught.value, BallpassError)
        assert isinstance(caught.value, ValueError)
    with pytest.raises(BallpassError, match=r"path: a path or a scene|path: a path is expected, not 'a\\x00b'"):
        read_scene("a\0b")


def test_a_byte_order_mark_and_windows_line_ends_are_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "punching_press.toml"
    path.write_bytes(b"\xef\xbb\xbf" + PRESS.replace("\n", "\r\n").encode())
    assert read_scene(path) == read_scene(SCENES / "punching_press.toml")


def test_an_error_names_its_file(tmp_path: Path) -> None:
    path = tmp_path / "press.toml"
    path.write_text(edited(PRESS, '"0.3567 kg"', '"-1 kg"'), encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        read_scene(path)
    assert caught.value.source == str(path)


def test_faults_of_reading_of_values_and_of_topology_are_told_together_with_their_lines() -> None:
    text = edited(PRESS, 'mass = "2.55 kg"', 'mas = "2.55 kg"')  # reading
    text = edited(text, "poisson_ratio = 0.3", "poisson_ratio = 0.5")  # a value
    text = edited(text, 'branch = "ahead"', "")  # assembly
    lines = {fault.key: fault.line for fault in faults(text).faults}
    given = text.split("\n")
    # a key that is misspelt is not missing as well
    assert set(lines) == {"mechanism.bodies.rod.mas", "mechanism.joints.C.branch", "bearing.contact.poisson_ratio"}
    for key, words in (
        ("mechanism.bodies.rod.mas", "mas ="),
        ("mechanism.joints.C.branch", "[mechanism.joints.C]"),
        ("bearing.contact.poisson_ratio", "poisson_ratio = 0.5"),
    ):
        line = lines[key]
        assert line is not None
        assert given[line - 1].startswith(words)


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        (
            (('B = "6 mm"', 'B = "160 mm"'), ('"drive_torque"]', '"drive_torq"]')),
            {"mechanism.joints.C": "[mechanism.joints.C]", "run.outputs": "outputs ="},
        ),
        (
            (
                ('B = "6 mm"', 'B = "160 mm"'),
                ('inertia = "7517.545 kg*mm^2"', ""),
                ("[mechanism.joints.A]", f"{SPRING_ON_A_HINGE}\n[mechanism.joints.A]"),
            ),
            {
                "mechanism.bodies.rod.inertia": "[mechanism.bodies.rod]",
                "mechanism.springs.s.points": "points = [",
                "mechanism.joints.C": "[mechanism.joints.C]",
            },
        ),
    ],
)
def test_faults_that_deriving_finds_are_told_together_with_their_lines(
    changes: tuple[tuple[str, str], ...], found: dict[str, str]
) -> None:
    text = PRESS
    for old, new in changes:
        text = edited(text, old, new)
    scene = scene_from_text(text, "press")
    with pytest.raises(SceneError) as caught:
        derive(scene)
    given = text.split("\n")
    lines = {fault.key: given[(fault.line or 0) - 1] for fault in caught.value.faults}
    assert lines.keys() == found.keys()
    assert all(line.startswith(found[key]) for key, line in lines.items())


def test_a_bearing_half_moved_to_bearings_is_one_fault() -> None:
    start = PRESS.index("[bearing]")
    end = PRESS.index("[run]")
    moved = PRESS[start:end].replace("[bearing", "[bearings.left")
    text = f"{PRESS[:start]}[bearing]\nballs = 8\n\n{moved}{PRESS[end:]}"
    assert [fault.key for fault in faults(text).faults] == ["bearings"]


TWO_WAY = ("share = 0.5                             # [paper]", 'coupling = "two-way"  #')


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("", ""), "moves with the body that carries it"),
        (('joint = "A"\ncoupling', 'joint = "D"\ncoupling'), "must sit at a revolute joint"),
        (('joint = "A"\ncoupling', 'joint = "B"\ncoupling'), "which one carries the inner ring"),
        (('coupling = "two-way"', 'coupling = "two-way"\nshare = 0.5'), "takes the load that the motion gives"),
    ],
)
def test_what_two_way_coupling_has_no_use_for_is_refused(
    scene_text: Callable[..., str], change: tuple[str, str], words: str
) -> None:
    text = scene_text("punching_press", TWO_WAY).replace(*change, 1)
    with pytest.raises(SceneError, match=words):
        scene_from_text(text, "press")


def test_a_one_way_bearing_has_no_place_in_a_linkage_with_play(scene_text: Callable[..., str]) -> None:
    text = scene_text("punching_press_hinges")
    one_way = text.replace('coupling = "two-way"\ncount = 2 ', "share = 0.5 ", 1)
    with pytest.raises(SceneError, match="one coupling for all bearings"):
        scene_from_text(one_way, "press")


def test_inner_rings_of_one_joint_are_on_one_body_and_start_together(scene_text: Callable[..., str]) -> None:
    text = scene_text("punching_press_hinges")
    beside = text.replace('joint = "B"', 'joint = "A"', 1)
    assert [b.beside for b in scene_from_text(beside, "press").bearings] == ["", "main", ""]
    apart = beside.replace(
        '[bearings.big_end.inner_ring]\nbody = "crank"', '[bearings.big_end.inner_ring]\nbody = "frame"'
    )
    start = beside.replace("[bearings.big_end.contact]", 'initial.inner = ["1 um", "0 um"]\n[bearings.big_end.contact]')
    for wrong, words in ((apart, "all inner rings of a joint on one body"), (start, "initial state of bearings.main")):
        with pytest.raises(SceneError, match=words):
            scene_from_text(wrong, "press")


DUTY = '\n[duty.work]\nshare = 0.7\n[duty.idle]\nshare = 0.3\nset.mechanism.driver.speed = "300 rpm"\n'


def test_states_of_a_duty_cycle_take_numbers_like_any_other_and_compile_nothing() -> None:
    scene, plain = (scene_from_text(PRESS + more, "press") for more in (DUTY, ""))
    assert [state.share for state in scene.duty] == [0.7, 0.3]
    assert dict(scene.duty[1].parameters) == {"mechanism.driver.speed": pytest.approx(10.0 * math.pi)}
    film = '\n[bearing.lubrication]\nviscosity = "30 mm^2/s"\ncontamination = 0.5\n'
    assert scene.structure() == plain.structure() == scene_from_text(PRESS + film, "press").structure()


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("share = 0.3", "share = 0.2", "duty", "add a state for the rest"),
        ("share = 0.3", "share = -0.3", "duty.idle.share", "delete the state"),
        ("driver.speed", "driver.sped", "duty.idle.set.mechanism.driver.sped", "did you mean"),
        ('speed = "300 rpm"', 'speed = "300 mm"', "duty.idle.set.mechanism.driver.speed", "rpm"),
        ("set.mechanism.driver.speed", "set.bearing.balls", "duty.idle.set.bearing.balls", ""),
        ('speed = "300 rpm"', "speed = true", "duty.idle.set.mechanism.driver.speed", "one number"),
        ("set.mechanism.driver.speed", "set.bearing.ball_diameter", "duty.idle.set.bearing.ball_diameter", "rpm|unit"),
        ("[duty.work]", "[bearing.lubrication]\ncontamination = 0.5\n[duty.work]", "bearing.lubrication", "add visc"),
        (
            "[duty.work]",
            "[bearing.lubrication]\nviscosity_ratio = 0.05\ncontamination = 0.5\n[duty.work]",
            "bearing.lubrication.viscosity_ratio",
            "thicker",
        ),
        (
            "[duty.work]",
            "[bearing.lubrication]\nviscosity_ratio = 1\ncontamination = 1.5\n[duty.work]",
            "bearing.lubrication.contamination",
            "cleanliness",
        ),
    ],
)
def test_faults_of_duty_and_film_name_their_place(old: str, new: str, key: str, words: str) -> None:
    found = {fault.key: fault.remedy for fault in faults(PRESS + edited(DUTY, old, new)).faults}
    assert key in found
    assert re.search(words, found[key])


def test_a_misspelt_table_that_decides_about_other_keys_is_one_fault() -> None:
    """A table in place of a constant force: neither is the constant missing, nor the direction one too many."""
    text = edited((SCENES / "engine.toml").read_text(encoding="utf-8"), "forces.gas.table]", "forces.gas.tabel]")
    (fault,) = faults(text, "engine").faults
    assert (fault.key, fault.remedy) == ("mechanism.forces.gas.tabel", 'did you mean "table"?')


def test_missing_tables_of_a_bearing_are_shown_as_they_can_be_written() -> None:
    """With what is allowed there written into it, the scene is read."""
    text = """
        shaft.speed = "3000 rpm"
        load = { type = "constant", force = ["0 N", "-100 N"] }
        [bearing]
        designation = "6204"
        clearance = "10 um"
    """
    missing = faults(text, "rotor").faults
    assert len(missing) == 3
    for fault in missing:
        table, keys = fault.allowed.split(" with ")
        text += "\n".join(("", table, *keys.split(" and ")))
    assert scene_from_text(text, "rotor").bearings


@pytest.mark.parametrize(
    ("old", "new", "key", "remedy"),
    [
        ("[bearing]\n", "[bearing]\ndesignation = 6205\n", "bearing.designation", 'write designation = "6205"'),
        ("[bearing]\n", "[bearing]\ndesignation = 6295\n", "bearing.designation", '"6205"?'),
        ('title = "Punching machine of the paper"', "title = 2024", "title", 'write title = "2024"'),
        (
            "[mechanism.forces.punch]",
            '[mechanism.friction.pin]\njoint = "B"\ncoefficient = 0.1\nsmoothing = "1 rad/s"\n\n'
            "[mechanism.forces.punch]",
            "mechanism.friction.pin.coefficient",
            "give the torque",
        ),
        (
            "[mechanism.forces.punch]",
            '[mechanism.springs.s]\nbodies = ["frame", "rod"]\npoints = ["A", "B"]\nfree_length = "1 mm"\n\n'
            "[mechanism.forces.punch]",
            "mechanism.springs.s",
            "add stiffness",
        ),
        ('force = ["0 N", "8964.8 N"]', "force = {}", "mechanism.forces.punch.force.magnitude", 'magnitude = "196 N"'),
    ],
)
def test_a_remedy_can_be_followed(old: str, new: str, key: str, remedy: str) -> None:
    """It said to write the number as another text, or to delete a key that belongs beside the missing one."""
    found = faults(edited(PRESS, old, new)).faults
    assert found[0].key == key
    assert remedy in found[0].remedy
    assert len(found) == 1 or new.endswith("{}")


def test_a_wrong_unit_of_a_column_is_one_fault_at_the_unit() -> None:
    """Each of its 28 rows was one."""
    text = (SCENES / "engine.toml").read_text(encoding="utf-8")
    (fault,) = faults(re.sub(r'(force = { unit = )"N"', r'\1"Pa"', text), "engine").faults
    assert fault.key == "mechanism.forces.gas.table.force.unit"
