"""Claims about the exported C program: the same numbers as the model in Python, clean code, honest messages."""

from __future__ import annotations

import ctypes
import importlib.util
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from artefact import write_folder
from stepper_methods import NAMES
from typer.testing import CliRunner

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import ArtefactError, IntegrationError, Model, RequestError, Solution, load
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.bounds import allowed
from ballpass.runtime.contract.manifest import ParameterInfo
from ballpass.runtime.export.c_program import export_c
from ballpass.runtime.request.assembly import check_assembly
from ballpass.runtime.request.locating import tight_below
from ballpass.runtime.request.segments import segment_edges
from ballpass.runtime.time import timeline

SHORT, LONG = (
    ("punching_press",),
    ("varying_compliance", "punching_press_tangent", "punching_press_roller", "four_bar", "offset_slider"),
)
MOST_OF_THEM_LONG = (*SHORT, *(pytest.param(name, marks=pytest.mark.long) for name in LONG))
OUTPUTS = 'outputs = ["inner.*", "ball.*", "load.*"]'
WARNINGS = "-Wall -Wextra -Wconversion -Wshadow -pedantic -Werror"

pytestmark = pytest.mark.skipif(
    shutil.which("make") is None or shutil.which("cc") is None, reason="needs make and a C compiler"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """An exported scene: the folder generated, the folder exported, and what make said."""

    name: str
    generated: Path
    folder: Path
    messages: str

    def __call__(self, *arguments: str, binary: Path | None = None) -> subprocess.CompletedProcess[str]:
        command = [str(binary or self.folder / self.name), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)

    def table(self, *arguments: str, binary: Path | None = None) -> np.ndarray:
        """Time and states."""
        return self.columns(*arguments, binary=binary)[:, : 1 + len(self.model.states)]

    def columns(self, *arguments: str, binary: Path | None = None) -> np.ndarray:
        done = self(*arguments, binary=binary)
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        return np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1, ndmin=2)

    @property
    def model(self) -> Model:
        return load(self.generated)


def build(folder: Path, *settings: str, into: Path | None = None, target: str = "") -> str:
    """Messages of make in a copy of an exported folder, or in the folder itself."""
    place = folder
    if into is not None:
        place = Path(shutil.copytree(folder, into, ignore=shutil.ignore_patterns("*.o")))
    command = ["make", "-s", "-j2", "-C", str(place), *settings, *([target] if target else [])]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory, scene_text: Callable[..., str]) -> Callable[..., Program]:
    """A scene, with replacements in its text, exported and built once with warnings as errors."""
    kept: dict[tuple[object, ...], Program] = {}

    def make(name: str, *changes: tuple[str, str]) -> Program:
        if (name, *changes) not in kept:
            place = tmp_path_factory.mktemp(name)
            generated = generate(scene_from_text(scene_text(name, *changes), name), place / name)
            folder = export_c(generated, place / "c")
            flags = next(line for line in (folder / "Makefile").read_text().splitlines() if line.startswith("CFLAGS"))
            strict = f"{flags.partition('?= ')[2].replace('$(NATIVE)', '-march=native')} {WARNINGS}"
            messages = build(folder, f"CFLAGS={strict}")
            kept[name, *changes] = Program(name=name, generated=generated, folder=folder, messages=messages)
        return kept[name, *changes]

    return make


# numbers


@pytest.mark.parametrize("scene", MOST_OF_THEM_LONG)
def test_program_prints_the_numbers_of_the_model_and_compiles_without_warnings(
    exported: Callable[..., Program], scene: str
) -> None:
    program = exported(scene)
    assert program.messages == ""
    solution = program.model.simulate(method="stepper")
    header = program("--cycles", "0.01").stdout.splitlines()[0]
    names, expected = all_columns(solution)
    assert header == ",".join(names)
    assert np.array_equal(program.columns(), expected)


@pytest.mark.parametrize("outputs", ["ball.force", pytest.param("inner.y", marks=pytest.mark.long)])
def test_a_scene_of_one_output_or_of_states_alone_is_exported(exported: Callable[..., Program], outputs: str) -> None:
    program = exported("varying_compliance", (OUTPUTS, f'outputs = ["{outputs}"]'))
    assert program.messages == ""
    found = program.columns("--cycles", "2")
    assert np.array_equal(found, all_columns(program.model.simulate(method="stepper", cycles=2))[1])


def all_columns(solution: Solution) -> tuple[list[str], np.ndarray]:
    """Names and samples of time, states, and outputs that are no states."""
    states = [info.name for info in solution.manifest.states]
    names, columns = ["t", *states], [solution.t, *solution.x.T]
    for name, samples in solution.outputs.items():
        if name not in states:
            balls = samples.ndim == 2
            names += [f"{name}[{k + 1}]" for k in range(samples.shape[1])] if balls else [name]
            columns += [*samples.T] if balls else [samples]
    return names, np.column_stack(columns)


@pytest.mark.parametrize(
    ("scene", "changes", "rtol"),
    [
        ("punching_press", (), "1e-6"),
        pytest.param(
            "varying_compliance",
            (
                ('law = "none"', 'law = "two-sided-gated"\ncoefficient = "4000 N*s/m"'),
                ("cycles = 24 ", "cycles = 3 "),
                ("transient_cycles = 20 ", "transient_cycles = 1 "),
            ),
            "1e-5",
            marks=pytest.mark.long,
        ),
        pytest.param("punching_press_tangent", (), "1e-8", marks=pytest.mark.long),
        pytest.param("four_bar", (), "1e-7", marks=[pytest.mark.long, pytest.mark.extreme]),
        pytest.param("varying_compliance", (), "1e-9", marks=pytest.mark.long),
    ],
)
def test_program_locates_kinks_as_the_model_does(
    exported: Callable[..., Program], scene: str, changes: tuple[tuple[str, str], ...], rtol: str
) -> None:
    """Laws with kinks of the rate, of contact, with jumps: every digit that is printed."""
    program = exported(scene, *changes)
    assert program.messages == ""
    model = program.model
    arguments = (f"--rtol={rtol}", "--samples=101")
    over, located = (program.table(*arguments, f"--kinks={how}") for how in ("stepped-over", "located"))
    solution = model.simulate(method="stepper", rtol=float(rtol), samples_per_cycle=101, kinks="located")
    assert solution.statistics.located is not None
    assert solution.statistics.located > 0
    assert np.array_equal(located, np.column_stack([solution.t, solution.x]))
    assert not np.array_equal(located, over)


def test_program_locates_by_itself_where_the_model_does(exported: Callable[..., Program]) -> None:
    program = exported("varying_compliance")
    tight = tight_below(program.model.manifest)
    for rtol, method, expected, other in (
        (tight, "auto", "located", "stepped-over"),
        (3.5 * tight, "auto", "stepped-over", "located"),
        (tight, "dop853", "stepped-over", "located"),
    ):
        arguments = ("--cycles=0.5", f"--rtol={rtol!r}", f"--method={method}")
        named = method.replace("auto", "stepper").replace("dop853", "stepper-dop853")
        assert program.model.simulate(0.5, rtol=rtol, method=named).statistics.kinks == expected
        words = ((), (f"--kinks={expected}",), (f"--kinks={other}",))
        by_itself, told, otherwise = (program(*arguments, *more).stdout for more in words)
        assert by_itself == told != otherwise
    wrong = program("--kinks=locate")
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "Allowed: stepped-over, located." in wrong.stderr


def test_options_do_what_the_arguments_of_simulate_do(exported: Callable[..., Program]) -> None:
    program = exported("varying_compliance")
    model = program.model
    arguments = ["--cycles=2.3", "--rtol=1e-11", "--samples", "37"]
    for method in (name.removeprefix("stepper-") for name in NAMES):
        found = program.table(*arguments, "--method", method)
        solution = model.simulate(2.3, rtol=1e-11, samples_per_cycle=37, method=f"stepper-{method}")
        assert np.array_equal(found[:, 0], solution.t)
        assert np.max(np.abs(found[:, 1:] - solution.x) / solution.statistics.magnitudes) < 1e-12
        rough = program.table("--cycles=2.3", "--rtol=1e-3", "--samples=37", f"--method={method}")
        assert np.max(np.abs(rough[:, 1:] - solution.x) / solution.statistics.magnitudes) > 1e-5
    found = program.table("--duration=0.05", "--samples=100")
    solution = model.simulate(duration=0.05, samples_per_cycle=100, method="stepper")
    assert np.array_equal(found[:, 0], solution.t)
    assert np.max(np.abs(found[:, 1:] - solution.x) / solution.statistics.magnitudes) < 1e-12


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        # a stroke that starts in one turn and ends in the next, and a driver that runs backward
        ("four_bar", {"mechanism.torques.work.window.start": 5.6, "mechanism.torques.work.window.end": 0.9}),
        ("four_bar", {"mechanism.driver.speed": -55.0, "mechanism.driver.start_angle": 2.5}),
        # edges shared by both windows, at the start and at whole turns
        pytest.param(
            "offset_slider",
            {
                "mechanism.forces.tool.window.start": 0.0,
                "mechanism.forces.tool.window.end": 4.0,
                "mechanism.forces.strip.window.start": 4.0,
                "mechanism.forces.strip.window.end": 6.283185307179586,
            },
            marks=pytest.mark.long,
        ),
        # a window without width, and a clearance that changes the derived constants' neighbours
        pytest.param(
            "offset_slider",
            {"mechanism.forces.tool.window.end": 4.014257279586958, "bearing.clearance": 4e-6},
            marks=pytest.mark.long,
        ),
        ("punching_press", {"bearing.ball_diameter": 7.5e-3, "bearing.contact.young_modulus": 310e9}),
    ],
)
def test_changed_parameters_move_loads_and_constants_as_in_python(
    exported: Callable[..., Program], scene: str, changes: dict[str, float]
) -> None:
    program = exported(scene)
    solution = program.model.simulate(2, parameters=changes, method="stepper-dop853", rtol=1e-12, samples_per_cycle=50)
    overrides = [f"{name}={value!r}" for name, value in changes.items()]
    found = program.table("--cycles=2", "--rtol=1e-12", "--samples=50", "--method=dop853", *overrides)
    assert np.array_equal(found[:, 0], solution.t)
    assert np.max(np.abs(found[:, 1:] - solution.x) / np.array(solution.statistics.magnitudes)) < 1e-12
    # and they matter
    plain = program.table("--cycles=2", "--rtol=1e-12", "--samples=50", "--method=dop853")
    assert np.max(np.abs(found[:, 1:] - plain[:, 1:]) / np.array(solution.statistics.magnitudes)) > 1e-3


SWITCHES = """
#include <math.h>
#include <stdio.h>
#include "ballpass.h"

int main(void)
{
    ballpass *simulation = ballpass_make();
    if (ballpass_start(simulation, NULL)) return 1;
    for (double next; isfinite(next = ballpass_next_switch(simulation)); printf("%.17g\\n", next))
        if (ballpass_run_to(simulation, next)) return 1;
    ballpass_free(simulation);
    return 0;
}
"""


@pytest.mark.long
def test_table_of_loads_and_many_segments_equal_python(exported: Callable[..., Program], tmp_path: Path) -> None:
    program = exported(
        "varying_compliance",
        ('type = "constant"  ', 'type = "table"  '),
        (
            'force = ["196 N", "0 N"]',
            'time = ["10 ms", "0.05 s", "0.153 s", "0.3 s"]\n'
            'x = ["0 N", "300 N", "100 N", "196 N"]\ny = ["5 N", "0 N", "90 N", "0 N"]\n#',
        ),
    )
    solution = program.model.simulate(method="stepper", cycles=3)
    found = program.table("--cycles=3")
    assert np.array_equal(found[:, 0], solution.t)
    np.testing.assert_allclose(found[:, 1:], solution.x, rtol=0.0, atol=1e-16)
    # more segments than one call takes
    solution = program.model.simulate(method="stepper", cycles=1500, rtol=1e-4, samples_per_cycle=1)
    found = program.table("--cycles=1500", "--rtol=1e-4", "--samples=1")
    assert solution.statistics.calls > 2
    assert np.array_equal(found[:, 0], solution.t)
    np.testing.assert_allclose(found[:, 1:], solution.x, rtol=0.0, atol=1e-16)
    refused = program("load.time.2=0.5")
    assert refused.returncode == 2
    assert "increase" in refused.stderr
    # what switches are its rows, and no whole turn
    build(program.folder, target="libvarying_compliance.a")
    (tmp_path / "switches.c").write_text(SWITCHES, encoding="utf-8")
    link = [f"-I{program.folder}", str(tmp_path / "switches.c"), str(program.folder / "libvarying_compliance.a"), "-lm"]
    subprocess.run(["cc", "-std=c99", *link, "-o", str(tmp_path / "switches")], check=True, timeout=60)
    told = subprocess.run([str(tmp_path / "switches")], capture_output=True, text=True, check=True, timeout=60).stdout
    end = program.model.simulate(method="stepper", samples_per_cycle=1).statistics.duration
    assert [float(word) for word in told.split()] == [row for row in (10e-3, 0.05, 0.153, 0.3) if row < end]


@pytest.mark.long
def test_table_over_the_drivers_angle_equals_python(exported: Callable[..., Program]) -> None:
    rows = 'angle = ["-20 deg", "30 deg", "190 deg"], force = ["0 N", "1200 N", "-60 N"]'
    program = exported(
        "crank_shaper",
        ('force = ["1500 N", "0 N"]', f'direction = "10 deg"\ntable = {{ {rows} }}'),
        ('window = { start = "350 deg", end = "190 deg" }\n', ""),
    )
    for changes in ({}, {"mechanism.driver.speed": -9.0, "mechanism.driver.start_angle": 2.5}):
        solution = program.model.simulate(2, parameters=changes, method="stepper-dop853", samples_per_cycle=50)
        overrides = [f"{name}={value!r}" for name, value in changes.items()]
        found = program.table("--cycles=2", "--samples=50", "--method=dop853", *overrides)
        assert np.array_equal(found[:, 0], solution.t)
        assert np.max(np.abs(found[:, 1:] - solution.x) / np.array(solution.statistics.magnitudes)) < 1e-12
    refused = program("mechanism.forces.cut.table.angle.3=6.2")
    assert refused.returncode == 2
    assert "within a turn" in refused.stderr


HARMONIC = (
    ('type = "constant"  ', 'type = "harmonic"  '),
    (
        'force = ["196 N", "0 N"]',
        'mean = ["196 N", "5 N"]\namplitude = ["150 N", "80 N"]\nfrequency = "9 Hz"\nphase = "40 deg"\n#',
    ),
)


@pytest.mark.parametrize(
    ("scene", "changes", "numbers"),
    [
        # each moves the sizes of the motion by a tenth and more; one keeps none of the scene's own
        ("punching_press", (), {"bearing.clearance": 60e-6}),
        ("punching_press", (), {"mechanism.driver.speed": 5.0, "mechanism.forces.punch.force.y": -2e5}),
        pytest.param(  # built for this alone
            "punching_press_tangent",
            (),
            {"bearing.clearance": 60e-6, "bearing.outer_ring.stiffness": 4e6},
            marks=pytest.mark.long,
        ),
        ("four_bar", (), {"mechanism.driver.speed": 300.0}),
        pytest.param("offset_slider", (), {"bearing.clearance": 60e-6}, marks=pytest.mark.long),
        pytest.param(
            "varying_compliance",
            (),
            {"bearing.clearance": 2e-4, "bearing.initial.inner_velocity.y": 0.3},
            marks=pytest.mark.long,
        ),
        pytest.param(
            "varying_compliance", HARMONIC, {"load.amplitude.x": 2000.0, "shaft.speed": 400.0}, marks=pytest.mark.long
        ),
    ],
)
@pytest.mark.parametrize(
    ("arguments", "asked"),
    [
        (("--cycles=1.3",), {"cycles": 1.3}),
        (("--cycles=1", "--rtol=1.6e-9", "--method=dp54"), {"cycles": 1, "rtol": 1.6e-9, "method": "stepper-dp54"}),
        (("--duration=0.004", "--rtol=1e-3"), {"duration": 0.004, "rtol": 1e-3}),
    ],
    ids=["cycles", "tight", "duration"],
)
def test_tolerances_follow_the_sizes_of_the_run_at_hand_as_in_python(
    exported: Callable[..., Program],
    scene: str,
    changes: tuple[tuple[str, str], ...],
    numbers: dict[str, float],
    arguments: tuple[str, ...],
    asked: dict[str, Any],
) -> None:
    """Changed parameters and lengths change magnitudes, hence steps: the same ones as those of the model."""
    program = exported(scene, *changes)
    model = program.model
    asked = {"method": "stepper", **asked}
    solution = model.simulate(parameters=numbers, samples_per_cycle=200, **asked)
    overrides = [f"{name}={value!r}" for name, value in numbers.items()]
    found = program.table(*arguments, "--samples=200", *overrides)
    magnitude = np.array(solution.statistics.magnitudes)
    assert np.array_equal(found[:, 0], solution.t)
    assert np.max(np.abs(found[:, 1:] - solution.x) / magnitude) < 1e-12
    # which those of the scene's own run would not give
    scenes_own = np.array(model.simulate(method="stepper", samples_per_cycle=1).statistics.magnitudes)
    assert np.max(np.abs(np.log(magnitude / scenes_own))) > 0.1


@pytest.mark.parametrize(
    ("scene", "changes", "numbers", "length"),
    [
        ("four_bar", (), {}, 3.7),
        pytest.param("offset_slider", (), {"mechanism.driver.speed": -40.0}, 2.0, marks=pytest.mark.long),
        # a fast load on a slow shaft, and on one that stands: segments end before a phase gets large
        ("varying_compliance", HARMONIC, {"shaft.speed": 0.01, "load.frequency": 3.3e6}, 700.0),
        pytest.param(
            "varying_compliance", HARMONIC, {"shaft.speed": 0.0, "load.frequency": 3.3e6}, 50.0, marks=pytest.mark.long
        ),
    ],
)
def test_segments_and_their_inputs_are_those_of_python_to_the_last_bit(
    exported: Callable[..., Program],
    tmp_path: Path,
    scene: str,
    changes: tuple[tuple[str, str], ...],
    numbers: dict[str, float],
    length: float,
) -> None:
    program = exported(scene, *changes)
    model = program.model
    inputs, resolved = model.manifest.inputs, model.numbers(numbers)
    turn = timeline.driver(model.manifest, resolved.values).turn
    edges = segment_edges(model, resolved, 0.0, length, turn)
    angles = [resolved.values[info.offset] for info in model.manifest.turnings]
    values = np.concatenate([resolved.p, resolved.c, angles, [np.nan, 0.0, 0.0]])
    library = tmp_path / "schedule.so"
    sources = [str(program.folder / name) for name in ("schedule.c", "scene.c")]
    subprocess.run(["cc", "-std=c99", "-O2", "-shared", "-fPIC", *sources, "-o", str(library), "-lm"], check=True)
    code = ctypes.CDLL(str(library))
    real, long, pointer = ctypes.c_double, ctypes.c_long, ctypes.c_void_p
    given = (ctypes.addressof(ctypes.c_char.in_dll(code, "scene_schedule")), values.ctypes.data)
    code.schedule_edges.restype = long
    code.schedule_edges.argtypes = (pointer, pointer, real, real, real, pointer)
    code.schedule_inputs.argtypes = (pointer, pointer, real, real, pointer)
    code.schedule_most_segments.restype = real
    code.schedule_most_segments.argtypes = (pointer, pointer, real, real)
    found = ctypes.POINTER(real)()
    count = code.schedule_edges(*given, 0.0, length, turn, ctypes.addressof(found))
    assert np.array_equal(np.array(found[: count + 1]), edges)
    assert count <= code.schedule_most_segments(*given, length, turn) < 1.5 * count + 10.0
    u = np.zeros(len(inputs))
    for left, right in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        code.schedule_inputs(*given, left, 0.5 * (left + right), u.ctypes.data)
        assert np.array_equal(u, timeline.inputs_at(model.manifest, resolved.values, left, 0.5 * (left + right)))


# as a library

EMBEDDED = r"""
#include <cmath>
#include <cstdio>
#include <vector>
#include "ballpass.h"

// Two presses in turn, one of them with another clearance; the second is read nine times as often, and goes back once.
int main()
{
    ballpass *one = ballpass_make(), *two = ballpass_make();
    std::vector<double> a(ballpass_columns()), b(a.size());
    std::vector<char> kept(ballpass_state_size());
    double none;
    if (ballpass_get(one, "nothing", &none) != BALLPASS_REFUSED || !*ballpass_error(one)) return 8;
    if (ballpass_set(two, "bearing.clearance", 20e-6)) return 1;
    if (ballpass_start(one, nullptr) || ballpass_start(two, nullptr)) return 1;
    const double end = ballpass_default(one).end;
    for (int k = 1; k <= 40; k++) {
        if (ballpass_run_to(one, end * (k / 40.0)) || ballpass_read(one, a.data())) return 2;
        for (int j = 1; j <= 9; j++) {
            const double time = end * ((k - 1 + j / 9.0) / 40.0);
            if (ballpass_run_to(two, j < 9 ? time : end * (k / 40.0)) || ballpass_read(two, b.data())) return 3;
        }
        if (k == 20) ballpass_save(two, kept.data());
        if (k == 23) {
            ballpass *copy = ballpass_make();
            if (ballpass_restore(copy, kept.data(), kept.size()) || ballpass_run_to(copy, end * (k / 40.0))) return 4;
            std::vector<double> c(b.size());
            if (ballpass_read(copy, c.data()) || c != b) return 5;
            ballpass_free(copy);
        }
        for (double x : a) std::printf("%.17g,", x);
        for (size_t i = 0; i < b.size(); i++) std::printf(i ? ",%.17g" : "%.17g", b[i]);
        std::printf("\n");
    }
    if (ballpass_restore(one, kept.data(), kept.size())) return 9;
    for (int k = 21; k <= 104; k++)  // beyond the end as well
        if (ballpass_run_to(one, end * (k / 40.0)) || ballpass_read(one, a.data())) return 10;
    if (ballpass_run_to(two, end * (104 / 40.0)) || ballpass_read(two, b.data()) || a != b) return 11;
    if (ballpass_run_to(one, 0.0) != BALLPASS_REFUSED) return 6;
    if (ballpass_set(one, "bearing.clearance", 1e-5) != BALLPASS_REFUSED) return 7;
    std::fprintf(stderr, "%s\n", ballpass_error(one));
    ballpass_free(one);
    ballpass_free(two);
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("c++") is None, reason="needs a C++ compiler")
def test_program_of_another_language_embeds_the_scene_twice(exported: Callable[..., Program], tmp_path: Path) -> None:
    """Instances do not share anything, and how often one is read, or saved and restored, does not change a bit."""
    program = exported("punching_press")
    build(program.folder, target="example")
    shown = subprocess.run([str(program.folder / "example")], capture_output=True, text=True, check=True).stdout
    assert shown.splitlines()[-1].startswith("t = 0.48 s, inner.x = ")
    source, binary = tmp_path / "embedded.cpp", tmp_path / "embedded"
    source.write_text(EMBEDDED, encoding="utf-8")
    link = [f"-I{program.folder}", str(source), str(program.folder / "libpunching_press.a"), "-lm", "-o", str(binary)]
    subprocess.run(["c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", *link], check=True, timeout=120)
    done = subprocess.run([str(binary)], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stderr == (
        "bearing.clearance: 1e-05 was given. Allowed: a value before the run starts; in a run loads, forces and "
        "torques change.\n"
    )
    found = np.loadtxt(io.StringIO(done.stdout), delimiter=",")
    for columns, parameters in zip(np.hsplit(found, 2), ({}, {"bearing.clearance": 20e-6}), strict=True):
        whole = program.model.simulate(method="stepper", parameters=parameters)
        asked = program.model.simulate(
            method="stepper", parameters=parameters, times=columns[:, 0], duration=whole.statistics.duration
        )
        assert np.array_equal(columns, all_columns(asked)[1])


# code


@pytest.mark.long
@pytest.mark.parametrize(
    "scene",
    ["punching_press", *(pytest.param(name, marks=pytest.mark.extreme) for name in ("varying_compliance", "four_bar"))],
)
def test_program_runs_clean_under_the_sanitizers(exported: Callable[..., Program], tmp_path: Path, scene: str) -> None:
    program = exported(scene)
    probe = tmp_path / "probe.c"
    probe.write_text("int main(void) { return 0; }\n", encoding="utf-8")
    sanitize = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    able = subprocess.run(
        ["cc", *sanitize, str(probe), "-o", str(tmp_path / "probe")], capture_output=True, check=False
    )
    if able.returncode != 0:
        pytest.skip("the compiler has no sanitizers")
    flags = f"-g -O0 -std=c99 -ffp-contract=off {' '.join(sanitize)}"
    build(program.folder, f"CFLAGS={flags}", into=tmp_path / "c")
    binary = tmp_path / "c" / scene
    expected = program.table("--cycles=1", "--samples=101")
    for method in ("auto", "rodas4", "rodas5p", "dp54", "dop853"):
        found = program.table("--cycles=1", "--samples=101", "--method", method, binary=binary)
        if method == "auto":
            scale = np.max(np.abs(expected[:, 1:]), axis=0)
            assert np.max(np.abs(found[:, 1:] - expected[:, 1:]) / scale) < 1e-9
    program.table("--cycles=1", "--samples=101", "--kinks=located", binary=binary)
    # what fails must fail cleanly as well
    bad = program("--cycles=1", "bearing.initial.inner_velocity.x=1e300", binary=binary)
    assert bad.returncode == 1
    assert bad.stderr.startswith("error: ")
    assert "runtime error" not in bad.stderr
    assert "Sanitizer" not in bad.stderr


def other_compilers() -> list[tuple[str, str]]:
    found = [(name, path) for name in ("clang", "tcc") if (path := shutil.which(name)) is not None]
    if importlib.util.find_spec("ziglang") is not None:
        found.append(("ziglang", f"{sys.executable} -m ziglang cc"))
    return found


@pytest.mark.long
@pytest.mark.extreme
@pytest.mark.parametrize("scene", ["punching_press", "varying_compliance"])
def test_another_compiler_gives_the_same_numbers(exported: Callable[..., Program], tmp_path: Path, scene: str) -> None:
    others = other_compilers()
    if not others:
        pytest.skip("neither clang nor tcc nor ziglang is installed")
    program = exported(scene)
    arguments = ("--cycles=1", "--samples=101", "--rtol=1e-6", "--method=rodas5p")
    expected = program.table(*arguments)
    for name, command in others:
        build(program.folder, f"CC={command}", into=tmp_path / name)
        found = program.table(*arguments, binary=tmp_path / name / scene)
        scale = np.max(np.abs(expected[:, 1:]), axis=0)
        assert np.max(np.abs(found[:, 1:] - expected[:, 1:]) / scale) < 1e-12, name


def test_an_exported_folder_has_the_headers_that_its_program_needs_and_no_other(
    exported: Callable[..., Program],
) -> None:
    folder = exported("four_bar").folder
    sources = sorted(folder.glob("*.c"))
    rules = subprocess.run(["cc", "-MM", *map(str, sources)], capture_output=True, text=True, check=True).stdout
    assert set(re.findall(r"[^\s/]+\.h\b", rules)) == {path.name for path in folder.glob("*.h")}


def test_exported_folder_knows_no_machine_and_repeats_byte_for_byte(
    exported: Callable[..., Program], tmp_path: Path
) -> None:
    program = exported("four_bar")
    again = export_c(program.generated, tmp_path / "again")
    for path in sorted(again.iterdir()):
        content = path.read_bytes()
        assert content == (program.folder / path.name).read_bytes(), path.name
        assert str(tmp_path).encode() not in content
        assert os.sep.encode() + b"tmp" not in content
        assert str(Path.home()).encode() not in content
    written = {path.name for path in again.iterdir()}
    assert {"Makefile", "README.md", "main.c", "ballpass.c", "ballpass.h", "scene.c", "constants.c"} <= written
    assert {"kernels.h", "method_tables.h", "stepper.c"} <= written
    named = re.findall(r"`(\w+\.[ch])`", (again / "README.md").read_text(encoding="utf-8"))
    assert set(named) <= written


# command line


def test_command_writes_the_folder_and_wants_a_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Path(__file__).resolve().parents[2] / "scenes" / "varying_compliance.toml"
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["export", str(scene), "--c"])
    assert done.exit_code == 0, done.stderr
    assert done.stdout == "export/varying_compliance\n"
    assert (tmp_path / "export" / "varying_compliance" / "main.c").is_file()
    elsewhere = CliRunner().invoke(app, ["export", str(scene), "--c", "--out", "there"])
    assert elsewhere.exit_code == 0
    for path in sorted((tmp_path / "there").iterdir()):
        assert path.read_bytes() == (tmp_path / "export" / "varying_compliance" / path.name).read_bytes()
    without = CliRunner().invoke(app, ["export", str(scene)])
    assert without.exit_code == 2
    assert "--c" in without.stderr
    taken = CliRunner().invoke(app, ["export", str(scene), "--c", "--out", str(scene)])
    assert taken.exit_code == 2
    for wrong, words in (
        (("--c", "--fmu"), "both formats were given"),
        (("--c", "--input", "load"), "--input is for --fmu"),
        (("--fmu", "--out", "there"), "this is a folder"),
        (("--fmu", "--out", "press"), "ends in .fmu"),
        (("--fmu", "--input", "bearing"), "does not change in a run"),
    ):
        refused = CliRunner().invoke(app, ["export", str(scene), *wrong])
        assert refused.exit_code == 2
        assert words in " ".join(refused.stderr.split()), refused.stderr


# messages


def test_wrong_requests_name_what_was_given_and_what_is_allowed(exported: Callable[..., Program]) -> None:
    program = exported("varying_compliance")
    wrong = {
        "--cycles=0": "above 0",
        "--cycles=many": "above 0",
        "--rtol=1": "1e-13 to 0.1",
        "--samples=1.5": "whole number",
        "--samples=-3": "above 0",
        "--method=euler": "rodas5p",
        "--steps=3": "--help",
        "--rtol": "a value after it",
        "bearing.clearence=1e-5": "--list",
        "bearing.clearance": "SI units",
        "bearing.clearance=": "SI units",
        "bearing.clearance=1e-5m": "SI units",
        "bearing.clearance=nan": "SI units",
        "1e-5": "--list",
        "shaft.speed=0": "--duration",
        "bearing.inner_ring.mass=0": "a number above 0 [kg]",
        "bearing.pitch_diameter=1e-3": "above 2.61312593 times bearing.ball_diameter",
    }
    for argument, words in wrong.items():
        done = program(argument)
        assert done.returncode == 2, argument
        assert done.stdout == "", argument
        assert done.stderr.startswith("error: "), argument
        assert words in done.stderr, done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--cycles=2", "--duration=0.1"), "--cycles, --duration: each of them was given. Allowed: one of the two."),
        (("--duration", "0.1", "--cycles", "2", "--list"), "--cycles, --duration: each of them was given."),
        (("bearing.clearance=1e-5", "bearing.clearance=1e-5"), "bearing.clearance: more than one value was given."),
        (
            ("--duration=1e9", "--samples=1", "shaft.speed=0.6"),
            "up to 95493337.94 segments, cut where a load switches and at every whole turn, were asked for. Allowed: "
            "89478485.",
        ),
    ],
)
def test_requests_that_say_two_things_or_too_much_are_refused(
    exported: Callable[..., Program], arguments: tuple[str, ...], words: str
) -> None:
    done = exported("varying_compliance")(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: {words}")


@pytest.mark.parametrize("scene", ["four_bar", "offset_slider"])
def test_program_and_model_refuse_the_same_linkages(exported: Callable[..., Program], scene: str) -> None:
    program = exported(scene)
    model = program.model
    random = np.random.default_rng(7)
    names = [name for name in model.parameters if ".points." in name] + ["mechanism.driver.start_angle"]
    told = re.compile(r"at joint '?(\w+)'?,? (?:worst )?at crank angle")
    verdicts = []
    for _ in range(30):
        numbers = {name: float(model.parameters[name] * np.exp(random.normal(0.0, 0.6))) for name in names}
        numbers["mechanism.driver.speed"] = 5e6  # 286 deg in the time of the run
        expected: list[str] = []
        try:
            check_assembly(model, model.numbers(numbers), 1e-6)
        except RequestError as fault:
            expected = told.findall(str(fault))
            assert expected
        done = program("--duration=1e-6", *(f"{name}={value!r}" for name, value in numbers.items()))
        assert told.findall(done.stderr) == expected
        assert done.returncode == (2 if expected else 0)
        verdicts.append(bool(expected))
    assert {True, False} == set(verdicts)


def test_help_and_list_are_answers_and_not_errors(exported: Callable[..., Program]) -> None:
    program = exported("varying_compliance")
    helped, listed = program("--help"), program("--list", "bearing.clearance=3e-6")
    assert (helped.returncode, listed.returncode) == (0, 0)
    options = {"--cycles", "--duration", "--rtol", "--samples", "--method", "--kinks", "--list"}
    assert set(re.findall(r"^  (--[a-z]+)", helped.stdout, flags=re.MULTILINE)) == options
    page = Path(__file__).resolve().parents[2] / "docs" / "howto" / "export.md"
    rows = set(re.findall(r"^\| `(--[a-z]+)", page.read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert rows == {*options, "--help"}
    lines = dict(line.split("  ", 1)[0].split("=") for line in listed.stdout.splitlines())
    assert list(lines) == list(program.model.parameters)
    assert float(lines["bearing.clearance"]) == 3e-6


def just_outside(info: ParameterInfo) -> list[float]:
    """The values nearest to what a parameter may have that it may not have."""
    beyond = [info.above, info.below]
    beyond += [None if info.least is None else np.nextafter(info.least, -np.inf)]
    beyond += [None if info.most is None else np.nextafter(info.most, np.inf)]
    return [float(value) for value in beyond if value is not None]


def test_values_that_no_scene_file_may_have_are_refused_with_what_is_allowed(exported: Callable[..., Program]) -> None:
    program = exported("punching_press")
    manifest = program.model.manifest
    looked_at = 0
    for info in manifest.parameters:
        for value in just_outside(info):
            done = program(f"{info.name}={value!r}")
            assert (done.returncode, done.stdout) == (2, ""), info.name
            assert f"error: {info.name}: {value:.9g} was given. Allowed: a number {allowed(info)}" in done.stderr
            looked_at += 1
        for value in ("nan", "-inf", "1e999"):
            done = program(f"{info.name}={value}")
            assert (done.returncode, done.stdout) == (2, ""), info.name
            assert done.stderr.startswith(f"error: {info.name}: {value} was given. Allowed: a number in SI units")
    assert looked_at > 20
    for name, factor, other in manifest.relations:
        edge = factor * program.model.parameters[other]
        done = program(f"{name}={edge - 1e-15 * abs(edge)!r}")
        assert (done.returncode, done.stdout) == (2, "")
        assert f"error: {name}: " in done.stderr
        assert f"Allowed: a number above {factor:.9g} times {other}, which is" in done.stderr
    # all faults at once, and numbers that are only listed are looked at as well
    both = program("bearing.contact.poisson_ratio=2", "bearing.outer_ring.mass=0", "--list")
    assert (both.returncode, both.stdout) == (2, "")
    assert both.stderr.count("error: ") == 2


def test_failed_run_prints_the_rows_it_reached(exported: Callable[..., Program]) -> None:
    program = exported("punching_press")
    done = program("mechanism.forces.punch.force.y=1e300", "--cycles=1", "--samples=3600")
    assert done.returncode == 1
    assert "written" in done.stderr
    assert "t = " in done.stderr
    rows = np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1)
    assert np.all(np.isfinite(rows))
    # as many as the model has: tolerances that belong to such a force let the motion go before the punch begins
    with pytest.raises(IntegrationError) as caught:
        program.model.simulate(
            1, parameters={"mechanism.forces.punch.force.y": 1e300}, samples_per_cycle=3600, method="stepper"
        )
    partial = caught.value.partial
    assert partial is not None
    assert 1000 < len(partial) < 3600
    assert np.array_equal(rows, all_columns(partial)[1])


def test_model_without_states_and_edited_folders_are_refused(tmp_path: Path, exported: Callable[..., Program]) -> None:
    bare = write_folder(tmp_path / "bare", states=False)
    with pytest.raises(RequestError, match="no states"):
        export_c(bare, tmp_path / "out")
    edited = Path(shutil.copytree(exported("varying_compliance").generated, tmp_path / "edited"))
    (edited / "kernels.h").write_text("/* nothing */\n", encoding="utf-8")
    with pytest.raises(ArtefactError, match=r"kernels\.h"):
        export_c(edited, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    without = write_folder(tmp_path / "without")
    with pytest.raises(ArtefactError, match=r"kernels\.h"):
        export_c(without, tmp_path / "out")
    assert not (tmp_path / "out").exists()
