"""Claims about linkages that cannot be assembled at every angle: what is asked at an instant, what a run reaches."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import IntegrationError, Model, RequestError, Status
from ballpass.runtime.request import assembly

#: The press with a rod [m] shorter than its crank: hinge B stands ``crank |cos(angle)|`` beside the slider's guide.
ROD, CRANK = 5e-3, 6e-3
LOCKS = {"mechanism.bodies.rod.points.C": ROD}

ASKED: dict[str, Callable[..., Any]] = {
    "evaluate": lambda model, t, p: list(model.evaluate(t, parameters=p).values()),
    "jacobian": lambda model, t, p: model.jacobian("load.*", "mechanism.bodies.crank.points.B", t=t, parameters=p),
    "jacobian_function": lambda model, t, p: model.jacobian_function("rhs", t=t, parameters=p)(model.initial()),
    "hessian": lambda model, t, p: model.hessian("load.*", ("crank_angle",) * 2, t=t, parameters=p),
    "linearize": lambda model, t, p: model.linearize(t, x=np.full(8, 1e-6), parameters=p).stiffness,
    "static_equilibrium": lambda model, t, p: model.static_equilibrium(t, parameters=p).x,
}


@pytest.fixture(scope="module")
def press(make_virtual: Callable[..., Model]) -> Model:
    return make_virtual("punching_press")


@pytest.mark.filterwarnings("ignore::ballpass.runtime.KinkWarning")
@pytest.mark.parametrize("name", ASKED)
def test_what_is_asked_at_an_instant_needs_the_linkage_assembled_at_that_instant(press: Model, name: str) -> None:
    """RRP can be assembled where the rod reaches the guide: crank |cos(angle)| < rod."""

    def ask(degrees: float, parameters: Mapping[str, float]) -> Any:
        return ASKED[name](press, math.radians(degrees) / press.parameters["mechanism.driver.speed"], parameters)

    edge = math.degrees(math.acos(ROD / CRANK))
    for degrees in (edge + 5.0, 175.0 - edge):
        for found in ask(degrees, LOCKS):
            assert np.all(np.isfinite(found))
    for degrees in (0.0, edge - 0.01, 180.0 - edge + 0.01):
        words = f"joint 'C' at .* s, crank angle {degrees:.2f} deg .*margin -"
        with pytest.raises(RequestError, match=words) as refused:
            ask(degrees, LOCKS)
        margin = float(re.findall("margin (.*)\\)", str(refused.value))[0])
        assert margin == pytest.approx(1.0 - (CRANK * math.cos(math.radians(degrees)) / ROD) ** 2, rel=1e-3)
    ask(0.0, {})


def test_a_jacobian_function_is_not_moved_to_where_the_linkage_locks(press: Model) -> None:
    prepared = press.jacobian_function("rhs")
    with pytest.raises(RequestError, match="cannot be assembled at joint 'C'"):
        prepared.move(0.0, LOCKS)


# A four-bar with its crank of 30 mm at the angle a: the coupler's joint B is sqrt(a^2 + g^2 - 2 a g cos) from D.
GROUND, SPEED = "mechanism.frame.points.D.x", "mechanism.driver.speed"
COUPLER, ROCKER = "mechanism.bodies.coupler.points.C", "mechanism.bodies.rocker.points.C"
START = "mechanism.driver.start_angle"


@pytest.fixture(scope="module")
def four_bar(scene_text: Callable[..., str], model_of: Callable[..., Model]) -> Model:
    text = scene_text("four_bar", ("outputs = [", 'outputs = ["drive_torque"] #'))
    return model_of(text[: text.index("[bearing]")] + text[text.index("[run]") :], "four_bar")


def run_to(model: Model, degrees: float, parameters: Mapping[str, float]) -> Any:
    """A run whose driver turns so far."""
    speed = model.numbers(parameters).values[SPEED]
    return model.simulate(duration=abs(math.radians(degrees) / speed), parameters=parameters)


def test_a_linkage_that_locks_runs_up_to_where_it_does(four_bar: Model) -> None:
    """Coupler and rocker of 65 mm reach 130 mm, which the crank's pin is away from D at acos(-2/9), 102.84 deg."""
    edge, links = math.degrees(math.acos(-2.0 / 9.0)), {COUPLER: 0.065, ROCKER: 0.065}
    for speed in (60.0, -60.0):
        assert len(run_to(four_bar, edge - 0.01, links | {SPEED: speed}).t) > 1
        words = rf"cannot be assembled at joint 'C' .*: margin -.*valid from crank angle -{edge:.4f} to {edge:.4f} deg"
        with pytest.raises(RequestError, match=f"(?s){words}"):
            run_to(four_bar, edge + 0.01, links | {SPEED: speed})
    with pytest.raises(RequestError, match=r"cannot make a whole turn"):
        four_bar.check_assembly(links)
    with pytest.raises(RequestError, match=r"crank angle 180\.00 deg, where it starts .*start_angle"):
        run_to(four_bar, 1.0, links | {START: math.pi})


def test_a_parallelogram_branches_where_it_is_flat(four_bar: Model) -> None:
    """All bars collinear at 0 and 180 deg, where it does not lock; the margin is near sin(angle)^2 there."""
    bars = {COUPLER: 0.12, ROCKER: 0.03, START: math.pi / 2.0}
    assert len(run_to(four_bar, 89.9, bars).t) > 1
    near = math.degrees(math.asin(math.sqrt(1e-9)))
    words = rf"branches at joint 'C' at crank angle 180\.00 deg .*from crank angle {near:.4f} to {180.0 - near:.4f} deg"
    with pytest.raises(RequestError, match=f"(?s){words}") as refused:
        run_to(four_bar, 90.1, bars)
    assert "cannot be assembled" not in str(refused.value)
    with pytest.raises(RequestError, match=r"(?s)at crank angle 0\.00 deg.*at crank angle 180\.00 deg"):
        four_bar.check_assembly(bars)


def test_a_gap_between_the_angles_of_the_sweep_is_found(press: Model) -> None:
    """The crank is longer than the rod by 1e-7 of it: the margin dips below zero for 0.05 deg at 180.23 deg."""
    turned = math.radians(0.23 + 270.0 - math.degrees(press.parameters["mechanism.joints.D.direction"]))
    numbers = {"mechanism.bodies.crank.points.B": 0.1 * (1.0 + 1e-7), START: turned + math.radians(90.0)}
    with pytest.raises(RequestError, match=r"cannot be assembled at joint 'C' at crank angle"):
        press.check_assembly(numbers)


def test_a_constant_margin_has_no_minima_to_refine(
    make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The axes of a gear stay as far apart: the check of each run took a hundred times as long as the run itself."""
    model, asked, plain = make_model("geared_five_bar"), [], assembly.margins_at

    def counted(*given: Any) -> np.ndarray:
        rows = plain(*given)
        asked.append(rows)
        return rows

    monkeypatch.setattr(assembly, "margins_at", counted)
    model.check_assembly({"mechanism.bodies.left.points.C": 0.1311})  # numbers that no other test has checked
    rows = asked[0]
    assert np.sum(np.ptp(rows, axis=0) < 1e-12) == 1
    assert len(rows) == 1440  # the machine repeats after two turns
    assert 1 < len(asked) <= 20


def test_members_of_an_ensemble_are_refused_by_their_own_runs(four_bar: Model) -> None:
    """The same four-bar that locks at 102.84 deg, from three starts, for 50 deg."""
    starts = {START: np.radians([0.0, 50.0, 60.0]), COUPLER: np.full(3, 0.065), ROCKER: np.full(3, 0.065)}
    duration = math.radians(50.0) / four_bar.parameters[SPEED]
    result = four_bar.simulate_many(starts, ["peak:drive_torque"], duration=duration, transient=0.0)
    assert [failure.member for failure in result.failures] == [2]
    assert "valid from crank angle -102.8396 to 102.8396 deg" in result.failures[0].message


# A crank that a torque turns towards where its rod is across the guide: sin(angle) = rod over crank.
BY_TORQUE = """
[mechanism.driver]
joint = "A"
speed = "1 rad/s"
start_angle = "45 deg"
[mechanism.driver.torque]
law = "constant"
torque = "{torque} N*m"
[mechanism.frame.points]
A = "origin"
[mechanism.bodies]
crank = {{ mass = "1 kg", inertia = "1 kg*m^2", center_of_mass = "0 m", points = {{ A = "origin", B = "{crank} m" }} }}
rod = {{ mass = "1 kg", inertia = "0.1 kg*m^2", center_of_mass = "0.5 m", points = {{ B = "origin", C = "1 m" }} }}
slider = {{ mass = "1 kg", center_of_mass = "origin", points = {{ C = "origin" }} }}
[mechanism.joints]
A = {{ type = "revolute", bodies = ["frame", "crank"] }}
B = {{ type = "revolute", bodies = ["crank", "rod"] }}
C = {{ type = "revolute", bodies = ["rod", "slider"], branch = "ahead" }}
D = {{ type = "prismatic", bodies = ["frame", "slider"], points = ["A", "C"], direction = "0 deg" }}
[run]
duration = "3 s"
transient_cycles = 0
outputs = ["driver.angle"]
"""


@pytest.mark.parametrize("method", ["stepper", "stepper-dp54", "stepper-rodas4"])
def test_a_driver_that_a_torque_turns_stops_where_the_linkage_locks(
    model_of: Callable[..., Model], method: str
) -> None:
    """Steps passed over that moment, behind which the driver turned back and the rod had jumped to its other side."""
    model, edge = model_of(BY_TORQUE.format(torque=400, crank=1.2)), math.degrees(math.asin(1.0 / 1.2))
    with pytest.raises(IntegrationError, match=rf"crank angle {edge:.2f}\d\d deg.*Joint 'C' locks") as stopped:
        model.simulate(method=method, rtol=1e-6)
    assert stopped.value.status is Status.LOCKED
    kept = stopped.value.partial
    assert kept.t[-1] <= stopped.value.time
    assert np.all(np.diff(kept["driver.angle"]) > 0.0)
    angles = {"mechanism.driver.torque.torque": [400.0, -10.0]}
    many = model.simulate_many(angles, ["max:driver.angle"], duration=0.3, method=method, rtol=1e-6)
    assert [(one.member, one.status) for one in many.failures] == [(0, "LOCKED")]


#: A crank-slider whose rod is hardly longer than its crank of 50 mm, with a bearing in the crank pin.
PLAYING = """
[mechanism.driver]
joint = "A"
speed = "60 rad/s"
[mechanism.frame.points]
A = "origin"
[mechanism.bodies]
crank = { mass = "0.4 kg", inertia = "300 kg*mm^2", center_of_mass = "0 mm", points = { A = "origin", B = "50 mm" } }
rod = { mass = "0.6 kg", inertia = "1500 kg*mm^2", center_of_mass = "20 mm", points = { B = "origin", C = "50.05 mm" } }
slider = { mass = "1.2 kg", center_of_mass = "origin", points = { C = "origin" } }
[mechanism.joints]
A = { type = "revolute", bodies = ["frame", "crank"] }
B = { type = "revolute", bodies = ["crank", "rod"] }
C = { type = "revolute", bodies = ["rod", "slider"], branch = "ahead" }
D = { type = "prismatic", bodies = ["frame", "slider"], points = ["A", "C"], direction = "0 deg" }
[bearing]
joint = "B"
coupling = "two-way"
designation = "6204"
clearance = "0.2 mm"
[bearing.damping]
law = "tangent"
ratio = "0.25e-5 s"
[bearing.outer_ring]
support = "fixed"
[bearing.inner_ring]
body = "crank"
[run]
cycles = 1
transient_cycles = 0
outputs = ["inner.*", "point.rod.B.y"]
"""


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::ballpass.runtime.UnusualWarning")
def test_play_that_brings_a_linkage_to_its_dead_centre_ends_the_run_with_the_reason(
    model_of: Callable[..., Model],
) -> None:
    """The ideal linkage turns round; with play the pin comes as far from the guide as the rod is long."""
    model, rod = model_of(PLAYING), "mechanism.bodies.rod.points.C"
    model.check_assembly()
    with pytest.raises(IntegrationError, match=r"(?s)less play.*Joint 'C' locks \(.*: margin") as stopped:
        model.simulate()
    assert stopped.value.status is Status.LOCKED
    assert 0.01 < stopped.value.time < 0.03  # near 90 deg of the crank
    assert np.max(np.abs(stopped.value.partial["point.rod.B.y"])) < 50.05e-3
    longer = model.simulate(duration=0.03, parameters={rod: 0.052})
    assert np.max(np.abs(longer["point.rod.B.y"])) > 50.05e-3


def test_a_driver_that_a_torque_turns_is_refused_where_the_linkage_branches(model_of: Callable[..., Model]) -> None:
    model = model_of(BY_TORQUE.format(torque=400, crank=1.0))
    with pytest.raises(RequestError, match=r"branches at joint 'C' at crank angle 90\.00 deg"):
        model.simulate()


def test_a_driver_keeps_to_its_range(model_of: Callable[..., Model]) -> None:
    """A crank that turns round, by a torque and at constant speed; whole turns count."""
    text = BY_TORQUE.format(torque=40, crank=0.8).replace(
        "[mechanism.driver]", '[mechanism.driver]\nrange = { start = "-400 deg", end = "60 deg" }'
    )
    with pytest.raises(
        IntegrationError, match=r"crank angle 60\.\d+ deg.*range is from -400\.0000 to 60\.0000"
    ) as left:
        model_of(text).simulate(rtol=1e-9)
    assert left.value.status is Status.LOCKED
    assert np.rad2deg(left.value.partial["driver.angle"].max()) < 60.0
    assert np.rad2deg(model_of(text).simulate(duration=0.1)["driver.angle"].max()) < 60.0
    given = text[: text.index("[mechanism.driver.torque]")] + text[text.index("[mechanism.frame") :]
    model = model_of(given.replace('outputs = ["driver.angle"]', ""))
    for speed, most in ((1.0, math.radians(15.0)), (-2.0, math.radians(445.0))):
        model.simulate(duration=0.999 * most / abs(speed), parameters={SPEED: speed})
        with pytest.raises(RequestError, match="The driver's range ends at crank angle"):
            model.simulate(duration=1.001 * most / abs(speed), parameters={SPEED: speed})
    with pytest.raises(RequestError, match="starts outside of its range"):
        model.simulate(duration=0.1, parameters={START: math.radians(70.0)})


def test_a_range_makes_a_linkage_that_branches_run(model_of: Callable[..., Model]) -> None:
    text = BY_TORQUE.format(torque=-1, crank=1.0)
    inside = text.replace("[mechanism.driver]", '[mechanism.driver]\nrange = { start = "10 deg", end = "89 deg" }')
    assert len(model_of(inside).simulate(duration=0.1).t) > 1
