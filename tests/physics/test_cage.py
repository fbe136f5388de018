"""Claims about a cage whose slip changes: its angle, spalls met in time, the statistics of a random slip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import edge_times

TIMES, SLIPS = np.array([0.0, 0.02, 0.05, 0.06]), np.array([0.0, 0.3, -0.1, 0.05])
TABLES = f"""[bearing.cage]
slip = {{ time = {{ values = {TIMES.tolist()}, unit = "s" }}, value = {SLIPS.tolist()} }}
[bearing.defects.spall]
on = "inner"
angle = "30 deg"
chord = "1 mm"
depth = "5 um"
profile = "half-sine"
[bearing.ball_waviness.each]
2 = {{ amplitude = "0.1 um" }}
[bearing.inner_ring]"""
PRELOAD = 20e-6
CHANGES = (
    ("[bearing.inner_ring]", TABLES),
    ('clearance = "0 um"  ', f'clearance = "{-2e6 * PRELOAD} um"  '),
    ('law = "none"  ', 'law = "tangent"\nratio = "2e-5 s"  '),
    ('["3.9937 um", "0.1 um"]', '["0 um", "0 um"]'),
    ('"load.*"]', '"cage.*"]'),
)


@pytest.fixture(scope="module")
def slipping(make_model: Callable[..., Model]) -> Model:
    return make_model("varying_compliance", *CHANGES)


def turned(model: Model, time: float) -> float:
    """Angle of the cage since the start: each row holds until the next [rad]."""
    spans = np.diff(np.minimum([*TIMES, np.inf], time))
    return float(
        model.constants()["bearing.cage_ratio"] * model.parameters["shaft.speed"] * np.sum((1 - SLIPS) * spans)
    )


@pytest.mark.parametrize("time", [0.0, 0.013, 0.02, 0.04, 0.055, 0.4])
def test_the_cage_turns_by_each_row_in_its_time(slipping: Model, time: float) -> None:
    seen = slipping.evaluate(time, np.zeros(4), ["cage.in_outer", "cage.in_inner"])
    shaft = slipping.parameters["shaft.speed"] * time
    assert np.exp(1j * seen["cage.in_outer"]) == pytest.approx(np.exp(1j * turned(slipping, time)), abs=1e-12)
    assert np.exp(1j * seen["cage.in_inner"]) == pytest.approx(np.exp(1j * (turned(slipping, time) - shaft)), abs=1e-12)


def test_spalls_are_met_where_the_slipping_cage_brings_them(slipping: Model) -> None:
    """Edges of the windows against the angle at their times: half the chord before and behind the spall."""
    values = {**slipping.parameters, **slipping.constants()}
    gates = [item for item in slipping.manifest.inputs if item.kind == "gate"]
    passed = [t for gate in gates for _, t in edge_times(slipping.manifest, gate, values, 0.0, 0.15)]
    edges = np.unique(np.concatenate(passed))
    assert len(edges) >= 8
    half = slipping.constants()["bearing.defects.spall.half_angle"]
    for time in edges:
        past = turned(slipping, time) - slipping.parameters["shaft.speed"] * time - np.deg2rad(30.0)
        pitch = 2.0 * np.pi / 8
        assert abs((past + pitch / 2) % pitch - pitch / 2) == pytest.approx(half, abs=1e-9)
    waves = {"bearing.defects.spall.depth": 0.0}
    for time in (0.01, 0.03, 0.2):
        found = slipping.evaluate(time, np.zeros(4), ["ball.deflection"], waves)["ball.deflection"]
        spin = turned(slipping, time) * (1 + 33.5 / 7.9375)
        assert found - PRELOAD == pytest.approx(np.full(8, 2e-7 * np.cos(2 * spin)), abs=1e-16)


@pytest.mark.long
def test_methods_lanes_and_derivatives_agree_while_the_slip_changes(slipping: Model) -> None:
    runs = [
        slipping.simulate(cycles=0.6, transient=0, method=m, rtol=1e-10).x
        for m in ("stepper-dop853", "stepper-rodas5p", "cvodes")
    ]
    scale = np.max(np.abs(runs[0]), axis=0)
    for other in runs[1:]:
        assert np.max(np.abs(other - runs[0]) / scale) < 1e-6
    chords = {"bearing.defects.spall.chord": [0.8e-3, 1e-3]}
    many = slipping.simulate_many(chords, ["max:inner.y"], cycles=0.6, transient=0, rtol=1e-10)
    alone = slipping.reduce(cycles=0.6, transient=0, rtol=1e-10)["inner.y"].maximum
    assert many["max:inner.y"][1] == pytest.approx(alone, rel=1e-9, abs=0.0)
    names = ["bearing.cage.slip.value.2", "bearing.cage.slip.value.4", "bearing.cage.slip.time.3"]
    found = slipping.sensitivities(names, cycles=0.6, method="stepper-rodas5p", rtol=1e-11).x[-1]
    for name, column in zip(names, found.T, strict=True):
        value = slipping.parameters[name]
        ends = [
            slipping.simulate(
                cycles=0.6, transient=0, parameters={name: value + s}, method="stepper-dop853", rtol=1e-12
            ).x[-1]
            for s in (1e-6, -1e-6)
        ]
        slope = (ends[0] - ends[1]) / 2e-6
        assert column == pytest.approx(slope, rel=1e-4, abs=1e-4 * np.max(np.abs(slope)))


def drawn(scene_text: Callable[..., str], seed: int, rows: int = 100) -> np.ndarray:
    """Slips that a seed draws about 0.02 with a deviation of 0.01, every 2 ms."""
    jitter = f'{{ deviation = 0.01, interval = "2 ms", duration = "{2 * rows} ms", seed = {seed} }}'
    table = f"[bearing.cage]\nslip = 0.02\njitter = {jitter}\n[bearing.inner_ring]"
    scene = scene_from_text(scene_text("varying_compliance", ("[bearing.inner_ring]", table)), "jitter")
    cage = scene.bearings[0].cage
    assert cage is not None
    assert [q.value for q in cage.time] == pytest.approx(2e-3 * np.arange(rows + 1), rel=1e-12, abs=0.0)
    assert cage.slips[-1].value == 0.02
    return np.array([q.value for q in cage.slips[:-1]])


def test_a_random_slip_is_normal_and_its_angle_walks_at_random(scene_text: Callable[..., str]) -> None:
    """Rows of 40 seeds: normal, without memory; the variance of the angle grows with the number of rows."""
    several = np.array([drawn(scene_text, seed) for seed in range(40)])
    normal = (several - 0.02) / 0.01
    assert stats.kstest(normal.ravel(), "norm").pvalue > 1e-3
    assert abs(np.mean(normal[:, 1:] * normal[:, :-1])) < 4.0 / np.sqrt(normal.size)
    walked = np.cumsum(normal, axis=1)
    for rows in (10, 40, 100):
        ratio = np.var(walked[:, rows - 1]) * 40 / rows  # chi square of 39 degrees of freedom
        assert stats.chi2.ppf(1e-4, 39) < ratio < stats.chi2.ppf(1 - 1e-4, 39)
    assert np.array_equal(several[7], drawn(scene_text, 7))


def test_rows_that_do_not_begin_at_the_start_are_refused(scene_text: Callable[..., str]) -> None:
    table = '[bearing.cage]\nslip = { time = ["1 s", "2 s"], value = [0.0, 0.1] }\n[bearing.inner_ring]'
    with pytest.raises(SceneError, match="does not begin at the start"):
        scene_from_text(scene_text("varying_compliance", ("[bearing.inner_ring]", table)), "late")


def test_a_ring_that_stands_is_passed_at_the_mean_speed_of_a_slipping_cage(make_virtual: Callable[..., Model]) -> None:
    """Of a shaft that carries the outer ring the balls passed the inner one as with the last slip."""
    slip = '[bearing.cage]\nslip = { time = ["0 s", "0.03 s"], value = [0.0, 0.2] }\n[bearing.inner_ring]'
    outer = ("[shaft]\n", '[shaft]\nring = "outer"\n')
    model = make_virtual("varying_compliance", ("[bearing.inner_ring]", slip), outer)
    values = {**model.parameters, **model.constants()}
    found = {**values, **timeline.mean_rates(model.manifest, values, 0.02, 0.06)}
    shaft = values["shaft.speed"]
    cage = (1.0 - values["bearing.cage_ratio"]) * shaft * (1.0 - 0.2 * 0.03 / 0.04)
    assert found["bearing.cage_speed"] == pytest.approx(cage, rel=1e-12)
    assert found["bearing.inner_pass_speed"] == pytest.approx(cage, rel=1e-12)
    assert found["bearing.outer_pass_speed"] == pytest.approx(cage - shaft, rel=1e-12)
