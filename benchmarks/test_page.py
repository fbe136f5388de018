"""Claims about the committed results and page, and about how figures come from results; nothing is measured here.

Ten seconds, most of them for the figures of the page.
"""

from __future__ import annotations

import json
import math
import re
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.__main__ import RESULTS, parts_of
from benchmarks.compared import Compared, Ratio
from benchmarks.curves import LEVELS, basis, between, lower, time_at
from benchmarks.problem import CASES, ROOT
from benchmarks.provenance import lines
from benchmarks.report import text_of
from benchmarks.targets import targets
from benchmarks.timing import Entry, interleave

PAGE = ROOT / "docs" / "benchmarks.md"


@pytest.fixture(scope="module")
def results() -> dict[str, dict[str, Any]]:
    """The committed results by the name of their part."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(RESULTS.glob("*.json"))}


def test_every_part_has_a_full_result(results: dict[str, dict[str, Any]]) -> None:
    assert sorted(results) == sorted(parts_of(quick=False))
    assert not [name for name, result in results.items() if result["quick"]]


def test_page_is_what_its_results_say(tmp_path: Path) -> None:
    """Fails where the page was edited by hand, or results were measured and no page written from them."""
    page = PAGE.read_text(encoding="utf-8")
    state = re.search(r"at code state ([0-9a-f]{16})\.", page)
    assert state is not None, "the page does not name the state of the code it was written at"
    assert page == text_of(RESULTS, tmp_path, state[1])
    for image in re.findall(r"\]\((images/[^)]+)\)", page):
        assert (PAGE.parent / image).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("key", [case.key for case in CASES])
def test_figures_of_targets_rest_on_all_parameter_sets(results: dict[str, dict[str, Any]], key: str) -> None:
    case = Compared(results[f"work_precision_{key}"])
    assert case.case["members"] >= 30
    at_1e3 = ("stepper", "hand-best", "numbalsoda-lsoda", "erk", "cvodes-compiled", "numpy-best")
    peers = [one for one in case.contenders if not one.startswith(("stepper", "simulate", "hand-"))]
    for level in LEVELS[1:]:
        times = {one: found.time for one in peers if (found := case.figure(one, level)) is not None}
        nearest = sorted(times, key=lambda one: times[one])[:3]
        for one in ("stepper", *nearest):
            found = case.figure(one, level)
            assert found is not None
            assert found.members == case.case["members"], (one, level)
    for one in at_1e3:
        found = case.figure(one, LEVELS[0])
        assert found is not None, one
        assert found.members == case.case["members"], one


@pytest.mark.parametrize("key", [case.key for case in CASES])
def test_references_agree_far_below_the_errors_compared(results: dict[str, dict[str, Any]], key: str) -> None:
    reference = results[f"work_precision_{key}"]["reference"]
    assert 0.5 * reference["worst_agreement"] < 0.2 * LEVELS[-1]
    assert reference["methods"][0].startswith("SciPy")


def test_control_of_derivatives_lowers_their_error(results: dict[str, dict[str, Any]]) -> None:
    for case in results["sensitivity_error"]["cases"]:
        for row in case["rows"]:
            assert row["with derivatives"]["derivative"]["median"] < 0.2 * row["states alone"]["derivative"]["median"]


# ---------------------------------------------------------------------------------------------- from results to figures


def test_time_at_an_error_follows_a_power_law() -> None:
    errors = 10.0 ** -np.arange(1.0, 9.0)
    slow = [(float(e), float(e**-0.2)) for e in errors]
    fast = [(float(e), float(0.01 * e**-0.5)) for e in errors]
    assert time_at(slow, 3e-5) == pytest.approx(3e-5**-0.2)
    assert time_at(slow, 1e-12) is None
    assert time_at(slow[3:], 1e-1) == slow[3][1]  # more accurate than asked for
    crossing = lower([slow, fast])
    assert crossing[0][1] == pytest.approx(min(slow[0][1], fast[0][1]))
    assert crossing[-1][1] == pytest.approx(min(slow[-1][1], fast[-1][1]))


def test_basis_names_the_neighbours_of_an_error() -> None:
    points = [(1e-2, 1.0), (1e-4, 2.0), (1e-6, 4.0)]
    assert [k for k, _ in basis(points, 1e-5)] == [1, 2]
    assert between([t for _, t in points], basis(points, 1e-5)) == pytest.approx(math.sqrt(8.0))
    assert [k for k, _ in basis(points, 0.1)] == [0]
    assert basis(points, 1e-7) == ()


def _case(**factors: float) -> dict[str, Any]:
    """A case whose contenders take a power law of a random size in each parameter set, times a factor."""
    random = np.random.default_rng(3)
    members = 32
    size, wrong = np.exp(0.1 * random.standard_normal((2, members)))
    contenders = []
    for key, factor in factors.items():
        key = key.replace("_", "-")
        tolerances = [10.0**-k for k in range(2, 10)]
        runs = [
            {
                "tolerance": tol,
                "errors": (tol * wrong).tolist(),
                "times": (1e-4 * factor * size * tol**-0.2).tolist(),
            }
            for tol in tolerances
        ]
        contenders.append({"key": key, "label": key, "group": "g", "tolerances": tolerances, "runs": runs})
    return {"case": "stiff", "words": "stiff", "members": members, "contenders": contenders}


def test_ratio_of_what_goes_together_has_no_spread() -> None:
    """Parameter sets are drawn the same for both, so what they do to both alike is not spread of the ratio."""
    case = Compared(_case(stepper=1.0, peer=2.5))
    figure, ratio = case.figure("peer", 1e-5), case.ratio("peer", "stepper", 1e-5)
    assert figure is not None
    assert ratio is not None
    assert figure.high / figure.low > 1.1
    assert figure.time == pytest.approx(2.5e-4 * 1e-5**-0.2, rel=0.05)
    assert (ratio.low, ratio.value, ratio.high) == pytest.approx((2.5, 2.5, 2.5))


def test_spread_of_a_ratio_is_that_of_a_median_over_32() -> None:
    """Against the known standard error of a median of normal numbers, 1.2533 sigma / sqrt(n)."""
    case = _case(stepper=1.0, peer=2.5)
    noise = 0.1
    for run in case["contenders"][1]["runs"]:
        drawn = np.random.default_rng(5).standard_normal(32)
        run["times"] = [2.5e-4 * run["tolerance"] ** -0.2 * math.exp(noise * z) for z in drawn]
        run["errors"] = [run["tolerance"]] * 32
    for run in case["contenders"][0]["runs"]:
        run["times"] = [1e-4 * run["tolerance"] ** -0.2] * 32
        run["errors"] = [run["tolerance"]] * 32
    ratio = Compared(case).ratio("peer", "stepper", 1e-5)
    assert ratio is not None
    expected = 2 * 1.2816 * 1.2533 * noise / math.sqrt(32)
    assert math.log(ratio.high / ratio.low) == pytest.approx(expected, rel=0.5)
    assert ratio.low < ratio.value < ratio.high


def test_target_within_the_spread_is_at_the_limit() -> None:
    from benchmarks.targets import _verdict

    assert _verdict(Ratio(value=3.1, low=2.9, high=3.3), 3.0) == "at the limit"
    assert _verdict(Ratio(value=3.1, low=3.05, high=3.3), 3.0) == "met"
    assert _verdict(Ratio(value=1.6, low=1.55, high=1.7), 1.5, at_most=True) == "**short**"


def test_another_method_is_named_only_where_it_is_faster() -> None:
    slower = "\n".join(targets([Compared(_case(stepper=1.0, stepper_dop853=1.2, peer=2.5))], {}))
    assert "short" in slower
    assert "reaches" not in slower
    faster = "\n".join(targets([Compared(_case(stepper=1.0, stepper_dop853=0.8, peer=2.5))], {}))
    assert "stepper-dop853 reaches 3.12×" in faster


def test_parts_of_different_states_are_told() -> None:
    def result(digest: str) -> dict[str, Any]:
        return {"state": {"digest": digest, "commit": "abc", "date": "2026-01-01"}}

    one = "\n".join(lines({"balls": result("a" * 16), "ensemble": result("a" * 16)}, "a" * 16))
    assert one.startswith("All parts were measured on one state of the code")
    assert "changed" not in one
    assert "has changed since" in "\n".join(lines({"balls": result("a" * 16)}, "b" * 16))
    mixed = "\n".join(lines({"balls": result("a" * 16), "ensemble": result("b" * 16), "old": {}}, "b" * 16))
    assert "not all measured on one state" in mixed
    for part, differs in (("balls", "yes"), ("ensemble", "no"), ("old", "yes")):
        assert next(line for line in mixed.splitlines() if f"`{part}`" in line).split(" | ")[3] == differs


def _visit(visits: list[str], name: str, _: int) -> None:
    visits.append(name)


def test_what_others_are_divided_by_is_visited_more_often_and_evenly() -> None:
    visits: list[str] = []
    names = [f"peer {k}" for k in range(9)]
    entries = [Entry(call=lambda _: visits.append("stepper"), turns=3)]
    entries += [Entry(call=partial(_visit, visits, name)) for name in names]
    interleave(entries, rounds=2)
    calls = [name for name, before in zip(visits, ["", *visits], strict=False) if name != before]
    assert sorted(calls) == sorted(2 * [*3 * ["stepper"], *names])
    places = [k for k, name in enumerate(calls) if name == "stepper"]
    assert {b - a for a, b in pairwise(places)} == {4}
