"""The page of the benchmarks is what its results say, and no results of two machines make one."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from benchmarks import waviness
from benchmarks.__main__ import main

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.long
def test_page_of_the_benchmarks_is_drawn_from_its_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(ROOT / "benchmarks" / "results", tmp_path / "results")
    assert main(["--draw", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "benchmarks.md").read_bytes() == (ROOT / "docs" / "benchmarks.md").read_bytes()
    drawn = sorted(path.name for path in (tmp_path / "images").iterdir())
    assert drawn == sorted(path.name for path in (ROOT / "docs" / "images").glob("bench_*"))
    other = tmp_path / "results" / "coupling.json"
    found = json.loads(other.read_text(encoding="utf-8"))
    found["state"]["machine"] = "another"
    other.write_text(json.dumps(found), encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["--draw", "--out", str(tmp_path)])
    assert "results of 2 machines: " in capsys.readouterr().err


def test_page_on_effects_says_what_was_measured_of_waviness() -> None:
    found = json.loads(waviness.RESULTS.read_text(encoding="utf-8"))
    assert waviness.sentence(found) in (ROOT / "docs" / "theory" / "effects.md").read_text(encoding="utf-8")
