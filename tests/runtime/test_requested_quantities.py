"""Claims about quantities of outputs on request: work along a run, and derivatives of Hertz's pressure."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict

POWERS = ("drive_power", "force.punch.power", "weight.power", "contact.power", "housing.power")


@pytest.mark.long
def test_work_along_a_run_is_the_change_of_the_kinetic_energy(make_model: Callable[..., Model]) -> None:
    """Two-way, with impacts, damping, punch and drive: all joules of a turn."""
    asked = ", ".join(f'"{name}"' for name in (*POWERS, "kinetic_energy"))
    model = make_model("punching_press_two_way", ("outputs = [", f"outputs = [{asked}, "))
    turn = model.period()
    # Gauss's quadrature between the edges of the punch's window, fine where balls touch and leave
    nodes, weights = np.polynomial.legendre.leggauss(6)
    edges = np.array([0.0, 237.0, 267.0, 360.0]) / 360.0 * turn
    pieces = [np.linspace(a, b, int(16_000 * (b - a) / turn)) for a, b in pairwise(edges)]
    grid = np.unique(np.concatenate(pieces))
    half = np.diff(grid)[:, None] / 2
    times = np.concatenate([[0.0], (grid[:-1, None] + half * (1 + nodes)).ravel(), [turn]])
    run = model.simulate(duration=turn, transient=0, times=times, rtol=1e-12, kinks="located", method="stepper-dop853")
    work = {name: float((half * weights).ravel() @ run[name][1:-1]) for name in POWERS}
    all_joules, gained = sum(map(abs, work.values())), run["kinetic_energy"][-1] - run["kinetic_energy"][0]
    assert sum(work.values()) == pytest.approx(gained, abs=1e-9 * all_joules)
    # the quantity, by the nodes that derivatives have
    report = model.sensitivity([f"integral:{n}" for n in POWERS], ["bearing.clearance"], 1, transient=0, check=False)
    for item, name in zip(report.quantities, POWERS, strict=True):
        assert item.value == pytest.approx(work[name], abs=1e-6 * all_joules)
        assert item.unit == "J"


@pytest.mark.long
@pytest.mark.extreme
def test_derivatives_of_pressure_are_a_third_of_those_of_the_force(make_model: Callable[..., Model]) -> None:
    """p = const Q^(1/3), the constant of the geometry alone; and they are verified, for that geometry as well."""
    asked = '"ball.inner_pressure", "point.slider.C.ay", "force.punch.power", '
    model = make_model("punching_press", ("outputs = [", f"outputs = [{asked}"))
    wrt = ["bearing.clearance", "mechanism.forces.punch.force.y", "bearing.contact.inner_groove_radius"]
    of = ["max:ball.inner_pressure", "max:ball.elastic_force", "integral:force.punch.power", "max:point.slider.C.ay"]
    report = model.sensitivity(of, wrt, 2, transient=1)
    for name in wrt[:2]:
        pressure, force = report[of[0], name], report[of[1], name]
        assert pressure.dimensionless == pytest.approx(force.dimensionless / 3.0, rel=1e-8), name
    assert report[of[2], wrt[1]].dimensionless == pytest.approx(1.0, rel=1e-8)
    assert all(pair.check.verdict.value == "verified" for pair in report.pairs)


def test_statistics_of_an_angle_that_jumps_are_those_of_the_sawtooth(make_model: Callable[..., Model]) -> None:
    """Of a crank from turn 2 to 4.3, whose angle is in (-pi, pi]; and their derivatives, jumps and all."""
    model = make_model("four_bar")
    asked = [f"{kind}:body.crank.angle" for kind in ("mean", "rms", "max", "range")]
    # three pieces of straight lines: to pi, a whole turn, and what is left
    ends = [(0.0, math.pi), (-math.pi, math.pi), (-math.pi, 0.6 * math.pi)]
    length = 2.3 * math.tau
    mean = sum((b**2 - a**2) / 2.0 for a, b in ends) / length
    rms = math.sqrt(sum((b**3 - a**3) / 3.0 for a, b in ends) / length)
    found = model.sensitivity(
        asked, ["mechanism.driver.start_angle", "mechanism.driver.speed"], 4.3, transient=2, check=False
    )
    values = [pair.value for pair in found.pairs[::2]]
    assert values == pytest.approx([mean, rms, math.pi, math.tau], rel=1e-11)
    by_angle, by_speed = ([pair.derivative for pair in found.pairs[k::2]] for k in (0, 1))
    end = 0.6 * math.pi
    assert by_angle == pytest.approx([end / length, end**2 / (2.0 * length * rms), 0.0, 0.0], rel=1e-10, abs=1e-12)
    assert by_speed == pytest.approx(np.zeros(4), abs=1e-12)


@pytest.mark.long
def test_derivatives_of_means_of_an_angle_that_jumps_hold_where_the_motion_decides_it(
    make_model: Callable[..., Model],
) -> None:
    model = make_model("punching_press_motor", ('outputs = ["inner.*"', 'outputs = ["body.*", "inner.*"'))
    asked = [f"{kind}:body.crank.angle" for kind in ("mean", "rms", "kurtosis", "amplitude")]
    asked[-1] += "@9Hz"
    tight = model.quantities(asked, cycles=3.3, transient=1, rtol=1e-12)
    for name, value in model.quantities(asked, cycles=3.3, transient=1, rtol=1e-9).items():
        assert value.value == pytest.approx(tight[name].value, rel=1e-8)
    found = model.sensitivity(asked, ["mechanism.driver.speed", "mechanism.driver.start_angle"], 3.3, transient=1)
    assert found.verdicts[Verdict.VERIFIED] == len(found.pairs)
