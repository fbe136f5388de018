"""What the figures show, against the run they are drawn of; nothing cut, labels with units, same bytes each time."""

from __future__ import annotations

import math
import re
import struct
import subprocess
import sys
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Annulus, Circle
from matplotlib.text import Annotation, Text

from ballpass.runtime import Model, Solution
from ballpass.runtime.app.figure_run import run_for_figures
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.plot import CAPTIONS, NAMES, bearing, on_paper
from ballpass.runtime.plot.animation import choose_frames, to_plain
from ballpass.runtime.plot.bearing import draw_bearing
from ballpass.runtime.plot.gallery import FIGURES, draw, draw_all
from ballpass.runtime.plot.mechanism import _hatched_wall, draw_mechanism
from ballpass.runtime.plot.motion import phase_portrait, spectra
from ballpass.runtime.plot.record import gather
from ballpass.runtime.plot.shapes import guide_direction, links, used_points
from ballpass.runtime.plot.style import (
    INK,
    PALE,
    SAND,
    SIGNAL,
    TORQUE,
    caption,
    caption_of,
    decade_words,
    frame,
    log_ticks,
    save,
    write_figures,
)
from ballpass.runtime.questions.question import declared

Run = tuple[Model, Solution]

#: Those of a single bearing without a place along a shaft.
OF_A_BEARING = tuple(name for name in NAMES if name != "shaft_loads")

#: Points of a coupler, one of which no joint has.
COUPLER = 'points = { B = "origin", C = "100 mm", P = ["50 mm", "60 mm"] }'


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Run:
    model = make_model("punching_press")
    return model, model.simulate(cycles=4)


@pytest.fixture(scope="module")
def shaft(make_model: Callable[..., Model]) -> Run:
    model = make_model("varying_compliance")
    return model, model.simulate(cycles=4, transient=2)


@pytest.fixture(scope="module")
def linkage_alone(make_model: Callable[..., Model], scene_text: Callable[..., str]) -> Run:
    text = scene_text("punching_press")
    bearing = text[text.index("[bearing]\n") : text.index("[run]\n")]
    outputs = re.search(r"outputs = \[.*?\]", text, re.DOTALL)
    assert outputs is not None
    model = make_model(
        "punching_press", (bearing, ""), (outputs[0], 'outputs = ["reaction.*.x", "reaction.*.y", "drive_torque"]')
    )
    return model, model.simulate(cycles=2, transient=1)


def texts(figure: Figure) -> str:
    """Words of a figure and its caption."""
    written = [item.get_text() for item in figure.findobj(Text)]
    return " ".join([*written, caption_of(figure)]).replace("\n", " ").replace("\u00a0", " ")


@pytest.mark.long
def test_figures_are_the_same_bytes_whatever_the_user_s_settings(press: Run, tmp_path: Path) -> None:
    first = draw_all(*press, tmp_path / "a")
    assert [path.name for path in first] == [*(f"{name}.png" for name in OF_A_BEARING), CAPTIONS]
    with matplotlib.rc_context({"font.size": 30.0, "axes.grid": False, "lines.linewidth": 9.0, "savefig.dpi": 37.0}):
        before = dict(matplotlib.rcParams)
        second = draw_all(*press, tmp_path / "b")
        assert dict(matplotlib.rcParams) == before
    for one, other in zip(first, second, strict=True):
        data = one.read_bytes()
        assert data == other.read_bytes()
        if one.suffix == ".png":
            assert struct.unpack(">I", data[16:20]) == (1200,)  # width in the PNG header
            assert b"Software" not in data
            assert b"tIME" not in data


@pytest.mark.parametrize(("kind", "head"), [("svg", b"<?xml"), pytest.param("pdf", b"%PDF", marks=pytest.mark.long)])
def test_vector_figures_are_the_same_bytes_each_time(press: Run, tmp_path: Path, kind: str, head: bytes) -> None:
    files = [save(draw("load_curve", *press), tmp_path / f"{name}.{kind}").read_bytes() for name in "ab"]
    assert files[0] == files[1]
    assert files[0].startswith(head)
    assert b"Date>" not in files[0]
    assert b"CreationDate" not in files[0]


@pytest.mark.parametrize("kind", ["png", "svg", pytest.param("pdf", marks=pytest.mark.long)])
def test_figures_for_a_paper_have_its_width_and_letters_of_seven_points(press: Run, tmp_path: Path, kind: str) -> None:
    """Read from the files; letters are letters, and no title, label or legend leaves the picture."""
    with on_paper(0.09, titles=False):
        figure = draw("orbit", *press)
        (path, page) = write_figures([("orbit", figure)], tmp_path, (kind,), CAPTIONS)
    assert "**Orbit of the inner ring's centre.**" in page.read_text(encoding="utf-8")
    data, points = path.read_bytes(), 90.0 / 25.4 * 72.0
    if kind == "png":
        assert struct.unpack(">I", data[16:20])[0] == pytest.approx(90.0 / 25.4 * 300, abs=1.0)
        assert struct.unpack(">I", data[data.index(b"pHYs") + 4 :][:4])[0] == pytest.approx(300 / 0.0254, abs=1.0)
    elif kind == "svg":
        assert float(re.search(rb'width="([\d.]+)pt"', data)[1]) == pytest.approx(points, rel=1e-5)
        box = float(re.search(rb'viewBox="0 0 ([\d.]+)', data)[1])
        assert b">in the</tspan>" in data or b">in the</text>" in data
        assert 9.5 * points / box == pytest.approx(7.0)
    else:
        assert float(re.search(rb"/MediaBox \[ 0 0 ([\d.]+)", data)[1]) == pytest.approx(points, rel=1e-6)
        assert b"/Type3" not in data
        # the right orbit is whole: curves were cut at the width of the page, to which the drawing is scaled
        streams = [zlib.decompress(part) for part in re.findall(rb"stream\n(x.*?)\nendstream", data, re.DOTALL)]
        ends = [float(found) for one in streams for found in re.findall(rb"([\d.]+) [\d.]+ l\n", one)]
        assert sum(end > points for end in ends) > 100
        assert max(ends) < 9.5 / 7.0 * points
    assert "Orbit" not in texts(figure).replace(caption_of(figure), "")
    figure.draw_without_rendering()
    labels = [label for axes in figure.axes for label in (axes.xaxis.label, axes.yaxis.label, *axes.texts)]
    for part in (*labels, *figure.legends):
        box = part.get_window_extent()
        assert 0.0 <= box.x0 <= box.x1 <= figure.bbox.width
        assert 0.0 <= box.y0 <= box.y1 <= figure.bbox.height
    for axes in figure.axes:  # and the note stands off the path
        (box,) = (text.get_window_extent() for text in axes.texts)
        places = np.vstack([axes.transData.transform(line.get_xydata()) for line in axes.lines])
        assert np.max(places[places[:, 0] > box.x0, 1]) < box.y0


@pytest.mark.parametrize("name", ["spectrum", "spectrogram", "map"])
def test_axes_in_a_narrow_column_keep_their_room_and_limits(
    make_model: Callable[..., Model], tmp_path: Path, name: str
) -> None:
    """Legends stand below, and ticks beyond the limits do not stretch what a map is drawn over."""
    rotor, plane = (
        make_model("varying_compliance"),
        ["bearing.clearance=2 um:10 um:3", "shaft.speed=1000 rpm:7000 rpm:4"],
    )
    answer: object
    if name == "map":
        question, answer = Model.bifurcation, rotor.bifurcation(plane, readings=20, settling=5)
    else:
        question, answer = Model.spectrum, rotor.spectrum("inner.y", cycles=30, spectrogram=name == "spectrogram")
    figures = declared(question).figures
    assert figures is not None
    with on_paper(0.085, titles=False), warnings.catch_warnings():
        warnings.simplefilter("error")
        (_, figure), *_ = figures(rotor, answer, {})
        save(figure, tmp_path / "figure.png")
    width, height = figure.bbox.size
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    for axes in panels:
        assert axes.bbox.width > (0.4 if name == "spectrogram" else 0.5) * width
        assert axes.bbox.height > 0.3 * height
        if name == "map":
            assert axes.get_xlim() == pytest.approx((0.0, 12.0))
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert box.x0 >= 0.0
        assert box.x1 <= width
        assert not any(box.overlaps(axes.get_tightbbox()) for axes in panels)


def test_captions_stand_beside_the_pictures(press: Run, tmp_path: Path) -> None:
    figure = draw("orbit", *press)
    assert "method" in caption_of(figure)
    assert caption_of(figure) not in " ".join(item.get_text() for item in figure.findobj(Text))
    written = write_figures([("orbit", figure)], tmp_path, ("svg", "png"), CAPTIONS)
    assert [path.name for path in written] == ["orbit.svg", "orbit.png", CAPTIONS]
    assert written[-1].read_text(encoding="utf-8").splitlines() == [
        "![Orbit of the inner ring's centre](orbit.svg)",
        "",
        f"**Orbit of the inner ring's centre.** {caption_of(figure)}",
    ]


@pytest.mark.parametrize("put", [caption, frame])
def test_dollars_in_a_scene_s_title_are_no_formula(put: Callable[[Figure, str, str], None], tmp_path: Path) -> None:
    figure = Figure()
    put(figure, "Press of $x_$", "")
    assert save(figure, tmp_path / "a.png").is_file()


@pytest.mark.long
def test_a_scene_without_mechanism_gets_the_bearing_s_figures(shaft: Run, tmp_path: Path) -> None:
    assert [path.stem for path in draw_all(*shaft, tmp_path)][:-1] == [*OF_A_BEARING[1:]]


@pytest.mark.long
def test_every_bearing_gets_its_figures(
    make_model: Callable[..., Model], scene_text: Callable[..., str], tmp_path: Path
) -> None:
    text = scene_text("varying_compliance")
    bearing = text[text.index("[bearing]\n") : text.index("[run]")]
    both = "".join(re.sub(r"^\[bearing\b", f"[bearings.{name}", bearing, flags=re.MULTILINE) for name in ("a", "b"))
    outputs = re.search(r"outputs = \[.*?\]", text, re.DOTALL)
    assert outputs is not None
    model = make_model("varying_compliance", (bearing, both), (outputs[0], 'outputs = ["*.inner.*", "*.ball.force"]'))
    run = model, model.simulate(cycles=2, transient=1, parameters={"bearings.b.clearance": 5e-6})
    assert [path.stem for path in draw_all(*run, tmp_path)][:-1] == [
        f"{k}_{name}" for name in "ab" for k in OF_A_BEARING[1:]
    ]
    second = gather(*run, model.manifest.bearings[1])
    np.testing.assert_array_equal(second.values("inner.x"), run[1].steady()["b.inner.x"])
    for kind in (kind for kind in FIGURES[1:] if not kind.whole):
        figure = kind.draw(second)
        assert "diametral clearance 5 µm" in texts(figure)
        assert figure.get_suptitle().splitlines()[1] == "bearing b"


@pytest.mark.long
def test_a_scene_without_bearing_gets_reactions_and_mechanism(linkage_alone: Run, tmp_path: Path) -> None:
    assert [path.stem for path in draw_all(*linkage_alone, tmp_path)][:-1] == ["load_curve", "peak_moment"]
    figure = draw("load_curve", *linkage_alone)
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == [
        "x at A: crank on frame",
        "y at A: crank on frame",
    ]
    assert len(figure.axes) == 2 * 4 + 1
    # the guide is vertical and free of friction: rounding must not be blown up to a force
    noise = next(axes for axes in figure.axes if axes.get_title(loc="left").startswith("y at D"))
    assert noise.get_ylim()[1] > 50.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "scene",
    ["press", pytest.param("shaft", marks=pytest.mark.long), pytest.param("linkage_alone", marks=pytest.mark.long)],
)
def test_nothing_is_cut_and_axes_have_units(name: str, scene: str, request: pytest.FixtureRequest) -> None:
    run: Run = request.getfixturevalue(scene)
    record = gather(*run)
    kind = next(kind for kind in FIGURES if kind.name == name)
    if not kind.possible(record):
        with pytest.raises(RequestError, match="cannot be drawn"):
            draw(name, *run)
        return
    figure = kind.draw(record)
    FigureCanvasAgg(figure).draw()
    drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert drawn.x0 >= -0.01
    assert drawn.y0 >= -0.01
    assert drawn.x1 <= width + 0.01
    assert drawn.y1 <= height + 0.01
    labels = [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
    labels += [figure.get_supylabel()] if figure.get_supylabel() else []
    assert all(re.search(r"\[.+\]$", label) for label in labels), labels
    assert labels or name == "peak_moment"


@pytest.mark.parametrize("name", OF_A_BEARING)
def test_caption_says_how_the_run_was_made(press: Run, name: str) -> None:
    text = texts(draw(name, *press))
    for words in ("2 transient cycles dropped", f"method {press[1].statistics.method}", "clearance 10 µm", "one-sided"):
        assert words in text


@pytest.mark.long
def test_a_share_of_the_reaction_is_not_drawn_as_the_load_where_the_scene_gives_one_beside_it(
    make_virtual: Callable[..., Model],
) -> None:
    """5 kN more than the arrow showed; where the load is an output it is drawn."""
    given = '[load]\ntype = "constant"\nforce = ["5 kN", "0 N"]\n\n[run]\n'
    kept = '"outer.*", "ball.*", "reaction.A.*"'
    for more, drawn in (("", False), (', "load.*"', True)):
        model = make_virtual("punching_press", ("[run]\n", given), (kept, kept + more))
        load = gather(model, model.simulate(cycles=0.01, transient=0)).ring_load()
        assert (load is not None) is drawn
        if load is not None:
            assert load[0, 0] > 4.5e3


def test_the_load_of_an_outer_ring_that_moves_is_what_the_balls_push_back(make_virtual: Callable[..., Model]) -> None:
    """Two-way the joint's reaction is that of the housing, which moves the outer ring: up to 8 % of the load apart."""
    outputs = ('"ball.*", "reaction.*"', '"ball.*", "ring_force.*", "reaction.*"')
    model = make_virtual("punching_press_two_way", outputs)
    record = gather(model, model.simulate(cycles=0.8, transient=0.7))
    load, push, reaction = (
        np.column_stack([record.values(f"{name}.{axis}") for axis in "xy"]) if name else record.ring_load()
        for name in ("", "ring_force", "reaction.A")
    )
    assert load == pytest.approx(push, rel=1e-9, abs=1e-6)
    assert np.max(np.hypot(*(np.abs(push) - np.abs(reaction)).T)) > 100.0


@pytest.mark.long
def test_one_way_the_ring_is_loaded_by_the_joint_at_any_speed(make_virtual: Callable[..., Model]) -> None:
    """By a table of speeds too, where the rings' mean speed is written as that of a two-way bearing."""
    table = 'start_angle = "0 deg"\n[mechanism.driver.table]\ntime = ["0 s", "1 s"]\nspeed = ["500 rpm", "600 rpm"]\n#'
    model = make_virtual("punching_press", ('speed = "500 rpm"', ""), ('start_angle = "0 deg"', table))
    record = gather(model, model.simulate(duration=0.01, transient=0))
    load, reaction = record.ring_load(), record.values("reaction.A.x")
    assert load is not None
    assert load[:, 0] == pytest.approx(0.5 * reaction, rel=1e-9)
    assert "is loaded one-way" in " ".join(model.explain().limits)


def test_an_axially_preloaded_bearing_is_drawn_with_the_gap_that_is_left(make_virtual: Callable[..., Model]) -> None:
    """Its clearance was drawn, of which an axial displacement leaves a preload."""
    model = make_virtual("rotor", ("[bearing.damping]", 'axial_displacement = "0.08 mm"\n\n[bearing.damping]'))
    record = gather(model, model.simulate(cycles=0.1, transient=0))
    assert record.radial_gap == record.solution.constants["bearing.radial_gap"] < -1e-6
    figure = Figure()
    draw_bearing(figure.subplots(), record, 0)
    outer = next(patch for patch in figure.axes[0].patches if isinstance(patch, Annulus))
    touched = 0.5 * (record.parameter("bearing.pitch_diameter") + record.parameter("bearing.ball_diameter"))
    assert outer.get_radii()[0] - outer.get_width() < touched


def test_load_curve_shows_reaction_and_half_of_it_over_one_turn(press: Run) -> None:
    figure = draw("load_curve", *press)
    solution = press[1].steady()
    for axes, axis in zip(figure.axes, "xy", strict=False):
        reaction, load = (line.get_xydata() for line in axes.get_lines()[:2])
        assert (np.min(reaction[:, 0]), np.max(reaction[:, 0])) == pytest.approx((0.0, 360.0), abs=0.2)
        assert np.max(reaction[:, 1]) == solution[f"reaction.A.{axis}"].max()
        assert load[:, 1] == pytest.approx(0.5 * reaction[:, 1])
        # the punch acts between 237 and 267 degrees: everywhere else the reaction is that of inertia and weight
        outside = (reaction[:, 0] < 236.9) | (reaction[:, 0] > 267.1)
        if axis == "y":
            assert (
                np.max(np.abs(reaction[outside, 1]))
                < 600.0
                < 8000.0
                < np.min(reaction[(reaction[:, 0] > 237.2) & (reaction[:, 0] < 266.8), 1])
            )


def test_spectrum_lines_equal_fourier_integrals_of_the_run(press: Run) -> None:
    figure = draw("spectra", *press)
    solution = press[1].steady()
    time = solution.t[:-1]
    for axes, axis in zip(figure.axes, "xy", strict=False):
        dots = next(line for line in axes.get_lines() if line.get_marker() == "o").get_xydata()
        signal = 1e6 * solution[f"inner.{axis}"][:-1]
        for frequency, amplitude in dots[:8]:
            integral = 2.0 * np.mean(signal * np.exp(-2j * np.pi * frequency * time))
            assert amplitude == pytest.approx(abs(integral), rel=1e-6)
    text = texts(figure)
    assert "8.333 Hz" in text
    assert "25.44 Hz" in text
    # 3.0522 - 3 ball passes a turn: two turns cannot tell them apart, and the caption says so
    assert "within one line; separating them takes 20 turns" in text


def test_turns_that_are_left_out_do_not_count_for_figures(make_model: Callable[..., Model]) -> None:
    """A spectrum of 40 turns after 80 that settle is one of 40 turns."""
    rotor = make_model("rotor")
    assert run_for_figures(rotor, rotor.simulate(120, transient=80)) is not None
    assert run_for_figures(rotor, rotor.simulate(121, transient=20)) is None


def test_a_run_of_many_turns_separates_ball_pass_from_the_third_harmonic(press: Run) -> None:
    longer = run_for_figures(*press)
    assert longer is not None
    record = gather(*press, longer=longer)
    closer = spectra(record).axes[2].get_lines()[0].get_xydata()  # along x
    harmonic, ball_pass = 3.0 / 0.12, 8.0 * (1.0 - 7.9375 / 33.5) / 2.0 / 0.12
    tops = [float(np.max(closer[np.abs(closer[:, 0] - frequency) < 0.1, 1])) for frequency in (harmonic, ball_pass)]
    between = closer[(closer[:, 0] > harmonic) & (closer[:, 0] < ball_pass), 1]
    assert np.min(between) < 0.1 * min(tops)
    # once a turn behind all that was dropped, and the end of the last one
    points = phase_portrait(record).axes[1].get_lines()[0].get_xydata()
    turn = round(0.12 / (longer.t[1] - longer.t[0]))
    assert len(points) == 101
    expected = np.column_stack((1e6 * longer["inner.x"], 1e3 * longer["inner.vx"]))[20 * turn :: turn]
    assert points == pytest.approx(expected, abs=1e-6)


def test_second_orbit_is_relative_to_the_outer_ring(press: Run) -> None:
    panel = draw("orbit", *press).axes[1]
    last = next(line for line in panel.get_lines() if line.get_label() == "last turn").get_xydata()
    solution = press[1].steady()
    moved = [solution[f"inner.{axis}"] - solution[f"outer.{axis}"] for axis in "xy"]
    assert last[::8] == pytest.approx(1e6 * np.column_stack(moved)[-2001:])


def test_phase_portrait_marks_the_state_at_each_turn(press: Run) -> None:
    figure = draw("phase_portrait", *press)
    points = next(line for line in figure.axes[0].get_lines() if line.get_marker() == "o").get_xydata()
    solution = press[1].steady()
    expected = np.column_stack((1e6 * solution["inner.x"], 1e3 * solution["inner.vx"]))[::2000]
    assert points == pytest.approx(expected, abs=1e-6)


def test_displacements_are_those_of_both_rings_over_two_turns(press: Run) -> None:
    figure = draw("displacements", *press)
    solution = press[1].steady()
    angle = np.degrees(solution.parameters["mechanism.driver.speed"] * solution.t)
    for axes, axis in zip(figure.axes, "xy", strict=True):
        for ring, line in zip(("inner", "outer"), axes.get_lines(), strict=True):
            shown = line.get_xydata()
            assert np.ptp(shown[:, 0]) == pytest.approx(720.0)
            assert np.mod(shown[:, 0] - angle[-len(shown) :] + 1.0, 360.0) == pytest.approx(1.0, abs=1e-6)
            assert shown[:, 1].tolist() == (1e6 * solution[f"{ring}.{axis}"][-len(shown) :]).tolist()


def test_every_ball_has_its_strip(press: Run) -> None:
    figure = draw("ball_loads", *press)
    solution = press[1].steady()
    assert len(figure.axes) == 16
    peak = np.max(solution["ball.force"])
    for number, (axes, closer) in enumerate(zip(figure.axes[::2], figure.axes[1::2], strict=True)):
        # beside it a closer look, in which the highest force stands
        low, high = closer.get_xlim()
        curve = closer.get_lines()[0].get_xydata()
        inside = solution["ball.force"][(curve[:, 0] >= low) & (curve[:, 0] <= high)]
        assert high - low == pytest.approx(45.0, rel=0.1)
        assert np.max(inside) == peak
        curve = axes.get_lines()[0].get_xydata()
        assert curve[:, 1] == pytest.approx(solution["ball.force"][:, number])
        assert (curve[0, 0], curve[-1, 0]) == pytest.approx((0.0, 720.0), abs=1e-6)


def test_orbit_passes_through_the_samples(press: Run) -> None:
    figure = draw("orbit", *press)
    last = next(line for line in figure.axes[0].get_lines() if line.get_label() == "last turn").get_xydata()
    solution = press[1].steady()
    assert last[::8] == pytest.approx(1e6 * np.column_stack((solution["inner.x"], solution["inner.y"]))[-2001:])


def test_drawn_mechanism_keeps_its_lengths(press: Run) -> None:
    record = gather(*press)
    for time in (0.0, 0.031, 0.3194):
        points = record.points(time)
        angle = 2.0 * np.pi * time / 0.12
        assert points["crank", "B"] == pytest.approx(6e-3 * np.array([np.cos(angle), np.sin(angle)]))
        assert np.hypot(*(points["rod", "C"] - points["rod", "B"])) == pytest.approx(100e-3)
        assert points["slider", "C"] == pytest.approx(points["rod", "C"])
        assert points["slider", "C"][0] == pytest.approx(0.0, abs=1e-15)


def test_drawn_bearing_shows_the_moment_of_the_highest_ball_force(press: Run) -> None:
    figure = draw("peak_moment", *press)
    solution = press[1].steady()
    force = solution["ball.force"]
    sample, loaded = np.unravel_index(int(np.argmax(force)), force.shape)
    text = texts(figure)
    assert f"{force[sample, loaded]:.0f} N" in text
    assert f"crank angle {solution.t[sample] / 0.12 % 1.0 * 360.0:.1f}°" in text
    # the balls, darkest first: the most loaded one; all lie between the raceways of a 6204
    balls = [patch for patch in figure.axes[1].patches if isinstance(patch, Circle) and patch.radius == 7.9375e-3 / 2]
    assert len(balls) == 8
    dark = [luminance(patch.get_facecolor()[:3]) for patch in balls]
    assert int(np.argmin(dark)) == loaded
    angles = 2.0 * np.pi * (np.arange(8) / 8.0 + 0.38152985 * solution.t[sample] / 0.12)
    for patch, angle in zip(balls, angles, strict=True):
        assert np.hypot(*patch.center) == pytest.approx(33.5e-3 / 2, rel=0.06)
        assert patch.center / np.hypot(*patch.center) == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-6)


def arrows(axes: Axes) -> list[Annotation]:
    return [item for item in axes.findobj(Annotation) if item.arrow_patch is not None]


def test_applied_force_is_drawn_where_it_acts_and_while_it_acts(press: Run) -> None:
    """The punch pushes the slider up, from 237 to 267 degrees of the crank: a second arrow there, one elsewhere."""
    record = gather(*press)
    angles = np.degrees(record.crank_angle()) % 360.0
    for angle, names in ((236.9, []), (237.1, ["punch"]), (266.9, ["punch"]), (267.1, []), (90.0, [])):
        sample = int(np.argmin(np.abs(angles - angle)))
        axes = Figure().add_subplot()
        draw_mechanism(axes, record, sample)
        written = [text.get_text() for text in axes.texts]
        assert [text.split("\n")[0] for text in written if text.startswith("punch")] == names
        assert len(arrows(axes)) == 1 + len(names)
        if names:
            arrow = arrows(axes)[-1]
            slider = record.points(float(record.t[sample]))["slider", "C"]
            assert arrow.xy == pytest.approx(slider)
            assert arrow.xyann[0] == pytest.approx(slider[0])
            assert arrow.xyann[1] < slider[1] - 0.01
            assert "punch\n8965 N" in written


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        pytest.param(
            'force = { magnitude = "50 N", direction = "120 deg" }',
            (-25.0, 25.0 * np.sqrt(3.0)),
            marks=pytest.mark.long,
        ),
        ('force = ["3 N", "-4 N"]', (3.0, -4.0)),
    ],
)
def test_applied_force_has_the_components_of_the_scene(
    make_virtual: Callable[..., Model], change: str, expected: tuple[float, float]
) -> None:
    always = ('window = { start = "237 deg", end = "267 deg" }', "")
    model = make_virtual("punching_press", ('force = ["0 N", "8964.8 N"]', change), always)
    ((name, place, force),) = gather(model, model.simulate(cycles=0.01, transient=0)).applied_forces(1e-4)
    assert (name, place) == ("punch", ("slider", "C"))
    assert force == pytest.approx(expected)


@pytest.mark.long
def test_a_force_by_a_table_is_drawn_as_large_as_the_table_says(make_model: Callable[..., Model]) -> None:
    """On a lug of the slider, and as the table falls from 1000 N at 0 to -1000 N at 180 degrees, to the other side."""
    table = 'table = { angle = ["0 deg", "180 deg"], force = ["1000 N", "-1000 N"] }\ndirection = "30 deg"'
    model = make_model(
        "punching_press",
        ('force = ["0 N", "8964.8 N"]', table),
        ('window = { start = "237 deg", end = "267 deg" }', ""),
        ('point = "C"', 'point = "lug"'),
        ('points = { C = "origin" }', 'points = { C = "origin", lug = ["40 mm", "0 mm"] }'),
    )
    record = gather(model, model.simulate(cycles=2, transient=1))
    angles = np.degrees(record.crank_angle()) % 360.0
    for angle, amount in ((45.0, 500.0), (135.0, -500.0), (225.0, -500.0), (300.0, 1000.0 / 3.0)):
        sample = int(np.argmin(np.abs(angles - angle)))
        t = float(record.t[sample])
        ((name, place, force),) = record.applied_forces(t)
        assert (name, place) == ("punch", ("slider", "lug"))
        assert force == pytest.approx(amount * np.array([np.sqrt(0.75), 0.5]), abs=5.0)
        axes = Figure().add_subplot()
        draw_mechanism(axes, record, sample)
        lug = record.points(t)["slider", "lug"]
        assert arrows(axes)[-1].xy == pytest.approx(lug)
        assert any(text.get_text() == f"punch\n{np.hypot(*force):.0f} N" for text in axes.texts)
        bars = [line.get_xydata() for line in axes.get_lines() if line.get_linewidth() == 8]
        assert any(np.allclose(end, lug) for bar in bars for end in bar)


def test_pictures_hold_the_whole_wheels_of_a_gear(make_virtual: Callable[..., Model]) -> None:
    """The wheel of 80 mm is in no joint's way: figure and page cut it off at its axis."""
    model = make_virtual("geared_five_bar")
    record = gather(model, model.simulate(cycles=2, transient=0, samples_per_cycle=40))
    axes = Figure().add_subplot()
    draw_mechanism(axes, record, 0)
    box = np.array([axes.get_xlim(), axes.get_ylim()])
    wheels = {(0.0, 0.0): 0.040, (0.120, 0.0): 0.080}
    drawn = {tuple(np.round(p.center, 6)): p.radius for p in axes.patches if isinstance(p, Circle) and p.radius > 0.03}
    assert drawn == pytest.approx(wheels)
    linkage = to_plain(choose_frames([record], 0.05))["linkage"]
    page = np.array([linkage["low"], linkage["high"]])
    for centre, radius in wheels.items():
        for low, high in (box.T, page):
            assert np.all(low <= np.array(centre) - radius + 1e-9)
            assert np.all(np.array(centre) + radius - 1e-9 <= high)


def test_a_spring_pulls_what_moves_towards_its_other_end(make_virtual: Callable[..., Model]) -> None:
    """With stiffness times elongation."""
    spring = """[mechanism.springs.hold]
bodies = ["frame", "slider"]
points = ["hook", "C"]
stiffness = "20 N/mm"
free_length = "10 mm"

[mechanism.forces.punch]
"""
    model = make_virtual(
        "punching_press",
        ("[mechanism.forces.punch]\n", spring),
        ("[mechanism.frame.points]\n", '[mechanism.frame.points]\nhook = ["30 mm", "-60 mm"]\n'),
        ('"drive_torque"', '"drive_torque", "spring.hold.tension"'),
    )
    record = gather(model, model.simulate(cycles=0.1, transient=0))
    axes = Figure().add_subplot()
    draw_mechanism(axes, record, 50)
    points = record.points(float(record.t[50]))
    slider, hook = points["slider", "C"], np.array([0.03, -0.06])
    length = float(np.hypot(*(hook - slider)))
    assert f"hold\n{20e3 * (length - 0.01):.0f} N" in [text.get_text() for text in axes.texts]
    arrow = arrows(axes)[-1]
    assert arrow.xyann == pytest.approx(slider)
    way = np.array(arrow.xy) - slider
    assert way / np.hypot(*way) == pytest.approx((hook - slider) / length)
    (told,) = (
        force
        for force in to_plain(choose_frames([record], 0.05))["linkage"]["forces"]
        if force["words"] == "spring hold on slider"
    )
    last = record.points(float(record.t[-1]))["slider", "C"]
    length = float(np.hypot(*(hook - last)))
    shown = [told[axis]["values"][-1] / 10.0 ** told[axis]["decimals"] for axis in "xy"]
    assert shown == pytest.approx(20e3 * (length - 0.01) * (hook - last) / length, rel=1e-3)


def test_a_motor_s_torque_turns_around_its_joint_and_the_punch_acts_in_its_window(
    make_virtual: Callable[..., Model], scene_text: Callable[..., str]
) -> None:
    """The crank's angle is a state: no input holds the window.  The arc turns with the torque on the crank."""
    text = scene_text("punching_press_motor")
    bearing = text[text.index("[bearing]\n") : text.index("[run]\n")]
    outputs = 'outputs = ["inner.*", "outer.*", "ball.force", "reaction.*", "drive_*", "driver.*"]'
    wanted = 'outputs = ["reaction.*", "drive_*", "driver.*"]'
    model = make_virtual("punching_press_motor", (bearing, ""), (outputs, wanted))
    record = gather(model, model.simulate(cycles=1.2, transient=0))
    degrees = np.degrees(record.values("driver.angle")) % 360.0
    senses = set()
    for angle, acts in ((236.0, False), (238.0, True), (266.0, True), (268.0, False)):
        sample = int(np.argmin(np.abs(degrees - angle)))
        axes = Figure().add_subplot()
        draw_mechanism(axes, record, sample)
        written = [item.get_text() for item in axes.texts]
        assert ("punch\n8965 N" in written) is acts
        torque = float(record.values("drive_torque")[sample])
        assert f"drive\n{abs(torque):.3g} N·m" in written
        x, y = next(line for line in axes.get_lines() if line.get_color() == TORQUE).get_xydata().T
        assert np.sign(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) == np.sign(torque)  # around the origin, joint A
        senses.add(np.sign(torque))
    assert senses == {-1.0, 1.0}


@pytest.mark.long
def test_a_load_curve_covers_all_turns_of_a_force_s_table(make_model: Callable[..., Model]) -> None:
    """A four-stroke engine fires in one turn of two: the last turn alone may show the other one."""
    model = make_model("engine")
    for cycles in (4, 5):
        found = model.simulate(cycles=cycles, transient=2)
        axes = draw("load_curve", model, found).axes
        assert axes[0].get_xlim() == (0.0, 720.0)
        angle, force = axes[1].get_lines()[0].get_xydata().T
        assert force.min() == pytest.approx(found["reaction.A.y"].min(), rel=1e-9)
        assert 90.0 < angle[np.argmin(force)] < 120.0  # behind top dead centre with ignition


@pytest.mark.long
def test_a_body_is_drawn_around_its_points_and_its_centre_and_coupler_points_are_named(
    make_model: Callable[..., Model],
) -> None:
    model = make_model("four_bar", ('points = { B = "origin", C = "100 mm" }', COUPLER))
    record = gather(model, model.simulate(cycles=1, transient=0))
    axes = Figure().add_subplot()
    draw_mechanism(axes, record, 0)
    assert "P" in [item.get_text() for item in axes.texts]
    place = record.points(float(record.t[0]), record.state(0))
    corners = {key[1] for key in dict(links(used_points(record.mechanism), place, 0.2))["coupler"]}
    assert corners == {"B", "C", "P"}  # the centre of mass lies within
    heavy = {**place, ("coupler", "center_of_mass"): place["coupler", "P"] * 2.0 - place["coupler", "B"]}
    corners = {key[1] for key in dict(links(used_points(record.mechanism), heavy, 0.2))["coupler"]}
    assert "center_of_mass" in corners  # beside them: it is a corner


@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0, 170.0, 240.0, 300.0])
def test_no_words_of_the_mechanism_overlap(press: Run, angle: float) -> None:
    """A and B are 6 mm apart on a machine of 112 mm."""
    record = gather(*press)
    sample = int(np.argmin(np.abs(np.degrees(record.crank_angle()) % 360.0 - angle)))
    figure = Figure(figsize=(4.0, 5.0))
    axes = figure.add_subplot()
    draw_mechanism(axes, record, sample)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in axes.texts if text.get_text()]
    assert len(boxes) >= 4
    for number, box in enumerate(boxes):
        assert not box.count_overlaps(boxes[:number])


def test_a_load_by_a_table_is_shaded_where_it_is_not_zero(make_virtual: Callable[..., Model]) -> None:
    """Also over the start of the turn; a table that nowhere stays zero is not shaded."""
    rows = 'angle = ["20 deg", "100 deg", "150 deg", "200 deg", "300 deg"]'
    table = f'table = {{ {rows}, force = ["0 N", "0 N", "7 N", "0 N", "0 N"] }}\ndirection = "90 deg"'
    always = ('window = { start = "237 deg", end = "267 deg" }', "")
    model = make_virtual("punching_press", ('force = ["0 N", "8964.8 N"]', table), always)
    solution = model.simulate(cycles=0.01, transient=0)
    assert np.degrees(gather(model, solution).load_windows()) == pytest.approx(np.array([[100.0, 200.0]]))
    value = "mechanism.forces.punch.table.force"
    names = [info.name for info in model.manifest.parameters if info.name.startswith(value)]
    for changed, expected in (
        ({names[4]: 3.0}, [[100.0, 380.0]]),
        ({names[0]: 3.0}, [[300.0, 560.0]]),
        ({names[0]: 3.0, names[2]: 0.0}, [[300.0, 460.0]]),
        ({names[0]: 3.0, names[3]: 3.0}, []),
    ):
        other = gather(model, model.simulate(cycles=0.01, transient=0, parameters=changed))
        assert np.degrees(other.load_windows()).tolist() == [pytest.approx(window) for window in expected], changed


def test_loads_of_which_some_act_at_any_angle_are_not_shaded(make_virtual: Callable[..., Model]) -> None:
    """All of a compressor of two cylinders was shaded, and its orbit had no line but that under the loads."""
    second = """[mechanism.forces.other]
body = "slider"
point = "C"
force = ["0 N", "-5 N"]
window = { start = "260 deg", end = "240 deg" }

[mechanism.forces.punch]"""
    model = make_virtual("punching_press", ("[mechanism.forces.punch]", second))
    for end, count in ((240.0, 0), (230.0, 2)):
        numbers = {"mechanism.forces.other.window.end": math.radians(end)}
        record = gather(model, model.simulate(cycles=0.01, transient=0, parameters=numbers))
        assert len(record.load_windows()) == count


def test_a_block_that_passes_the_point_of_its_guide_keeps_its_direction() -> None:
    """A Scotch yoke: its block is at the middle of the slot twice a turn, where two points give no direction."""
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    rail, block = ("yoke", "Y"), ("block", "B")
    trace = {rail: np.column_stack([np.cos(angle), 0 * angle]), block: np.column_stack([np.cos(angle), np.sin(angle)])}
    for now in (0.0, 1e-3, 0.3, np.pi):
        pose = {rail: np.array([np.cos(now), 0.0]), block: np.array([np.cos(now), np.sin(now)])}
        assert abs(guide_direction(pose, trace, rail, block) @ [0.0, 1.0]) == pytest.approx(1.0)


def test_two_forces_at_one_point_have_words_apart(make_virtual: Callable[..., Model]) -> None:
    """The second one's name was printed over the first one's size."""
    second = """[mechanism.forces.weight]
body = "slider"
point = "C"
force = ["0 N", "5000 N"]

[mechanism.forces.punch]"""
    model = make_virtual("punching_press", ("[mechanism.forces.punch]", second))
    record = gather(model, model.simulate(cycles=1, transient=0))
    test_no_words_of_the_mechanism_overlap((model, record.solution), 250.0)


def test_a_ball_in_a_spall_is_no_applied_load(make_virtual: Callable[..., Model]) -> None:
    sizes = 'profile = "half-sine"\nangle = "90 deg"\nchord = "1 mm"\ndepth = "9 um"\n'
    places = ('on = "outer"\n', 'on = "inner"\n', 'on = "ball"\nball = 1\n')
    spalls = "".join(f"[bearing.defects.spall_{k}]\n{place}{sizes}\n" for k, place in enumerate(places))
    model = make_virtual("punching_press", ("[bearing.initial]", f"{spalls}[bearing.initial]"))
    record = gather(model, model.simulate(cycles=0.01, transient=0))
    assert np.degrees(record.load_windows()) == pytest.approx(np.array([[237.0, 267.0]]))


def test_pages_colour_contact_loads_as_figures_do() -> None:
    """Script and style sheet have the stops of the colours once more."""
    folder = Path(bearing.__file__).parent
    (stops,) = re.findall(r"const STOPS = (.*);", (folder / "pictures.js").read_text(encoding="utf-8"))
    shades = [tuple(int(part) / 255 for part in stop) for stop in re.findall(r"(\d+), (\d+), (\d+)", stops)]
    # matplotlib's table has 256 places, of which none is a third
    assert np.allclose(shades, bearing.LOAD_COLOURS(np.linspace(0.0, 1.0, 4))[:, :3], atol=0.006)
    hexes = ", ".join(to_hex(shade) for shade in shades)
    assert f"linear-gradient(to right, {hexes})" in (folder / "pictures.css").read_text(encoding="utf-8")


def luminance(colour: tuple[float, float, float]) -> float:
    """CIE lightness L* of an sRGB colour (IEC 61966-2-1, CIE 15)."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
    y = float(np.dot(linear, (0.2126, 0.7152, 0.0722)))
    return 116.0 * y ** (1.0 / 3.0) - 16.0 if y > 0.008856 else 903.3 * y


def test_ticks_of_decades_are_numbers_that_people_write() -> None:
    shown = [decade_words(value) for value in (1e-11, 2e-5, 0.001, 0.5, 2000.0, 1e5)]
    assert shown == ["10⁻¹¹", "2·10⁻⁵", "0.001", "0.5", "2000", "10⁵"]
    axes = Figure().add_subplot()
    axes.set_xscale("log")
    for limits, expected in (((0.15, 2.5), [0.2, 0.5, 1.0, 2.0]), ((0.05, 200.0), [0.1, 1.0, 10.0, 100.0])):
        axes.set_xlim(*limits)
        log_ticks(axes.xaxis)
        ticks = [tick for tick in axes.get_xticks() if limits[0] <= tick <= limits[1]]
        assert ticks == pytest.approx(expected)


def test_palette_keeps_its_order_in_greyscale() -> None:
    steps = np.diff([luminance(to_rgb(colour)) for colour in (INK, SIGNAL, SAND, PALE)])
    assert np.min(steps) > 12.0


def test_figures_leave_pyplot_alone() -> None:
    unwanted = "'matplotlib.pyplot' in sys.modules or 'sympy' in sys.modules"
    code = f"import sys, ballpass.runtime.plot; sys.exit({unwanted})"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_unknown_figure_is_refused_with_the_names_there_are(press: Run) -> None:
    with pytest.raises(RequestError, match="load_curve, orbit, displacements, spectra"):
        draw("waterfall", *press)


@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0, 135.0])
def test_strokes_of_a_wall_stand_at_45_degrees_to_it(angle: float) -> None:
    """Matplotlib's hatches have one direction on the paper: along a wall of 45° there was none to be seen."""
    axes, way = Figure().add_subplot(), np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    _hatched_wall(axes, np.zeros(2), way, np.array([-way[1], way[0]]), 1.0)
    *strokes, wall = [line.get_xydata() for line in axes.lines]
    assert len(strokes) > 10
    assert np.allclose(wall[1] - wall[0], way)
    for stroke in strokes:
        turned = (stroke[1] - stroke[0]) / np.linalg.norm(stroke[1] - stroke[0])
        assert turned @ way == pytest.approx(math.sqrt(0.5))
