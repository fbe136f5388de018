"""Loads whose frequency is nearly that of the shaft: a run within their beat says so, and lives cover it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.app.transient_words import warnings_of_transient
from ballpass.runtime.time.repetition import Repetition

PUSH = """[loads.push]
type = "harmonic"
mean = ["0 N", "0 N"]
amplitude = ["30 N", "20 N"]
frequency = "50.1 Hz"
phase = "0 deg"

"""
FREQUENCY = "loads.push.frequency"


@pytest.fixture(scope="module")
def rotor(make_model: Callable[..., Model]) -> Model:
    """3000 rpm, with an unbalance."""
    return make_model("rotor", ("[bearing]\n", PUSH + "[bearing]\n"))


def test_beats_are_those_of_rates_that_nearly_match(rotor: Model) -> None:
    def slowest(frequency: float) -> tuple[float, str]:
        values = rotor.numbers({FREQUENCY: frequency}).values
        return max((beat.period, beat.words) for beat in Repetition.of(rotor.manifest, values).beats())

    assert slowest(50.1) == (pytest.approx(10.0), "load push with the shaft")
    assert slowest(25.05) == (pytest.approx(10.0), "load push with the shaft")  # 50.1 against 50
    passing = next(
        b.period for b in Repetition.of(rotor.manifest, rotor.numbers().values).beats() if b.words.startswith("balls")
    )
    assert slowest(50.0) == (pytest.approx(passing), "balls passing the outer ring with the shaft")  # locked


def test_a_run_within_a_beat_says_so_where_its_numbers_depend_on_the_part(rotor: Model) -> None:
    """Load and unbalance meet once in 500 turns: 32 turns have one part of that."""

    def beat(frequency: float, amplitude: float = 30.0) -> list[str]:
        numbers = {FREQUENCY: frequency, "loads.push.amplitude.x": amplitude}
        numbers["loads.push.amplitude.y"] = amplitude
        return [one for one in warnings_of_transient(rotor, numbers, cycles=52, transient=20) if "beats once" in one]

    (words,) = beat(50.1)
    assert "load push with the shaft beats once in 10 s, 500 turns" in words
    assert "--cycles 520 --transient 20" in words
    assert beat(50.0) == []
    assert beat(50.1, amplitude=1e-3) == []


@pytest.mark.long
def test_lives_cover_the_beat(rotor: Model) -> None:
    """64 turns of one part of it gave a life that depends on the load's phase."""
    lives = [
        rotor.life(parameters={FREQUENCY: 50.1, "loads.push.phase": phase}).bearings[0].basic_life
        for phase in np.linspace(0.0, math.pi, 3).tolist()
    ]
    assert max(lives) < 1.005 * min(lives)
