"""Loads that follow a table over time: answers are those of the scene's turns, for later ones are unlike them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.figure_run import run_for_figures
from ballpass.runtime.app.transient_words import warnings_of_transient
from ballpass.runtime.questions.life import COLUMNS, life_figures

#: The rotor's scene gives 60 turns, 1.2 s, here without the first five; most of it is heavily loaded.
TRANSIENT, HEAVY, LENGTH = 0.1, 1.0, 1.2
BURST = f"""[loads.work]
type = "table"
time = ["0 s", "{HEAVY} s", "1.005 s", "{LENGTH} s"]
x = ["0 N", "0 N", "0 N", "0 N"]
y = ["-1000 N", "-1000 N", "0 N", "0 N"]

"""
KEPT = ("transient_cycles = 20", "transient_cycles = 5")


@pytest.fixture(scope="module")
def worked(make_model: Callable[..., Model]) -> Model:
    return make_model("rotor", ("[bearing]\n", BURST + "[bearing]\n"), KEPT)


def test_life_is_that_of_the_load_in_the_scenes_turns(worked: Model) -> None:
    """The heavy load alone lasts L; a part of the time it lasts longer by that part (the light one does no damage)."""
    (found,) = worked.life().bearings
    (alone,) = worked.life(parameters={"loads.work.y.3": -1000.0, "loads.work.y.4": -1000.0}).bearings
    heavy = (HEAVY - TRANSIENT) / (LENGTH - TRANSIENT)
    assert found.life is not None
    assert alone.life is not None
    assert found.hours(found.life) == pytest.approx(alone.hours(alone.life) / heavy, rel=0.02)


@pytest.mark.long
def test_the_pressure_of_a_life_is_drawn_over_the_whole_run(worked: Model) -> None:
    """It was over the first turn after the transient, which of a load over time is any."""
    figure = dict(life_figures(worked, worked.life(), {}))["pressure"]
    panel = figure.axes[0]
    assert panel.get_xlabel() == "time [s]"
    column = (LENGTH - TRANSIENT) / COLUMNS
    assert panel.get_xlim() == pytest.approx([TRANSIENT, LENGTH], abs=column)
    pressure = np.max(panel.collections[0].get_array(), axis=0)
    times = np.linspace(TRANSIENT, LENGTH, len(pressure))
    assert np.min(pressure[times < HEAVY]) > 2.0 * np.max(pressure[times > 1.05])


def test_no_answer_takes_turns_behind_the_table(worked: Model) -> None:
    run = worked.simulate()
    assert worked.spectrum("inner.y").resolution == pytest.approx(1.0 / (LENGTH - TRANSIENT), rel=1e-9)
    assert run_for_figures(worked, run) is None
    with pytest.raises(RequestError, match="table or a window over time"):
        worked.settle()
    # the peak of the heavy load is no impact of the start
    assert warnings_of_transient(worked, {}, cycles=20, transient=2) == []


def test_turns_of_a_scene_without_a_run_say_that_they_lie_behind_the_table(
    worked: Model, make_model: Callable[..., Model], scene_text: Callable[..., str]
) -> None:
    text = scene_text("rotor")
    bare = make_model("rotor", ("[bearing]\n", BURST + "[bearing]\n"), (text[text.index("[run]") :], ""))
    earlier = {f"loads.work.time.{row}": time for row, time in ((2, 0.3), (3, 0.31), (4, 0.4))}
    (said,) = warnings_of_transient(bare, earlier)
    assert "begin at 1 s" in said
    assert "rows up to 0.4 s" in said
    assert warnings_of_transient(bare, earlier, cycles=60, transient=5) == warnings_of_transient(worked, {}) == []


@pytest.mark.long
def test_turns_behind_the_last_row_are_alike(worked: Model) -> None:
    """There the machine is the one whose load has the value of the last row all along."""
    behind = math.ceil(LENGTH / worked.period()) + 10
    last = worked.parameters["loads.work.y.4"]
    even = {f"loads.work.y.{row}": last for row in range(1, 5)}
    points = [worked.section(readings=40, settling=200, parameters=one) for one in ({}, even)]
    spread = [np.ptp(one.states[:, 0]) for one in points]
    assert spread[0] == pytest.approx(spread[1], rel=0.02)
    found = worked.settle(transient=behind)
    assert found.settled
    assert found.reductions["ball.force"].maximum < 100.0
    assert worked.life(transient=behind).states[0].turns >= 128


SLOW = """[loads.slow]
type = "harmonic"
mean = ["0 N", "-1000 N"]
amplitude = ["0 N", "900 N"]
frequency = "1 Hz"
phase = "0 deg"

"""


@pytest.fixture(scope="module")
def slow(make_model: Callable[..., Model]) -> Model:
    return make_model("rotor", ("[bearing]\n", SLOW + "[bearing]\n"))


def test_life_takes_whole_periods_of_a_slow_load(slow: Model) -> None:
    """The third root of the mean of (a - b cos)^3 is that of a^3 + 3/2 a b^2; 50 turns of the shaft in a period."""
    state = slow.life().states[0]
    weight = 49.03
    a, b = 1000.0 + weight, 900.0
    assert state.settled
    assert state.bearings[0].equivalent_load == pytest.approx((a**3 + 1.5 * a * b**2) ** (1 / 3), rel=1e-3)


def test_turns_of_a_scene_without_a_run_say_that_they_hold_no_period(
    slow: Model, make_model: Callable[..., Model], scene_text: Callable[..., str]
) -> None:
    text = scene_text("rotor")
    bare = make_model("rotor", ("[bearing]\n", SLOW + "[bearing]\n"), (text[text.index("[run]") :], ""))
    (said,) = warnings_of_transient(bare, {})
    assert "are 0.2 s, and a period of its slowest harmonic load 1 s" in said
    assert warnings_of_transient(bare, {"loads.slow.frequency": 5.0}) == warnings_of_transient(slow, {}) == []


@pytest.mark.long
def test_a_load_slower_than_all_turns_is_not_settled(slow: Model) -> None:
    """It begins at 100 N and comes to 1900 N after an hour and a half."""
    slower = {"loads.slow.frequency": 1e-4}
    assert not slow.life(parameters=slower).states[0].settled
    with pytest.raises(RequestError, match="slowest harmonic load, or beat, takes 500000 turns"):
        slow.settle(parameters=slower)


def test_explain_finds_the_heaviest_load_of_the_run(make_model: Callable[..., Model]) -> None:
    """A burst behind half a second, of which the first turn knows nothing."""
    late = BURST.replace('["0 s", "1.0 s", "1.005 s"', '["0 s", "0.5 s", "0.51 s"').replace(
        '"-1000 N", "-1000 N"', '"0 N", "-1000 N"'
    )
    found = make_model("rotor", ("[bearing]\n", late + "[bearing]\n"), KEPT).explain()
    lightest, heaviest = found.scales
    assert heaviest.time == pytest.approx(0.5, abs=0.02)  # the unbalance turns on it
    assert heaviest.frequency > 1.5 * lightest.frequency
    assert [item.time for item in found.breakpoints] == pytest.approx([0.0, 0.5, 0.51])
    assert "tables over time: 0° knot of the load; 0.5 s knot of the load" in " ".join(str(found).split())
