"""What objects show in notebooks and consoles: HTML that parses and escapes, texts that stay short."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any

import pytest

import ballpass.derive
import ballpass.runtime
from ballpass.derive import derive, equations
from ballpass.derive.lowering.functions import lower
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import (
    DataSetReport,
    Distribution,
    MemberFailure,
    Model,
    QuantityFunction,
    Results,
    Sensor,
    SignalClass,
)
from ballpass.runtime.certify.method_choice import MethodChoice
from ballpass.runtime.certify.trade import measure_trade
from ballpass.runtime.many.signals import Signals
from ballpass.runtime.report.html import to_html
from ballpass.runtime.report.report import Marked, Report, ReportTable
from ballpass.runtime.show import html
from ballpass.runtime.vibration.diagnosis import diagnosis, spectrogram
from ballpass.runtime.vibration.spectrum import amplitude_spectrum, power_spectrum

ROOT = Path(__file__).resolve().parents[2]

#: What must not reach a page as it is.
ATTACK = '<script>alert("&")</script>'

WAYS = (MethodChoice(method="stepper", rtol=1e-5), MethodChoice(method="stepper-rodas4", rtol=1e-3))

CLEARANCE = "bearing.clearance"

MISSING = MemberFailure(member=3, status="REFUSED", time=0.0, message="Give another.")

#: Symbols of parameters that are letters with an index.
SYMBOL = re.compile(r"[A-Za-z]_\{?[a-z]+\}?")


def titled(model: Model) -> Model:
    return Model(model.folder, replace(model.manifest, title=ATTACK), model.library)


def by_class(*items: Any) -> dict[str, Any]:
    return {type(item).__name__: item for item in items}


@pytest.fixture(scope="module")
def shown(rotor: Model, scene_text: Callable[..., str]) -> dict[str, Any]:
    """Objects of calls that take no time, of a scene whose title is an attack."""
    system = derive(replace(scene_from_text(scene_text("varying_compliance"), "rotor"), title=ATTACK))
    model = titled(rotor)
    solution = model.simulate(3)
    t, x = solution.t, solution["inner.x"]
    return by_class(
        *(system, system.scene, lower(system), model, model.manifest, model.parameters, model.numbers()),
        *(solution, solution.statistics, solution.end, solution.reductions, solution.reductions),
        *(model.refine_peak(solution, "ball.elastic_force"), model.explain(), model.static_equilibrium()),
        *(model.linearize(), model.linearize().modes[0], model.jacobian_function("rhs"), model.library),
        *(amplitude_spectrum(t, x), power_spectrum(t, x), spectrogram(t, x, segment=0.02), diagnosis(x)),
        *(model.refine_peak(solution, "inner.x"), solution.reductions["inner.x"]),
        *(Signals(outputs=("inner.x",), sample_rate=1e4, duration=0.1), Distribution(name="norm"), Sensor(noise=0.1)),
        SignalClass(label="sound", model=model, members=9, parameters={f"a{k}": float(k) for k in range(1000)}),
        DataSetReport(path=Path("set.zarr"), members=9, made=9, failures=(MISSING,) * 1000),
        *(MISSING, Results(solution=solution, summary={"parameters": {f"a{k}": k for k in range(1000)}})),
    )


@pytest.fixture(scope="module")
def reports(make_model: Callable[..., Model]) -> dict[str, Any]:
    """The same of calls that run often, or compile more."""
    model = titled(make_model("punching_press"))
    life, trade = model.life(3), measure_trade(model, members=2, ways=WAYS)
    sensitivity = model.sensitivity("peak_ball_force", CLEARANCE, 3)
    many = model.simulate_many({CLEARANCE: [5e-6, 8e-6]}, "peak_ball_force", cycles=3)
    exact = model.simulate(3, error=0.05)
    return by_class(
        *(life, life.states[0], life.bearings[0], life.bearings[0].inner, trade, trade.measured[0]),
        *(sensitivity, sensitivity.pairs[0], many, many.statistics, model.sensitivities(CLEARANCE, 1)),
        *(exact, exact.accuracy, model.settle()),
        QuantityFunction(model, "rms:inner.y", [CLEARANCE], cycles=3),
    )


def check_reprs(items: dict[str, Any]) -> None:
    lengths = {name: len(repr(item)) for name, item in items.items()}
    assert {name: length for name, length in lengths.items() if length > 1000} == {}


def check_html(item: Any, words: str, *, with_title: bool) -> None:
    page = ET.fromstring(item._repr_html_())  # each element closed, each sign escaped
    text = "".join(page.itertext())
    assert words in text
    assert not list(page.iter("script"))
    assert (ATTACK in text) == with_title


def test_reprs_are_short(shown: dict[str, Any]) -> None:
    """The system of the press once printed 84 124 characters."""
    check_reprs(shown)
    assert "frequency=array(" in repr(shown["AmplitudeSpectrum"])


@pytest.mark.long
def test_reprs_of_reports_are_short(reports: dict[str, Any]) -> None:
    check_reprs(reports)


@pytest.mark.parametrize(
    ("name", "words", "with_title"),
    [
        ("System", "Equations of motion", True),
        ("Scene", "Diametral clearance", True),
        ("Model", "bearing.clearance", True),
        ("Parameters", "Diametral clearance", False),
        ("Solution", "centre of the inner ring", True),
        ("Results", "centre of the inner ring", True),
        ("Linearization", "ratio", False),
        ("StaticEquilibrium", "ball 8", False),
        ("Explanation", "at rest under the load", False),
        ("Reductions", "ball.elastic_force", False),
        ("AmplitudeSpectrum", "frequency", False),
        ("PowerSpectrum", "power", False),
        ("Spectrogram", "segments", False),
    ],
)
def test_notebooks_get_html_that_parses_and_escapes(
    shown: dict[str, Any], name: str, words: str, with_title: bool
) -> None:
    check_html(shown[name], words, with_title=with_title)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "words", "with_title"),
    [
        ("Solution", "estimated", True),
        ("SensitivityReport", "verified", False),
        ("Trade", "stepper-rodas4", True),
        ("EnsembleResult", "median", True),
        ("LifeReport", "peak pressure", True),
        ("Settled", "steady turns", False),
    ],
)
def test_reports_give_html_that_parses_and_escapes(
    reports: dict[str, Any], name: str, words: str, with_title: bool
) -> None:
    check_html(reports[name], words, with_title=with_title)


@pytest.mark.long
def test_reports_are_pandas_tables(reports: dict[str, Any]) -> None:
    life, trade = reports["LifeReport"], reports["Trade"]
    many, derivatives = reports["EnsembleResult"], reports["SensitivityReport"]
    lives = life.to_pandas()
    assert lives.loc[("", ""), "life"] == life.bearings[0].life
    ways = trade.to_pandas()
    assert ways["time"].min() == min(one.time for one in trade.measured)
    assert ways[trade.quantities[0]].tolist() == [one.promised[trade.quantities[0]] for one in trade.measured]
    assert many.to_pandas().loc[1].tolist() == [8e-6, many["peak_ball_force"][1]]
    assert many.to_pandas().attrs["units"] == {CLEARANCE: "m", "peak_ball_force": "N"}
    (row,) = derivatives.to_pandas().itertuples()
    assert row.Index == ("peak_ball_force", CLEARANCE)
    assert (row.derivative, row.verdict) == (derivatives.pairs[0].derivative, "verified")


def test_every_word_of_a_view_is_escaped() -> None:
    words = f"{ATTACK}\"'[bold]"
    marked = Marked(words, "good", words)
    table = ReportTable(title=words, caption=words, heads=(words,), rows=[(marked,)], right=(words,))
    page = ET.fromstring(
        html.block(
            html.title(words, words),
            html.folded(words, html.table([words], [[words]], right=[words])),
            to_html(Report(parts=(table, words))),
            html.framed_page(words),
        )
    )
    text = "".join(page.itertext()) + (next(page.iter("iframe")).get("srcdoc") or "")
    assert text.count(words) == 12
    assert [item.text for item in page.iter("span") if item.get("class") == "good"] == [words]


def test_equations_are_mathml_with_every_formula_of_the_page(shown: dict[str, Any]) -> None:
    """No `$` is left for a notebook to typeset, which some do with a script of the network and some not at all."""
    page = ET.fromstring(shown["System"]._repr_html_())
    text = "".join(page.itertext())
    assert "$" not in text
    assert "\\" not in text
    maths = [item for item in page.iter() if item.tag.endswith("}math")]
    markdown = equations(shown["System"])
    displayed = markdown.count("$$") // 2
    assert len(maths) == displayed + (markdown.count("$") - 4 * displayed) // 2
    shown_symbols = {"".join(item.itertext()) for item in maths}
    # D_{pw} is set as a D with the index pw
    symbols = {re.sub("[_{}]", "", p.latex) for p in shown["System"].parameters if SYMBOL.fullmatch(p.latex)}
    assert {"Dw", "Dpw", "Pd", "kb", "mei"} <= symbols
    assert symbols <= shown_symbols
    head = next(item for item in page.iter("details") if "open" in item.attrib)
    assert head[0].text == "Equations of motion, Eq. (2)"
    assert len([item for item in head.iter() if item.tag.endswith("}math")]) == 2  # along x and y


@pytest.mark.long
def test_the_blocks_of_the_page_on_notebooks_run_in_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a kernel of Jupyter, with its backend of matplotlib, which shows a picture for each cell that draws."""
    nbclient = pytest.importorskip("nbclient", reason="not installed: pip install ballpass[notebook]")
    nbformat = pytest.importorskip("nbformat", reason="not installed: pip install ballpass[notebook]")
    page = (ROOT / "docs/howto/notebooks.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    cells = ["import numpy as np", *blocks, "solution.plot.animate()", "derive(scene)"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    monkeypatch.delenv("MPLBACKEND", raising=False)
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": str(tmp_path)}}, timeout=300).execute()
    given = [[output.data for output in cell.outputs if "data" in output] for cell in notebook.cells]
    pictures = [sum("image/png" in data for data in cell) for cell in given]
    assert pictures[1:5] == [0, 4, 1, 1]  # the model, new axes, axes given, a figure
    assert "41 parameters" in given[1][-1]["text/html"]
    assert "srcdoc" in given[-2][-1]["text/html"]
    assert "<math" in given[-1][-1]["text/html"]


@pytest.mark.long
def test_every_public_class_was_looked_at(shown: dict[str, Any], reports: dict[str, Any]) -> None:
    classes = {
        name
        for package in (ballpass.derive, ballpass.runtime)
        for name in package.__all__
        if isinstance(found := getattr(package, name), type) and not issubclass(found, Exception | Enum)
    }
    assert classes - {*shown, *reports} == set()
