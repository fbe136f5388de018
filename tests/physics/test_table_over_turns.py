"""A force table over two turns, as in a four-stroke engine: each is as given, and derivatives hold in each."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.app.transient_words import warnings_of_transient
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.solution.settle import LEAST
from ballpass.runtime.time.repetition import Repetition

SCENES = Path(__file__).resolve().parents[2] / "scenes"
WINDOW = 'window = { start = "237 deg", end = "267 deg" }'
FORCE = ('force = ["0 N", "8964.8 N"]', 'direction = "90 deg"')
ANGLES, FORCES = [30.0, 140.0, 230.0, 250.0], [0.0, 500.0, 4000.0, 0.0]


def table(angles: list[float], forces: list[float], more: str = "") -> tuple[tuple[str, str], ...]:
    columns = f'angle = {{ values = {angles}, unit = "deg" }}, force = {{ values = {forces}, unit = "N" }}'
    text = f"table = {{ {columns}{more} }}"
    return FORCE, (WINDOW, text)


@pytest.mark.parametrize("scene", ["punching_press", pytest.param("punching_press_motor", marks=pytest.mark.long)])
def test_a_turn_without_a_force_differs_from_one_with_it(make_virtual: Callable[..., Model], scene: str) -> None:
    both = [*ANGLES, *(angle + 360.0 for angle in ANGLES)]
    one = make_virtual(scene, *table(ANGLES, FORCES))
    idle = make_virtual(scene, *table(both, [*FORCES, 0.0, 0.0, 0.0, 0.0], ", turns = 2"))
    a, b = (
        model.simulate(2.4, transient=0, method="cvodes", rtol=1e-9, samples_per_cycle=100)["reaction.A.y"]
        for model in (one, idle)
    )
    size = np.max(np.abs(a))
    first, second = slice(0, 80), slice(140, 190)
    assert b[first] == pytest.approx(a[first], rel=0, abs=1e-4 * size)
    assert np.max(np.abs(b[second])) < 0.5 * np.max(np.abs(a[second]))


@pytest.mark.long
def test_derivatives_of_a_cycle_of_two_turns_are_verified(make_model: Callable[..., Model]) -> None:
    both = [*ANGLES, *(angle + 360.0 for angle in ANGLES)]
    model = make_model("punching_press", *table(both, [*FORCES, 0.0, 300.0, 900.0, 0.0], ", turns = 2"))
    path = "mechanism.forces.punch.table"
    names = [f"{path}.force.7", f"{path}.angle.3", f"{path}.angle.7", "mechanism.driver.speed"]
    report = model.sensitivity(["rms:inner.y"], names, 5, transient=1)
    assert report.verdicts[Verdict.VERIFIED] == 4
    assert all(pair.by_steps != 0.0 for pair in report.pairs)


def without_length(text: str) -> str:
    return "".join(line for line in text.splitlines(True) if not re.match(r"(transient_)?cycles =", line))


@pytest.mark.parametrize(("turns", "length"), [(1, 10), (2, 10), (3, 12), (4, 12), (6, 12), (16, 16)])
def test_a_run_without_a_length_is_as_long_as_loads_repeat_after(
    scene_text: Callable[..., str], turns: int, length: int
) -> None:
    text = without_length(scene_text("punching_press", *table(ANGLES, FORCES, f", turns = {turns}")))
    for run, dropped in (("", 50), ("transient_cycles = 7\n", 7)):
        read = scene_from_text(text.replace("[run]\n", "[run]\n" + run), "press").run
        assert (read.cycles, read.transient_cycles) == (dropped + length, dropped)
    assert scene_from_text(text.replace("[run]\n", "[run]\ncycles = 4\n"), "press").run.cycles == 4.0


@pytest.mark.parametrize(("frequency", "length"), [(20.0, 10), (30.0, 10), (20.0 / 3.0, 12), (35.0, 12), (7.77, 10)])
def test_a_harmonic_load_repeats_after_as_many_turns_as_its_frequency_says(
    scene_text: Callable[..., str], frequency: float, length: int
) -> None:
    """On a shaft of 20 turns a second; what does not repeat has no such number."""
    load = 'type = "harmonic"\nmean = ["196 N", "0 N"]\namplitude = ["50 N", "0 N"]\nphase = "0 deg"\n'
    text = re.sub(
        r'(?s)type = "constant".*?\n\n',
        f'{load}frequency = "{frequency!r} Hz"\n\n',
        scene_text("varying_compliance"),
        count=1,
    )
    text = re.sub(r'speed = "393.*?"', 'speed = "1200 rpm"', without_length(text))
    assert scene_from_text(text, "rotor").run.cycles == 50.0 + length


@pytest.mark.long
def test_means_without_asking_are_those_of_whole_cycles(make_model: Callable[..., Model]) -> None:
    """Of a force in the first of three turns, which ten turns would count four times."""
    length = re.compile(r"(transient_)?cycles = \d+ .*\n")
    changes = [(found.group(0), "") for found in length.finditer((SCENES / "punching_press.toml").read_text())]
    model = make_model("punching_press", *table(ANGLES, FORCES, ", turns = 3"), *changes)
    asked = ["mean:reaction.A.y", "rms:drive_torque"]
    found, whole = ([q.value for q in model.quantities(asked, **length).values()] for length in ({}, {"cycles": 53}))
    assert found == pytest.approx(whole, rel=1e-6)
    assert warnings_of_transient(model, {}, cycles=4, transient=0)[-1].startswith("means and rms are over 4 turns")
    assert not warnings_of_transient(model, {}, cycles=6, transient=3)
    assert model.settle().turns % 3 == 0
    assert round(model.life().states[0].turns or 0.0) % 3 == 0


@pytest.mark.parametrize("scene", ["punching_press", "punching_press_motor"])
def test_loads_of_any_drive_repeat_after_the_turns_of_a_table(make_virtual: Callable[..., Model], scene: str) -> None:
    """A motor's angle is a state: its settled runs and lives were 64 turns, no multiple of three."""
    model = make_virtual(scene, *table(ANGLES, FORCES, ", turns = 3"))
    assert (model.explain().turns, Repetition.of(model.manifest, model.numbers().values).whole(LEAST)) == (3, 66)


def test_angles_beyond_the_turns_are_refused(scene_text: Callable[..., str]) -> None:
    with pytest.raises(SceneError, match=r"(?s)cover a whole turn.*turns = 2"):
        scene_from_text(scene_text("punching_press", *table([0.0, 100.0, 700.0], [0.0, 1.0, 0.0])), "press")
