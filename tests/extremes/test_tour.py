"""The quick part of the tour of extremes: every case holds, and no refusal is a traceback."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from extremes.case import Case, Row, run_case
from extremes.tour import cases

from extremes import coverage, sanitized

QUICK = [case for case in cases() if case.quick]


@pytest.mark.parametrize("case", QUICK, ids=[f"{case.group}: {case.name}, {case.method}" for case in QUICK])
def test_case_of_the_tour_holds(case: Case) -> None:
    if shutil.which("gcc") is None and case.group == "Generated C":
        pytest.skip("the compiler's warnings and sanitizers are those of gcc, which is not installed")
    if shutil.which("cc") is None and shutil.which("gcc") is None and shutil.which("clang") is None:
        pytest.skip("there is no C compiler: the stepper does not run")
    found = case.run()
    assert found.holds, f"error {found.error} of {found.bound}: {case.against}"


def test_every_case_answers_an_edge_that_can_be_asked_for_and_every_edge_has_a_case() -> None:
    every = cases()
    for item, patterns in coverage.ITEMS:
        for pattern in patterns:
            assert coverage.answering((pattern,), every), f"{item}: no case fits {pattern}"
    answered = {case.name for _, patterns in coverage.ITEMS for case in coverage.answering(patterns, every)}
    assert not [case.name for case in every if case.name not in answered]
    rows = [Row(case=case, finding=None, fault="", seconds=0.0) for case in every]
    assert all(" | 0 of " in line for line in coverage.table(rows)[2:])


def test_names_of_cases_tell_them_apart() -> None:
    names = [(case.group, case.name, case.method) for case in cases()]
    again = {name for name in names if names.count(name) > 1}
    # energy with the same words runs by two methods, so the method belongs to the name
    assert not again


def test_a_fault_planted_in_a_driver_is_reported_and_a_driver_without_fault_is_not() -> None:
    if not sanitized.able():
        pytest.skip("gcc's libasan and libubsan are not installed")
    loop = next(plant for plant in sanitized.PLANTS if plant[0] == "loop.c")
    row = run_case(Case(group="", name="", method="", against="", run=lambda: sanitized.planted(*loop)))
    assert row.holds, row.fault
    assert row.finding is not None
    assert "heap-buffer-overflow" in row.finding.status
    source, function, _, call = loop
    with pytest.raises(AssertionError, match="the fault was not seen"):
        sanitized.planted(source, function, "", call)
