"""A method is one file: put beside the others it runs wherever they do, with a folder generated before it was there."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ballpass.runtime import Model
from ballpass.runtime.contract.method_registry import METHODS

#: Fehlberg 5(4): the last stage is in the middle of the step, and the error needs no end slope.
FEHLBERG = """
from ballpass.runtime.contract.tableaus import ErrorEstimate, ExplicitTableau, row_of, rows_of

METHOD = ExplicitTableau(
    name="Fehlberg 5(4)",
    number=NUMBER,
    order=5,
    dense_order=3,
    nodes=row_of("0 1/4 3/8 12/13 1 1/2"),
    matrix=rows_of(
        "", "1/4", "3/32 9/32", "1932/2197 -7200/2197 7296/2197", "439/216 -8 3680/513 -845/4104",
        "-8/27 2 -3544/2565 1859/4104 -11/40",
    ),
    weights=row_of("16/135 0 6656/12825 28561/56430 -9/50 2/55"),
    error_estimates=(ErrorEstimate(weights=row_of("1/360 0 -128/4275 -2197/75240 1/50 2/55 0"), order=4),),
    dense_nodes=(),
    dense_matrix=(),
    dense_rows=(),
    source="Fehlberg 1970, doi:10.1007/BF02241732",
)
"""

RUN = """
import json, sys
import ballpass.runtime.contract.methods as methods
methods.__path__.append(sys.argv[1])
from ballpass.runtime import load
from ballpass.runtime.export.c_program import program_texts

model = load(sys.argv[2])
mine, other = "stepper-fehlberg", "stepper-dop853"
run = {"cycles": 0.3, "transient": 0, "rtol": 1e-10}
x = {method: model.simulate(method=method, outputs=(), **run).x for method in (mine, other)}
force = {method: model.reduce(method=method, **run)["ball.force"].maximum for method in (mine, other)}
members = model.simulate_many({"bearing.clearance": [1e-6] * 3}, ["max:ball.force"], method=mine, **run)
single = model.reduce(method=mine, parameters={"bearing.clearance": 1e-6}, **run)["ball.force"].maximum
located = {m: model.simulate(method=m, outputs=(), kinks="located", **run).x for m in (mine, other)}
slope = {m: model.sensitivities(["bearing.clearance"], cycles=0.1, rtol=1e-10, method=m).x[-1] for m in (mine, other)}

def apart(one, two):
    return float(abs(one - two).max() / abs(two).max())

print(json.dumps({
    "states": apart(x[mine], x[other]),
    "reductions": abs(force[mine] / force[other] - 1),
    "lanes": float(abs(members["max:ball.force"] / single - 1).max()),
    "in lanes": members.statistics.lanes,
    "located": apart(located[mine], located[other]),
    "derivatives": apart(slope[mine], slope[other]),
    "program": "fehlberg" in program_texts(model)["scene.c"],
}))
"""


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("methods")
    source = FEHLBERG.replace("NUMBER", str(len(METHODS) + 1))
    (folder / "fehlberg.py").write_text(source, encoding="utf-8")
    return folder


@pytest.mark.long
def test_a_method_put_beside_the_others_runs_everywhere(make_model: Callable[..., Model], beside: Path) -> None:
    folder = make_model("varying_compliance").folder
    given = [sys.executable, "-W", "ignore", "-c", RUN, str(beside), str(folder)]
    done = subprocess.run(given, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found.pop("in lanes") > 1
    assert found.pop("program")
    assert max(found.values()) < 1e-6, found
