"""Shipped machines against what textbooks say of them: work of a pump and of an engine, loads of a shaft's bearings."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model


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


@pytest.mark.long
def test_bearings_of_the_shaft_carry_their_shares_of_weight_belt_and_unbalance(
    make_model: Callable[..., Model],
) -> None:
    found = make_model("rotor_two_bearings").simulate(cycles=2)
    unbalance = 12 * 20e-6 * (2950 * 2 * math.pi / 60) ** 2
    total = [np.asarray(found[f"pulley.load.{axis}"]) + np.asarray(found[f"free_end.load.{axis}"]) for axis in "xy"]
    assert np.hypot(total[0] - 600, total[1] + 117.7) == pytest.approx(unbalance, rel=1e-9)
    assert found["pulley.load.x"] == pytest.approx(0.7 * total[0], rel=1e-12)
