"""Limits of lives: each is said beyond it, with its number, and not before."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from ballpass.runtime import Model
from ballpass.runtime.life.limits import limits_of

#: A light ring, much damped: the force on the bearing is the load.
CALM = {"bearing.inner_ring.mass": 0.2, "bearing.inner_ring.damping": 5e3}

XJTU = (("balls = 8", 'balls = 8\ndynamic_rating = "12.82 kN"\nstatic_rating = "6.65 kN"'),)


@pytest.mark.parametrize(
    ("kilonewton", "rpm", "hours", "share"),
    [(12.0, 2100.0, 9.677, 0.94), (11.0, 2250.0, 11.726, 0.86), (10.0, 2400.0, 14.632, 0.78)],
)
def test_printed_lives_of_run_to_failure_tests_are_met_and_doubted(
    make_model: Callable[..., Model], kilonewton: float, rpm: float, hours: float, share: float
) -> None:
    """XJTU-SY, LDK UER204: L_10h is printed; bearings lived 0.87 to 42 h, for P is beyond 0.5 C_r."""
    model = make_model("varying_compliance", *XJTU)
    numbers = {
        **CALM,
        "load.force.x": 1e3 * kilonewton,
        "shaft.speed": rpm * math.tau / 60.0,
        "bearing.ball_diameter": 7.92e-3,
        "bearing.pitch_diameter": 34.55e-3,
    }
    report = model.life(cycles=3, transient=2, parameters=numbers)
    (bearing,) = report.bearings
    assert bearing.basic_life is not None
    assert bearing.hours(bearing.basic_life) == pytest.approx(hours, rel=5e-3)
    assert any(f"is {share:.2f} C_r: ISO 281 gives lives up to 0.5 C_r" in words for words in report.beyond)
    assert any("exceeds C_0r = 6650 N" in words for words in report.beyond)
    assert any("exceeds 4200 MPa" in words for words in report.beyond)
    assert any("below 1" in words for words in report.beyond)


def test_a_bearing_within_all_limits_gets_no_word(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance", *XJTU)
    options = {"cycles": 3, "transient": 2}
    usual = {**CALM, "load.force.x": 1e3, "shaft.speed": 100.0}
    assert model.life(**options, parameters=usual).beyond == ()  # type: ignore[arg-type]
    (slides,) = model.life(**options, parameters={**usual, "load.force.x": 100.0}).beyond  # type: ignore[arg-type]
    assert "0.0078 C_r: below 0.01 C_r" in slides
    # a ball of 2.0 g at 16.75 mm and 0.38 of 4000 rad/s
    report = model.life(**options, parameters={**usual, "shaft.speed": 4000.0})  # type: ignore[arg-type]
    fast = report.beyond
    force = 7800.0 * math.pi / 6.0 * 7.9375e-3**3 * 16.75e-3 * (0.5 * (1.0 - 7.9375 / 33.5) * 4000.0) ** 2
    assert any(f"centrifugal force of a ball, {force:.3g} N" in words for words in fast)
    assert any("n d_m = 1.28e+06 mm/min exceeds 500000" in words for words in fast)


@pytest.mark.long
def test_a_short_burst_of_speed_is_judged_by_its_highest(make_model: Callable[..., Model]) -> None:
    """Most of the time 300 rpm, for a moment 18 000 rpm: 33.5 mm by 18 000 rpm is beyond what grease allows."""
    rows = (
        'time = ["0 s", "1 s", "1.02 s", "1.04 s", "1.06 s"], speed = ["300 rpm", "300 rpm", "{0}", "{0}", "300 rpm"]'
    )
    model = make_model(
        "four_bar",
        ('speed = "600 rpm"', f"table = {{ {rows.format('18000 rpm')} }}"),
        ("cycles = 4\n", 'duration = "1.2 s"\n'),
    )
    light = {f"mechanism.bodies.{body}.mass": 1e-4 for body in ("crank", "coupler", "rocker")}
    light |= {f"mechanism.bodies.{body}.inertia": 1e-8 for body in ("crank", "coupler", "rocker")}
    fast = model.life(parameters=light, transient=0).beyond
    assert any("n d_m at the highest speed = 6.03e+05 mm/min exceeds 500000" in words for words in fast)
    calm = light | {f"mechanism.driver.table.speed.{row}": 300.0 * math.pi / 30.0 for row in (3, 4)}
    assert not any("n d_m" in words for words in model.life(parameters=calm, transient=0).beyond)


@pytest.mark.parametrize("slip", [0.0, 0.1])
def test_the_centrifugal_force_is_that_of_the_models_cage(make_model: Callable[..., Model], slip: float) -> None:
    """Where the outer ring turns balls go round faster, (1 + gamma)/2 of its speed; a cage that slips is slower."""
    model = make_model("varying_compliance", ("[shaft]\n", '[shaft]\nring = "outer"\n'))
    numbers = {**CALM, "load.force.x": 1e3, "shaft.speed": -4000.0}
    (bearing,) = model.life(cycles=3, transient=2, parameters=numbers).bearings
    values = dict(model.numbers(numbers).values)
    ball, pitch = values["bearing.ball_diameter"], values["bearing.pitch_diameter"]
    values["bearing.cage_speed"] *= 1.0 - slip
    force = 7800.0 * math.pi / 6.0 * ball**3 * pitch / 2.0 * (0.5 * (1.0 + ball / pitch) * (1.0 - slip) * 4000.0) ** 2
    (words,) = (one for one in limits_of(model.manifest.bearings[0], values, bearing) if "centrifugal" in one)
    assert f"centrifugal force of a ball, {force:.3g} N" in words


def test_a_bearing_that_carries_nothing_lives_without_limit(make_model: Callable[..., Model]) -> None:
    """A ring in free fall through a wide clearance: a reciprocal of zero ended in a traceback."""
    model = make_model("varying_compliance", *XJTU)
    report = model.life(cycles=0.02, transient=0, parameters={**CALM, "bearing.clearance": 30e-3})
    (bearing,) = report.bearings
    assert bearing.basic_life == math.inf
    assert bearing.equivalent_load == 0.0
    (words,) = report.beyond
    assert "P = 0 N is 0 C_r: below 0.01 C_r, the minimum load" in words
