"""Claims about runs of bearings coupled both ways: what all scenes can do, the press with coupled bearings can too."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stepper_methods import NAMES

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from ballpass.runtime.app.summary import summarize
from ballpass.runtime.plot.record import gather

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SHORT = {"cycles": 0.3, "transient": 0}


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_two_way")


@pytest.fixture(scope="module")
def hinges(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_hinges")


@pytest.mark.parametrize(
    ("method", "bound"), [*((method, 1e-5) for method in NAMES), pytest.param("cvodes", 1e-3, marks=pytest.mark.long)]
)
def test_methods_agree(press: Model, method: str, bound: float) -> None:
    one = press.simulate(method="stepper-dop853", rtol=1e-10, **SHORT)
    other = press.simulate(method=method, rtol=1e-10, **SHORT)
    for name in ("inner.y", "outer.y", "reaction.A.y"):
        assert np.max(np.abs(other[name] - one[name])) < bound * np.max(np.abs(one[name]))


@pytest.mark.long
def test_methods_agree_where_balls_turn_with_the_state(hinges: Model) -> None:
    one, other = (hinges.simulate(method=f"stepper-{name}", rtol=1e-10, **SHORT) for name in ("dop853", "rodas5p"))
    for name in ("pin.inner.y", "big_end.inner.x", "reaction.B.y"):
        assert np.max(np.abs(other[name] - one[name])) < 1e-5 * np.max(np.abs(one[name]))


def test_the_reaction_is_the_force_of_the_housing(press: Model) -> None:
    """Newton and Euler's balance of all bodies, and spring and damper: two ways to one force."""
    run = press.simulate(rtol=1e-9, **SHORT)
    count, stiffness, damping = (
        press.numbers().parameters[f"bearing.{name}"]
        for name in ("count", "outer_ring.stiffness", "outer_ring.damping")
    )
    for axis in "xy":
        housing = count * (stiffness * run[f"outer.{axis}"] + damping * run[f"outer.v{axis}"])
        assert np.max(np.abs(run[f"reaction.A.{axis}"] - housing)) < 1e-11 * np.max(np.abs(run["reaction.A.y"]))


@pytest.mark.long
def test_the_bearing_carries_the_linkage(press: Model) -> None:
    """Along the guide a pair of bearings feels slider, rod and crank, not twice Eq. (3)'s 0.41 kg."""
    mass = press.linearize().mass
    bodies = press.numbers().parameters
    along = sum(bodies[f"mechanism.bodies.{name}.mass"] for name in ("crank", "rod", "slider"))
    assert mass[1, 1] == pytest.approx(along, rel=1e-3)  # the rod's tilt adds its turning inertia
    assert np.allclose(mass, mass.T, rtol=0.0, atol=1e-12)


TEN = (
    *("bearing.clearance", "mechanism.bodies.rod.inertia", "bearing.damping.ratio", "mechanism.driver.speed"),
    *("mechanism.bodies.crank.mass", "mechanism.bodies.rod.mass", "mechanism.bodies.slider.mass"),
    *("bearing.outer_ring.mass", "bearing.outer_ring.stiffness", "bearing.outer_ring.damping"),
)


@pytest.mark.long
def test_sensitivities_are_verified_and_those_of_differences(press: Model) -> None:
    """Differences of runs by another method, of fourth order; those of the certificate are the project's own."""
    run = {**SHORT, "cycles": 1.2, "transient": 0.2}
    report = press.sensitivity(["peak_ball_force", "rms:inner.y", "max:reaction.C.y"], TEN, **run)
    assert len(report.pairs) == 30
    assert {pair.check.verdict.value for pair in report.pairs} == {"verified"}
    for pair in report.pairs:
        assert pair.check.disagreement is not None
        assert pair.check.disagreement < 1e-4 * abs(pair.derivative)
    derivatives = {(pair.quantity, pair.parameter): pair.derivative for pair in report.pairs}
    for name in TEN:
        value = press.parameters[name]

        def quantities(factor: float, name: str = name, value: float = value) -> np.ndarray:
            found = press.reduce(
                parameters={name: factor * value}, method="stepper-dop853", kinks="located", rtol=1e-12, **run
            )
            return np.array([found["ball.force"].maximum, found["inner.y"].rms])

        step = 1e-4
        near, far = (quantities(1.0 + k * step) - quantities(1.0 - k * step) for k in (1, 2))
        slopes = (8.0 * near - far) / (12.0 * step * value)
        own = [derivatives[quantity, name] for quantity in ("peak_ball_force", "rms:inner.y")]
        assert own == pytest.approx(slopes, rel=1e-4, abs=0.0), name


@pytest.mark.long
def test_two_bearings_with_tables_of_their_own_are_a_pair(press: Model, tmp_path: Path) -> None:
    """Equal, they move as one with count = 2; with outputs of the inner ring under either name, and none of them."""
    text = (SCENES / "punching_press_two_way.toml").read_text(encoding="utf-8")
    start, end = text.index("[bearing]"), text.index("# ---", text.index("[bearing.initial]"))
    table = re.sub(r"(?m)^count = .*\n", "", text[start:end])
    first, second = (table.replace("[bearing", f"[bearings.{name}") for name in "ab")
    second = re.sub(r"(?m)^inner(_velocity)? = .*\n", "", second)
    one = press.simulate(rtol=1e-9, **SHORT)
    for outputs in ('"*inner.*", "*outer.*", "*ball.*"', '"*.ball.force"'):
        rest = text[end:].replace('"inner.*", "outer.*", "ball.*"', outputs)
        scene = scene_from_text(text[:start] + first + second + rest, "press")
        pair = load(generate(scene, tmp_path / str(len(outputs))))
        both = pair.simulate(rtol=1e-9, **SHORT)
        for own, other in (("a.inner.y", "inner.y"), ("b.outer.y", "outer.y"), ("reaction.A.y", "reaction.A.y")):
            assert np.max(np.abs(both[own] - one[other])) < 1e-6 * np.max(np.abs(one[other]))
        assert np.max(np.abs(both["b.ball.force"] - one["ball.force"])) < 1e-5 * np.max(one["ball.force"])
        assert not summarize(pair, both)["warnings"]
        assert gather(pair, both, pair.manifest.bearings[1]).can_draw_bearing
    assert ("b.inner.y" in both) is False
