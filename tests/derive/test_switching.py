"""Claims about the switching functions that are derived from the laws."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import sympy as sp

from ballpass.derive import generate
from ballpass.derive.bearing.laws import LAWS
from ballpass.derive.bearing.laws.contact import Contact, Rest
from ballpass.derive.bearing.switching import Switching, find_switching
from ballpass.derive.reading.read import scene_from_text

DELTA, RATE, STIFFNESS, COEFFICIENT, WIDTH, RATE_WIDTH = sp.symbols("delta rate k c w w_v", real=True)


def switching(law: str, *, contact: bool = False, rate: bool = False, pairs: bool = False) -> Switching:
    touch = Contact(stiffness=STIFFNESS, width=WIDTH if contact else None)
    force = LAWS[law].force(DELTA, RATE, COEFFICIENT, touch, Rest(width=RATE_WIDTH if rate else None))
    return find_switching([touch.force(DELTA), force], DELTA, RATE, pairs=pairs)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        # function, whether the law of contact ends there, whether it jumps
        ("none", [(DELTA, True, False)]),
        ("one-sided", [(DELTA, True, False), (RATE, False, False)]),
        ("one-sided-gated", [(DELTA, True, True), (RATE, False, False)]),
        ("two-sided-gated", [(DELTA, True, True)]),
        ("tangent", [(DELTA, True, False)]),
    ],
)
def test_laws_switch_where_their_formulas_do(law: str, expected: list[tuple[sp.Symbol, bool, bool]]) -> None:
    found = switching(law)
    assert [(s.function, s.ends_above, s.jumps) for s in found.switches] == expected
    assert not any(s.ends_below for s in found.switches)


@pytest.mark.parametrize("law", LAWS)
def test_smoothed_laws_switch_nowhere(law: str) -> None:
    assert switching(law, contact=True, rate=True).switches == ()


def test_what_is_left_unsmoothed_still_switches() -> None:
    (switch,) = switching("one-sided-gated", contact=True).switches
    assert (switch.function, switch.of_rate, switch.jumps) == (RATE, True, False)
    (switch,) = switching("one-sided", rate=True).switches
    assert (switch.function, switch.of_rate) == (DELTA, False)


def test_opposite_balls_take_out_a_kink_of_the_rate_alone() -> None:
    assert [s.function for s in switching("one-sided", pairs=True).switches] == [DELTA]
    assert [s.function for s in switching("one-sided-gated", pairs=True).switches] == [DELTA, RATE]


def test_a_held_law_continues_its_side_and_is_the_law_where_let_go() -> None:
    found = switching("one-sided-gated")
    touch, approach = (s.border for s in found.switches)
    numbers = {STIFFNESS: 2, COEFFICIENT: 3}
    hertz = 2 * sp.Rational(1, 4) ** sp.Rational(3, 2)
    there = found.force.subs(numbers | {touch: -sp.oo, approach: -sp.oo})
    assert there.subs({DELTA: -1, RATE: -5}) == -15
    assert there.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == hertz + 15
    away = found.force.subs(numbers | {touch: sp.oo, approach: sp.oo})
    assert away.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == 0
    receding = found.force.subs(numbers | {touch: -sp.oo, approach: sp.oo})
    assert receding.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == hertz
    free = found.force.subs(numbers | {touch: 0, approach: 0})
    assert free.subs({DELTA: -1, RATE: 5}) == 0
    assert free.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == hertz + 15


def test_a_law_that_ends_from_above_is_held_there_alone() -> None:
    mirrored = sp.Piecewise((0, DELTA > 0), (STIFFNESS * (-DELTA) ** sp.Rational(3, 2), True))
    found = find_switching([mirrored], DELTA, RATE, pairs=False)
    (switch,) = found.switches
    assert (switch.ends_above, switch.ends_below) == (False, True)
    values = {STIFFNESS: 2, DELTA: -sp.Rational(1, 4)}
    assert found.force.subs({switch.border: -sp.oo}).subs(values) == 0
    assert found.force.subs({switch.border: sp.oo}).subs(values) == sp.Rational(1, 4)
    assert found.force.subs({switch.border: sp.oo}).subs({STIFFNESS: 2, DELTA: sp.Rational(1, 4)}) == 0


def test_a_condition_of_something_else_is_refused() -> None:
    with pytest.raises(TypeError, match="constant of the run"):
        find_switching([sp.Piecewise((1, DELTA > RATE), (0, True))], DELTA, RATE, pairs=False)


def test_a_scene_without_kinks_has_no_file_of_them(scene_text: Callable[..., str], tmp_path: Path) -> None:
    smoothing = ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n')
    plain = generate(scene_from_text(scene_text("varying_compliance"), "plain"), tmp_path / "plain")
    smooth = generate(scene_from_text(scene_text("varying_compliance", smoothing), "smooth"), tmp_path / "smooth")
    assert (plain / "switches.h").is_file()
    assert not (smooth / "switches.h").exists()
