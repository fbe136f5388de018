"""Claims about the benchmarks: one command measures and writes the page, and nothing is left out in silence.

Half a minute without the peers, two with them.  What the committed results and page claim is in `test_page.py`.

The numbers of a quick run mean nothing; that all is there, and that what is compared is the same, does.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ballpass.runtime.native.compilers import find_compiler
from benchmarks.curves import curve, error_of

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a quick run."""
    if find_compiler() is None:
        pytest.skip("the benchmarks compile C; no compiler is here")
    folder = tmp_path_factory.mktemp("benchmarks")
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", "--quick", "--out", str(folder)],
        cwd=ROOT,
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder


def _result(folder: Path, name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "results" / f"{name}.json").read_text(encoding="utf-8"))
    return found


def test_every_contender_has_runs_or_says_why_not(quick: Path) -> None:
    page = (quick / "benchmarks.md").read_text(encoding="utf-8").partition("## Work and precision")[2]
    contenders = _result(quick, "work_precision_onesided")["contenders"]
    assert {
        "stepper",
        "simulate",
        "hand-dp54",
        "erk",
        "cvodes",
        "numbalsoda-lsoda",
        "numbalsoda-dop853",
        "cvode-bdf",
        "cvode-adams",
        "diffrax-tsit5",
    } <= {c["key"] for c in contenders}
    for contender in contenders:
        assert ("runs" in contender) != ("absent" in contender)
        row = next(line for line in page.splitlines() if line.startswith(f"| {contender['label']}"))
        if "absent" in contender:
            assert contender["absent"] in row
        else:
            assert any(run.get("times") for run in contender["runs"]), contender


def test_all_methods_converge_to_the_same_cycle(quick: Path) -> None:
    for contender in _result(quick, "work_precision_onesided")["contenders"]:
        errors = [error for error, _ in curve(contender)]
        if errors:
            assert min(errors) < 1e-3, contender["key"]
            assert errors[-1] < errors[0] or max(errors) < 1e-6, contender["key"]


def test_stepper_takes_the_steps_of_the_same_method_by_hand(quick: Path) -> None:
    """Sums over the balls are rounded in another order: at tight tolerances a few steps of thousands fall elsewhere.

    An error hangs on where in a step the contacts open; where steps fall elsewhere it is another draw, up or down.  So
    errors are one where the steps are, and on the average over the tolerances everywhere.
    """
    contenders = {c["key"]: c for c in _result(quick, "work_precision_onesided")["contenders"]}
    same_steps, ratios = 0, []
    for method in ("dp54", "rodas4", "rodas5p"):
        own, hand = (contenders[f"{who}-{method}"]["runs"] for who in ("stepper", "hand"))
        for mine, theirs in zip(own, hand, strict=True):
            error, expected = error_of(mine), error_of(theirs)
            if expected > 1e-2:
                continue  # nothing is resolved there, steps neither
            steps, by_hand = mine["counts"]["steps"], theirs["counts"]["steps"]
            assert steps == pytest.approx(by_hand, rel=0.01)
            ratios.append(error / expected)
            if expected > 1e-6 and steps == by_hand:
                same_steps += 1
                assert error == pytest.approx(expected, rel=0.05)
    assert same_steps >= 4
    assert len(ratios) >= 15
    assert max(*ratios, *(1 / ratio for ratio in ratios)) < 3
    assert np.exp(np.mean(np.log(ratios))) == pytest.approx(1.0, abs=0.15)


def test_two_references_agree_and_right_hand_sides_are_one_model(quick: Path) -> None:
    result = _result(quick, "work_precision_onesided")
    assert result["reference"]["worst_agreement"] < 1e-8
    assert {"NumPy", "C"} <= set(result["rate_agreement"])
    assert all(value < 1e-12 for value in result["rate_agreement"].values())


def test_page_shows_figures_and_names_no_paths(quick: Path) -> None:
    page = (quick / "benchmarks.md").read_text(encoding="utf-8")
    for title in (
        "How to read it",
        "Work and precision",
        "Targets",
        "One right-hand side",
        "Number of balls",
        "Number of parameters",
        "Errors of derivatives",
        "Ensembles",
        "Jacobians",
        "Fast arithmetic",
        "From scene",
    ):
        assert f"## {title}" in page
    images = re.findall(r"\]\((images/[^)]+)\)", page)
    assert images
    for image in images:
        assert (quick / image).read_bytes().startswith(b"\x89PNG")
    everything = page + "".join(p.read_text(encoding="utf-8") for p in (quick / "results").glob("*.json"))
    for place in (str(ROOT), str(Path.home()), str(quick)):
        assert place not in everything


def test_derivatives_of_casadi_and_of_the_stepper_are_one(quick: Path) -> None:
    rows = [row for row in _result(quick, "sensitivity_cost")["rows"] if "agreement" in row]
    assert {row["way"] for row in rows} == {"CasADi erk, C", "CasADi rosenbrock, C"}
    assert all(row["agreement"] < 1e-2 for row in rows)


def test_control_of_derivatives_lowers_their_error_over_the_ensemble(quick: Path) -> None:
    """In every row, and on the average over the rows by far; the two members of a quick run tell no more of one row."""
    for case in _result(quick, "sensitivity_error")["cases"]:
        gains = []
        for row in case["rows"]:
            free, controlled = row["states alone"], row["with derivatives"]
            gains.append(controlled["derivative"]["median"] / free["derivative"]["median"])
            assert controlled["state"]["median"] < free["state"]["median"]
        assert max(gains) < 1.0
        assert np.exp(np.mean(np.log(gains))) < 0.3


def test_an_unknown_part_is_refused() -> None:
    from benchmarks.__main__ import main

    assert main(["--quick", "work_precission"]) == 2


def test_rate_of_another_model_is_refused() -> None:
    from benchmarks.press import disagreement, make_load, make_vector_rate
    from benchmarks.problem import CASES, models

    if find_compiler() is None:
        pytest.skip("the benchmarks compile C; no compiler is here")
    case = next(c for c in CASES if c.key == "onesided")
    model = models()[case.scene]
    magnitude = np.array([1e-4] * 4 + [1.0] * 4)
    right = make_vector_rate(np, make_load(math), 8, False)
    assert disagreement(model, {}, right, magnitude) < 1e-12
    seven_balls = make_vector_rate(np, make_load(math), 7, False)
    other_law = make_vector_rate(np, make_load(math), 8, True)
    assert disagreement(model, {}, seven_balls, magnitude) > 1e-3
    assert disagreement(model, {}, other_law, magnitude) > 1e-3
