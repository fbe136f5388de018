"""The tables of docs/howto/life.md hold what runs give."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import pi
from pathlib import Path

import pytest

from ballpass.runtime import Model

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "howto" / "life.md").read_text(encoding="utf-8")
#: Beginning of a row of the table of presses -> scene and numbers.
PRESSES = {
    "as shipped": ("punching_press", {}),
    "the ratio read in SI": ("punching_press", {"bearing.damping.ratio": 0.25e-5}),
    "`tangent`": ("punching_press_tangent", {}),
    "two-way": ("punching_press_two_way", {}),
    "clearance 0": ("punching_press", {"bearing.clearance": 0.0}),
    "clearance 5": ("punching_press", {"bearing.clearance": 5e-6}),
    "clearance 20": ("punching_press", {"bearing.clearance": 20e-6}),
    "700 rpm": ("punching_press", {"mechanism.driver.speed": 700.0 * pi / 30.0}),
}


@pytest.mark.long
@pytest.mark.parametrize("row", PRESSES)
def test_rows_of_presses_are_what_runs_give(make_model: Callable[..., Model], row: str) -> None:
    found = re.search(rf"^\| {re.escape(row)}.*\| ([\d.]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)
    assert found is not None
    scene, numbers = PRESSES[row]
    (bearing,) = make_model(scene).life(parameters=numbers).bearings
    assert bearing.life is not None
    given = [bearing.static_safety, bearing.life / 1e6]
    assert given == pytest.approx([float(text) for text in found.groups()], rel=1e-2, abs=0.06)


@pytest.mark.long
def test_what_changes_the_life_most_is_what_a_sensitivity_gives(make_model: Callable[..., Model]) -> None:
    rows = re.findall(r"^\| `([\w.]+)`.* \| (-?[\d.]+) \|$", PAGE.partition("## What changes")[2], re.MULTILINE)
    assert len(rows) == 9
    names = [name for name, _ in rows]
    report = make_model("punching_press").sensitivity(of="life", wrt=names, cycles=6, transient=2, check=False)
    for name, text in rows:
        assert report["life", name].dimensionless == pytest.approx(float(text), rel=1e-2), name


def test_percentages_of_the_prose_follow_from_the_numbers_beside_them() -> None:
    lives = dict(re.findall(r"^\| (.+?) \| [\d.]+ \| ([\d.]+) \|$", PAGE, re.MULTILINE))
    shipped, two_way = (
        float(next(lives[row] for row in lives if row.startswith(begin)))
        for begin in PRESSES
        if begin in ("as shipped", "two-way")
    )
    low, high = (float(next(lives[row] for row in lives if row.startswith(f"clearance {edge}"))) for edge in (5, 20))
    readings = [float(lives[row]) for row in lives if not row.startswith(("two-way", "clearance", "700"))]
    ((simulated, quasi_static),) = re.findall(r"# (\d+) million turns; quasi-static (\d+)", PAGE)
    assert f"{100 * (1 - two_way / shipped):.0f} % less" in PAGE
    assert f"costs {100 * (1 - high / low):.0f} %" in PAGE
    assert f"moves the life by {100 * (max(readings) / min(readings) - 1):.0f} %" in PAGE
    assert f"take {100 * (1 - int(simulated) / int(quasi_static)):.0f} % off the life" in PAGE
