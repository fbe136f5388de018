"""The table of docs/howto/two_way.md holds what such runs give."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.runtime import Model

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "two_way.md"
PAIR = r"([\d.]+) \\\| ([\d.]+)"
ROW = re.compile(rf"^\| `([\w-]+)`, .+? \| (\w+) \| {PAIR} \| {PAIR} \| {PAIR} \|$", re.MULTILINE)
ROWS = ROW.findall(PAGE.read_text(encoding="utf-8"))

TANGENT = (('law = "one-sided"', 'law = "tangent"'), ('ratio = "0.25e-5 s*mm^0.5"', 'ratio = "2.5e-5 s"'))
FIXED = (
    ('support = "elastic"\nmass', 'support = "fixed"\n#mass'),
    ('stiffness = "5e7 N/m"', "#"),
    ('damping = "500 N*s/m"', "#"),
    ('outer = ["0 um", "0 um"]\nouter_velocity = ["0 m/s", "0 m/s"]', ""),
    ('"outer.*", ', ""),
)


def test_the_table_has_all_cases() -> None:
    assert {row[:2] for row in ROWS} == {(law, s) for law in ("one-sided", "tangent") for s in ("elastic", "fixed")}


@pytest.mark.long
@pytest.mark.parametrize("row", ROWS, ids=[" ".join(row[:2]) for row in ROWS])
def test_rows_are_what_runs_give(make_model: Callable[..., Model], row: tuple[str, ...]) -> None:
    for k, scene in enumerate(("punching_press", "punching_press_two_way")):
        model = make_model(scene, *(TANGENT if row[0] == "tangent" else ()), *(FIXED if row[1] == "fixed" else ()))
        run = model.simulate(
            cycles=12, rtol=1e-8, samples_per_cycle=20000, outputs=["inner.y", "inner.vy", "ball.force"]
        )
        turn = run.cycle_length
        assert turn is not None
        steady = run.t >= 2.0 * turn
        peaks = [np.max(run["ball.force"][(run.t >= n * turn) & (run.t <= (n + 1) * turn)]) for n in range(2, 12)]
        rms = [np.sqrt(np.mean(run[name][steady] ** 2)) for name in ("inner.y", "inner.vy")]
        found = (np.mean(peaks), 1e6 * rms[0], 1e3 * rms[1])
        for value, printed in zip(found, row[2 + k :: 2], strict=True):
            last_digit = 10.0 ** -len(printed.partition(".")[2])
            assert value == pytest.approx(float(printed), rel=2e-4, abs=0.5 * last_digit)
