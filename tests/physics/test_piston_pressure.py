"""Pressures on pistons: forces are pressure times area, and their work is that of the indicator diagram."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import read_scene
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.plot.record import gather

CRANK, ROD, SPEED, TURN = 0.022, 0.095, 1450.0 * math.pi / 30.0, 2.0 * math.pi
AREA, AMBIENT, AXES = math.pi / 4.0 * 0.052**2, 1e5, {"1": math.radians(45.0), "2": math.radians(135.0)}


def rows(model: Model, cylinder: str) -> tuple[np.ndarray, np.ndarray]:
    """Angles and pressures as the file has them."""
    path = f"mechanism.forces.gas_{cylinder}.table"
    angle, pressure = (
        np.array([value for name, value in model.parameters.items() if name.startswith(f"{path}.{column}.")])
        for column in ("angle", "pressure")
    )
    return angle, pressure


def pressure_at(model: Model, cylinder: str, angle: np.ndarray) -> np.ndarray:
    return np.interp(angle, *rows(model, cylinder), period=TURN)


@pytest.mark.parametrize("ambient", [AMBIENT, 3e5])
def test_force_on_the_piston_is_pressure_difference_times_area(
    make_model: Callable[..., Model], ambient: float
) -> None:
    """Of a piston without mass, whose pin takes the force along the cylinder."""
    model = make_model("v_compressor")
    numbers = {f"mechanism.forces.gas_{k}.ambient": ambient for k in AXES} | {
        f"mechanism.bodies.piston_{k}.mass": 1e-9 for k in AXES
    }
    for degrees in (5.0, 50.0, 100.0, 200.0, 301.0, 364.0, 720.0 + 33.0):
        angle = math.radians(degrees)
        found = model.evaluate(angle / SPEED, parameters=numbers)
        for k, axis in AXES.items():
            along = found[f"reaction.C{k}.x"] * math.cos(axis) + found[f"reaction.C{k}.y"] * math.sin(axis)
            force = (float(pressure_at(model, k, np.array(angle))) - ambient) * AREA
            assert -along == pytest.approx(force, rel=1e-9, abs=1e-3), (k, degrees)


def test_work_of_the_drive_is_the_area_of_both_indicator_diagrams(make_model: Callable[..., Model]) -> None:
    """Without friction; both integrals by Gauss's rule between the rows, the volumes by hand."""
    model = make_model("v_compressor")
    edges = np.unique(np.concatenate([rows(model, k)[0] % TURN for k in AXES] + [np.array([0.0, TURN])]))
    nodes, weights = np.polynomial.legendre.leggauss(6)
    half = np.diff(edges)[:, np.newaxis] / 2.0
    angle, weight = ((edges[:-1, np.newaxis] + half * (1.0 + nodes)).ravel(), (half * weights).ravel())
    torque = np.array([model.evaluate(one / SPEED)["drive_torque"] for one in angle])
    indicated = 0.0
    for k, axis in AXES.items():
        past = angle - axis
        arm = CRANK * np.sin(past)
        outwards = -arm - arm * CRANK * np.cos(past) / np.sqrt(ROD**2 - arm**2)  # of the piston, for each radian
        indicated += float(weight @ (pressure_at(model, k, angle) * AREA * outwards))
    assert 30.0 < indicated < 45.0  # J: two cylinders of 93 cm^3, compressed to 8.6 bar
    assert float(weight @ torque) == pytest.approx(indicated, rel=1e-8)


@pytest.mark.long
def test_derivatives_by_bore_ambient_and_rows_are_verified(make_model: Callable[..., Model]) -> None:
    path = "mechanism.forces.gas_1"
    names = [f"{path}.bore", f"{path}.ambient", f"{path}.table.pressure.1", f"{path}.table.angle.18"]
    report = make_model("v_compressor").sensitivity(["rms:front.load.y"], names, 2, transient=1)
    assert report.verdicts[Verdict.VERIFIED] == len(names)
    assert all(pair.by_steps != 0.0 for pair in report.pairs)


def drawn(model: Model, name: str, time: float) -> np.ndarray:
    """Force as pictures and pages have it."""
    record = gather(model, model.simulate(cycles=1, transient=0))
    return {label: force for label, _, force in record.applied_forces(time)}.get(name, np.zeros(2))


def test_pictures_have_the_force_in_newtons(make_virtual: Callable[..., Model]) -> None:
    model = make_virtual("v_compressor")
    over = (float(pressure_at(model, "1", np.array(0.0))) - AMBIENT) * AREA
    assert over > 500.0
    along = np.array([math.cos(AXES["1"]), math.sin(AXES["1"])])
    assert drawn(model, "gas_1", 0.0) == pytest.approx(-over * along, rel=1e-9)


def test_pictures_have_the_force_where_a_motor_decides_the_angle(make_virtual: Callable[..., Model]) -> None:
    table = 'bore = "100 mm"\ntable = { angle = ["10 deg", "190 deg"], pressure = ["2 bar", "12 bar"] }'
    windowed = 'window = { start = "237 deg", end = "267 deg" }'
    model = make_virtual(
        "punching_press_motor", ('force = ["0 N", "8964.8 N"]', 'direction = "90 deg"'), (windowed, table)
    )
    record = gather(model, model.simulate(cycles=1, transient=0))
    time = float(record.t[len(record.t) // 3])
    ((_, _, force),) = record.applied_forces(time)
    angle = float(record.crank_angle(np.array([time]))[0])
    pressure = np.interp(angle, np.radians([10.0, 190.0]), [2e5, 12e5], period=TURN)
    assert force == pytest.approx([0.0, (pressure - 101325.0) * math.pi / 4.0 * 0.01], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("window", "share"), [("", 1.0), ('window = { start = "30 deg", end = "90 deg" }', 0.0)])
def test_a_pressure_acts_always_or_within_a_window(
    make_virtual: Callable[..., Model], scene_text: Callable[..., str], window: str, share: float
) -> None:
    text = scene_text("v_compressor")
    table = text[text.index("[mechanism.forces.gas_1.table]") : text.index("[mechanism.forces.gas_2]")]
    model = make_virtual("v_compressor", (table, f'pressure = "0.5 MPa"\n{window}\n'))
    along = np.array([math.cos(AXES["1"]), math.sin(AXES["1"])])
    for degrees, acts in ((0.0, share), (45.0, 1.0)):
        time = math.radians(degrees) / SPEED
        assert drawn(model, "gas_1", time) == pytest.approx(-acts * 4e5 * AREA * along, rel=1e-9), degrees
        values = model.evaluate(time, parameters={"mechanism.bodies.piston_1.mass": 1e-9})
        on_pin = values["reaction.C1.x"] * along[0] + values["reaction.C1.y"] * along[1]
        assert on_pin == pytest.approx(-acts * 4e5 * AREA, rel=1e-9, abs=1e-3)


def test_pressures_of_a_file_are_those_of_the_table(scene_text: Callable[..., str], tmp_path: Path) -> None:
    """Of an indicator that measures in kPa."""
    text = scene_text("v_compressor")
    own = scene_from_text(text, "v").mechanism.forces[1].law
    lines = [f"{math.degrees(a.value):.6f},{p.value / 1e3:.6f}" for a, p in zip(own.angle, own.values, strict=True)]
    (tmp_path / "indicator.csv").write_text("\n".join(["angle [deg],p [kPa]", *lines]), encoding="utf-8")
    start, end = text.index("[mechanism.forces.gas_2.table]"), text.index("[mechanism.forces.belt]")
    file = 'table = { angle = { file = "indicator.csv", column = "angle" }, '
    file += 'pressure = { file = "indicator.csv", column = "p" } }\n\n'
    (tmp_path / "v.toml").write_text(text[:start] + file + text[end:], encoding="utf-8")
    law = read_scene(tmp_path / "v.toml").mechanism.forces[1].law
    assert [p.value for p in law.values] == pytest.approx([p.value for p in own.values], rel=1e-9)
    assert [a.value for a in law.angle] == pytest.approx([a.value for a in own.angle], rel=1e-6)
