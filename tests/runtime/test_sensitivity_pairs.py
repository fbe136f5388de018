"""Sensitivities of quantities against Richardson-extrapolated differences of tight runs, at parameters kicked away from
the defaults.  The table is written to build/sensitivity_pairs.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.certify.sensitivity_report import Sensitivity

pytestmark = pytest.mark.long

TABLE = Path(__file__).resolve().parents[2] / "build" / "sensitivity_pairs.md"


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    parameters: Mapping[str, float]
    span: Mapping[str, float]
    of: tuple[str, ...]
    wrt: tuple[str, ...]


CASES = {
    "punching_press": Case(
        parameters={
            "bearing.clearance": 8e-6,
            "mechanism.driver.speed": 50.0,
            "mechanism.driver.start_angle": 3.9,
            "bearing.initial.inner.y": -3e-6,
        },
        span={"cycles": 0.75, "transient": 0.25},
        of=("peak_ball_force", "rms:inner.y", "value:inner.y@250deg", "max:reaction.A.y"),
        wrt=(
            "mechanism.driver.speed",
            "mechanism.forces.punch.window.start",
            "mechanism.bodies.crank.points.B",
            "mechanism.bodies.slider.mass",
        ),
    ),
    "punching_press_tangent": Case(
        parameters={
            "bearing.clearance": 12e-6,
            "mechanism.driver.speed": 55.0,
            "mechanism.driver.start_angle": 3.9,
            "bearing.initial.inner.x": 2e-6,
        },
        span={"cycles": 0.75, "transient": 0.25},
        of=("peak_ball_force", "rms:inner.y", "range:inner.y", "value:inner.y@250deg"),
        wrt=(
            "bearing.clearance",
            "mechanism.bodies.slider.mass",
            "mechanism.forces.punch.force.y",
            "mechanism.forces.punch.window.end",
            "bearing.contact.outer_groove_radius",
        ),
    ),
    "offset_slider": Case(
        parameters={"bearing.clearance": 9e-6, "mechanism.driver.speed": 60.0},
        span={"cycles": 1, "transient": 0.5},
        of=("peak_ball_force", "rms:inner.x", "mean:ball.force"),
        wrt=("mechanism.driver.speed", "bearing.clearance", "mechanism.bodies.crank.points.B"),
    ),
    "four_bar": Case(
        parameters={"bearing.clearance": 11e-6, "mechanism.driver.speed": 58.0},
        span={"cycles": 0.75, "transient": 0.15},
        of=("peak_ball_force", "rms:inner.y", "amplitude:inner.x@2x"),
        wrt=("mechanism.driver.speed", "bearing.clearance", "bearing.ball_diameter"),
    ),
    "varying_compliance": Case(
        parameters={
            "bearing.clearance": 2e-6,
            "shaft.speed": 45.0,
            "load.force.x": 210.0,
            "bearing.initial.inner.y": 2e-7,
        },
        span={"cycles": 3, "transient": 1},
        of=("peak_ball_force", "rms:inner.x", "range:inner.y", "amplitude:inner.x@bpfo"),
        wrt=("shaft.speed", "bearing.clearance", "load.force.x", "bearing.contact.stiffness"),
    ),
}


@pytest.fixture(scope="module")
def pairs(make_model: Callable[..., Model]) -> dict[str, tuple[Sensitivity, ...]]:
    found = {}
    for scene, case in CASES.items():
        report = make_model(scene).sensitivity(case.of, case.wrt, parameters=case.parameters, **_span(case))
        found[scene] = report.pairs
    lines = [
        "| scene | quantity | parameter | dQ/dp | differences | relative error | (p/Q) dQ/dp | verdict |",
        "| --- | --- | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for scene, rows in found.items():
        lines += [
            f"| {scene} | {row.quantity} | {row.parameter} | {row.derivative:.8g} | {row.check.value:.8g} | "
            f"{error(row):.1e} | {row.dimensionless:+.4f} | {row.check.verdict.value} |"
            for row in rows
        ]
    TABLE.parent.mkdir(exist_ok=True)
    TABLE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return found


def _span(case: Case) -> dict[str, Any]:
    return dict(case.span)


def error(pair: Sensitivity) -> float:
    """Relative error against the differences; a derivative that both say is exactly zero has none."""
    assert pair.check.value is not None
    if pair.check.value == pair.derivative == 0.0:
        return 0.0
    return abs(pair.derivative - pair.check.value) / abs(pair.check.value)


def test_derivatives_agree_with_extrapolated_differences(pairs: dict[str, tuple[Sensitivity, ...]]) -> None:
    """At least 60 pairs on five scenes: median 1e-5, worst 1e-3."""
    # a reaction of rigid links does not depend on the bearing; zeros are no evidence
    errors = [error(pair) for rows in pairs.values() for pair in rows if pair.derivative != 0.0]
    assert len(errors) >= 60
    assert float(np.median(errors)) <= 1e-5
    worst = max((pair for rows in pairs.values() for pair in rows), key=error)
    assert error(worst) <= 1e-3, worst


def test_what_the_differences_confirm_is_called_verified(pairs: dict[str, tuple[Sensitivity, ...]]) -> None:
    assert all(pair.check.verdict is Verdict.VERIFIED for rows in pairs.values() for pair in rows)


def test_the_table_has_a_line_for_each_pair(pairs: dict[str, tuple[Sensitivity, ...]]) -> None:
    assert len(TABLE.read_text(encoding="utf-8").splitlines()) == 2 + sum(map(len, pairs.values()))
