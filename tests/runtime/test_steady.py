"""One Newton step towards a periodic orbit: multipliers by the loss of volume, quadratic convergence, refusals."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.cli import app

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "varying_compliance.toml"

#: Time from ball to ball on the load line [s], and what preloads all balls, so that the equations are smooth.
PERIOD, PRELOAD = 0.05, {"bearing.clearance": -20e-6}


@pytest.fixture(scope="module")
def rotor(make_model: Callable[..., Model]) -> Model:
    return make_model("varying_compliance")


@pytest.fixture(scope="module")
def turns(rotor: Model) -> float:
    return PERIOD * rotor.parameters["shaft.speed"] / math.tau


def test_multipliers_have_the_product_that_damping_leaves_of_volume(rotor: Model, turns: float) -> None:
    """Liouville: the divergence of the equations is -c/m for each of two velocities, wherever the balls stand."""
    found = rotor.steady(turns)
    loss = 2.0 * rotor.parameters["bearing.inner_ring.damping"] / rotor.parameters["bearing.inner_ring.mass"]
    assert np.prod(found.multipliers) == pytest.approx(math.exp(-loss * PERIOD), rel=1e-9)
    assert found.difference < 1e-6


def test_a_step_leaves_an_error_of_higher_order_than_its_distance(rotor: Model, turns: float) -> None:
    names = rotor.manifest.initial
    orbit = rotor.steady(turns, parameters=PRELOAD)
    for _ in range(2):
        orbit = rotor.steady(turns, parameters={**PRELOAD, **dict(zip(names, orbit.start, strict=True))})
    assert np.max(np.abs(orbit.after[:2])) < 1e-13
    left = []
    for away in (1e-6, 1e-7):
        moved = orbit.start + np.array([away, 0.0, 0.0, 0.0])
        step = rotor.steady(turns, parameters={**PRELOAD, **dict(zip(names, moved, strict=True))})
        assert abs(step.before[0]) > 0.5 * away
        left.append(abs(step.after[0]))
    assert left[1] < left[0] / 90.0


def test_turns_after_which_the_balls_are_elsewhere_are_warned_of(rotor: Model, turns: float) -> None:
    assert rotor.steady(turns).report().warnings == []
    (warning,) = rotor.steady(0.9 * turns).report().warnings
    assert "no period" in warning


def test_a_driver_whose_motion_is_a_state_is_refused(make_model: Callable[..., Model]) -> None:
    with pytest.raises(RequestError, match="driver's motion is a state"):
        make_model("punching_press_motor").steady()


def test_the_command_prints_what_the_call_gives(
    rotor: Model, turns: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["steady", str(SCENE), "--turns", repr(turns)]
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == 0, done.output
    plain, found = json.loads(done.stdout), rotor.steady(turns)
    assert [row["after"] for row in plain["states"]] == pytest.approx(found.after.tolist(), rel=1e-6, abs=1e-18)
    assert [row["magnitude"] for row in plain["multipliers"]] == pytest.approx(np.abs(found.multipliers).tolist())
    told = CliRunner().invoke(app, words)
    assert "multipliers, magnitudes: 0.7788" in told.stdout
    assert "One step only" in told.stdout
    assert CliRunner().invoke(app, [*words[:3], "0"]).exit_code == 2


@pytest.mark.parametrize(
    ("ask", "given", "words"),
    [
        ("steady", {"turns": 0.0}, "turns: 0 lies outside its bounds. Allowed: a number above 0"),
        ("spectrum", {"of": "inner.x", "top": 0, "scaling": "loud"}, "Allowed: amplitude, power, density"),
        ("spectrum", {"of": "inner.x", "orders": True, "spectrogram": True}, "both given"),
        ("checked_jacobian", {"of": "rhs", "wrt": "states", "state": "moving"}, "Allowed: equilibrium, initial"),
        ("life", {"cycles": float("inf")}, "cycles: inf lies outside its bounds"),
    ],
)
def test_options_are_refused_in_python_as_on_the_command_line(
    rotor: Model, ask: str, given: dict[str, object], words: str
) -> None:
    with pytest.raises(RequestError, match=words):
        getattr(rotor, ask)(**given)
