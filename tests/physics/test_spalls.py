"""Claims about spalls: how deep a ball sinks, when, steps that end on every edge, derivatives across them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive import SceneError, derive
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, RequestError

BALLS, PRELOAD = 9, 50e-6
#: SKF 6205 of the CWRU data set: diameters, and its published factors to shaft speed.
CWRU = {"bearing.ball_diameter": 0.3126 * 0.0254, "bearing.pitch_diameter": 1.537 * 0.0254}
BPFO, BPFI, TWICE_BSF = 3.5848, 5.4152, 4.7135
OF_6204 = {"bearing.ball_diameter": 7.9375e-3, "bearing.pitch_diameter": 33.5e-3}
SPALLS = """
[bearing.defects.deep]
on = "outer"
angle = "10 deg"
chord = "1 mm"
profile = "path"
[bearing.defects.shallow]
on = "inner"
angle = "-60 deg"
chord = "1 mm"
depth = "1 mm"
profile = "path"
[bearing.defects.dent]
on = "outer"
angle = "31 deg"
chord = "0.5 mm"
depth = "0 um"
profile = "half-sine"
[bearing.defects.flake]
on = "ball"
ball = 2
angle = "50 deg"
chord = "0.5 mm"
depth = "0 um"
profile = "rectangular"
[bearing.defects.pit]
on = "ball"
ball = 4
angle = "-30 deg"
chord = "1 mm"
profile = "path"
"""
CHANGES = (
    ("balls = 8", "balls = 9"),
    ("[bearing.inner_ring]", f"{SPALLS}[bearing.cage]\nslip = 0.0\n[bearing.inner_ring]"),
    ('clearance = "0 um"  ', f'clearance = "{-2e6 * PRELOAD} um"  '),
    ('law = "none"  ', 'law = "tangent"\nratio = "2e-5 s"  '),
    ('["3.9937 um", "0.1 um"]', '["0 um", "0 um"]'),
    ('"load.*"]', '"ring_force.*"]'),
)


@pytest.fixture(scope="module")
def spalled(make_virtual: Callable[..., Model]) -> Model:
    return make_virtual("varying_compliance", *CHANGES)


def sunk(model: Model, ball: int, time: float, numbers: dict[str, float] | None = None) -> float:
    """How deep a ball is sunk while the rings are held [m]."""
    found = model.evaluate(time, np.zeros(4), ["ball.deflection"], numbers)["ball.deflection"]
    return PRELOAD - float(found[ball - 1])


def passing(model: Model, ring: str) -> float:
    return model.constants(OF_6204)["bearing.cage_speed" if ring == "outer" else "bearing.inner_pass_speed"]


@pytest.mark.parametrize(("ring", "spall", "deepest"), [("outer", "deep", 25.588e-6), ("inner", "shallow", 41.406e-6)])
def test_a_ball_touches_the_edges_and_nothing_else_of_the_raceway(
    spalled: Model, ring: str, spall: str, deepest: float
) -> None:
    """Its circle and many points of the raceway beside the spall: the least room is how deep it sinks."""
    ball, pitch = OF_6204.values()
    ball, pitch = ball / 2, pitch / 2
    side = 1.0 if ring == "outer" else -1.0
    raceway = pitch + side * ball
    half = np.arcsin(0.5e-3 / raceway)
    outline = half * np.concatenate([-np.linspace(1.0, 3.0, 4001), np.linspace(1.0, 3.0, 4001)])
    middle, speed = spalled.parameters[f"bearing.defects.{spall}.angle"], passing(spalled, ring)
    for past in np.array([-1.01, -0.99, -0.6, -0.2, 0.0, 0.3, 0.9, 1.01]) * half:
        place = outline - past
        aside = raceway * np.sin(place)
        touch = raceway * np.cos(place) - side * np.sqrt(ball**2 - aside**2)  # centre of a ball that touches the point
        room = np.min(side * (touch - pitch))
        time = (middle + past + (2.0 * np.pi if speed * (middle + past) < 0.0 else 0.0) * np.sign(speed)) / speed
        assert sunk(spalled, 1, time, OF_6204) == pytest.approx(max(room, 0.0), abs=2e-12)
    time = (middle + (2.0 * np.pi if speed * middle < 0.0 else 0.0) * np.sign(speed)) / speed
    assert sunk(spalled, 1, time, OF_6204) == pytest.approx(deepest, abs=1e-9)
    shallow = {**OF_6204, f"bearing.defects.{spall}.depth": 15e-6}
    if ring == "inner":
        assert sunk(spalled, 1, time, shallow) == pytest.approx(15e-6, abs=1e-16)


def test_a_ball_sinks_as_deep_by_its_own_spall(spalled: Model) -> None:
    """Sagittas again: at the outer raceway, and half a turn of the ball later at the inner one."""
    spin = spalled.constants(OF_6204)["bearing.spin_speed"]
    middle = spalled.parameters["bearing.defects.pit.angle"]
    for turned, deepest in ((2.0 * np.pi, 25.588e-6), (np.pi, 41.406e-6)):
        assert sunk(spalled, 4, (middle + turned) / spin, OF_6204) == pytest.approx(deepest, abs=1e-9)
        assert sunk(spalled, 3, (middle + turned) / spin, OF_6204) == 0.0


@pytest.mark.parametrize("slip", [0.0, pytest.param(0.04, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("spall", "factor", "radius"),
    [
        ("dent", BPFO, (1.537 + 0.3126) / 2 * 0.0254),
        ("shallow", BPFI, (1.537 - 0.3126) / 2 * 0.0254),
        ("flake", TWICE_BSF, None),
    ],
)
def test_pulses_come_at_the_published_frequencies_and_last_as_kinematics_say(
    spalled: Model, spall: str, factor: float, radius: float | None, slip: float
) -> None:
    """Edges found in the deflection of the balls alone, by bisection.

    A cage that slips moves lines of outer raceway and balls by (1 - s), and of the inner one what it adds to them.
    """
    factor = BALLS - (BALLS - factor) * (1 - slip) if spall == "shallow" else factor * (1 - slip)
    numbers = {
        **CWRU,
        "bearing.cage.slip": slip,
        "bearing.defects.dent.depth": 5e-6,
        "bearing.defects.flake.depth": 5e-6,
    }
    others = [name for name in ("deep", "shallow", "dent", "flake", "pit") if name != spall]
    shut = {f"bearing.defects.{name}.chord": 1e-9 for name in others}
    turn = 2.0 * np.pi / spalled.parameters["shaft.speed"]

    def within(time: float) -> bool:
        found = spalled.evaluate(time, np.zeros(4), ["ball.deflection"], {**numbers, **shut})["ball.deflection"]
        return bool(np.max(PRELOAD - found) > 0.0)

    times = np.linspace(0.0, 1.1 * turn, 1500)
    seen = np.array([within(t) for t in times])
    edges = []
    for k in np.flatnonzero(seen[1:] != seen[:-1]):
        a, b = times[k], times[k + 1]
        while b - a > 1e-12 * turn:
            middle = (a + b) / 2
            a, b = (middle, b) if within(middle) == seen[k] else (a, middle)
        edges.append(a)
    begins, ends = (edges[k::2] for k in ((0, 1) if not seen[0] else (1, 2)))
    period = np.diff(begins)
    assert len(period) >= 3
    assert turn / period == pytest.approx(factor, abs=6e-5)  # as published, to its last digit
    ball, pitch = CWRU.values()
    cage = (1 - ball / pitch) / 2 * (1 - slip)
    exact = {"dent": BALLS * cage, "shallow": BALLS * (1 - cage)}
    exact["flake"] = pitch / ball * (1 - (ball / pitch) ** 2) * (1 - slip)
    assert period == pytest.approx(turn / exact[spall], rel=1e-6)
    chord = spalled.parameters[f"bearing.defects.{spall}.chord"]
    angle = 2.0 * np.arcsin(chord / 2 / (ball / 2 if radius is None else radius))
    speed = factor / (2.0 if radius is None else BALLS) * 2.0 * np.pi / turn
    least = 2e-3 if spall == "shallow" else 2e-5  # a path begins so gently that rounding hides its first part
    assert np.array(ends[: len(begins)]) - begins[: len(ends)] == pytest.approx(angle / speed, rel=least)


@pytest.mark.long
def test_steps_end_on_every_edge_however_narrow_and_coarse(make_model: Callable[..., Model]) -> None:
    """A spall that takes a thousandth of a turn of the cage, at a tolerance that steps over it."""
    compiled = make_model("varying_compliance", *CHANGES)
    narrow = {"bearing.defects.dent.depth": 20e-6, "bearing.defects.dent.chord": 20e-6}
    run = compiled.simulate(cycles=0.6, transient=0, parameters=narrow, rtol=1e-3)
    fine = compiled.simulate(cycles=0.6, transient=0, parameters=narrow, rtol=1e-10)
    without = compiled.simulate(cycles=0.6, transient=0, rtol=1e-10)
    felt = np.max(np.abs(fine.x - without.x), axis=0)
    assert np.all(np.max(np.abs(run.x - fine.x), axis=0) < 0.05 * felt)


def test_a_given_ratio_of_the_cage_takes_the_place_of_rolling(scene_text: Callable[..., str]) -> None:
    text = scene_text(
        "varying_compliance", ("[bearing.inner_ring]", "[bearing.cage]\nratio = 0.4\n[bearing.inner_ring]")
    )
    known = {d.symbol.name: d.expression for d in derive(scene_from_text(text, "given")).constants}
    assert known["bearing.cage_ratio"].name == "bearing.cage.ratio"
    for wrong in ("1.2", "-0.1"):
        with pytest.raises(SceneError, match=r"bearing\.cage\.ratio"):
            scene_from_text(text.replace("0.4", wrong), "given")


def test_a_spall_that_two_balls_would_share_is_refused(spalled: Model, scene_text: Callable[..., str]) -> None:
    long = scene_text(
        "varying_compliance", (CHANGES[1][0], CHANGES[1][1].replace('chord = "1 mm"', 'chord = "8 mm"', 1))
    )
    with pytest.raises(SceneError, match="as long as the balls are apart"):
        scene_from_text(long, "long")
    with pytest.raises(RequestError, match="ball_diameter: allowed is a number above"):
        spalled.simulate(cycles=0.1, parameters={"bearing.defects.deep.chord": 9e-3})
