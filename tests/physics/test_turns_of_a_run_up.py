"""Runs that are asked for in turns, where a table gives the driver's speed: turns are those that it really makes."""

from __future__ import annotations

import math
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.optimize import brentq

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.export.c_program import export_c
from ballpass.runtime.time.turning import Turning

PRESS = (Path(__file__).parents[2] / "scenes/punching_press.toml").read_text()
SPEED = 'speed = "500 rpm"                       # [paper]; positive is counter-clockwise\n'
TABLE = 'table = { time = ["0 s", "0.2 s", "0.5 s"], speed = ["60 rpm", "900 rpm", "500 rpm"] }\n'
TIMES, SPEEDS = np.array([0.0, 0.2, 0.5]), np.array([60.0, 900.0, 500.0]) * math.pi / 30.0
NAMES = ["mechanism.driver.table.time.2", "mechanism.driver.table.speed.2", "mechanism.driver.table.speed.3"]
OVER: Literal["stepped-over"] = "stepped-over"  # as lanes do
TURN = 60.0 / 500.0  # behind the last row [s]


def turned(time: float, times: np.ndarray = TIMES, speeds: np.ndarray = SPEEDS) -> float:
    """Turns from t = 0 on: trapezoids between rows."""
    edges = np.array([0.0, *times[(times > 0.0) & (times < time)], time])
    return float(np.trapezoid(np.interp(edges, times, speeds), edges)) / math.tau


def when(turns: float, times: np.ndarray = TIMES, speeds: np.ndarray = SPEEDS) -> float:
    return float(brentq(lambda t: turned(t, times, speeds) - turns, 0.0, 10.0, xtol=1e-15))


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """The press of the paper, run up past its speed."""
    scene = scene_from_text(PRESS.replace(SPEED, TABLE), "run_up")
    return load(generate(scene, tmp_path_factory.mktemp("run_up") / "model"))


@pytest.fixture(scope="module")
def even(make_model) -> Model:  # type: ignore[no-untyped-def]
    model = make_model("punching_press")
    assert isinstance(model, Model)
    return model


@pytest.mark.parametrize("seed", range(20))
def test_so_many_turns_are_made_at_the_time_that_is_said(seed: int) -> None:
    """Random rows with rests and reversals; turns count in either sense.  A driver that stands makes no more."""
    draw = np.random.default_rng(seed)
    times = np.cumsum(draw.uniform(0.05, 1.0, 5))
    speeds = np.where(draw.random(5) < 0.3, 0.0, draw.normal(0.0, 40.0, 5))
    turning = Turning.by_speeds(draw.normal(), times, speeds)
    at = np.linspace(0.0, times[-1] + 2.0, 400_001)
    made = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turning.at(at)[0])))]) / math.tau
    for share in (0.1, 0.5, 0.99):
        begin, turns = float(at[40_000]), share * float(made[-1] - made[40_000])
        time = turning.after(turns, begin)
        if turns == 0.0:
            continue
        assert np.interp(time, at, made) == pytest.approx(made[40_000] + turns, abs=1e-6 * made[-1])
        assert turning.turns(begin, time) == pytest.approx(turns, rel=1e-12)
    stops = Turning.by_speeds(0.0, [0.0, 1.0], [math.tau, 0.0])
    assert (stops.after(0.375), stops.after(0.6)) == (0.5, math.inf)


@pytest.mark.long
def test_runs_of_turns_end_where_the_driver_has_made_them(press: Model, tmp_path: Path) -> None:
    """Simulated, reduced, continued, in lanes, and as a program of its own."""
    run = press.simulate(4.5, transient=1.5, samples_per_cycle=100)
    assert run.t[-1] == pytest.approx(when(4.5), rel=1e-13)
    assert run.steady().t[0] == pytest.approx(when(1.5), abs=run.t[1])
    reduced = press.reduce(4.5, transient=1.5)
    assert (reduced.start, reduced.start + reduced.duration) == pytest.approx((when(1.5), when(4.5)), rel=1e-13)
    later = press.simulate(1.25, initial=run.end, transient=0)
    assert later.t[-1] == pytest.approx(when(5.75), rel=1e-13)
    table = {NAMES[1]: SPEEDS[1] * np.array([0.8, 1.0, 1.2])}
    lanes = press.simulate_many(table, ["max:ball.force", "mean:inner.y"], cycles=4.5, transient=1.5, kinks=OVER)
    for k, speed in enumerate(table[NAMES[1]].tolist()):
        alone = press.reduce(4.5, transient=1.5, parameters={NAMES[1]: speed}, kinks=OVER)
        assert lanes["max:ball.force"][k] == pytest.approx(alone["ball.force"].maximum, rel=1e-5)
        assert lanes["mean:inner.y"][k] == pytest.approx(alone["inner.y"].mean, rel=1e-5)
    export_c(press.folder, tmp_path)
    subprocess.run(["make", "-s", "-C", str(tmp_path)], check=True, capture_output=True)
    rows = subprocess.run([tmp_path / "run_up", "--cycles", "4.5"], check=True, capture_output=True, text=True).stdout
    assert float(rows.splitlines()[-1].split(",")[0]) == pytest.approx(when(4.5), rel=1e-13)


def test_a_driver_that_comes_to_rest_makes_no_more_turns(press: Model) -> None:
    stops = {NAMES[2]: 0.0}
    with pytest.raises(RequestError, match=r"cycles: the driver stands still after 3.85 turns"):
        press.simulate(4, parameters=stops)
    assert press.simulate(3, parameters=stops, transient=0).t[-1] < 0.5


def test_work_in_a_turn_of_a_run_up_is_that_of_samples(press: Model, even: Model) -> None:
    """And its derivatives by the rows, whose turns end elsewhere, are those of differences."""
    asked = {"cycles": 4.0, "transient": 1.0, "rtol": 1e-10}
    found = press.sensitivity("drive_work", NAMES, **asked)
    ends = [when(1.0), when(4.0)]
    cuts = [ends[0], *press.breakpoints(*ends), ends[1]]
    work = 0.0
    for left, right in pairwise(cuts):
        times = np.linspace(left, right, 4001)
        times[[0, -1]] += [1e-9, -1e-9]
        run = press.simulate(times=times, duration=ends[1], rtol=1e-10, outputs=["drive_torque"])
        work += float(simpson(run["drive_torque"] * np.interp(times, TIMES, SPEEDS), x=times))
    assert found.quantities[0].value == pytest.approx(work / 3.0, rel=1e-6)  # samples leave out 1e-9 s at edges
    for name in NAMES:
        step = 1e-4 * press.parameters[name]
        up, down = (
            press.quantities("drive_work", parameters={name: press.parameters[name] + by}, **asked)["drive_work"].value
            for by in (step, -step)
        )
        assert found["drive_work", name].derivative == pytest.approx((up - down) / (2.0 * step), rel=1e-5)
    with pytest.raises(RequestError, match="whole turns"):
        press.quantities("drive_work", cycles=4.2, transient=1)


@pytest.mark.long
def test_behind_the_last_row_it_is_the_machine_of_that_speed(press: Model, even: Model) -> None:
    assert press.period() == pytest.approx(TURN)
    dropped = math.ceil(turned(0.5)) + 2
    run = press.simulate(dropped + 3, transient=dropped)
    assert (run.period, run.steady().period) == (None, pytest.approx(TURN))
    settled, known = press.settle(transient=dropped), even.settle(transient=2)
    assert settled.settled
    for name in ("ball.force", "inner.y"):
        assert settled.reductions[name].rms == pytest.approx(known.reductions[name].rms, rel=2e-2)
    lives = [model.life(transient=turns).states[0] for model, turns in ((press, dropped), (even, 2.0))]
    assert lives[0].bearings[0].life == pytest.approx(lives[1].bearings[0].life, rel=2e-2)
    lines = press.spectrum("inner.y", transient=dropped)
    assert {mark.name for mark in lines.marks} == {"shaft", "FTF", "BPFO", "BPFI", "2 BSF"}
    with pytest.raises(RequestError, match="behind its last row"):
        press.settle(transient=1)


@pytest.mark.long
def test_a_run_up_comes_to_the_steady_state_of_its_last_speed(tmp_path: Path) -> None:
    """From backwards to forwards, so that driver and balls stand at the last row where they stood at the start."""
    cage = ('pitch_diameter = "33.5 mm"', 'pitch_diameter = "31.75 mm"')
    assert PRESS.count(cage[0]) == 1
    table = 'table = { time = ["0 s", "0.4 s"], speed = ["-500 rpm", "500 rpm"] }\n'
    text = PRESS.replace(*cage)
    known = load(generate(scene_from_text(text, "even"), tmp_path / "even"))
    there = load(generate(scene_from_text(text.replace(SPEED, table), "there"), tmp_path / "there"))
    one, other = known.steady(), there.steady()
    assert (one.begin, other.begin) == (0.0, pytest.approx(0.4, abs=1e-12))
    assert other.start == pytest.approx(one.start, rel=1e-6, abs=1e-12)
    assert np.abs(other.multipliers) == pytest.approx(np.abs(one.multipliers), rel=1e-5, abs=1e-9)
    assert other.contacts.same(one.contacts)
    points = [model.section("inner.y", readings=60, settling=60) for model in (known, there)]
    assert points[1].states[-1] == pytest.approx(points[0].states[-1], rel=1e-3)  # of runs at 1e-6
    assert points[0].period == points[1].period
    path = "bearing.clearance=9 um:10 um:2"
    kinds = [[motion.kind for motion in model.bifurcation(path, readings=30).up] for model in (known, there)]
    assert kinds[0] == kinds[1]
    ends = [model.steady(over="bearing.clearance=10 um:9 um").branches[0].points[-1] for model in (known, there)]
    assert ends[1].nodes[0] == pytest.approx(ends[0].nodes[0], rel=1e-5)  # of runs at the tolerance of branches
