"""Grazing: a contact that is touched, not crossed, is flagged with ball and time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from ballpass.runtime import Model
from ballpass.runtime.certify.grazing import Grazing, describe, find_grazing, merge_grazing
from ballpass.runtime.certify.sensitivity_report import SensitivityReport
from ballpass.runtime.plot.style import caption_of
from ballpass.runtime.plot.tornado import tornado

#: Ball and time [s].
PLACES = ((1, 0.1), (5, 0.1), (2, 0.2))
TIMES = np.linspace(0.0, 1.0, 2001)
ONE_PART = np.zeros(len(TIMES), dtype=int)


def flags(signal: np.ndarray, *, one_sided: bool = False) -> list[tuple[int, float, str]]:
    found = find_grazing(TIMES, ONE_PART, np.column_stack([signal, 0.3 + TIMES]), 0.0 * TIMES, one_sided=one_sided)
    return [(item.ball, item.time, item.kink) for item in found]


@pytest.mark.parametrize("depth", [2e-5, 0.0, -2e-5])
def test_an_extreme_near_zero_is_flagged_with_ball_and_time(depth: float) -> None:
    ((ball, time, kink),) = flags(1.0 - (1.0 - depth) * (1.0 - 0.0 * TIMES) - 4.0 * (TIMES - 0.4) ** 2)
    assert (ball, kink) == (1, "contact")
    assert time == pytest.approx(0.4, abs=1e-6)


def test_a_crossing_and_a_deep_touch_are_not_flagged() -> None:
    assert flags(np.sin(2 * np.pi * 3 * TIMES)) == []
    assert flags(0.01 - 4.0 * (TIMES - 0.4) ** 2) == []


def test_a_rate_that_touches_zero_is_flagged_under_one_sided_damping_alone() -> None:
    """(t - 0.4)^3 stands still for a moment without turning back."""
    creeping = 0.5 + (TIMES - 0.4) ** 3
    assert flags(creeping) == []
    found = flags(creeping, one_sided=True)
    assert [(ball, kink) for ball, _, kink in found] == [(1, "rate")]
    assert found[0][1] == pytest.approx(0.4, abs=1e-3)


def test_a_trajectory_made_to_graze_is_flagged_and_its_neighbours_are_not(make_model: Callable[..., Model]) -> None:
    """Preload is relieved behind the load: the clearance at which ball 1 is just relieved in passing makes it graze."""
    model = make_model("varying_compliance")
    span = {"cycles": 3.0, "transient": 0.3}

    def report(clearance: float) -> SensitivityReport:
        numbers = {"bearing.inner_ring.damping": 4e5, "bearing.clearance": clearance}
        return model.sensitivity("min:ball.deflection[1]", "load.force.x", parameters=numbers, check=False, **span)  # type: ignore[arg-type]

    def least(clearance: float) -> float:
        return report(clearance).quantities[0].value

    touching = brentq(least, -20e-6, -0.1e-6, xtol=1e-12)
    (flag,) = [item for item in report(touching).grazing if item.ball == 1]
    (quantity,) = report(touching).quantities
    assert flag.kink == "contact"
    assert flag.time == pytest.approx(quantity.time, abs=1e-3 * model.period())
    assert abs(flag.depth) < 1e-9
    for away in (0.9, 1.1):
        assert [item for item in report(away * touching).grazing if item.ball == 1] == []


def test_balls_that_graze_at_one_moment_are_one_place() -> None:
    def place(ball: int, time: float, kink: str = "rate") -> Grazing:
        return Grazing(ball=ball, time=time, crank_angle=0.0, depth=1e-9, kink=kink)

    found = [place(5, 0.1), place(1, 0.1 + 1e-9), place(2, 0.1, "contact"), place(1, 0.2)]
    merged = merge_grazing(found)
    assert [[item.ball for item in items] for items in merged] == [[1, 5], [2], [1]]
    assert describe(merged[0]).startswith("balls 1 and 5 graze the kink")


def test_the_chart_counts_the_places_that_the_table_lists(make_model: Callable[..., Model]) -> None:
    """Two balls at one moment, and one at another: the report tells of three, in two places.  Bars are in words."""
    model = make_model("varying_compliance")
    report = model.sensitivity("static_deflection", ["load.force.x", "bearing.contact.stiffness"], check=False)
    found = tuple(Grazing(ball=k, time=t, crank_angle=0.0, depth=1e-9, kink="contact") for k, t in PLACES)
    chart = tornado(report, "static_deflection").axes[0]
    written = {label.get_text().replace("\n", " ") for label in chart.get_yticklabels()}
    words = {info.name: info.description for info in model.manifest.parameters}
    assert written == {words["load.force.x"], words["bearing.contact.stiffness"]}
    for some, count in ((found, "2 places"), (found[:2], "1 place")):
        grazing = replace(report, grazing=some)
        words = caption_of(tornado(grazing, "static_deflection"))
        assert f"grazes a kink at {count}, where" in words
        assert f"grazing at {count} ({len(some)} counting each ball)" in str(grazing)


def test_kinks_are_sought_whether_or_not_the_outputs_name_the_deflection(make_model: Callable[..., Model]) -> None:
    """The mean force's derivative jumps at contact onset: both scenes must see the same places and numbers."""
    asked = ["mean:ball.force", "load.force.x"]
    numbers = {"bearing.clearance": 20e-6, "bearing.initial.inner.x": 14e-6}
    options = {"cycles": 0.6, "transient": 0.0, "parameters": numbers, "check": False}
    full = make_model("varying_compliance")
    fewer = make_model("varying_compliance", ('"ball.*"', '"ball.force"'))
    assert "ball.deflection" not in fewer.outputs
    expected, found = (model.sensitivity(*asked, **options) for model in (full, fewer))  # type: ignore[arg-type]
    assert found.pairs[0].derivative == pytest.approx(expected.pairs[0].derivative, rel=1e-9)
    assert [(item.ball, item.kink) for item in found.grazing] == [(item.ball, item.kink) for item in expected.grazing]
