"""Peaks of a settled run do not depend on the balls' first angle; a run says what more turns would change."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.cli import app
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import resolve
from ballpass.runtime.run.reduced_run import reduced
from ballpass.runtime.solution.settle import LEAST, MEANS, PEAKS, changed

ANGLE = "bearing.ball_angle"
SCENE = Path(__file__).resolve().parents[2] / "scenes" / "punching_press.toml"
#: Peak ball force of the press over 500 turns [N].
LONG_PEAK = 4404.46


@pytest.mark.long
def test_settled_peaks_do_not_depend_on_the_ball_angle(make_model: object) -> None:
    model = make_model("punching_press")  # type: ignore[operator]
    two, settled = [], []
    for angle in np.linspace(0.0, math.tau / 8.0, 4, endpoint=False):
        two.append(model.reduce(parameters={ANGLE: angle})["ball.force"].maximum)
        found = model.settle(parameters={ANGLE: angle})
        settled.append((found.reductions["ball.force"].maximum, found.reductions["inner.y"].rms))
        assert found.settled
        assert found.reductions.duration == pytest.approx(found.turns * found.reductions.cycle_length)
    assert np.ptp(two) / np.mean(two) > 0.04
    peaks, rms = np.transpose(settled)
    assert peaks == pytest.approx(LONG_PEAK, rel=1e-3)
    assert np.ptp(rms) < MEANS * np.mean(rms)


@pytest.mark.long
def test_twice_the_turns_change_a_settled_run_by_less_than_it_says(press: Model) -> None:
    found = press.settle()
    assert found.settled
    assert all(peak <= PEAKS and mean <= MEANS for peak, mean in found.changes.values())
    twice = press.reduce(2 + 2 * found.turns)
    for name, few in found.reductions.items():
        assert abs(few.maximum - twice[name].maximum) <= PEAKS * twice[name].range
        assert abs(few.minimum - twice[name].minimum) <= PEAKS * twice[name].range
        assert few.rms == pytest.approx(twice[name].rms, rel=MEANS)


@pytest.mark.long
def test_what_does_not_settle_says_so(press: Model) -> None:
    """At this angle of the balls 128 turns find higher extremes than 64."""
    found = press.settle(parameters={ANGLE: math.tau / 24.0}, most=2 * LEAST)
    assert (found.turns, found.settled) == (2 * LEAST, False)
    assert "not settled over 128 steady turns" in found.words
    assert press.settle(parameters={ANGLE: math.tau / 24.0}).settled
    with pytest.raises(RequestError, match="most = 7"):
        press.settle(most=7)
    with pytest.raises(RequestError, match="nothing turns"):
        press.settle(parameters={"mechanism.driver.speed": 0.0}, transient=0)


@pytest.mark.long
def test_run_says_what_more_turns_change_and_settles_on_request(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> Result:
        return CliRunner().invoke(app, ["run", str(SCENE), "--no-figures", *words])

    shown = run("--set", f"{ANGLE}=15 deg").stdout
    assert "Over 64 steady turns: highest ball force 4404 N instead of 4082" in shown
    assert "steady turns: 2" in shown
    assert "highest ball force 4404 N as before;" in run("--cycles", "25", "--set", f"{ANGLE}=20 deg").stdout
    settled = run("--turns", "settle", "--set", f"{ANGLE}=15 deg").stdout
    assert "settled over 128 steady turns" in settled
    assert "steady turns: 128" in " ".join(settled.split())
    summary = json.loads(run("--turns", "settle", "--json").stdout)
    assert summary["peak_ball_force"]["total"] == pytest.approx(LONG_PEAK, rel=1e-3)
    assert summary["inner.x"]["min"] == summary["longer"]["inner.x"]["min"]
    assert summary["longer"]["settled"] is True
    for wrong in (("many",), ("40",), ("settle", "--duration", "1 s"), ("settle", "--cycles", "4")):
        refused = run("--turns", *wrong)
        assert refused.exit_code == 2
        assert "--turns" in refused.stderr


def test_a_ring_at_rest_has_settled(make_model: Callable[..., Model]) -> None:
    """Without load the ring stops in its clearance; velocities of 1e-45 m/s were extremes of the start."""
    idle = {"loads.weight.force.y": 0.0, "loads.unbalance.mass": 0.0}
    found = make_model("rotor").settle(parameters=idle, transient=50)
    assert found.settled
    assert (found.turns, found.dropped) == (128, 0)


def test_the_angle_that_counts_turns_is_not_compared(make_model: Callable[..., Model]) -> None:
    """It grows with every turn, and would never settle."""
    model = make_model("punching_press_motor")
    run = resolve(model, model.numbers(), Request(cycles=2.0, transient_cycles=1.0))
    few = reduced(run)
    assert model.manifest.mechanism is not None
    assert set(few) - set(changed(run, few, few)) == {model.manifest.mechanism.angle}
