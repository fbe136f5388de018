"""Claims about gates, tables and phases, checked by hand or against brute force."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import InputInfo
from ballpass.runtime.run import driver_angle

TURN = 2.0 * math.pi
GATE = InputInfo(name="gate", kind="gate", offset="start", rate="speed", windows=(("w.start", "w.end"),))
TABLE = InputInfo(name="table", kind="table", times=("t1", "t2", "t3"), values=("y1", "y2", "y3"))
SLOPE = InputInfo(name="slope", kind="table_rate", times=("t1", "t2", "t3"), values=("y1", "y2", "y3"))
PHASE = InputInfo(name="phase", kind="phase", offset="start", rate="speed")
KNOTS = {"t1": 1.0, "t2": 2.0, "t3": 4.0, "y1": 10.0, "y2": 20.0, "y3": 0.0}


def window(start: float, end: float, speed: float = TURN, offset: float = 0.0) -> dict[str, float]:
    """A window in degrees; one turn a second by default."""
    return {"w.start": math.radians(start), "w.end": math.radians(end), "speed": speed, "start": offset}


def gate(values: dict[str, float], t: float) -> float:
    return float(driver_angle.inputs_at((GATE,), values, t)[0])


def test_punch_window_switches_at_its_angles_in_every_turn() -> None:
    values = window(237, 267)
    expected = [(k + angle / 360.0) for k in range(3) for angle in (237, 267)]
    np.testing.assert_allclose(driver_angle.breakpoints((GATE,), values, 0.0, 3.0), expected, rtol=1e-15)
    assert [gate(values, t / 360.0) for t in (236.999, 237.001, 266.999, 267.001)] == [0.0, 1.0, 1.0, 0.0]


def test_start_belongs_to_the_window_and_end_does_not_even_when_rounding_hits_them() -> None:
    values = window(237, 267, speed=500.0 * TURN / 60.0, offset=0.1)
    edges = driver_angle.breakpoints((GATE,), values, 0.0, 120.0)
    assert len(edges) == 2 * 1000
    inside = [gate(values, t) for t in edges]
    assert inside == [1.0, 0.0] * 1000


def test_window_across_zero_is_one_window() -> None:
    values = window(330, 30)
    assert [gate(values, a / 360.0) for a in (0, 29, 31, 180, 329, 331, 359, 361)] == [1, 1, 0, 0, 0, 1, 1, 1]
    np.testing.assert_allclose(driver_angle.breakpoints((GATE,), values, 0.0, 1.0), [30 / 360, 330 / 360], rtol=1e-15)


@pytest.mark.parametrize(("start", "end", "value"), [(40, 40, 0.0), (0, 360, 1.0), (90, 450, 1.0), (10, 800, 1.0)])
def test_windows_of_zero_width_never_act_and_of_a_turn_or_more_always(start: float, end: float, value: float) -> None:
    values = window(start, end)
    assert [gate(values, t) for t in np.linspace(0.0, 2.0, 97)] == [value] * 97
    assert driver_angle.breakpoints((GATE,), values, 0.0, 5.0).size == 0


def test_backward_driver_meets_the_end_first() -> None:
    values = window(237, 267, speed=-TURN)
    np.testing.assert_allclose(driver_angle.breakpoints((GATE,), values, 0.0, 1.0), [93 / 360, 123 / 360], rtol=1e-14)
    assert [gate(values, t / 360.0) for t in (92, 94, 122, 124)] == [0.0, 1.0, 1.0, 0.0]


def test_standing_driver_holds_its_gate() -> None:
    values = window(237, 267, speed=0.0, offset=math.radians(240))
    assert gate(values, 1e6) == 1.0
    assert driver_angle.breakpoints((GATE,), values, 0.0, 1e6).size == 0


@pytest.mark.parametrize(("begin", "end"), [(0.0, 1e300), (-1.7e308, 1.7e308), (0.0, 1e9)])
def test_more_turns_than_can_be_listed_are_refused(begin: float, end: float) -> None:
    with pytest.raises(RequestError, match="too many to list what switches"):
        driver_angle.breakpoints((GATE,), window(237, 267), begin, end)


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
    edges = driver_angle.breakpoints((GATE,), values, 0.0, t1)
    bounds = np.concatenate([[0.0], edges, [t1]])
    # edges nearer than the clock's resolution are one edge: leave out starts and ends that all but meet one
    assume(np.min(np.diff(bounds)) * speed > 1e4 * driver_angle.ANGLE_RESOLUTION)
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
    found = [driver_angle.inputs_at((TABLE,), KNOTS, t)[0] for t in times]
    np.testing.assert_allclose(found, np.interp(times, [1, 2, 4], [10, 20, 0]), rtol=1e-15)
    slopes = [driver_angle.inputs_at((SLOPE,), KNOTS, t)[0] for t in times]
    assert slopes == [0.0, 10.0, 10.0, -10.0, -10.0, 0.0, 0.0]
    np.testing.assert_array_equal(driver_angle.breakpoints((TABLE, SLOPE), KNOTS, 0.0, 9.0), [1.0, 2.0, 4.0])


def test_slope_is_that_of_the_interval_while_the_value_is_that_of_the_reference_time() -> None:
    found = driver_angle.inputs_at((TABLE, SLOPE), KNOTS, 2.0, inside=3.0)
    np.testing.assert_allclose(found, [20.0, -10.0])
    before = driver_angle.inputs_at((TABLE, SLOPE), KNOTS, 2.0, inside=1.5)
    np.testing.assert_allclose(before, [20.0, 10.0])


def test_table_times_must_increase() -> None:
    with pytest.raises(RequestError, match=r"t3 = 2 s was given after t2 = 2 s"):
        driver_angle.inputs_at((TABLE,), {**KNOTS, "t3": 2.0}, 0.0)


def test_phase_is_reduced_and_stays_accurate_in_the_thousandth_turn() -> None:
    values = {"start": 0.25, "speed": TURN / 0.125}  # eight turns a second, exact in binary
    found = driver_angle.inputs_at((PHASE,), values, 1000.0 + 0.125 / 4)[0]
    assert 0.0 <= found < TURN
    assert found == pytest.approx(0.25 + TURN / 4, abs=1e-11)


@pytest.mark.parametrize("t", [0.5, 1.3, 2.7, 5.0])
def test_input_derivatives_equal_differences(t: float) -> None:
    values = {**KNOTS, "start": 0.2, "speed": 3.0}
    inputs = (PHASE, TABLE, SLOPE)
    found = dict.fromkeys(values, np.zeros(3))
    for row, name, slope in driver_angle.input_derivatives(inputs, values, t):
        found[name] = found[name] + slope * np.eye(3)[row]
    for name, value in values.items():
        step = 1e-6
        sides = [driver_angle.inputs_at(inputs, {**values, name: value + s * step}, t) for s in (1, -1)]
        change = sides[0] - sides[1]
        change[0] = math.remainder(change[0], TURN)
        np.testing.assert_allclose(found[name], change / (2 * step), atol=1e-7, err_msg=name)
