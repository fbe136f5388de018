"""A moment is one row of a table: put beside the others it is taken in single runs and in lanes."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable

import pytest

from ballpass.runtime import Model

#: Rows for the kurtosis; then the kurtosis by them and by its integral along the steps.
RUN = """
import json, sys
import ballpass.runtime.native.reduction_rows as tables

tables.MOMENTS |= {"cube": 3, "fourth": 4}
tables.ROWS = tables.row_names()

import numpy as np
from ballpass.runtime import load
from ballpass.runtime.quantity.kinds import kurtosis
from ballpass.runtime.quantity.registry import KINDS

def reduced(runs, quantity):
    first, square, cube, fourth = (runs.entry(kind, quantity.channel) / runs.duration for kind in tables.MOMENTS)
    variance = square - first**2
    return (fourth - 4 * first * cube + 6 * first**2 * square - 3 * first**4) / variance**2

model = load(sys.argv[1])
names = ["kurtosis:inner.y", "kurtosis:ball.force"]
run = {"cycles": 2.0, "transient": 0.5, "rtol": 1e-9, "method": "stepper-dp54", "kinks": "stepped-over"}
table = {"bearing.clearance": [9e-6, 1e-5]}
along = [model.simulate_many(table, names, lanes=lanes, **run) for lanes in (True, False)]
object.__setattr__(KINDS["kurtosis"], "reduced", reduced)
object.__setattr__(KINDS["kurtosis"], "rows", tuple(tables.MOMENTS))
rows = [model.simulate_many(table, names, lanes=lanes, **run) for lanes in (True, False)]
print(json.dumps({
    "lanes": rows[0].statistics.lanes,
    "same bits": all(np.array_equal(rows[0][name], rows[1][name]) for name in names),
    "apart": [float(abs(rows[0][name] / along[1][name] - 1).max()) for name in names],
}))
"""


@pytest.mark.long
def test_a_row_put_beside_the_others_is_taken_everywhere(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    given = [sys.executable, "-W", "ignore", "-c", RUN, str(model.folder)]
    done = subprocess.run(given, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["lanes"] > 1
    assert found["same bits"]
    # of states exact but for the nodes' own rule; the force of the balls has kinks within steps
    assert found["apart"][0] < 1e-8
    assert found["apart"][1] < 1e-3
