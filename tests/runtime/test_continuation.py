"""Branches of maps whose fixed points and multipliers are known in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ballpass.runtime.motion import continuation
from ballpass.runtime.motion.continuation import SteadyBranch, follow
from ballpass.runtime.motion.shooting import Residual


@pytest.fixture(autouse=True)
def _without_contacts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(continuation, "contact_sequence", lambda *_: SimpleNamespace(same=lambda _: True))


class KnownMap:
    """What `follow` takes of a `Shooting`, for a function that must vanish, with its derivatives."""

    repeats, segments = 1, 1

    def __init__(self, function: Callable[[np.ndarray, float], tuple[Any, Any, Any]], states: int) -> None:
        self.function, self.magnitude = function, np.ones(states)

    def residual(self, nodes: np.ndarray, value: float) -> Residual:
        left, by_states, by_parameter = (np.array(one, dtype=float) for one in self.function(nodes[0], value))
        return Residual(
            left=left, by_states=by_states, by_parameter=by_parameter, monodromy=by_states + np.eye(len(left))
        )


def branch_of(function: Callable[[np.ndarray, float], tuple[Any, Any, Any]], start: Any, value: float) -> SteadyBranch:
    begin: Any = SimpleNamespace(nodes=np.array([start], dtype=float))
    known: Any = KnownMap(function, len(start))
    return follow(known, begin, value, (0.0, 1.0))


def at_rest(
    matrix: Callable[[float], np.ndarray],
) -> Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """A linear map, whose fixed point is zero and whose multipliers are the matrix's eigenvalues."""

    def function(x: np.ndarray, value: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        by_states = matrix(value) - np.eye(len(x))
        return by_states @ x, by_states, np.zeros(len(x))

    return function


def with_trace(trace: float, product: float) -> np.ndarray:
    return np.array([[trace, -product], [1.0, 0.0]])


@pytest.mark.parametrize("width", [0.1, 0.01, 1e-3, 2e-4])
def test_two_doublings_within_a_step_are_both_found(width: float) -> None:
    """A tongue, in which a pair of multipliers leaves the unit circle through -1 and comes back; others turn on."""
    places = np.array([0.0123, 0.327, 0.734, 0.95])  # half a width is left at the end of the range

    def matrix(value: float) -> np.ndarray:
        # 1 + trace + product is the polynomial of the multipliers at -1
        whole = np.zeros((2 * len(places) + 2, 2 * len(places) + 2))
        for k, place in enumerate(places):
            polynomial = 100.0 * ((value - place) ** 2 - (0.5 * width) ** 2)
            whole[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = with_trace(min(polynomial, 1.9) - 1.9, 0.9)
        whole[-2:, -2:] = with_trace(1.9 * math.cos(12.0 * value), 0.9)
        return whole

    found = branch_of(at_rest(matrix), np.zeros(2 * len(places) + 2), 0.0).special
    zeros = np.sort(np.concatenate([places - 0.5 * width, places + 0.5 * width]))
    assert {point.kind for point in found} == {"period doubling"}
    assert [point.value for point in found] == pytest.approx(zeros[(zeros > 0.0) & (zeros < 1.0)], abs=1e-8)


def test_a_complex_pair_that_passes_the_circle_is_told_from_two_real_ones_of_product_one() -> None:
    complex_pair = branch_of(at_rest(lambda v: with_trace(0.5, 0.8 + 0.3 * v)), np.zeros(2), 0.0)
    assert [(point.kind, round(point.value, 8)) for point in complex_pair.special] == [
        ("Neimark-Sacker", round(2.0 / 3.0, 8))
    ]
    real_ones = branch_of(at_rest(lambda v: with_trace(3.0, 0.8 + 0.3 * v)), np.zeros(2), 0.0)
    assert not real_ones.special
    assert not any(point.stable for point in real_ones.points)


def test_a_multiplier_that_jumps_across_the_circle_is_no_doubling() -> None:
    """As where a contact grazes: it is -0.5 before and -3 behind."""
    found = branch_of(at_rest(lambda v: np.array([[-0.5 if v < 0.4 else -3.0]])), np.zeros(1), 0.0)
    assert not found.special
    ((one, other),) = found.unlocated
    assert one.value < 0.4 < other.value < one.value + 0.01


def test_a_branch_that_turns_back_leaves_its_range_by_the_first_end() -> None:
    """x^2 = 1/2 - value, of which the lower half attracts."""
    found = branch_of(lambda x, v: ([x[0] ** 2 + v - 0.5], [[2.0 * x[0]]], [1.0]), [-math.sqrt(0.5)], 0.0)
    assert [(point.kind, round(point.value, 8)) for point in found.special] == [("fold", 0.5)]
    assert found.points[-1].value == pytest.approx(0.0, abs=1e-9)
    assert found.points[-1].nodes[0, 0] == pytest.approx(math.sqrt(0.5))
    assert found.ended == "at the first end of the range, to which it turned back"


def test_a_closed_branch_is_followed_once() -> None:
    """A circle of radius 0.2 about the middle of the range, begun at its top."""

    def circle(x: np.ndarray, v: float) -> tuple[Any, Any, Any]:
        return [x[0] ** 2 + (v - 0.5) ** 2 - 0.04], [[2.0 * x[0]]], [2.0 * (v - 0.5)]

    found = branch_of(circle, [0.2], 0.5)
    assert found.ended == "where it began: it is closed"
    assert [round(point.value, 7) for point in found.special] == [0.7, 0.3]


def test_a_branch_without_end_says_that_its_points_are_used_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(continuation, "POINTS", 30)
    found = branch_of(lambda x, _: ([x[0]], [[1.0]], [0.0]), [0.0], 0.0)
    assert found.ended == "where its 30 points are used up"
    assert len(found.points) == 31
