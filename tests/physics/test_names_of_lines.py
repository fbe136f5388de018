"""Claims about the names of lines: healthy machines have no damaged bearings, frequencies are exact."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.quantity.characteristic import CharacteristicLine, characteristic_lines, names_of, without_chance
from ballpass.runtime.questions.spectrum import spectrum
from ballpass.runtime.run.solution_file import load_solution

DAMAGED = re.compile("BPFI|BSF|FTF")
LONG = (
    "crank_shaper",
    "eccentric_pump",
    "four_bar",
    "offset_slider",
    "punching_press_hinges",
    "punching_press_motor",
    "punching_press_roller",
)
SCENES = (
    "engine",
    "punching_press",
    "rotor",
    *(
        pytest.param(name, marks=pytest.mark.long)
        for name in (*LONG, "punching_press_tangent", "punching_press_two_way", "toggle_press", "varying_compliance")
    ),
)


@pytest.mark.parametrize("scene", SCENES)
def test_a_healthy_machine_has_no_line_of_a_damaged_bearing(make_model: Callable[..., Model], scene: str) -> None:
    """At any length of record; BPFO is none: balls of a healthy bearing pass its load."""
    model = make_model(scene)
    channel = f"{model.manifest.bearings[0].prefix}inner.x"
    for turns, orders in ((2, False), (2, True), (27, True), (100, False), (None, True)):
        run = {} if turns is None else {"cycles": turns + 20, "transient": 20}
        found = model.spectrum(channel, orders=orders, **run)
        assert not [name for name in found.names if DAMAGED.search(name)], (turns, orders)
        # a motor's speed changes within the turn, and its lines lie between the multiples of the mean
        assert found.names[0] in {"1/2 shaft", "shaft", "BPFO"} or scene in (
            "varying_compliance",
            "punching_press_motor",
        )


def test_what_a_short_record_cannot_tell_is_said_with_the_length_that_would(make_model: Callable[..., Model]) -> None:
    """2 BSF of the 6204 is the order 3.983532: a line of the spectrum off the fourth at 1/0.016468 = 60.7 turns."""
    model = make_model("punching_press")
    short = model.spectrum("inner.x", cycles=29, transient=2, orders=True)
    fourth = short.names.index("4 shaft")
    assert short.alternatives[fourth] == "2 BSF (61 turns)"
    assert "2 BSF (61 turns)" in str(short)
    long = model.spectrum("inner.x", orders=True)
    assert long.alternatives[long.names.index("4 shaft")] == ""
    assert long.resolution == pytest.approx(0.01)


def test_a_line_of_a_load_with_a_frequency_of_its_own_is_no_bearings(make_model: Callable[..., Model]) -> None:
    """A load at the frequency of BPFI, and one between all lines."""
    push = """[loads.push]
type = "harmonic"
mean = ["0 N", "0 N"]
amplitude = ["20 N", "0 N"]
frequency = "247.4 Hz"
phase = "0 deg"

"""
    model = make_model("rotor", ("[bearing]\n", push + "[bearing]\n"), ('"load.*"]', '"load.*", "inner.*"]'))
    for frequency in (247.4, 333.3):
        found = model.spectrum("inner.x", parameters={"loads.push.frequency": frequency})
        nearest = np.argmin(np.abs(found.position[list(found.highest)] - frequency))
        assert found.names[nearest] == "load push"
        assert [mark.name for mark in model.spectrum("load.x").marks] == ["shaft", "load push"]
        assert not [name for name in found.names if DAMAGED.search(name)], found.names
    turning = model.spectrum("load.x", parameters={"loads.push.frequency": 50.0})
    assert ([mark.name for mark in turning.marks], turning.names[0]) == (["shaft"], "shaft")


def test_sidebands_of_a_load_at_a_bearings_frequency_are_given_with_those_of_the_bearing() -> None:
    """The shaft modulates both: a record that cannot tell load and BPFI cannot tell their sidebands."""
    shaft, inner = 50.0, 247.4
    lines = (
        CharacteristicLine(name="shaft", bearing="", frequency=shaft, side=0.0, side_name=""),
        CharacteristicLine(name="load push", bearing="", frequency=inner + 0.1, side=shaft, side_name="shaft"),
        CharacteristicLine(name="BPFI", bearing="", frequency=inner, side=shaft, side_name="shaft"),
    )
    for side in (-shaft, shaft):
        first, *others = names_of(inner + side, lines, 0.5)
        words = f"{'-' if side < 0.0 else '+'} shaft"
        assert (first.words, [other.words for other in others]) == (f"load push {words}", [f"BPFI {words}"])
    apart, *others = names_of(inner + shaft, lines, 0.05)
    assert (apart.words, others) == ("BPFI + shaft", [])
    damage, *_ = names_of(inner, (lines[0], replace(lines[1], frequency=inner - shaft), lines[2]), 0.5)
    assert damage.words == "BPFI"  # the simpler name, though the load has a sideband there


def test_damage_beside_a_load_of_its_own_frequency_has_more_than_one_line() -> None:
    """Shaft, load and ball pass mix to lines everywhere: one of them where BPFI has one is chance."""
    shaft, inner, push = 50.0, 247.4, 67.3
    lines = (
        CharacteristicLine(name="shaft", bearing="", frequency=shaft, side=0.0, side_name=""),
        CharacteristicLine(name="load push", bearing="", frequency=push, side=shaft, side_name="shaft"),
        CharacteristicLine(name="BPFO", bearing="", frequency=152.6, side=shaft, side_name="shaft"),
        CharacteristicLine(name="BPFI", bearing="", frequency=inner, side=shaft, side_name="shaft"),
    )

    def named(*at: float, among: tuple[CharacteristicLine, ...] = lines) -> list[str]:
        found = without_chance([names_of(one, among, 0.5) for one in at], among)
        return [names[0].words if names else "" for names in found]

    assert named(push, shaft, inner) == ["load push", "shaft", ""]
    assert named(push, inner, inner - shaft) == ["load push", "BPFI", "BPFI - shaft"]
    assert named(shaft, 2 * shaft, inner, among=(lines[0], *lines[2:])) == ["shaft", "2 shaft", "BPFI"]
    assert named(152.6 + 2 * push, 152.6, shaft) == ["BPFO + 2 load push", "BPFO", "shaft"]


@pytest.mark.long
def test_healthy_bearings_under_harmonic_loads_have_no_damage(make_model: Callable[..., Model]) -> None:
    """Their sidebands with balls that pass, with a cage that slips, were BPFI and 2 BSF in every fifth spectrum."""
    loads = "".join(
        f'[loads.{name}]\ntype = "harmonic"\nmean = ["0 N", "0 N"]\namplitude = ["60 N", "36 N"]\n'
        f'frequency = "{frequency} Hz"\nphase = "0 deg"\n\n'
        for name, frequency in (("push", 37.3), ("pull", 21.7))
    )
    cage = ("[bearing.damping]", "[bearing.cage]\nslip = 0.0\n\n[bearing.damping]")
    model = make_model("rotor", ("[bearing]\n", loads + "[bearing]\n"), cage)
    drawn = np.random.default_rng(3)
    for one in (423.1334, 721.0832, 593.3734, *drawn.uniform(60.0, 1000.0, 7)):
        frequencies = {"loads.push.frequency": one, "loads.pull.frequency": float(drawn.uniform(60.0, 1000.0))}
        slip = {"bearing.cage.slip": float(drawn.uniform(0.0, 0.05))}
        for of in ("inner.x", "inner.ay"):
            names = model.spectrum(of, parameters={**frequencies, **slip}).names
            assert not [name for name in names if DAMAGED.search(name)], (one, names)


def test_balls_that_pass_the_load_are_named_before_damage_of_another_bearing(make_model: Callable[..., Model]) -> None:
    """In 27 turns a line of the healthy rotor lay nearer to 2 BSF + 3 FTF of the other bearing."""
    model = make_model("rotor_two_bearings")
    values = model.numbers().values
    lines = characteristic_lines(model.manifest, values)
    of = {line.label: line.frequency for line in lines}
    first, *_ = names_of(251.9, lines, of["shaft"] / 27)
    assert first.words == "2 BPFO pulley - shaft"
    damage, *_ = names_of(of["BPFI pulley"] + 0.1, lines, of["shaft"] / 27)
    assert damage.words == "BPFI pulley"


def test_lines_of_the_shaft_are_at_its_frequency_and_not_a_sample_below(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    found = model.spectrum("inner.x", cycles=6, transient=2)
    assert found.position[found.highest[0]] == pytest.approx(500.0 / 60.0, rel=1e-12)


@pytest.mark.parametrize("scaling", ["amplitude", "power"])
def test_a_force_that_is_one_sine_has_one_line(make_model: Callable[..., Model], scaling: str) -> None:
    """Nine more were rounding, 1e-14 N."""
    assert make_model("rotor").spectrum("load.x", scaling=scaling).names == ("shaft",)


@pytest.mark.long
def test_bearings_are_heard_where_they_move_something(make_model: Callable[..., Model]) -> None:
    one_way, two_way = make_model("punching_press"), make_model("punching_press_two_way")
    assert [mark.name for mark in one_way.spectrum("drive_torque").marks] == ["shaft"]
    assert [mark.name for mark in one_way.spectrum("reaction.A.y").marks] == ["shaft"]
    assert len(one_way.spectrum("inner.y").marks) == 5
    assert len(two_way.spectrum("drive_torque").marks) == 5


def test_a_rate_that_is_too_slow_folds_no_line(make_model: Callable[..., Model], tmp_path: Path) -> None:
    """At 700 Hz a line of the rotor above 350 Hz would stand below it; a file that is sampled so says so."""
    model = make_model("rotor")
    fine, slow = (model.spectrum("inner.ay", sample_rate=rate) for rate in (None, 700.0))
    assert slow.position[-1] <= 350.0
    there = fine.position <= 350.0
    np.testing.assert_allclose(slow.height, fine.height[there], rtol=1e-2, atol=1e-3 * np.max(fine.height[there]))
    model.simulate(60, sample_rate=700.0, outputs=["inner.ay"]).save(tmp_path / "slow.nc")
    (warning,) = spectrum(load_solution(tmp_path / "slow.nc"), "inner.ay").warnings
    assert "folded" in warning
