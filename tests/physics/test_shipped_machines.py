"""Shipped machines against what textbooks say of them: work of a pump and of an engine, loads of a shaft's bearings."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model


@pytest.mark.long
def test_work_of_the_pump_is_pressure_times_volume(make_model: Callable[..., Model]) -> None:
    """Less 0.3 % that the rise and fall of the pressure over 8 deg cost."""
    found = make_model("eccentric_pump").simulate(cycles=1)
    torque = np.asarray(found["drive_torque"])
    volume = 3 * math.pi / 4 * 0.016**2 * 0.010
    assert np.mean(torque[:-1]) * 2 * math.pi == pytest.approx(16e6 * volume, rel=0.005)


def test_work_of_the_engine_is_the_area_of_its_indicator_diagram(make_model: Callable[..., Model]) -> None:
    """Over two turns masses give back what they took: the drive does the work of the gas force, with the other sign."""
    model = make_model("engine")
    table = {q.name.rsplit(".table.")[1]: q.default for q in model.manifest.parameters if ".gas.table." in q.name}
    rows = range(1, len(table) // 2 + 1)
    angle = np.array([table[f"angle.{row}"] for row in rows])
    force = np.array([table[f"force.{row}"] for row in rows])
    crank = np.linspace(0.0, 4 * math.pi, 20001)
    height = 0.027 * np.sin(crank) + np.sqrt(0.09**2 - (0.027 * np.cos(crank)) ** 2)
    acting = np.interp(crank, angle, force, period=4 * math.pi)
    indicated = -float(np.trapezoid(acting, height))
    found = model.simulate(cycles=2)
    driven = float(np.trapezoid(found["drive_torque"], found.t)) * 3600 * 2 * math.pi / 60
    assert driven == pytest.approx(-indicated, rel=1e-3)
    assert 3000 < indicated * 30 < 5000  # W at 3600 rpm: engines of 196 cm^3 have about 4 kW


def test_teeth_of_the_cam_shaft_carry_the_torque_of_its_valves(make_model: Callable[..., Model]) -> None:
    """F_t = M / r of the wheel, 40 mm; the mean size over a cycle by hand, to 1e-7: its sense changes are no cuts."""
    model = make_model("engine_cam_shaft")
    table = {q.name.rsplit(".table.")[1]: q.default for q in model.manifest.parameters if ".valves.table." in q.name}
    rows = range(1, len(table) // 2 + 1)
    angle, torque = (np.array([table[f"{key}.{row}"] for row in rows]) for key in ("angle", "torque"))
    period = 4 * math.pi
    run = model.simulate(cycles=2, transient=0, samples_per_cycle=720)
    crank = run.t * 3600 * 2 * math.pi / 60
    acting = np.interp(crank, angle, torque, period=period)
    pressed = np.abs(acting) / 0.040 / math.cos(math.radians(20))
    np.testing.assert_allclose(run["gear.timing.force"], pressed, rtol=0.0, atol=1e-9)
    # the wheel is pushed off, to the right, whichever flank carries; the tangent is upright
    np.testing.assert_allclose(run["reaction.K.x"], pressed * math.sin(math.radians(20)), rtol=0.0, atol=1e-9)
    assert np.count_nonzero(np.diff(np.sign(acting))) == 4
    places = np.append(angle, angle[0] + period)
    ends = np.append(torque, torque[0])
    size = 0.0
    for width, first, last in zip(np.diff(places), ends[:-1], ends[1:], strict=True):
        crosses = first * last < 0.0
        size += width * (first**2 + last**2) / abs(first - last) / 2 if crosses else width * abs(first + last) / 2
    mean = model.quantities(["mean:gear.timing.force"])["mean:gear.timing.force"].value
    assert mean == pytest.approx(size / period / 0.040 / math.cos(math.radians(20)), rel=1e-7)


def test_a_cam_shaft_takes_its_power_from_the_crank(make_model: Callable[..., Model]) -> None:
    """At half the speed half its torque; everything else of the engine is the same."""
    torques = [
        make_model(scene).simulate(cycles=2, transient=0, samples_per_cycle=720)
        for scene in ("engine", "engine_cam_shaft")
    ]
    without, found = (run["drive_torque"] for run in torques)
    pressed = torques[1]["gear.timing.force"] * math.cos(math.radians(20)) * 0.020
    np.testing.assert_allclose(np.abs(found - without), pressed, rtol=0.0, atol=1e-9)
    assert np.mean(found - without) > 0.0
    assert make_model("engine_cam_shaft").manifest.mechanism.repeats == 2


@pytest.mark.long
def test_bearings_of_the_shaft_carry_their_shares_of_weight_belt_and_unbalance(
    make_model: Callable[..., Model],
) -> None:
    found = make_model("rotor_two_bearings").simulate(cycles=2)
    unbalance = 12 * 20e-6 * (2950 * 2 * math.pi / 60) ** 2
    total = [np.asarray(found[f"pulley.load.{axis}"]) + np.asarray(found[f"free_end.load.{axis}"]) for axis in "xy"]
    assert np.hypot(total[0] - 600, total[1] + 117.7) == pytest.approx(unbalance, rel=1e-9)
    assert found["pulley.load.x"] == pytest.approx(0.7 * total[0], rel=1e-12)
