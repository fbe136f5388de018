"""Claims about gates, tables and phases, checked by hand or against brute force."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import InputInfo, TurningInfo
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import breakpoint_slopes, breakpoints
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.turning import ANGLE_RESOLUTION, Turning

TURN = 2.0 * math.pi
ANGLE = TurningInfo(name="angle", kind="driver", words="", offset="start", rate="speed", speeds=("speed",))
GATE = InputInfo(name="gate", kind="gate", turning="angle", windows=(("w.start", "w.end"),))
TABLE = InputInfo(name="table", kind="table", times=("t1", "t2", "t3"), values=("y1", "y2", "y3"))
SLOPE = InputInfo(name="slope", kind="table_rate", times=("t1", "t2", "t3"), values=("y1", "y2", "y3"))
PHASE = InputInfo(name="phase", kind="phase", turning="angle")
KNOTS = {"t1": 1.0, "t2": 2.0, "t3": 4.0, "y1": 10.0, "y2": 20.0, "y3": 0.0}


def of(*inputs: InputInfo, turning: TurningInfo = ANGLE) -> Any:
    """What the timeline reads of a manifest."""
    return SimpleNamespace(inputs=inputs, turnings=(turning,), mechanism=None, bearing=None, bearings=())


def window(start: float, end: float, speed: float = TURN, offset: float = 0.0) -> dict[str, float]:
    """A window in degrees; one turn a second by default."""
    return {"w.start": math.radians(start), "w.end": math.radians(end), "speed": speed, "start": offset}


def gate(values: dict[str, float], t: float) -> float:
    return float(timeline.inputs_at(of(GATE), values, t)[0])


def test_punch_window_switches_at_its_angles_in_every_turn() -> None:
    values = window(237, 267)
    expected = [(k + angle / 360.0) for k in range(3) for angle in (237, 267)]
    np.testing.assert_allclose(breakpoints(of(GATE), values, 0.0, 3.0), expected, rtol=1e-15)
    assert [gate(values, t / 360.0) for t in (236.999, 237.001, 266.999, 267.001)] == [0.0, 1.0, 1.0, 0.0]


def test_start_belongs_to_the_window_and_end_does_not_even_when_rounding_hits_them() -> None:
    values = window(237, 267, speed=500.0 * TURN / 60.0, offset=0.1)
    edges = breakpoints(of(GATE), values, 0.0, 120.0)
    assert len(edges) == 2 * 1000
    inside = [gate(values, t) for t in edges]
    assert inside == [1.0, 0.0] * 1000


def test_window_across_zero_is_one_window() -> None:
    values = window(330, 30)
    assert [gate(values, a / 360.0) for a in (0, 29, 31, 180, 329, 331, 359, 361)] == [1, 1, 0, 0, 0, 1, 1, 1]
    np.testing.assert_allclose(breakpoints(of(GATE), values, 0.0, 1.0), [30 / 360, 330 / 360], rtol=1e-15)


@pytest.mark.parametrize(("start", "end", "value"), [(40, 40, 0.0), (0, 360, 1.0), (90, 450, 1.0), (10, 800, 1.0)])
def test_windows_of_zero_width_never_act_and_of_a_turn_or_more_always(start: float, end: float, value: float) -> None:
    values = window(start, end)
    assert [gate(values, t) for t in np.linspace(0.0, 2.0, 97)] == [value] * 97
    assert breakpoints(of(GATE), values, 0.0, 5.0).size == 0


def test_backward_driver_meets_the_end_first() -> None:
    values = window(237, 267, speed=-TURN)
    np.testing.assert_allclose(breakpoints(of(GATE), values, 0.0, 1.0), [93 / 360, 123 / 360], rtol=1e-14)
    assert [gate(values, t / 360.0) for t in (92, 94, 122, 124)] == [0.0, 1.0, 1.0, 0.0]


def test_standing_driver_holds_its_gate() -> None:
    values = window(237, 267, speed=0.0, offset=math.radians(240))
    assert gate(values, 1e6) == 1.0
    assert breakpoints(of(GATE), values, 0.0, 1e6).size == 0


@pytest.mark.parametrize(("begin", "end"), [(0.0, 1e300), (-1.7e308, 1.7e308), (0.0, 1e9)])
def test_more_turns_than_can_be_listed_are_refused(begin: float, end: float) -> None:
    with pytest.raises(RequestError, match="too many to list what switches"):
        breakpoints(of(GATE), window(237, 267), begin, end)


@settings(max_examples=100, deadline=None)
@given(
    start=st.floats(-720, 720),
    width=st.floats(0.5, 359.5),
    speed=st.floats(0.3, 40.0),
    sign=st.sampled_from([1.0, -1.0]),
    offset=st.floats(-10.0, 10.0),
)
def test_gate_changes_at_every_breakpoint_and_nowhere_else(
    start: float, width: float, speed: float, sign: float, offset: float
) -> None:
    values = window(start, start + width, speed=sign * speed, offset=offset)
    t1 = 2.3 * TURN / speed
    edges = breakpoints(of(GATE), values, 0.0, t1)
    bounds = np.concatenate([[0.0], edges, [t1]])
    # edges nearer than the clock's resolution are one edge: leave out starts and ends that all but meet one
    assume(np.min(np.diff(bounds)) * speed > 1e4 * ANGLE_RESOLUTION)
    levels = []
    for left, right in pairwise(bounds):
        inner = left + (right - left) * np.array([1e-3, 0.37, 0.5, 0.999])
        found = {gate(values, t) for t in inner}
        assert len(found) == 1, (left, right, found)
        # the definition itself, without any of the code's cases
        angle = (offset + sign * speed * inner[2] - math.radians(start)) % TURN
        if min(abs(angle - math.radians(width)), angle, TURN - angle) > 1e-9:
            assert found == {float(angle < math.radians(width))}
        levels.append(found.pop())
    assert all(a != b for a, b in pairwise(levels))


def test_table_is_linear_between_its_knots_and_constant_outside() -> None:
    times = np.array([0.0, 1.0, 1.25, 2.0, 3.0, 4.0, 9.0])
    found = [timeline.inputs_at(of(TABLE), KNOTS, t)[0] for t in times]
    np.testing.assert_allclose(found, np.interp(times, [1, 2, 4], [10, 20, 0]), rtol=1e-15)
    slopes = [timeline.inputs_at(of(SLOPE), KNOTS, t)[0] for t in times]
    assert slopes == [0.0, 10.0, 10.0, -10.0, -10.0, 0.0, 0.0]
    np.testing.assert_array_equal(breakpoints(of(TABLE, SLOPE), KNOTS, 0.0, 9.0), [1.0, 2.0, 4.0])


def test_slope_is_that_of_the_interval_while_the_value_is_that_of_the_reference_time() -> None:
    found = timeline.inputs_at(of(TABLE, SLOPE), KNOTS, 2.0, inside=3.0)
    np.testing.assert_allclose(found, [20.0, -10.0])
    before = timeline.inputs_at(of(TABLE, SLOPE), KNOTS, 2.0, inside=1.5)
    np.testing.assert_allclose(before, [20.0, 10.0])


def test_table_times_must_increase() -> None:
    with pytest.raises(RequestError, match=r"t3 = 2 s was given after t2 = 2 s"):
        timeline.inputs_at(of(TABLE), {**KNOTS, "t3": 2.0}, 0.0)


def test_phase_is_reduced_and_stays_accurate_in_the_thousandth_turn() -> None:
    values = {"start": 0.25, "speed": TURN / 0.125}  # eight turns a second, exact in binary
    found = timeline.inputs_at(of(PHASE), values, 1000.0 + 0.125 / 4)[0]
    assert 0.0 <= found < TURN
    assert found == pytest.approx(0.25 + TURN / 4, abs=1e-11)


ROWS = TurningInfo(
    name="angle",
    kind="cage",
    words="",
    offset="start",
    rate="speed",
    turns="turns",
    times=("s1", "s2", "s3", "s4"),
    speeds=("v1", "v2", "v3", "v4"),
    rolling="rolling",
    lag="lag",
    lag_times=("l1", "l2", "l3"),
    lags=("h1", "h2", "h3"),
)
SPEEDS = {"s1": 0.4, "s2": 1.1, "s3": 2.2, "s4": 3.0, "v1": 0.0, "v2": 40.0, "v3": -25.0, "v4": 9.0}
LAGS = {"l1": 0.2, "l2": 1.6, "l3": 2.6, "h1": 0.0, "h2": 0.3, "h3": 0.1, "lag": 0.05, "rolling": 0.7, "turns": 0.4}


@pytest.mark.parametrize("t", [0.5, 1.3, 2.7, 5.0])
def test_input_derivatives_equal_differences(t: float) -> None:
    values = {**KNOTS, **SPEEDS, **LAGS, "start": 0.2, "speed": 3.0}
    kinds: tuple[Literal["rate", "slope"], ...] = ("rate", "slope")
    turned = tuple(InputInfo(name=kind, kind=kind, turning="angle") for kind in kinds)
    manifest, now = of(PHASE, TABLE, SLOPE, *turned, turning=ROWS), np.array([t])
    for name, value in values.items():
        step = 1e-6
        found = timeline.input_slopes(manifest, values, {name: 1.0}, now, now)[0]
        sides = [timeline.inputs_at(manifest, {**values, name: value + s * step}, t) for s in (1, -1)]
        change = sides[0] - sides[1]
        change[0] = math.remainder(change[0], TURN)
        np.testing.assert_allclose(found, change / (2 * step), rtol=1e-7, atol=2e-7, err_msg=name)


@pytest.mark.parametrize("t", [0.61, 1.4, 2.9])
def test_the_time_of_an_edge_moves_as_differences_say(t: float) -> None:
    values = {**window(0, 40), **SPEEDS, **LAGS}
    manifest = of(GATE, turning=ROWS)
    at = float(np.min(edges[edges > t])) if len(edges := breakpoints(manifest, values, 0.0, 4.0)) else math.nan
    for name in (*SPEEDS, *LAGS, "start", "w.start", "w.end"):
        _, slopes = breakpoint_slopes(manifest, values, [{name: 1.0}], at)

        def moved(change: float, name: str = name) -> float:
            times = breakpoints(manifest, {**values, name: values[name] + change}, 0.0, 4.0)
            return float(times[np.argmin(np.abs(times - at))])

        assert slopes[0, 0] == pytest.approx((moved(1e-7) - moved(-1e-7)) / 2e-7, rel=1e-5, abs=1e-7), name


@settings(max_examples=150, deadline=None)
@given(
    gaps=st.lists(st.floats(0.01, 0.4), min_size=1, max_size=6),
    speeds=st.lists(st.sampled_from([0.0, 1.0, -1.0, 0.3, 2.0]), min_size=7, max_size=7),
    scale=st.floats(1.0, 400.0),
    offset=st.floats(-7.0, 7.0),
    angle=st.floats(-7.0, 7.0),
    turns=st.sampled_from([1, 2]),
)
def test_turnings_with_rests_and_reversals_equal_a_dense_search(
    gaps: list[float], speeds: list[float], scale: float, offset: float, angle: float, turns: int
) -> None:
    times = np.cumsum([0.05, *gaps])
    rates, end = scale * np.array(speeds[: len(times)]), float(times[-1]) + 0.1
    turning = Turning.by_speeds(offset, times, rates)
    dense = np.unique(np.concatenate([np.linspace(0.0, end, 40_001), times]))
    rate = np.interp(dense, times, rates)
    place = offset + np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(dense))])
    np.testing.assert_allclose(turning.at(dense)[0], place, atol=1e-9 * scale)
    moved = np.sum(np.abs(np.diff(place)))
    assert turning.turns(0.0, end) * TURN == pytest.approx(moved, rel=1e-6, abs=1e-6 * scale)
    past = (place - angle) / (turns * TURN)
    # touching an angle without passing it, resting on it, and starting from it are decided by rounding
    slow = (np.abs(rate) < 2e-2 * scale) | (dense == 0.0) | (dense == end)
    assume(np.min(np.abs(past - np.round(past))[slow], initial=1.0) > 1e-3)
    found = turning.passes(angle, 0.0, end, turns)
    assert len(found) == np.sum(np.abs(np.diff(np.floor(past))))
    np.testing.assert_allclose(np.interp(found, dense, past), np.round(np.interp(found, dense, past)), atol=1e-5)
    first = turning.first_pass(angle, turns)
    if len(found):
        assert first == pytest.approx(found[0], abs=1e-12)
    last = turning.last_pass(angle, end, turns)
    assert (last is None and not len(found)) or last == pytest.approx(found[-1], abs=1e-12)


@pytest.mark.parametrize("rate", [7.0, -7.0])
@pytest.mark.parametrize("end", [0.95, 1.3, 4.0, 40.0])
def test_the_last_pass_before_the_end_is_the_last_of_all(rate: float, end: float) -> None:
    """Clockwise times fall as whole turns grow: the first of two passes was taken for the last."""
    turning = Turning.even(0.3, rate)
    times = turning.passes(1.0, 0.0, end)
    assert np.all(np.diff(times) > 0.0)
    assert turning.last_pass(1.0, end) == pytest.approx(times[-1], rel=1e-14)
    assert turning.first_pass(1.0) == pytest.approx(times[0], rel=1e-14)


def test_rows_of_equal_value_are_no_rows() -> None:
    values = {**SPEEDS, **LAGS, "start": 0.0, "speed": 3.0, **dict.fromkeys(("v1", "v2", "v3", "v4"), 3.0)}
    manifest = of(PHASE, turning=replace(ROWS, lag_times=(), lags=(), lag="", rolling=""))
    even, changing = (Repetition.of(manifest, one) for one in (values, {**values, "v2": 4.0}))
    assert (even.settled_after, changing.settled_after) == (-math.inf, SPEEDS["s3"])
    assert not even.changing(0.0, 9.0)
    assert changing.changing(1.3, 1.4)
    assert not changing.changing(2.2, 9.0)
