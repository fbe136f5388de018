"""The quick part of the tour of extremes: every case holds, and no refusal is a traceback."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from extremes.case import Case
from extremes.tour import cases

QUICK = [case for case in cases() if case.quick]


@pytest.mark.parametrize("case", QUICK, ids=[f"{case.group}: {case.name}, {case.method}" for case in QUICK])
def test_case_of_the_tour_holds(case: Case) -> None:
    if shutil.which("gcc") is None and case.group == "Generated C":
        pytest.skip("the compiler's warnings and sanitizers are those of gcc, which is not installed")
    if shutil.which("cc") is None and shutil.which("gcc") is None and shutil.which("clang") is None:
        pytest.skip("there is no C compiler: the stepper does not run")
    found = case.run()
    assert found.holds, f"error {found.error} of {found.bound}: {case.against}"
