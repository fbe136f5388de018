"""A force from a table over the driver's angle, against interpolation by NumPy and virtual work."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.point.jacobian import rows_of, values_of_rows
from ballpass.runtime.time.breakpoints import breakpoints

DEGREE = math.pi / 180.0
ANGLES, FORCES = [-20.0, 30.0, 130.0, 190.0, 250.0], [0.0, 1200.0, 1700.0, 900.0, -60.0]
ANGLE = 'angle = { values = [-20, 30, 130, 190, 250], unit = "deg" }'
FORCE = 'force = { values = [0, 1200, 1700, 900, -60], unit = "N" }'
CHANGES = (
    ('force = ["1500 N", "0 N"]', f'direction = "10 deg"\ntable = {{ {ANGLE}, {FORCE} }}'),
    ('window = { start = "350 deg", end = "190 deg" }\n', ""),
)
TABLE = "mechanism.forces.cut.table."
SPEED = "mechanism.driver.speed"
START = "mechanism.driver.start_angle"


@pytest.fixture(scope="module")
def shaper(make_model: Callable[..., Model]) -> Model:
    return make_model("crank_shaper", *CHANGES)


def interpolated(crank: np.ndarray) -> np.ndarray:
    return np.asarray(np.interp(crank / DEGREE, ANGLES, FORCES, period=360.0))


def drive_torque(model: Model, t: np.ndarray, parameters: dict[str, float]) -> np.ndarray:
    numbers = model.numbers(parameters)
    rows = rows_of(model, "drive_torque")
    return np.array([values_of_rows(model, rows, point(model, numbers, float(at), None))[0] for at in t])


@pytest.mark.parametrize(("speed", "start"), [(4 * math.pi, 0.0), (4 * math.pi, 5.1), (-9.0, 0.7)])
def test_drive_torque_gives_the_power_of_the_interpolated_force(shaper: Model, speed: float, start: float) -> None:
    """The torque less that without the force is the force's virtual work, in this turn and in later ones."""
    t = np.linspace(0.013, 1.7, 60)
    given = {SPEED: speed, START: start}
    idle = {f"{TABLE}force.{row}": 0.0 for row in range(1, 6)}
    added = drive_torque(shaper, t, given) - drive_torque(shaper, t, given | idle)
    crank = start + speed * t
    slot, slot_rate = 0.08 * np.exp(1j * crank) + 0.2j, 1j * 0.08 * np.exp(1j * crank)  # by the crank angle
    turned = np.imag(np.conj(slot) * slot_rate) / np.abs(slot) ** 2
    tip_rate = 1j * turned * 0.38 * slot / np.abs(slot)
    along = np.real(tip_rate * np.exp(-1j * 10 * DEGREE))
    expected = -interpolated(crank) * along
    assert added == pytest.approx(expected, rel=1e-9, abs=1e-10 * float(np.max(np.abs(expected))))


@pytest.mark.parametrize("crank", [20.0, 75.0, 200.0, 300.0, 345.0])
def test_derivatives_by_knots_are_those_of_linear_interpolation(shaper: Model, crank: float) -> None:
    """reaction.O.x changes with the force F as the balance of moments says: in proportion; so ratios of derivatives
    are those of the interpolation: (1 - s, s) by the values, -slope times these by the angles, slope by the start."""
    t = crank * DEGREE / shaper.parameters[SPEED]
    angles = np.array([*ANGLES, ANGLES[0] + 360.0])
    k = int(np.searchsorted(angles, (crank + 20.0) % 360.0 - 20.0)) - 1
    names = [k + 1, (k + 1) % 5 + 1]
    span = (angles[k + 1] - angles[k]) * DEGREE
    share = ((crank + 20.0) % 360.0 - 20.0 - angles[k]) * DEGREE / span
    slope = (FORCES[(k + 1) % 5] - FORCES[k]) / span
    by_values = shaper.jacobian("reaction.O.x", [f"{TABLE}force.{n}" for n in names], t=t).ravel()
    by_angles = shaper.jacobian("reaction.O.x", [f"{TABLE}angle.{n}" for n in names], t=t).ravel()
    per_newton = float(np.sum(by_values))
    assert by_values == pytest.approx(per_newton * np.array([1.0 - share, share]), rel=1e-9)
    assert by_angles == pytest.approx(-slope * per_newton * np.array([1.0 - share, share]), rel=1e-9)
    others = [f"{TABLE}force.{n}" for n in range(1, 6) if n not in names]
    assert not np.any(shaper.jacobian("reaction.O.x", others, t=t))
    # second derivatives of the value: the cross one by value and angle is the weight over the span
    twice = shaper.hessian("reaction.O.x", (f"{TABLE}force.{names[1]}", f"{TABLE}angle.{names[1]}"), t=t)
    assert twice == pytest.approx(-per_newton * share / span, rel=1e-8)


def test_steps_end_at_the_knots_and_a_turn_has_each_of_them(shaper: Model) -> None:
    speed = shaper.parameters[SPEED]
    times = breakpoints(shaper.manifest, shaper.numbers().values, 0.0, 1.0)
    expected = sorted(((a % 360.0) + 360.0 * turn) * DEGREE / speed for a in ANGLES for turn in range(2))
    np.testing.assert_allclose(times, [t for t in expected if 0.0 < t < 1.0], rtol=1e-14)


@pytest.mark.long
@pytest.mark.parametrize("kinks", ["located", "stepped-over"])
def test_members_of_an_ensemble_are_single_runs(shaper: Model, kinks: str) -> None:
    table = {
        f"{TABLE}angle.3": np.radians([125.0, 130.0, 140.0]),
        f"{TABLE}force.2": np.array([1200.0, 900.0, 1500.0]),
        SPEED: np.array([11.0, 12.0, -9.0]),
        START: np.array([0.0, 2.0, 5.0]),
    }
    given = {"cycles": 1, "transient": 0, "rtol": 1e-8, "kinks": kinks}
    many = shaper.simulate_many(table, ["end:inner.x", "end:inner.vx"], **given)
    assert many.failures == ()
    for member in range(3):
        values = {name: float(column[member]) for name, column in table.items()}
        one = shaper.simulate(cycles=1, transient=0, rtol=1e-8, parameters=values)
        for name, tolerance in (("inner.x", 1e-10), ("inner.vx", 1e-6)):
            assert many[f"end:{name}"][member] == pytest.approx(one[name][-1], abs=tolerance)


def test_knots_that_do_not_increase_within_a_turn_are_refused_at_run_time(shaper: Model) -> None:
    for values, words in (
        ({f"{TABLE}angle.2": 140 * DEGREE}, "angles of a table must increase"),
        ({f"{TABLE}angle.5": 345 * DEGREE}, "within a turn"),
    ):
        with pytest.raises(RequestError, match=words):
            shaper.simulate(cycles=0.1, parameters=values)
