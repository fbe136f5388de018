"""``ballpass sensitivity``: what it prints and writes, and its exit codes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.image import imread
from typer.testing import CliRunner, Result

from ballpass.runtime.app.cli import app
from ballpass.runtime.quantity.quantity_run import EvaluatedQuantities, QuantityRun

SCENE = Path(__file__).resolve().parent.parent / "scenes" / "punching_press_tangent.toml"
SHORT = ["--cycles", "0.4", "--transient", "0", "--set", "bearing.clearance=-60 um"]
ASKED = ["--of", "rms:inner.y", "--of", "peak_ball_force", "--wrt", "bearing.share", "--wrt", "mechanism.gravity"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("sensitivity")


@pytest.fixture
def ballpass(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Callable[..., Result]:
    def call(*words: str) -> Result:
        monkeypatch.chdir(folder)
        monkeypatch.setenv("COLUMNS", "80")
        return CliRunner().invoke(app, ["sensitivity", str(SCENE), *words])

    return call


def test_the_report_is_printed_written_and_drawn(ballpass: Callable[..., Result], folder: Path) -> None:
    result = ballpass(*SHORT, *ASKED, "--out", "out")
    assert result.exit_code == 0, result.output
    assert "verified" in result.stdout
    assert "peak_ball_force" in result.stdout
    assert "…" not in result.stdout
    assert "N/(m/s²)" in result.stdout
    report = json.loads((folder / "out" / "sensitivity.json").read_text(encoding="utf-8"))
    assert report["verdicts"]["verified"] == 4
    for name in ("rms_inner_y", "peak_ball_force"):
        picture = imread(folder / "out" / f"tornado_{name}.png")
        assert picture.shape[1] >= 1100
        assert picture[..., :3].std() > 0.05


def test_patterns_choose_parameters_and_the_table_says_where_one_is_zero(ballpass: Callable[..., Result]) -> None:
    words = [
        *SHORT[:-2],
        "--set",
        "bearing.clearance=0 um",
        "--of",
        "static_deflection@240deg",
        "--wrt",
        "bearing.c[lo]*",
    ]
    result = ballpass(*words, "--no-check")
    assert result.exit_code == 0, result.output
    before, _, behind = result.stdout.partition("parameter is 0")
    assert "bearing.contact" in before
    assert "bearing.clearance" in behind
    assert "bearing.contact" not in behind


def test_json_is_one_object_and_nothing_else(ballpass: Callable[..., Result]) -> None:
    result = ballpass(*SHORT, *ASKED, "--json", "--no-check")
    assert result.exit_code == 0
    report = json.loads(result.stdout)
    assert [row["certificate"]["verdict"] for row in report["sensitivities"]] == ["not checked"] * 4
    assert report["sensitivities"][0]["unit"] == "m"


def test_a_disagreement_ends_with_exit_code_1_and_both_numbers(
    ballpass: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = QuantityRun.differentiate

    def wrong(self: QuantityRun, *arguments: object, **more: object) -> EvaluatedQuantities:
        course = plain(self, *arguments, **more)  # type: ignore[arg-type]
        return replace(course, estimates=tuple(replace(item, slope=1.05 * item.slope) for item in course.estimates))

    right = json.loads(ballpass(*SHORT, *ASKED, "--json").stdout)["sensitivities"][0]
    monkeypatch.setattr(QuantityRun, "differentiate", wrong)
    result = ballpass(*SHORT, *ASKED)
    assert result.exit_code == 1
    assert "disagrees" in result.stdout
    said = " ".join(result.stderr.split())
    assert f"{1.05 * right['derivative']:.9g}" in said
    assert f"{right['certificate']['value']:.9g}" in said


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["--of", "peak_bal_force"], "peak_ball_force"),
        (["--wrt", "bearing.clearanse"], "bearing.clearance"),
        (["--rtol", "7"], "rtol"),
    ],
)
def test_wrong_requests_end_with_exit_code_2_and_a_hint(
    ballpass: Callable[..., Result], words: list[str], hint: str
) -> None:
    result = ballpass(*SHORT, *words)
    assert result.exit_code == 2
    assert hint in " ".join(result.stderr.split())
