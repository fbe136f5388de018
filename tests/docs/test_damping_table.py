"""The table of docs/howto/damping.md holds what its commands give."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from ballpass.runtime import Model
from ballpass.runtime.app.summary import summarize

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "damping.md"
ROW = re.compile(r"^\| `([\w-]+)` \| read (.+?) \| .+? \| ([\d ]+) \| ([\d ]+) \|$", re.MULTILINE)
ROWS = ROW.findall(PAGE.read_text(encoding="utf-8"))


def test_the_table_has_all_laws() -> None:
    assert len(ROWS) == 7


@pytest.mark.long
@pytest.mark.parametrize(("law", "reading", "elastic", "total"), ROWS, ids=[f"{row[0]} {row[1]}" for row in ROWS])
def test_rows_are_what_runs_give(
    make_model: Callable[..., Model], law: str, reading: str, elastic: str, total: str
) -> None:
    if law == "tangent":
        model = make_model("punching_press_tangent")
    else:
        model = make_model("punching_press", ('law = "one-sided"', f'law = "{law}"'))
    numbers = {"bearing.damping.ratio": 0.25e-5} if reading == "in SI" else {}
    peak = summarize(model, model.simulate(parameters=numbers))["peak_ball_force"]
    assert peak["elastic"] == pytest.approx(float(elastic.replace(" ", "")), rel=1e-3)
    assert peak["total"] == pytest.approx(float(total.replace(" ", "")), rel=1e-3)
