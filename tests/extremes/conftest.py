"""Extreme cases: what they measured is collected, and written to a page when ``--extremes-page`` names one."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import pytest
from replacements import DAMPING

from ballpass.runtime import Model

HEAD = Path(__file__).with_name("page.md")
SECTIONS = {
    "test_numbers": "Numbers far from the shipped ones",
    "test_late_times": "Late times",
    "test_invariants": "Invariants",
    "test_methods": "Methods and refusals",
    "test_many": "Ensembles, derivatives, outputs",
    "test_certificates": "Certificates",
    "test_generated_c": "Generated C",
}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--extremes-page", metavar="FILE", help="write the page of the extreme cases to FILE")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--extremes-page") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Page(Path(config.getoption("--extremes-page"))))


class Page:
    """Collects the reports of the extreme cases and writes them as tables, a section a module, a table a claim."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.reports: list[pytest.TestReport] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        called = report.when == "call" or not report.passed
        if called and "claim" in dict(report.user_properties):
            self.reports.append(report)

    def pytest_sessionfinish(self) -> None:
        reports = sorted(self.reports, key=lambda report: (list(SECTIONS).index(_module(report)), report.location[1]))
        held = sum(report.passed for report in reports)
        minutes = sum(report.duration for report in reports) / 60.0
        commit = subprocess.run(
            ("git", "describe", "--always"), capture_output=True, text=True, check=False
        ).stdout.strip()
        counts = {
            "COMMIT": commit or "unknown",
            "HELD": held,
            "CASES": len(reports),
            "MINUTES": f"{minutes:.1f}",
            "PROCESSORS": os.cpu_count(),
        }
        text = HEAD.read_text(encoding="utf-8")
        for name, value in counts.items():
            text = text.replace(f"@{name}@", str(value))
        lines = [text.rstrip()]
        for module, of_module in groupby(reports, _module):
            lines += ["", f"## {SECTIONS[module]}"]
            for claim, of_claim in groupby(of_module, lambda report: dict(report.user_properties)["claim"]):
                lines += ["", claim, "", "| case | measured | allowed | verdict | time |", "|---|---:|---:|---|---:|"]
                lines += [_row(report) for report in of_claim]
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _module(report: pytest.TestReport) -> str:
    return Path(report.location[0]).stem


def _row(report: pytest.TestReport) -> str:
    told = dict(report.user_properties)
    case = report.location[2].partition("[")[2].removesuffix("]") or "–"
    note = f" ({told['note']})" if told.get("note") else ""
    verdict = {"passed": "holds", "failed": "**fails**", "skipped": "skipped"}[report.outcome]
    cells = (f"{case}{note}", told.get("measured", ""), told.get("allowed", ""), verdict, f"{report.duration:.1f} s")
    return f"| {' | '.join(map(str, cells))} |"


@pytest.fixture(autouse=True)
def _claim(request: pytest.FixtureRequest) -> None:
    """The first line of an extreme test's docstring is its claim."""
    if request.node.get_closest_marker("extreme"):
        claim = (request.function.__doc__ or request.function.__name__).strip().splitlines()[0]
        request.node.user_properties.append(("claim", claim))


@pytest.fixture
def holds(record_property: Callable[[str, object], None]) -> Callable[..., None]:
    """Asserts that an error is within its bound, and keeps both for the page."""

    def check(error: float, bound: float, note: str = "") -> None:
        record_property("measured", f"{error:.2g}")
        record_property("allowed", f"{bound:.2g}")
        record_property("note", note)
        assert error <= bound, f"error {error} of {bound}"

    return check


def _stepped(model: Model) -> Model:
    if not model.has_stepper:
        pytest.skip("the stepper needs a C compiler")
    return model


@pytest.fixture(scope="session")
def press(make_model: Callable[..., Model]) -> Callable[..., Model]:
    """The shipped press with a damping law, and with other replacements."""

    def make(law: str = "one-sided", *changes: tuple[str, str]) -> Model:
        damping = () if law == "one-sided" else ((DAMPING["one-sided"], DAMPING[law]),)
        return _stepped(make_model("punching_press", *damping, *changes))

    return make


@pytest.fixture(scope="session")
def rotor(make_model: Callable[..., Model]) -> Callable[..., Model]:
    """The shipped rotor in a fixed outer ring, with replacements."""
    return lambda *changes: _stepped(make_model("varying_compliance", *changes))
