"""Numbers of motion that amplifies small errors have a ± in run and sweep; derivatives of it are refused."""

from __future__ import annotations

import csv
import json
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ballpass.derive import generate
from ballpass.runtime import Model, SimulationError, load
from ballpass.runtime.app.cli import app
from ballpass.runtime.certify.error_target import TargetMissed

CLEARANCE = "bearing.clearance"
SCENES = Path(__file__).resolve().parents[2] / "scenes"
PRESS = SCENES / "punching_press_tangent.toml"
WIDE = {CLEARANCE: 60e-6}


@pytest.mark.long
def test_a_number_of_chaos_has_its_uncertainty_at_every_tolerance(press: Model) -> None:
    """Tangent press, 60 um, 12 turns: the lowest inner.x is -57, -56, -55 um at rtol 1e-6, 1e-8, 1e-10."""
    of = "min:inner.x"
    lowest = [press.quantities(of, 12, parameters=WIDE, rtol=one)[of].value for one in (1e-6, 1e-8, 1e-10)]
    assert np.ptp(lowest) > 1e-6
    for rtol, value in zip((1e-6, 1e-8, 1e-10), lowest, strict=True):
        apart = press.uncertainties(of, 12, parameters=WIDE, rtol=rtol)[of]
        assert np.all(np.abs(np.array(lowest) - value) < apart)
        assert apart < 1e-4


@pytest.mark.parametrize("scene", ["punching_press", "punching_press_tangent", "four_bar"])
def test_shipped_scenes_keep_their_digits(make_model: Callable[..., Model], scene: str) -> None:
    model, of = make_model(scene), ["peak_ball_force", "rms:inner.y", "range:inner.x"]
    tight = model.quantities(of, rtol=1e-11)
    for rtol, digits in ((1e-4, 2e-2), (1e-6, 1e-3), (1e-8, 1e-5)):
        found, apart = model.quantities(of, rtol=rtol), model.uncertainties(of, rtol=rtol)
        for name in of:
            assert abs(found[name].value - tight[name].value) < apart[name] < digits * abs(tight[name].value)


@pytest.mark.long
def test_a_law_whose_force_jumps_is_no_exception(make_model: Callable[..., Model]) -> None:
    model, of = make_model("punching_press", ('law = "one-sided"', 'law = "one-sided-gated"')), "range:inner.x"
    assert model.uncertainties(of)[of] < 1e-3 * model.quantities(of)[of].value
    wide = {CLEARANCE: 120e-6, "bearing.damping.ratio": 1e-7}
    start = np.zeros(len(model.states))
    start[0] = 1e-12
    ranges = [model.reduce(12, parameters=wide, rtol=1e-12, initial=k * start)["inner.x"].range for k in range(4)]
    assert np.ptp(ranges) > 1e-3 * np.mean(ranges)
    # from the scene's own start, which is symmetrical to the last bit, tolerances would not show it
    given = {"parameters": wide, "initial": start}
    found, apart = model.quantities(of, 12, **given)[of].value, model.uncertainties(of, 12, **given)[of]
    assert abs(found - ranges[1]) < apart < 1e-2 * found


@pytest.mark.long
def test_an_ensemble_says_how_far_its_members_are_from_tight_single_runs(press: Model) -> None:
    clearances = np.linspace(5e-6, 65e-6, 7)
    of = ["range_inner_x", "peak_ball_force"]
    plain = press.simulate_many({CLEARANCE: clearances}, of, cycles=12)
    found = press.simulate_many({CLEARANCE: clearances}, of, cycles=12, uncertainty=True)
    assert not plain.uncertainty
    assert list(found) == of
    for name in of:
        assert np.array_equal(plain[name], found[name])
    tight = [press.reduce(12, parameters={CLEARANCE: c}, rtol=1e-10)["inner.x"].range for c in clearances]
    off, apart = np.abs(found["range_inner_x"] - tight), found.uncertainty["range_inner_x"]
    assert np.all(off < 1.5 * apart)
    assert np.sum(apart > 2e-2 * np.array(tight)) >= 2
    assert np.sum(apart < 5e-3 * np.array(tight)) >= 2


@pytest.mark.long
def test_members_that_two_runs_share_by_luck_have_an_uncertainty(press: Model) -> None:
    """One more run left out 13 of 40 members, whose numbers others change by far more than their digits."""
    of, table = "min:inner.x", {CLEARANCE: np.linspace(24e-6, 60e-6, 20)}
    length = {"cycles": 6, "transient": 2}
    found = press.simulate_many(table, of, uncertainty=True, **length)  # type: ignore[arg-type]
    positions = [name for name in press.parameters if ".initial." in name and "velocity" not in name]
    starts = [
        press.simulate_many(
            {**table, **{name: np.full(20, press.parameters[name] + 1e-12 * k) for name in positions}},
            of,
            rtol=1e-8,
            **length,  # type: ignore[arg-type]
        )[of]
        for k in range(4)
    ]
    off = np.max(np.abs(np.array(starts) - found[of]), axis=0)
    assert np.count_nonzero(off > 1e-2 * np.abs(found[of])) >= 2
    assert np.flatnonzero(off > 2.0 * found.uncertainty[of]).tolist() == []


@pytest.mark.long
def test_the_commands_say_it_and_print_statistics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def ballpass(*words: str | Path) -> tuple[int, str, str]:
        done = CliRunner().invoke(app, [str(word) for word in words])
        return done.exit_code, done.stdout, done.stderr

    wide, turns = ("--set", f"{CLEARANCE}=60 um"), ("--cycles", "12", "--no-figures")
    asked = ("rms:inner.x", "mean:inner.x")
    code, shown, said = ballpass("run", PRESS, *wide, *turns, *(f"--of={name}" for name in asked))
    assert code == 0
    summary = json.loads((tmp_path / "results" / PRESS.stem / "summary.json").read_text(encoding="utf-8"))
    found = [summary["uncertainty"]["quantities"][name]["value"] for name in asked]
    assert found[0] == pytest.approx(summary["uncertainty"]["inner.x"]["rms"], rel=1e-9, abs=0.0)
    assert found[1] > 0.0
    assert all(re.search(rf"{name} +\S+ +µm\n +±\S+", shown) for name in asked)
    assert "amplifies small errors" in said
    lines = shown.splitlines()
    (row,) = [k for k, line in enumerate(lines) if line.strip().startswith("Inner ring, x")]
    assert lines[row + 1].count("±") == 3  # below their numbers
    (force,) = [line for line in shown.splitlines() if line.strip().startswith("Torque of the")]
    assert "±" not in force
    code, shown, said = ballpass("run", PRESS, "--no-figures")
    assert (code, "amplifies" in said, shown.count("±")) == (0, False, 1)  # in the sentence about tolerances

    code, shown, said = ballpass("sweep", PRESS, "--vary", f"{CLEARANCE}=10 um:60 um:2", *turns)
    assert code == 0
    assert "1 of 2 members amplify small errors" in said
    assert "±" in shown
    table = (tmp_path / "results" / PRESS.stem / "sweep.csv").read_text(encoding="utf-8")
    calm, chaotic = csv.DictReader(table.splitlines())
    assert float(calm["± range_inner_x [m]"]) < 5e-3 * float(calm["range_inner_x [m]"])
    assert float(chaotic["± range_inner_x [m]"]) > 1e-2 * float(chaotic["range_inner_x [m]"])

    began = time.process_time()
    code, _, said = ballpass("sensitivity", PRESS, *wide, "--cycles", "12")
    assert code == 1
    assert "the motion is chaotic" in said
    assert time.process_time() - began < 3.0  # one on a machine that does nothing else


@pytest.mark.long
def test_scatter_beside_settled_numbers_is_of_the_settled_turns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was that of the scene's two turns, ten times as much."""
    monkeypatch.chdir(tmp_path)
    tangent = PRESS.with_name("punching_press_tangent.toml")
    found = {}
    for turns in ((), ("--turns", "settle")):
        done = CliRunner().invoke(
            app, ["run", str(tangent), "--set", f"{CLEARANCE}=40 um", "--no-figures", "--json", *turns]
        )
        found[turns] = json.loads(done.stdout)
    short, long = found.values()
    assert long["longer"]["settled"] is True
    few, many = (one["uncertainty"]["inner.x"]["rms"] for one in (short, long))
    assert many < 0.3 * few


def test_derivatives_of_what_does_not_move_with_the_rings_are_not_refused(press: Model) -> None:
    report = press.sensitivity(
        "drive_work", "mechanism.forces.punch.force.y", 3, transient=1, parameters=WIDE, check=False
    )
    assert report.pairs[0].derivative != 0.0
    with pytest.raises(SimulationError, match=r"rms:inner\.x mean nothing here: the motion is chaotic"):
        press.sensitivity("rms:inner.x", CLEARANCE, 12, parameters=WIDE)


@pytest.mark.long
def test_two_runs_that_agree_by_luck_are_no_proof(tmp_path: Path) -> None:
    """Undamped six-bar, three turns: the highest inner.vy is .3122 to .3132 m/s by tolerance; two of them agree."""
    model = load(generate(Path(__file__).parents[1] / "physics" / "six_bar_chaotic.toml", tmp_path / "model"))
    tolerances = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
    every = [model.reduce(rtol=rtol, method="stepper") for rtol in tolerances]
    highest = [reduced["inner.vy"].maximum for reduced in every]
    assert np.ptp(highest) / np.mean(highest) > 2e-3
    assert model.uncertainties("max:inner.vy")["max:inner.vy"] > np.ptp(highest) / 2.0
    # what is said of the error bears what another tolerance or start gives
    with pytest.raises(TargetMissed, match="chaotic") as missed:
        model.simulate(error=0.01, of="max:inner.vy")
    assert missed.value.best is not None
    (estimate,) = missed.value.best.estimates.values()
    (value,) = missed.value.best.values.values()
    assert max(abs(each / value - 1.0) for each in highest) < 10.0 * estimate


def test_numbers_at_rest_take_no_step_for_their_uncertainty(press: Model) -> None:
    found = press.simulate_many({CLEARANCE: [5e-6, 1e-5]}, "static_peak_ball_force", uncertainty=True)
    assert found.statistics.steps == 0
    assert np.all(found.uncertainty["static_peak_ball_force"] == 0.0)
    moving = press.simulate_many({CLEARANCE: [5e-6, 1e-5]}, "peak_ball_force", uncertainty=True)
    assert moving.statistics.steps > 0
