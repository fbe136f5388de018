"""Claims about loads on rings without a mechanism, and beside one: their course over time, what they do to a rotor."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import h5netcdf
import numpy as np
import pytest

from ballpass.derive import SceneError, read_scene
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.point.jacobian import rows_of, values_of_rows

ROTOR = (Path(__file__).resolve().parents[2] / "scenes" / "varying_compliance.toml").read_text(encoding="utf-8")
OLD = ROTOR[ROTOR.index("[load]") : ROTOR.index("[bearing]")]
LOADS = """
[loads.rest]
type = "constant"
force = ["3 N", "-4 N"]
[loads.step]
type = "constant"
force = { magnitude = "10 N", direction = "90 deg" }
time_window = { start = "0.2 s" }
[loads.burst]
type = "harmonic"
mean = ["1 N", "0 N"]
amplitude = ["5 N", "7 N"]
frequency = "31 Hz"
phase = ["20 deg", "-50 deg"]
time_window = { start = "0.1 s", end = "0.33 s" }
[loads.cut]
type = "constant"
force = ["100 N", "0 N"]
window = { start = "300 deg", end = "40 deg" }
[loads.cam]
type = "table"
angle = { values = [10, 90, 200], unit = "deg" }
x = ["0 N", "30 N", "0 N"]
y = ["1 N", "2 N", "3 N"]
[loads.unbalance]
type = "unbalance"
mass = "30 g"
eccentricity = "50 mm"
angle = "35 deg"
"""


@pytest.fixture(scope="module")
def many(make_model: Callable[..., Model]) -> Model:
    return make_model("varying_compliance", (OLD, LOADS))


@pytest.mark.parametrize("speed", [41.0, -11.0])
def test_loads_sum_up_to_their_formulas(many: Model, speed: float) -> None:
    """Over several turns, windows open at their edges; force by NumPy."""
    t = np.linspace(0.0005, 0.5995, 800)
    found = many.simulate(times=t, parameters={"shaft.speed": speed}, outputs=["load.x", "load.y"])
    degree = math.pi / 180.0
    angle = np.mod(speed * t, 2 * math.pi)
    burst = (t >= 0.1) & (t < 0.33)
    cut = (angle >= 300 * degree) | (angle < 40 * degree)
    x = 3.0 + burst * (1.0 + 5.0 * np.cos(62 * math.pi * t + 20 * degree)) + 100.0 * cut
    y = -4.0 + 10.0 * (t >= 0.2) + burst * 7.0 * np.cos(62 * math.pi * t - 50 * degree)
    knots = np.array([10.0, 90.0, 200.0]) * degree
    x += np.interp(angle, knots, [0.0, 30.0, 0.0], period=2 * math.pi)
    y += np.interp(angle, knots, [1.0, 2.0, 3.0], period=2 * math.pi)
    turning = 0.03 * 0.05 * speed**2 * np.exp(1j * (speed * t + 35 * degree))
    assert found["load.x"] == pytest.approx(x + turning.real, abs=1e-9)
    assert found["load.y"] == pytest.approx(y + turning.imag, abs=1e-9)


def test_steps_end_on_the_edges_of_windows(many: Model) -> None:
    edges = many.breakpoints(0.0, 0.5)
    for time in (0.1, 0.2, 0.33):
        assert np.min(np.abs(edges - time)) == 0.0
    speed = many.parameters["shaft.speed"]
    for angle in (300.0, 40.0, 10.0, 90.0, 200.0):
        assert np.min(np.abs(edges - math.radians(angle) / speed)) < 1e-13


@pytest.mark.long
def test_a_burst_gives_a_free_ring_its_impulse_and_a_verified_slope(make_model: Callable[..., Model]) -> None:
    """In a wide clearance the ring is free: m v = F (t2 - t1), and the distance changes with t1 as -F (T - t1)/m."""
    burst = '[load]\ntype = "constant"\nforce = ["8 N", "-3 N"]\ntime_window = { start = "2 ms", end = "5 ms" }\n'
    free = (
        ('clearance = "0 um"  ', 'clearance = "70 um"  '),
        ('["3.9937 um", "0.1 um"]', '["0 um", "0 um"]'),
        ('damping = "200 N*s/m"  ', ""),
    )
    model = make_model("varying_compliance", (OLD, burst), *free)
    run = model.simulate(duration=0.01, transient=0, outputs=[])
    assert run["inner.vx"][-1] == pytest.approx(8.0 * 0.003 / 20.0, rel=1e-12, abs=0.0)
    assert run["inner.vy"][-1] == pytest.approx(-3.0 * 0.003 / 20.0, rel=1e-12, abs=0.0)
    edges = ["load.time_window.start", "load.time_window.end"]
    slopes = model.sensitivities(edges, duration=0.01)
    by_start, by_end = (slopes["inner.x", edge][-1] for edge in edges)
    assert by_start == pytest.approx(-8.0 / 20.0 * (0.01 - 0.002), rel=1e-9, abs=0.0)
    assert by_end == pytest.approx(8.0 / 20.0 * (0.01 - 0.005), rel=1e-9, abs=0.0)
    ends = [0.003, 0.004, 0.009]
    lanes = model.simulate_many({edges[1]: ends}, ["end:inner.vx"], duration=0.01, transient=0)
    assert lanes["end:inner.vx"] == pytest.approx([8.0 * (end - 0.002) / 20.0 for end in ends], rel=1e-12, abs=0.0)


def test_a_preloaded_rotor_answers_its_unbalance_like_a_linear_one(make_model: Callable[..., Model]) -> None:
    """Without weight, all balls of a preloaded bearing pressed alike, its stiffness is (Z/2) 1.5 k_b sqrt(delta_0), the
    same all round; a small unbalance moves the ring on a circle of radius m e w^2/|k - M w^2 + i c w|, behind by its
    phase."""
    model = make_model("rotor")
    preload, speed = 4e-6, 2 * math.pi * 400.0
    numbers = {
        "bearing.clearance": -2 * preload,
        "loads.weight.force.y": 0.0,
        "loads.unbalance.mass": 1e-8,
        "shaft.speed": speed,
        "bearing.initial.inner.y": 0.0,
    }
    stiffness = 0.5 * 8 * 1.5 * model.constants(numbers)["bearing.k_b"] * math.sqrt(preload)
    run = model.simulate(cycles=400, transient=390, parameters=numbers, rtol=1e-10, outputs=[]).steady()
    expected = 1e-8 * 0.02 * speed**2 / (stiffness - 5.0 * speed**2 + 500j * speed)
    found = (run["inner.x"] + 1j * run["inner.y"]) * np.exp(-1j * speed * run.t)
    assert np.max(np.abs(found / expected - 1.0)) < 2e-4


def test_loads_beside_a_mechanism_add_to_the_share_of_the_reaction(make_virtual: Callable[..., Model]) -> None:
    push = '[load]\ntype = "harmonic"\nmean = ["0 N", "10 N"]\namplitude = ["50 N", "0 N"]\nfrequency = "40 Hz"\n'
    push += 'phase = "0 deg"\n[run]'
    both = (make_virtual("punching_press"), make_virtual("punching_press", ("[run]", push)))
    for t in np.linspace(0.0, 0.1, 7).tolist():
        found = [values_of_rows(m, rows_of(m, ["load.x", "load.y"]), point(m, m.numbers(), t, None)) for m in both]
        added = np.subtract(found[1], found[0])
        assert added == pytest.approx([50.0 * math.cos(80 * math.pi * t), 10.0], abs=1e-11 * np.max(np.abs(found)))


def test_measured_loads_come_from_csv_and_netcdf(tmp_path: Path, scene_text: Callable[..., str]) -> None:
    """The same numbers, in the unit that the file or the scene gives."""
    times, force = [0.0, 1.5, 4.0], [0.1, -0.4, 0.25]
    rows = "\n".join(f"{t},{f}" for t, f in zip(times, force, strict=True))
    (tmp_path / "load.csv").write_text(f"t,f\n{rows}\n")
    with h5netcdf.File(tmp_path / "load.nc", "w") as file:
        file.dimensions["row"] = 3
        for name, numbers, unit in (("t", times, "ms"), ("f", force, "kN")):
            file.create_variable(name, ("row",), float, data=np.array(numbers)).attrs["units"] = unit
    found = []
    for name, units in (("load.csv", [', unit = "ms"', ', unit = "kN"']), ("load.nc", ["", ""])):
        t, f = (f'{{ file = "{name}", column = "{c}"{u} }}' for c, u in zip("tf", units, strict=True))
        text = scene_text("varying_compliance", (OLD, f'[load]\ntype = "table"\ntime = {t}\nx = {f}\ny = {f}\n'))
        path = tmp_path / "rotor.toml"
        path.write_text(text)
        found.append([q.value for q in read_scene(path).quantities if q.path.startswith("load.")])
    assert found[0] == found[1] == pytest.approx([0.0, 1.5e-3, 4e-3, *(2 * [100.0, -400.0, 250.0])])
    path.write_text(text.replace('column = "t"', 'column = "u"'))
    with pytest.raises(SceneError, match="no such column"):
        read_scene(path)


@pytest.mark.parametrize(
    ("base", "change", "message"),
    [
        ("rotor", ('angle = "0 deg"', 'window = { start = "10 deg", end = "10 deg" }'), "empty or as long as"),
        ("rotor", ('angle = "0 deg"', 'time_window = { start = "2 s", end = "1 s" }'), "ends before it begins"),
        ("rotor", ('eccentricity = "20 mm"', 'eccentricity = "-20 mm"'), "turn the angle by 180 deg"),
        ("rotor", ("[loads.weight]", "[load]"), "two places"),
        (
            "punching_press",
            ("[run]", '[load]\ntype = "unbalance"\nmass = "1 g"\neccentricity = "1 mm"\n[run]'),
            "center_of",
        ),
        ("punching_press_two_way", ("[run]", '[load]\ntype = "constant"\nforce = ["1 N", "0 N"]\n[run]'), "forces"),
    ],
)
def test_loads_that_make_no_sense_are_refused(
    scene_text: Callable[..., str], base: str, change: tuple[str, str], message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        scene_from_text(scene_text(base, change), base)
