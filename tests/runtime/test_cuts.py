"""Cuts of a run.  One more, at any time, of any cause and however it moves, changes no number: cuts say where panels
end.  And each moves with the parameters as its own time does, found in another way."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from quick_cases import long_but
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from ballpass.runtime import Model, Solution
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.quantity import cuts, layout
from ballpass.runtime.quantity.cuts import moving_cuts
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.nodes import Cause, Cuts
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.track import WINDOWS, ChannelValues
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.loop import steps_of

Array = np.ndarray[Any, np.dtype[np.float64]]

#: Of kinds that integrate, that search extremes between nodes, and that are taken at a moment.
SMOOTH = (
    *("rms:inner.y", "integral:drive_torque", "rms:drive_torque", "drive_work", "max:drive_torque"),
    *("peak_time:drive_torque", "value:inner.y@240deg"),
)
#: The same where the most loaded ball has corners, and how well the derivative by the speed is known [1].
#: No panel ends at corners of the places of a raceway.
CORNERED = {"mean:ball.force": 5e-6, "rms:ball.force": 5e-6, "min:ball.force": 5e-6, "life": 1e-4}
BY = {"bearing.clearance": 10.0, "mechanism.driver.speed": 2e-3}  # with how fast cuts move [s/unit]


@pytest.mark.parametrize("cause", [Cause.SCHEDULE, Cause.KINK])
@pytest.mark.parametrize("scene", long_but(["punching_press", "crank_shaper"], "punching_press"))
def test_a_cut_more_changes_no_value_and_no_derivative(
    make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch, scene: str, cause: Cause
) -> None:
    model = make_model(scene)
    # the damping of the press is one-sided; where it has an infinite slope, its derivative has fewer digits
    cornered = CORNERED if scene != "punching_press" else {**CORNERED, "mean:ball.damping_force": 5e-6}
    drawn = np.random.default_rng(1)
    shares, moves = np.sort(drawn.uniform(0.0, 1.0, 5)), drawn.uniform(-1.0, 1.0, (5, len(BY))) * [*BY.values()]

    def times(of: Cuts) -> Array:
        return np.asarray(of.times[of.first] + shares * (of.times[-1] - of.times[of.first]))

    def more(*given: Any) -> Cuts:
        found = plain_cuts(*given)
        return found.more(times(found), Cause.SCHEDULE, np.zeros(len(shares), dtype=int))

    def moved(run: Run, of: Cuts, chain: Chain) -> Array:
        added = np.isin(of.times, times(of))
        slopes = plain_slopes(run, of, chain)
        slopes[added] = moves[:, : slopes.shape[1]]
        return slopes

    run: dict[str, Any] = {"cycles": 2, "transient": 1, "check": False}
    plain = model.sensitivity((*SMOOTH, *cornered), list(BY), **run)
    plain_cuts, plain_slopes, plain_kinks = layout.scheduled_cuts, cuts.scheduled_slopes, layout.NodeLayer._kinks
    if cause == Cause.SCHEDULE:
        monkeypatch.setattr(layout, "scheduled_cuts", more)
        monkeypatch.setattr(cuts, "scheduled_slopes", moved)
    else:
        monkeypatch.setattr(
            layout.NodeLayer,
            "_kinks",
            lambda self, here, item: np.append(plain_kinks(self, here, item), times(here.cuts)),
        )
    cut = model.sensitivity((*SMOOTH, *cornered), list(BY), **run)
    for one, other in zip(plain.pairs, cut.pairs, strict=True):
        name = (one.quantity, one.parameter)
        assert other.value == pytest.approx(one.value, rel=1e-10, abs=0.0), name
        scale = max(abs(one.derivative), abs(one.value) / model.parameters[one.parameter])
        within = cornered.get(one.quantity, 1e-8)
        assert other.derivative == pytest.approx(one.derivative, abs=within * scale), name


def test_the_derivative_of_the_largest_damping_force_is_known_where_a_third_ball_comes_between_two(
    make_model: Callable[..., Model],
) -> None:
    """It was 1.1e-3 off: of three changes of rank between two places one was seen."""
    model = make_model("punching_press")
    (pair,) = model.sensitivity("mean:ball.damping_force", "mechanism.driver.speed", cycles=2, transient=1).pairs
    assert pair.check.verdict == Verdict.VERIFIED
    assert pair.derivative == pytest.approx(pair.check.value, rel=5e-5)


def cuts_of(model: Model, quantity: str, by: str, **asked: Any) -> Cuts:
    """Cuts of a quantity with their derivatives by one parameter."""
    run = resolve(model, model.numbers(None), Request(rtol=1e-10, **asked))
    evaluated = QuantityRun(model, quantities_of(model, [quantity]))
    _, (found,) = evaluated._measure(run, evaluated._moving, 1)
    angles, chain = evaluated._layer.angles_of(found), Chain(model, run.numbers, [by])
    return moving_cuts(found.motion, found.cuts, angles, chain, 1e-10)[0]


TABLE = 'table = { time = ["0 s", "0.2 s", "0.5 s"], speed = ["60 rpm", "900 rpm", "500 rpm"] }\n'
SPEED = 'speed = "500 rpm"                       # [paper]; positive is counter-clockwise\n'
DRIVER, PUNCH = "mechanism.driver.", "mechanism.forces.punch.window."
BY_SCHEDULE = [
    *((True, f"{DRIVER}{name}") for name in ("table.time.2", "table.speed.3", "start_angle")),
    *((True, f"{PUNCH}end"), (False, f"{DRIVER}speed"), (False, f"{PUNCH}start")),
]


@pytest.mark.parametrize(("runs_up", "by"), BY_SCHEDULE)
def test_rows_windows_turns_and_the_end_move_as_the_schedule_does(
    make_model: Callable[..., Model], runs_up: bool, by: str
) -> None:
    """Of a run-up, whose angle is a trapezoid, and at constant speed: each cut against a difference of its own time."""
    model = make_model("punching_press", *([(SPEED, TABLE)] if runs_up else []))
    found = cuts_of(model, "mean:drive_torque", by, cycles=8, transient_cycles=4)

    def schedule(change: float) -> dict[str, float]:
        """Times by what lies there."""
        values = {**model.parameters, by: model.parameters[by] + change}
        rows, speeds = np.zeros(1), np.array([values.get(f"{DRIVER}speed", 0.0)])
        if runs_up:
            rows, speeds = (
                np.array([values[f"{DRIVER}table.{key}.{k}"] for k in (1, 2, 3)]) for key in ("time", "speed")
            )

        def turned(time: float) -> float:
            edges = np.array([0.0, *rows[(rows > 0.0) & (rows < time)], time])
            return float(np.trapezoid(np.interp(edges, rows, speeds), edges))

        def when(angle: float) -> float:
            return float(brentq(lambda t: turned(t) - angle, 0.0, 5.0, xtol=1e-15, rtol=1e-14))

        times = {f"row {k}": time for k, time in enumerate(rows.tolist()) if k}
        times |= {f"turn {turn}": when(turn * math.tau) for turn in range(1, 9)}
        for edge in ("start", "end"):
            ahead = values[PUNCH + edge] - values[f"{DRIVER}start_angle"]
            times |= {f"{edge} {turn}": when(ahead + turn * math.tau) for turn in range(8)}
        return times

    here, (low, high), met = schedule(0.0), (schedule(-1e-4), schedule(1e-4)), set[str]()
    for time, slope in zip(found.times[1:].tolist(), found.slopes[1:, 0].tolist(), strict=True):
        (name,) = (name for name, at in here.items() if abs(at - time) < 1e-9)
        assert slope == pytest.approx((high[name] - low[name]) / 2e-4, rel=1e-6, abs=1e-9), name
        met.add(name.partition(" ")[0])
    assert met == {"start", "end", "turn", *(["row"] if runs_up else [])}


#: Change of a time by which its derivative is measured, and how far around it states are read [s].  Times of a motion
#: with contacts are far from linear in parameters.
CHANGE, AROUND = 3e-9, 1e-6


def derivative_of_root(
    model: Model, by: str, near: float, slope: float, height: Callable[[Solution], Array], **asked: Any
) -> float:
    """Derivative of the time at which a height is zero, by a difference of its roots between states read near it."""
    step, roots = CHANGE / abs(slope), []
    times = near + AROUND * np.linspace(-1.0, 1.0, 9)
    for change in (-step, step):
        parameters = {by: model.parameters[by] + change}
        found = model.simulate(times=times, parameters=parameters, rtol=1e-12, kinks="located", **asked)
        roots.append(float(brentq(CubicSpline(times, height(found)), times[0], times[-1], xtol=1e-16)))
    return (roots[1] - roots[0]) / (2.0 * step)


@pytest.mark.parametrize("by", [pytest.param(f"{DRIVER}flywheel.inertia", marks=pytest.mark.long), f"{PUNCH}end"])
def test_windows_and_jumps_of_an_angle_move_as_the_motion_does(make_model: Callable[..., Model], by: str) -> None:
    """Of a press that a motor turns: both edges of the window, and the angle's jump, in its second turn."""
    model = make_model("punching_press_motor", ('outputs = ["inner.*",', 'outputs = ["body.crank.angle", "inner.*",'))
    found = cuts_of(model, "mean:body.crank.angle", by, cycles=1.9, transient_cycles=1.0)
    info = model.manifest.mechanism
    assert info is not None
    checked = []
    for k in np.flatnonzero(found.cause != Cause.SCHEDULE):
        time, slope = float(found.times[k]), float(found.slopes[k, 0])
        edge = model.manifest.edges[found.angle[k]] if found.cause[k] == Cause.WINDOW else ""

        def beyond(solution: Solution, edge: str = edge) -> Array:
            past = solution[info.angle] - (solution.parameters[edge] if edge else math.pi)
            return np.asarray(past - math.tau * round(float(past[4]) / math.tau))

        # the window's end moves nothing before it
        expected = 0.0 if abs(slope) < 1e-12 else derivative_of_root(model, by, time, slope, beyond)
        assert slope == pytest.approx(expected, rel=5e-4, abs=1e-12), (time, edge)
        checked.append(edge)
    assert sorted(checked) == ["", f"{PUNCH}end", f"{PUNCH}start"]


@pytest.mark.parametrize("by", ["shaft.speed", "bearing.clearance"])
@pytest.mark.parametrize("quantity", ["min_time:ball.force", "peak_time:inner.y"])
def test_changes_of_rank_and_extremes_move_as_the_motion_does(
    make_model: Callable[..., Model], quantity: str, by: str
) -> None:
    """Of a bearing under a constant load: where the two most loaded balls are equal, and where a velocity is zero."""
    model = make_model("varying_compliance")
    (pair,) = model.sensitivity(quantity, by, cycles=2, transient=1, rtol=1e-10, check=False).pairs
    one, other = np.argsort(model.simulate(times=[pair.value])["ball.force"][0])[-2:]

    def height(solution: Solution) -> Array:
        force = solution["ball.force"]
        return np.asarray(solution["inner.vy"] if quantity.startswith("peak") else force[:, one] - force[:, other])

    expected = derivative_of_root(model, by, pair.value, pair.derivative, height)
    assert pair.derivative == pytest.approx(expected, rel=5e-4)


def test_steps_end_where_balls_come_into_contact_and_leave_it(make_model: Callable[..., Model]) -> None:
    """Kinks that the steps keep, against roots of the deflections in states read near them."""
    model = make_model("varying_compliance")
    kept = steps_of(resolve(model, model.numbers(None), Request(rtol=1e-10, cycles=1, kinks="located")))
    kinks = kept[kept[:, 1] > 0.0, 0]
    times = kinks[:, None] + AROUND * np.linspace(-1.0, 1.0, 9)
    found = model.simulate(times=np.sort(times.ravel()), rtol=1e-12, kinks="located")["ball.deflection"]
    for place, kink in zip(found.reshape(*times.shape, -1), kinks.tolist(), strict=True):
        around = kink + AROUND * np.linspace(-1.0, 1.0, 9)
        changing = np.flatnonzero(place[0] * place[-1] < 0.0)  # balls of both sides may meet at once
        roots = [brentq(CubicSpline(around, place[:, ball]), around[0], around[-1]) for ball in changing]
        assert np.min(np.abs(np.array(roots) - kink)) < 1e-9
    assert len(kinks) >= 4


SPALL = """[bearing.cage]
slip = { time = ["0 s", "0.01 s", "0.03 s"], value = [0.0, 0.2, 0.05] }

[bearing.defects.pit]
on = "inner"
angle = "10 deg"
chord = "0.3 mm"
profile = "path"

[bearing.initial]"""


def test_rates_of_angles_count_the_slip_of_a_cage_that_is_a_state(make_virtual: Callable[..., Model]) -> None:
    """Of a press that a motor turns: angles that a run is cut at, along straight lines as the motion goes."""
    outputs = ('outputs = ["inner.*",', 'outputs = ["cage.*", "inner.*",')
    model, many, step = make_virtual("punching_press_motor", outputs, ("[bearing.initial]", SPALL)), 6, 1e-6
    random, numbers = np.random.default_rng(5), model.numbers(None)
    here = {"t": random.uniform(0.0, 0.1, many), "x": 1e-6 * random.normal(size=(many, len(model.states)))}
    here["x"][:, model.states.index("driver.angle")] = random.uniform(0.0, 6.0, many)
    here["x"][:, model.states.index("driver.speed")] = 50.0
    rest = {"u": random.normal(size=(many, len(model.manifest.inputs))), "p": numbers.p, "c": numbers.c}
    (motion,) = model.loop("rhs", ("t", "x", "u"))(many, {**here, **rest}).values()
    for channel in (WINDOWS, "cage.in_inner"):
        channels = ChannelValues(model, [channel])
        loop = channels._own_loop("rates", channels._rows_with_rates)
        (_, rate), (ahead, _), (back, _) = (
            np.split(loop(many, {"t": here["t"] + h, "x": here["x"] + h * motion, **rest})["g"].copy(), 2, axis=1)
            for h in (0.0, step, -step)
        )
        assert rate == pytest.approx((ahead - back) / (2.0 * step), rel=1e-6, abs=1e-6), channel
