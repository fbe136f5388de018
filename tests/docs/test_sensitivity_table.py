"""Table and words of docs/howto/sensitivity_numbers.txt hold what the press gives."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from ballpass.runtime import Model

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "howto" / "sensitivity_numbers.txt").read_text(encoding="utf-8")
ROWS = re.findall(r"\(`([\w.]+)`\) \| ([+-][\d.]+) \| (\w+) \| .+? \| ([+-][\d.]+) \| (\w+) \|", PAGE)


@pytest.mark.long
def test_the_table_is_what_the_press_gives(make_model: Callable[..., Model]) -> None:
    names = [row[0] for row in ROWS]
    assert len(names) == 6
    report = make_model("punching_press").sensitivity(["peak_ball_force", "rms:inner.y"], names)
    for name, *cells in ROWS:
        for quantity, number, verdict in (("peak_ball_force", *cells[:2]), ("rms:inner.y", *cells[2:])):
            pair = report[quantity, name]
            assert pair.dimensionless == pytest.approx(float(number), abs=1e-4), (quantity, name)
            assert pair.check.verdict.value == verdict
    peak, rms = report.quantities
    assert f"Peak ball force {peak.value:.1f} N (ball {peak.ball}, t = {peak.time:.5f} s)" in PAGE
    assert f"y {1e6 * rms.value:.3f} µm. Places where the motion grazes a kink: {len(report.grazing)}." in PAGE
