"""The summary of a run: units everywhere, reference values of the press, honest extremes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from ballpass.runtime import Model, Solution
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.summary import add_turns, summarize
from ballpass.runtime.app.summary_table import render_summary
from ballpass.runtime.app.summary_words import stands_out
from ballpass.runtime.ask.peaks import steady_run
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.report.html import table_html
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.text import show, to_text
from ballpass.runtime.solution.settle import look_beyond

SCENES = Path(__file__).resolve().parents[2] / "scenes"


def table_text(table: ReportTable, width: int = 80) -> str:
    return to_text(Report(parts=(table,)), width)


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> tuple[Model, Solution]:
    model = make_model("punching_press")
    return model, model.simulate(cycles=4)


@pytest.fixture(scope="module")
def summary(press: tuple[Model, Solution]) -> dict[str, Any]:
    return summarize(*press)


def numbers(node: Any, path: tuple[str, ...] = (), unit: str = "") -> Iterator[tuple[tuple[str, ...], float, str]]:
    """Every number of a summary with the unit of the object it stands in."""
    if isinstance(node, dict):
        for key, value in node.items():
            yield from numbers(value, (*path, key), node.get("unit", ""))
    elif isinstance(node, int | float) and not isinstance(node, bool):
        yield path, float(node), unit


def test_every_number_has_a_unit_and_survives_json(summary: dict[str, Any]) -> None:
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    found = list(numbers(summary))
    assert len(found) > 60
    assert [path for path, _, unit in found if not unit] == []


def test_reactions_torque_and_work_are_those_of_the_paper_s_data(summary: dict[str, Any]) -> None:
    # found with an independent solver: |R14y| max 8497 N, |R14x| max 291 N, 9.0784 J a turn
    assert summary["reaction.A.y"]["max"] == pytest.approx(8497.0, abs=0.6)
    assert summary["reaction.A.x"]["min"] == pytest.approx(-291.0, abs=0.6)
    assert summary["drive_work"]["value"] == pytest.approx(9.0784, abs=1e-4)
    assert summary["drive_torque"]["min"] < 0.0 < summary["drive_torque"]["max"]


def test_stiffness_and_frequencies_are_the_reference_values(summary: dict[str, Any]) -> None:
    assert summary["k_b"] == {"value": pytest.approx(8.64473e9, rel=1e-6), "unit": "N/m^1.5"}
    assert summary["frequencies"]["cage"] * 0.12 == pytest.approx(0.381530, abs=1e-6)
    assert summary["frequencies"]["ball_pass_outer"] * 0.12 == pytest.approx(3.052239, abs=1e-6)


def test_motions_are_those_of_the_steady_part(press: tuple[Model, Solution], summary: dict[str, Any]) -> None:
    """Of its steps, which see a little more than 4000 samples."""
    _, solution = press
    kept = solution["inner.y"][solution.t >= 0.24 * (1.0 - 1e-12)]
    found = summary["inner.y"]
    assert kept.min() - 0.5e-6 < found["min"] <= kept.min()
    assert kept.max() <= found["max"] < kept.max() + 0.5e-6
    # 4000 equal steps: sums over the samples differ from integrals by the end points only
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(kept**2)), rel=2e-3)
    assert found["std"] == pytest.approx(np.std(kept), rel=2e-3)
    assert found["rms"] ** 2 == pytest.approx(found["std"] ** 2 + found["mean"] ** 2, rel=1e-12, abs=0.0)
    assert summary["transient_cycles_dropped"]["value"] == 2.0
    assert summary["steady_cycles"]["value"] == pytest.approx(2.0)


def test_peaks_tell_when_which_ball_and_what_the_samples_alone_show(
    press: tuple[Model, Solution], summary: dict[str, Any]
) -> None:
    model, solution = press
    # 40 times as many samples at a ten thousandth of the tolerance: time and ball are read off, not searched for
    fine = model.simulate(cycles=4, samples_per_cycle=80000, rtol=1e-10).steady()
    found = summary["peak_ball_force"]
    for key, name in (("elastic", "ball.elastic_force"), ("total", "ball.force")):
        k, ball = np.unravel_index(np.argmax(fine[name]), fine[name].shape)
        assert found["ball"][key] == ball + 1
        assert found["time"][key] == pytest.approx(fine.t[k], abs=5e-6)
        assert found["sampled"][key] == solution.steady()[name].max()
        assert found[key] >= found["sampled"][key]
        assert found[key] == pytest.approx(fine[name].max(), rel=1e-4)


def test_every_method_tells_its_steps(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    for method in ("cvodes", "stepper"):
        told = model.simulate(cycles=1, method=method, transient=0)
        assert summarize(model, told)["steps"]["value"] == told.statistics.steps > 500


def test_extremes_of_samples_alone_are_marked_where_they_stand(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    for method, mark in (("cvodes", "*"), ("stepper", "")):
        summary = summarize(model, model.simulate(cycles=2, transient=1, method=method))
        table, _ = render_summary(summary, model.manifest, every=True)
        words, peaks, _, highest, *_ = (list(column) for column in zip(*table.rows, strict=True))
        names = [str(word).split()[-1] for word in words]
        for name, unit in (("inner.y", 1e6), ("inner.vy", 1e3)):
            assert highest[names.index(name)] == f"{unit * summary[name]['max']:z.4g}{mark}"
        assert str(peaks[names.index("peak_ball_force.total")]).endswith("*") == bool(mark)
        assert ("* of the samples alone" in str(table.caption)) == bool(mark)
        first, *_ = stands_out(model.manifest, {**model.parameters, **model.constants()}, summary)
        assert f"force: {rounded(summary['peak_ball_force']['total'])}{mark} N" in first


def test_all_rows_of_two_bearings_are_one_table_of_80_columns(make_model: Callable[..., Model]) -> None:
    """A terminal prints what is wider in blocks: one block more held the units alone."""
    model = make_model("rotor_two_bearings")
    summary = summarize(model, model.simulate(cycles=2, transient=1))
    text = table_text(render_summary(summary, model.manifest, every=True)[0])
    assert max(map(len, text.splitlines())) <= 80
    (row,) = (line for line in text.splitlines() if "Mass moved by the inner ring of pulley" in line)
    assert "[kg]" in row or "[kg]" in text.splitlines()[text.splitlines().index(row) + 1]


def test_rows_that_are_always_zero_are_left_out(make_model: Callable[..., Model]) -> None:
    """A load along x alone has a zero row of y, which `--all` keeps; a row with one number is kept."""
    model = make_model("varying_compliance")
    summary = summarize(model, model.simulate(cycles=2, transient=1))
    assert (summary["load.y"]["min"], summary["load.y"]["max"]) == (0.0, 0.0)
    shown, left_out = render_summary(summary, model.manifest)
    every, _ = render_summary(summary, model.manifest, every=True)
    loads = [[str(cell) for cell in row if "Load on" in str(row[0])] for row in shown.rows]
    assert [cells[0][-1] for cells in loads if cells] == ["x"]
    assert len(every.rows) == len(shown.rows) + left_out


def test_a_scene_without_mechanism_has_no_reaction(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    found = summarize(model, model.simulate(cycles=2, transient=1))
    assert not [key for key in found if key.startswith(("reaction", "drive"))]
    assert found["frequencies"]["ball_pass_outer"] == pytest.approx(20.0, rel=1e-4)
    assert "outer.x" not in found


def test_values_that_are_not_finite_are_refused(press: tuple[Model, Solution]) -> None:
    model, solution = press
    broken = np.array(solution["inner.y"])
    broken[-5] = np.nan
    outputs = {**solution.outputs, "inner.y": broken}
    sampled = replace(solution, outputs=outputs, reductions=None, steady_reductions=None)
    with pytest.raises(SimulationError, match=r"inner\.y holds nan"):
        summarize(model, sampled)


def test_table_fits_a_terminal_and_shows_micrometres(press: tuple[Model, Solution], summary: dict[str, Any]) -> None:
    table, left_out = render_summary(summary, press[0].manifest)
    text = table_text(table)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80
    # words, no symbols, and the highest ball force first
    assert not any(symbol in text for symbol in ("k_b", "m_ei", "c_b", "reaction.", "_"))
    assert str(table.rows[0][0]) == "Highest ball force"
    every, none = render_summary(summary, press[0].manifest, every=True)
    assert none == 0
    assert len(every.rows) == len(table.rows) + left_out
    assert max(map(len, table_text(every).splitlines())) <= 80
    row = next(line for line in text.splitlines() if line.split()[:3] == ["Inner", "ring,", "y"])
    assert float(row.split()[4]) == pytest.approx(1e6 * summary["inner.y"]["max"], rel=1e-3)
    assert row.split()[-1] == "µm"
    assert "transient turns left out: 2" in " ".join(text.split())
    assert "one-sided" in text


@pytest.mark.parametrize("digits", [1, 2, 4])
def test_rounded_numbers_are_those_of_format_without_its_exponents(digits: int) -> None:
    """From a ten-thousandth to a million; beyond, the exponent counts more than the zeros."""
    for power in range(-9, 12):
        for value in (1.23456 * 10.0**power, -9.99999 * 10.0**power, 10.0**power):
            text = rounded(value, digits)
            shown = float(f"{value:.{digits}g}")
            whole = digits == 4 and 1e4 <= abs(shown) < 1e6  # no digit in front of the point is a zero in its place
            assert float(text) == (round(value) if whole else shown)
            assert ("e" in text) == (abs(float(text)) < 1e-4 or abs(float(text)) >= 1e6), text
    assert rounded(-0.0, digits) == "0"


def test_sentences_on_top_name_the_peak_and_its_pressure(
    make_model: Callable[..., Model], summary: dict[str, Any], press: tuple[Model, Solution]
) -> None:
    model, solution = press
    first, dent = stands_out(model.manifest, {**solution.parameters, **solution.constants}, summary)
    assert first.startswith("Highest ball force: 4391 N (ball 3 at 0.3194 s, crank at 238.2 deg), ")
    # the derived output is the pressure under the elastic force alone; Hertz's grows with its cube root
    pressed = make_model("punching_press", ("outputs = [", 'outputs = ["ball.inner_pressure", '))
    peak = summary["peak_ball_force"]
    derived = pressed.quantities("max:ball.inner_pressure")["max:ball.inner_pressure"].value
    expected = derived * (peak["total"] / peak["elastic"]) ** (1.0 / 3.0) / 1e6
    assert float(first.split()[-6]) == pytest.approx(expected, rel=2e-3)
    assert "4200 MPa (ISO 76)" in dent


def test_names_and_numbers_of_tables_are_whole_at_any_width(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    name, numbers, words = (
        "left.frequencies.ball pass outer",
        ("-2.575e-13", "1.044e+05"),
        "a sentence of six words here",
    )
    table = ReportTable(
        title="T",
        heads=("quantity", "value", "another value", "what"),
        rows=[(name, *numbers, words)],
        right=("value", "another value"),
        wrapped=("what",),
    )
    rows = [line.split() for line in table_text(table, width=20).splitlines() if name in line]
    assert [row[3] for row in rows[:2]] == list(numbers), rows
    # no line is wider where a block need not be, each block has the name; the sentence takes several lines
    monkeypatch.setenv("COLUMNS", "50")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    show(Report(parts=(table,)))
    lines = re.sub(r"\x1b\[[\d;]*m", "", capsys.readouterr().out).splitlines()
    assert max(len(line.rstrip()) for line in lines) <= 50
    assert sum(name in line for line in lines) == 3
    assert " ".join(word for line in lines for word in line.split() if word in words.split()) == words
    assert all(any(number in line for line in lines) for number in numbers)


@pytest.mark.long
def test_a_quantity_that_is_no_finite_number_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """nan and inf stood alone."""
    monkeypatch.chdir(tmp_path)
    still = ["loads.unbalance.mass=0 kg", "loads.weight.force.y=0 N"]
    words = ["run", str(SCENES / "rotor.toml"), "--no-figures"]
    asked = [word for name in ("kurtosis:load.y", "life", "mean:load.y") for word in ("--of", name)]
    done = CliRunner().invoke(app, [*words, *asked, *(word for one in still for word in ("--set", one))])
    assert done.exit_code == 0, done.stderr
    said = " ".join(done.stdout.split())
    assert "kurtosis (nan: the signal stands still)" in said
    assert "Rating life (inf: no ball carries a load)" in said
    assert said.count("nan") == said.count("inf:") + 1 == 2


def test_no_word_of_a_scene_is_read_as_a_picture_or_as_a_style() -> None:
    words = "Press [old] [/x] :fire:"
    table = ReportTable(title=words, heads=("name", "value"), rows=[("rms:x:y", "1")], caption=words)
    lines = table_text(table).splitlines()
    assert lines[:: len(lines) - 1] == [words, words]
    assert "rms:x:y" in table_text(table)
    assert table_html(table).count(words) == 2


def test_a_run_with_some_outputs_has_the_summary_of_these(
    press: tuple[Model, Solution], summary: dict[str, Any]
) -> None:
    model = press[0]
    run = model.simulate(cycles=4, outputs=["ball.force", "drive_torque"])
    found = summarize(model, run)
    peak, told = found["peak_ball_force"], summary["peak_ball_force"]
    assert (peak["total"], peak["time"]["total"]) == (told["total"], told["time"]["total"])
    assert "elastic" not in peak
    assert found["drive_work"] == summary["drive_work"]
    # states are there without being asked for
    assert found["inner.y"] == summary["inner.y"]
    assert "reaction.A.x" not in found
    own = steady_run(model, model.numbers(), run)
    assert own is not None
    longer = look_beyond(own, run.steady_reductions)
    assert longer is not None
    assert "highest ball force" in add_turns(found, longer, model.manifest, instead=False)[0]
    render_summary(found, model.manifest)
