"""Derivatives of runs in which an input comes back with the turn, over many turns, against differences of tight runs.

By a speed or an angle all that happens moves in time, and by more in every turn; a table and a window are met again in
each.  Differences are of runs at a tolerance of their own, or those of the certificate, and extrapolated.

Runs with a motor at rtol 1e-12 repeat to 5e-10 of their states (a start moved by 1e-18 m shows it), so that differences
by a weak parameter, over a step of 1e-4, are known to 4e-3 of what counts as nothing here: larger steps are tried too.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model, QuantityFunction

#: What a derivative may be off, over the largest of its state, or over its size.
AGREEMENT = 1e-4

SPEED, START = "mechanism.driver.speed", "mechanism.driver.start_angle"
SHAFT, CLEARANCE, ANGLE = "shaft.speed", "bearing.clearance", "bearing.ball_angle"

TABLE = (
    (
        'force = ["1500 N", "0 N"]',
        'direction = "10 deg"\ntable = { angle = { values = [-20, 30, 130, 190, 250], unit = "deg" }, '
        'force = { values = [0, 1200, 1700, 900, -60], unit = "N" } }',
    ),
    ('window = { start = "350 deg", end = "190 deg" }\n', ""),
)
TWO_TURNS = (
    ('force = ["0 N", "8964.8 N"]', 'direction = "90 deg"'),
    (
        'window = { start = "237 deg", end = "267 deg" }',
        'table = { angle = { values = [30, 140, 230, 250, 390, 500, 590, 610], unit = "deg" }, '
        'force = { values = [0, 500, 4000, 0, 0, 300, 900, 0], unit = "N" }, turns = 2 }',
    ),
)
EFFECTS = (
    (
        "[bearing.inner_ring]",
        """[bearing.cage]
slip = { time = { values = [0.0, 0.05, 0.13, 0.3], unit = "s" }, value = [0.0, 0.03, 0.01, 0.02] }
[bearing.outer_waviness.9]
amplitude = "0.5 um"
[bearing.defects.spall]
on = "inner"
angle = "30 deg"
chord = "1 mm"
depth = "5 um"
profile = "half-sine"
[bearing.inner_ring]""",
    ),
)
SPEEDS = (
    (
        'speed = "500 rpm"                       # [paper]; positive is counter-clockwise',
        'table = { time = { values = [0, 0.2, 0.5], unit = "s" }, speed = { values = [500, 430, 620], unit = "rpm" } }',
    ),
)

CASES = {
    "window": ("crank_shaper", (), 5.5, (SPEED, START, "mechanism.forces.cut.window.end", CLEARANCE)),
    "window, light damping": ("offset_slider", (), 5.5, (SPEED, "mechanism.forces.tool.window.start", ANGLE)),
    "table over the angle": (
        "crank_shaper",
        TABLE,
        5.5,
        (SPEED, "mechanism.forces.cut.table.force.3", "mechanism.forces.cut.table.angle.2", START),
    ),
    "slip, waviness, spall": (
        "varying_compliance",
        EFFECTS,
        1.6,  # later it multiplies what is changed by so much that differences show nothing
        (SHAFT, "bearing.cage.slip.value.2", "bearing.defects.spall.chord", ANGLE),
    ),
    "table of the speed": (
        "punching_press_two_way",
        SPEEDS,
        2.5,
        ("mechanism.driver.table.speed.2", "mechanism.driver.table.time.2", "mechanism.forces.punch.window.end"),
    ),
    "motor": ("punching_press_motor", (), 2.5, ("mechanism.driver.torque.synchronous_speed", SPEED, CLEARANCE)),
    "table over two turns, motor": (
        "punching_press_motor",
        TWO_TURNS,
        1.8,
        (
            *("mechanism.forces.punch.table.force.3", "mechanism.forces.punch.table.angle.3"),
            *("mechanism.forces.punch.table.force.7", "mechanism.bodies.crank.inertia"),
        ),
    ),
    "rotating load": ("rotor", (), 5.5, (SHAFT, "loads.unbalance.angle", CLEARANCE)),
}


def scale_of(model: Model, name: str) -> float:
    """A large change of a parameter."""
    unit = next(info.unit for info in model.manifest.parameters if info.name == name)
    return 1.0 if unit == "rad" else abs(model.parameters[name])


def extrapolated(run: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Central differences of four runs."""
    wide, narrow = ((run(s) - run(-s)) / (2.0 * s) for s in (step, 0.5 * step))
    return np.asarray((4.0 * narrow - wide) / 3.0)


#: What `make test` asks of gradients: a case and turns.
DEFAULT, OF_QUANTITIES = "window", 0.6


@pytest.mark.long
@pytest.mark.parametrize(
    ("case", "turns"), [*((case, CASES[case][2]) for case in CASES), ("table over two turns, motor", OF_QUANTITIES)]
)
def test_derivatives_of_states_are_those_of_differences_in_every_turn(
    make_model: Callable[..., Model], case: str, turns: float
) -> None:
    scene, changes, _, names = CASES[case]
    model = make_model(scene, *changes)
    found = model.sensitivities(list(names), turns, samples_per_cycle=40)
    times = found.solution.t
    run = {"duration": float(times[-1]), "times": times, "transient": 0, "rtol": 1e-12, "kinks": "located"}
    for k, name in enumerate(names):
        value = model.parameters[name]

        def states(change: float, name: str = name, value: float = value) -> np.ndarray:
            return model.simulate(**run, method="stepper-dop853", parameters={name: value + change}).x  # type: ignore[arg-type]

        large = scale_of(model, name)
        # a driver that follows its table is moved by its table alone
        nothing = 1e-3 * np.max(np.abs(found.solution.x), axis=0) / large
        best = math.inf
        # a weak parameter shows little of a small step, a strong one turns in a large one
        for step in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1):
            difference = extrapolated(states, step * large)
            off = np.abs(found.x[:, :, k] - difference) / np.maximum(np.max(np.abs(difference), axis=0), nothing)
            # at an edge that moves velocities have two derivatives: a few samples lie on one
            best = min(best, float(np.sort(np.max(off, axis=1))[-1 - 2 * math.ceil(turns)]))
            if best < AGREEMENT:
                break
        assert best < AGREEMENT, name


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::ballpass.runtime.KinkWarning")
@pytest.mark.parametrize(
    ("case", "turns"),
    [
        (DEFAULT, OF_QUANTITIES),
        *(pytest.param(case, CASES[case][2] - 0.1, marks=pytest.mark.long) for case in CASES),
    ],
)
def test_gradients_of_quantities_are_those_of_differences(
    make_model: Callable[..., Model], case: str, turns: float
) -> None:
    scene, changes, _, names = CASES[case]
    model = make_model(scene, *changes)
    of = ("rms:inner.y", "max:ball.force", "range:inner.x")
    function = QuantityFunction(model, of, names, turns, transient=0.0)
    gradient, report = function.jacobian(function.start), function.certify()
    compared = 0
    for row, quantity in enumerate(of):
        for column, name in enumerate(names):
            pair = report[quantity, name]
            assert pair.check.value is not None
            assert pair.check.uncertainty is not None
            # what a large change brings, below a tenth of the quantity, is nothing
            size = max(abs(pair.check.value), 0.1 * abs(pair.value) / pair.scale)
            if pair.check.sides is not None or pair.check.uncertainty > AGREEMENT * size:
                continue  # a kink, or differences tell too little
            compared += 1
            assert abs(gradient[row, column] - pair.check.value) < 2.0 * AGREEMENT * size, (quantity, name)
    # most: differences of what is small over turns of a spall are known to 2e-3 at best
    assert compared >= 0.6 * len(of) * len(names)


@pytest.mark.long
def test_derivatives_behind_spalls_are_known_to_a_fraction_of_what_they_are_within_them(
    make_model: Callable[..., Model],
) -> None:
    """A thousandth is left of them, and so would be of digits at a tolerance relative to the largest."""
    spall = """[bearing.cage]
slip = { time = { values = [0.0, 0.08, 0.21], unit = "s" }, value = [0.0, 0.04, 0.015] }
[bearing.inner_waviness.5]
amplitude = "0.4 um"
[bearing.defects.spall]
on = "inner"
angle = "77 deg"
chord = "1.1 mm"
depth = "4 um"
profile = "half-sine"
[bearing.inner_ring]"""
    model = make_model("varying_compliance", ("[bearing.inner_ring]", spall))
    asked = {"cycles": 2.67, "transient": 0.0}
    found = model.sensitivity("rms:inner.vx", ANGLE, **asked, check=False).pairs[0].derivative  # type: ignore[arg-type]
    function = QuantityFunction(model, "rms:inner.vx", ANGLE, **asked)  # type: ignore[arg-type]

    def run(change: float) -> np.ndarray:
        parameters = {ANGLE: model.parameters[ANGLE] + change}
        tight = {"rtol": 1e-12, "kinks": "located", "method": "stepper-dop853"}
        return np.array(model.reduce(2.67, transient=0, parameters=parameters, **tight)["inner.vx"].rms)  # type: ignore[arg-type]

    expected = float(extrapolated(run, 2e-5))
    assert found == pytest.approx(expected, rel=5e-5, abs=0.0)
    assert float(function.jacobian(function.start).ravel()[0]) == pytest.approx(expected, rel=5e-5, abs=0.0)
