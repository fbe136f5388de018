"""Claims about the names of lines: healthy machines have no damaged bearings, frequencies are exact."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.quantity.characteristic import CharacteristicLine, name_of
from ballpass.runtime.questions.spectrum import spectrum
from ballpass.runtime.solution.solution_file import load_solution

DAMAGED = re.compile("BPFI|BSF|FTF")
PUSH = """[loads.push]
type = "harmonic"
mean = ["0 N", "0 N"]
amplitude = ["20 N", "0 N"]
frequency = "247.4 Hz"
phase = "0 deg"

"""
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


def test_a_line_of_a_load_with_a_frequency_of_its_own_is_no_bearings(make_model: Callable[..., Model]) -> None:
    """A load at the frequency of BPFI, and one between all lines."""
    model = make_model("rotor", ("[bearing]\n", PUSH + "[bearing]\n"), ('"load.*"]', '"load.*", "inner.*"]'))
    for frequency in (247.4, 333.3):
        found = model.spectrum("inner.x", parameters={"loads.push.frequency": frequency})
        nearest = np.argmin(np.abs(found.position[list(found.highest)] - frequency))
        assert found.names[nearest] == "load push"
        assert [mark.name for mark in model.spectrum("load.x").marks] == ["shaft", "load push"]
        assert not [name for name in found.names if DAMAGED.search(name)], found.names
    turning = model.spectrum("load.x", parameters={"loads.push.frequency": 50.0})
    assert ([mark.name for mark in turning.marks], turning.names[0]) == (["shaft"], "shaft")


def test_the_nearest_name_is_given_and_the_machine_comes_before_its_bearings() -> None:
    """Loads mix with the shaft and with balls that pass to lines everywhere: damage beside them has no sidebands."""
    shaft, inner = 50.0, 247.4
    lines = (
        CharacteristicLine(name="shaft", bearing="", frequency=shaft, side=0.0, side_name=""),
        CharacteristicLine(name="load push", bearing="", frequency=67.3, side=shaft, side_name="shaft"),
        CharacteristicLine(name="BPFO", bearing="", frequency=152.6, side=shaft, side_name="shaft"),
        CharacteristicLine(name="BPFI", bearing="", frequency=inner, side=shaft, side_name="shaft"),
    )
    healthy = {67.3: "load push", 2.0 * shaft: "2 shaft", 152.6 + 2 * 67.3: "BPFO + 2 load push"}
    damage = {inner: "BPFI", inner - shaft: "", inner + 0.6: "", 3.0 * inner + 0.4: "3 BPFI"}
    for frequency, name in (healthy | damage).items():
        assert name_of(frequency, lines, 0.5) == name, frequency
    alone = (lines[0], *lines[2:])
    assert name_of(inner - shaft, alone, 0.5) == "BPFI - shaft"
    # a record of five turns does not separate BPFI from the fifth multiple of the shaft
    assert [name_of(at, alone, 10.0) for at in (inner, 5.0 * shaft)] == ["5 shaft", "5 shaft"]


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


def test_heights_at_the_characteristic_lines_are_those_of_the_signal(make_model: Callable[..., Model]) -> None:
    """A load of 20 N along x at 333.3 Hz, and 5 g at 20 mm that turn at 50 Hz."""
    model = make_model("rotor", ("[bearing]\n", PUSH + "[bearing]\n"))
    found = model.spectrum("load.x", window="flattop", parameters={"loads.push.frequency": 333.3})
    heights = dict(zip([mark.name for mark in found.marks], found.mark_heights, strict=True))
    assert heights["load push"] == pytest.approx(20.0, rel=1e-3)
    assert heights["shaft"] == pytest.approx(5e-3 * 20e-3 * (100.0 * np.pi) ** 2, rel=1e-3)
    assert "Heights at the characteristic lines" in str(found)


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
