"""``solution.plot`` and ``to_pandas``: axes in and out, what is drawn against samples and NumPy, reproducible bytes."""

from __future__ import annotations

import io
import pickle
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from quick_cases import long_but

from ballpass.runtime import Model, Solution
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.plot.motion import shown_range
from ballpass.runtime.vibration.spectrum import amplitude_spectrum

matplotlib.use("agg")


@pytest.fixture(scope="module")
def solution(rotor: Model) -> Solution:
    return rotor.simulate(cycles=6, transient=2)


DRAWN: dict[str, Callable[[Solution, Axes | None], Axes]] = {
    "orbit": lambda solution, ax: solution.plot.orbit(ax=ax),
    "spectrum": lambda solution, ax: solution.plot.spectrum("inner.y", ax=ax),
    "ball_loads": lambda solution, ax: solution.plot.ball_loads(ax=ax),
    "outputs": lambda solution, ax: solution.plot("inner.x", "inner.y", ax=ax),
}


@pytest.mark.parametrize("name", DRAWN)
def test_axes_given_come_back_with_units_and_the_users_settings_stay(solution: Solution, name: str) -> None:
    axes, before = Figure().add_subplot(), dict(matplotlib.rcParams)
    assert DRAWN[name](solution, axes) is axes
    assert axes.lines
    assert "[" in axes.get_xlabel()
    assert "µm]" in axes.get_ylabel() or axes.get_ylabel().endswith(" N")
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("name", long_but(DRAWN, "orbit"))
def test_new_axes_are_pyplots_and_the_same_bytes_each_time(solution: Solution, name: str) -> None:
    pictures = []
    for _ in range(2):
        axes = DRAWN[name](solution, None)
        assert pyplot.gca() is axes
        stream = io.BytesIO()
        axes.figure.savefig(stream, format="png", metadata={"Software": None})
        pictures.append(stream.getvalue())
        pyplot.close()
    assert pictures[0] == pictures[1]


def test_what_is_drawn_is_the_steady_part(solution: Solution) -> None:
    steady = solution.steady()
    x, y = solution.plot.outputs("inner.x", "inner.y", ax=Figure().add_subplot()).lines
    np.testing.assert_array_equal(x.get_xdata(), steady.t)
    np.testing.assert_allclose(y.get_ydata(), 1e6 * steady["inner.y"], rtol=1e-15)
    paths = {line.get_label(): line for line in solution.plot.orbit(ax=Figure().add_subplot()).lines}
    end = 1e6 * np.array([steady["inner.x"][-1], steady["inner.y"][-1]])
    np.testing.assert_allclose(np.array(paths["last turn"].get_data())[:, -1], end, rtol=1e-12)
    strips = solution.plot.ball_loads(ax=Figure().add_subplot())
    force = steady["ball.force"][steady.t >= steady.t[-1] - 2.0 * (steady.cycle_length or 0.0) * (1.0 + 1e-9)]
    for ball, line in enumerate(strips.lines):
        height = np.asarray(line.get_ydata()) - (force.shape[1] - ball)
        np.testing.assert_allclose(height, 0.9 * force[:, ball] / np.max(force), atol=1e-12)
    assert f"{np.max(force):.4g} N" in strips.get_ylabel()


def test_units_are_printed_as_in_the_figures(solution: Solution) -> None:
    infos = tuple(replace(info, unit="kg*m/s^2") for info in solution.manifest.outputs)
    other = replace(solution, manifest=replace(solution.manifest, outputs=infos))
    assert other.plot.outputs("ball.force", ax=Figure().add_subplot()).get_ylabel() == "ball.force [kg·m/s²]"


def test_the_spectrum_is_numpys(solution: Solution) -> None:
    (line,) = solution.plot.spectrum("inner.y", window="boxcar", ax=Figure().add_subplot()).lines
    y = 1e6 * solution.steady()["inner.y"][:-1]  # four whole turns; the last sample begins the next one
    amplitude = 2.0 * np.abs(np.fft.rfft(y - np.mean(y))) / y.size
    found = np.asarray(line.get_ydata())
    np.testing.assert_allclose(found[:200], amplitude[1:201], rtol=1e-9, atol=1e-12)


def test_the_range_of_a_spectrum_is_found_where_one_axis_hardly_moves() -> None:
    t = np.linspace(0.0, 1.0, 1001)
    large, small = (amplitude_spectrum(t, size * np.sin(2.0 * np.pi * 40.0 * t)) for size in (1.0, 1e-4))
    assert shown_range([large, small], shaft=0.0) == shown_range([large], shaft=0.0)


def test_what_cannot_be_drawn_is_told(rotor: Model, solution: Solution) -> None:
    bare = rotor.simulate(cycles=3, transient=1, outputs=[])
    for draw, words in (
        (lambda: solution.plot("inner.x", "ball.force"), "are m, N"),
        (lambda: solution.plot("inner.z"), "inner.z"),
        (lambda: solution.plot.spectrum("ball.force"), "one value at a time"),
        (lambda: solution.plot.orbit(bearing="left"), "left"),
        (lambda: solution.plot.orbit(relative=True), r"no inner.x, inner.y, outer.x"),
        (bare.plot.ball_loads, "simulate"),
    ):
        with pytest.raises(RequestError, match=words):
            draw()


def test_an_animation_in_a_notebook_is_the_page_that_it_writes(solution: Solution, tmp_path: Path) -> None:
    animation = solution.plot.animate(turns=2)
    (frame,) = ET.fromstring(f"<p>{animation._repr_html_()}</p>")
    assert frame.get("sandbox") == "allow-scripts"  # the notebook's own page is out of its reach
    written = animation.save(tmp_path / "two.html").read_text(encoding="utf-8")
    assert " ".join(written.split()) == " ".join((frame.get("srcdoc") or "").split())  # XML reads line ends as blanks
    assert len(repr(animation)) < 100
    with pytest.raises(RequestError, match="without its model"):
        replace(solution, model=None).plot.animate()


def test_importing_the_runtime_brings_no_matplotlib() -> None:
    code = "import ballpass.runtime.model, sys; sys.exit('matplotlib' in sys.modules or 'pandas' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_solution_travels_without_its_model(solution: Solution) -> None:
    assert solution.steady().model is solution.model is not None
    other = pickle.loads(pickle.dumps(solution))
    assert other.model is None
    np.testing.assert_array_equal(other["inner.x"], solution["inner.x"])
    assert other.plot.orbit(ax=Figure().add_subplot()).lines


@pytest.mark.parametrize("name", DRAWN)
def test_a_missing_matplotlib_is_named_with_the_command(
    solution: Solution, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "ballpass.runtime.plot.motion", raising=False)
    for module in [module for module in sys.modules if module.partition(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RequestError, match="needs matplotlib, which is not installed: pip install matplotlib"):
        DRAWN[name](solution, None)


def test_pandas_gets_a_column_for_each_ball_and_the_units(solution: Solution) -> None:
    table = solution.to_pandas()
    assert table.index.name == "time"
    np.testing.assert_array_equal(table.index, solution.t)
    np.testing.assert_array_equal(table["inner.x"], solution["inner.x"])
    np.testing.assert_array_equal(table["ball.force[3]"], solution["ball.force"][:, 2])
    assert set(table.attrs["units"]) == set(table.columns)
    assert table.attrs["units"]["ball.force[3]"] == "N"
    empty = replace(solution, t=solution.t[:0], x=solution.x[:0], outputs={})
    assert len(empty.to_pandas()) == 0


def test_a_missing_pandas_is_named_with_its_extra(solution: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(RequestError, match=r"pip install 'ballpass\[labelled\]'"):
        solution.to_pandas()
