"""The page with the solver in it gives the numbers of native runs, in a real browser, and asks for nothing."""

from __future__ import annotations

import importlib.util
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Page, needs_browser, opened
from typer.testing import CliRunner

from ballpass.derive import shipped_scenes
from ballpass.runtime import Model, SimulationError, UnusualWarning
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.explore import scene_units
from ballpass.runtime.app.summary import summarize
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.plot import explore
from ballpass.runtime.plot.explore import explore_page
from ballpass.runtime.plot.sliders import sliders

needs_compiler = pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed")

DONE = "typeof current !== 'undefined' && !busy && current !== null"


def shown(page: Page) -> dict[str, float]:
    """Results that the page shows, with all their digits."""
    page.wait(DONE)
    rows = page.value("[...document.querySelectorAll('[data-result]')].map((x) => [x.dataset.result, x.dataset.value])")
    return {name: float(value) for name, value in rows}


def peak_ball_force(model: Model, name: str = "ball.force", **run: Any) -> float:
    """Of the steady part of a native run [N]."""
    return model.refine_peak(model.simulate(**run).steady(), name).value


def life_in_hours(model: Model, name: str, parameters: dict[str, float] | None = None) -> float:
    """Of a native run [h]; the rings turn at constant speeds."""
    speed = next(info.ring_speed for info in model.manifest.bearings if f"{info.prefix}life" == name)
    turns = model.quantities([name], parameters=parameters)[name].value
    return turns * 2.0 * np.pi / abs(model.numbers(parameters).values[speed]) / 3600.0


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press")


@pytest.fixture(scope="module")
def page(press: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    units = scene_units(shipped_scenes()["press"], press.manifest)
    return press.explore(tmp_path_factory.mktemp("page") / "explore.html", units=units)


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Page]:
    with opened(tmp_path / "home") as one:
        yield one


@needs_browser
@needs_compiler
@pytest.mark.long
def test_keys_on_a_slider_give_the_native_run_and_no_request_leaves(press: Model, page: Path, browser: Page) -> None:
    browser.open(page)
    own = shown(browser)
    peak = press.refine_peak(press.simulate().steady(), "ball.force")
    assert own["peak_ball_force"] == pytest.approx(peak.value, rel=1e-6)
    turns = peak.time / 0.12  # of the crank, at 500 rpm
    where = browser.value("document.querySelector('#results tbody td').textContent")
    assert where == f"Highest ball force, at {turns % 1.0 * 360.0:.1f}\u00b0 of turn {int(turns) + 1} [N]"
    row = "document.querySelector('[data-name=\"bearing.clearance\"]')"
    browser.value(f"{row}.querySelector('input[type=range]').focus()")
    browser.press("ArrowRight", 5)
    field = f"Number({row}.querySelector('input[type=number]').value)"
    browser.wait(f"{field} > 10.9")
    moved, clearance = shown(browser), browser.value(field)
    numbers = {"bearing.clearance": clearance * 1e-6}
    assert moved["peak_ball_force"] != own["peak_ball_force"]
    assert moved["peak_ball_force"] == pytest.approx(peak_ball_force(press, parameters=numbers), rel=1e-6)
    # from every step, where the quantity has Gauss's nodes in the steps
    assert moved["life"] == pytest.approx(life_in_hours(press, "life", numbers), rel=1e-4)
    assert browser.value("decodeURIComponent(location.hash)") == f"#bearing.clearance={clearance:g}+um"
    assert browser.value("lines()") == [f'--set bearing.clearance="{clearance:g} um"']
    assert browser.asked == [page.as_uri()]
    assert not browser.complaints


@needs_browser
@needs_compiler
@pytest.mark.long
def test_curves_follow_a_slider(page: Path, browser: Page) -> None:
    """Each number draws curves of its own: other curves at another number, the same ones when it comes back."""
    browser.open(page)
    browser.wait(DONE)
    drawn = "[...document.querySelectorAll('#charts svg')].map((curve) => curve.outerHTML).join()"
    seen = []
    for clearance in (12e-6, 14e-6, 12e-6):
        browser.value(
            f"new Promise((done) => {{ change(isNumber.get('bearing.clearance'), {clearance});"
            "const look = () => (busy ? setTimeout(look, 5) : requestAnimationFrame(() => setTimeout(done)));"
            "look(); })"
        )
        seen.append(browser.value(drawn))
    assert browser.value("current !== scene")
    assert seen[0] != seen[1]
    assert seen[0] == seen[2]


@needs_browser
@needs_compiler
@pytest.mark.long
def test_a_move_of_a_slider_lays_the_page_out_a_few_times(page: Path, browser: Page) -> None:
    """From input to frame: a page that reads sizes between writes would lay out for every curve."""
    browser.open(page)
    browser.wait(DONE)
    browser.call("Performance.enable")

    def layouts() -> float:
        metrics = browser.call("Performance.getMetrics")["metrics"]
        return float(next(one["value"] for one in metrics if one["name"] == "LayoutCount"))

    counts = []
    for place in range(100, 109):
        before = layouts()
        browser.value(
            "new Promise((done) => { const slider = document.querySelector('[data-name=\"bearing.clearance\"] input');"
            f"slider.value = {place}; slider.dispatchEvent(new Event('input'));"
            "const look = () => requestAnimationFrame(() => (busy ? look() : setTimeout(done)));"
            "look(); })"
        )
        counts.append(layouts() - before)
    assert browser.value("current !== scene")
    assert 1 <= np.median(counts) <= 2


@needs_browser
@needs_compiler
@pytest.mark.long
def test_a_link_carries_values_and_a_fault_stands_in_the_words_of_the_solver(
    press: Model, page: Path, browser: Page
) -> None:
    numbers = {"bearing.clearance": 25e-6, "bearing.damping.ratio": 1e-5 * 1e-3**0.5, "mechanism.driver.speed": 40.0}
    speed = 40.0 * 30.0 / np.pi
    place = f"bearing.clearance=25 um&bearing.damping.ratio=1e-5 s*mm^0.5&mechanism.driver.speed={speed!r} rpm"
    browser.open(page, f"#{place}")
    browser.wait(f"{DONE} && current !== scene")
    found = shown(browser)
    solution = press.simulate(parameters=numbers)
    steady = solution.steady()
    assert found["peak_ball_force"] == pytest.approx(press.refine_peak(steady, "ball.force").value, rel=1e-6)
    assert found["peak_torque"] == pytest.approx(press.refine_peak(steady, "drive_torque").value, rel=1e-6)
    work = press.quantities(["drive_work"], parameters=numbers)["drive_work"].value
    assert found["drive_work"] == pytest.approx(work, rel=1e-5)
    # rms of the highest of all balls: by trapezoids on the native samples, which do not know of the load's jumps
    highest = np.max(steady["ball.force"], axis=1)
    assert found["rms_ball_force"] == pytest.approx(float(np.sqrt(np.mean(highest**2))), rel=2e-3)
    # what the pictures show is that run
    for name, column in (("inner.x", 0), ("inner.y", 1)):
        signal = browser.value(f"all(data.bearings[0].inner[{column}])")
        native = 1e6 * (steady[name] - steady[name.replace("inner", "outer")])[-2001:]
        assert np.max(np.abs(np.max(native) - np.max(signal))) < 1e-2
    browser.value("change(isNumber.get('bearing.pitch_diameter'), 1e-3)")
    browser.wait("!get('fault').hidden")
    fault = browser.value("get('fault').textContent")
    assert re.search(r"bearing.pitch_diameter: 0.001 was given. Allowed: a number above 2\.61312593 times", fault)
    browser.value("change(isNumber.get('bearing.contact.poisson_ratio'), 0.9)")
    browser.wait("get('fault').textContent.includes('bearing.contact.poisson_ratio: 0.9 was given. Allowed')")
    browser.value("get('reset').click()")
    browser.wait(f"{DONE} && get('fault').hidden")
    assert shown(browser)["peak_ball_force"] == pytest.approx(peak_ball_force(press), rel=1e-6)
    assert not browser.complaints


def page_with_native_peaks(model: Model, browser: Page, folder: Path, bearing: str) -> dict[str, float]:
    """Open a page whose highest ball force is that of native runs, also with the clearance moved; its own results."""
    browser.open(model.explore(folder / "page.html"))
    found = shown(browser)
    peak = peak_ball_force(model, f"{bearing}ball.force")
    assert found[f"{bearing}peak_ball_force"] == pytest.approx(peak, rel=1e-6)
    # ball forces have spikes between samples: in the crank-shaper 8e-3 above them, in the toggle press at another turn
    info = next(one for one in model.manifest.bearings if one.prefix == bearing)
    clearance = 1.1 * model.numbers(None).values[f"{info.path}.clearance"] or 1e-6
    browser.value(f"change(isNumber.get('{info.path}.clearance'), {clearance!r})")
    browser.wait(f"{DONE} && current !== scene")
    moved = peak_ball_force(model, f"{bearing}ball.force", parameters={f"{info.path}.clearance": clearance})
    assert shown(browser)[f"{bearing}peak_ball_force"] == pytest.approx(moved, rel=1e-6)
    return found


@needs_browser
@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "bearing"),
    [
        ("rotor", ""),
        ("punching_press_motor", ""),
        ("punching_press_hinges", "pin."),
        ("crank_shaper", ""),
        pytest.param("four_bar", "", marks=pytest.mark.extreme),
        pytest.param("punching_press_tangent", "", marks=pytest.mark.extreme),
        pytest.param("punching_press_two_way", "", marks=pytest.mark.extreme),
        pytest.param("toggle_press", "knee.", marks=pytest.mark.extreme),
    ],
)
def test_pages_of_other_machines_give_native_peaks_and_positions(
    make_model: Callable[..., Model], browser: Page, tmp_path: Path, scene: str, bearing: str
) -> None:
    model = make_model(scene)
    found = page_with_native_peaks(model, browser, tmp_path, bearing)
    swings = scene == "toggle_press" or bearing == "pin."
    assert (f"{bearing}life" in found) is not swings
    turning = {"rotor": "life", "punching_press_hinges": "main.life"}.get(scene)
    if turning is not None:
        assert found[turning] == pytest.approx(life_in_hours(model, turning), rel=1e-4)
    browser.value("get('reset').click()")
    browser.wait(DONE)
    # Positions, forces and angles are those that the page brings of the native run, of five digits.  Not so where the
    # last bit of a number changes a native run by more: 1e-4 of the four-bar's ball forces, what rattles in the toggle.
    own = browser.value("({ brought: numbers, solved: data })") if scene not in ("four_bar", "toggle_press") else {}
    for path in _signals(own.get("brought")):
        (native, digits), (solved, _) = (_at(own[kind], path) for kind in ("brought", "solved"))
        assert native.shape == solved.shape
        assert np.max(np.abs(native - solved)) <= 0.501 * 10.0**-digits + 2e-4 * np.max(np.abs(native)), path
    assert not browser.complaints


@needs_browser
@needs_compiler
@pytest.mark.long
@pytest.mark.extreme
@pytest.mark.parametrize(
    ("scene", "bearing"),
    [
        ("eccentric_pump", ""),
        ("engine", ""),
        ("offset_slider", ""),
        ("punching_press_roller", ""),
        ("rotor_two_bearings", "pulley."),
        ("v_compressor", "front."),
        ("varying_compliance", ""),
    ],
)
def test_pages_of_further_machines_give_native_peaks(
    make_model: Callable[..., Model], browser: Page, tmp_path: Path, scene: str, bearing: str
) -> None:
    page_with_native_peaks(make_model(scene), browser, tmp_path, bearing)
    assert not browser.complaints


@needs_browser
@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize("scene", ["punching_press", "punching_press_motor"])
def test_a_load_that_rises_is_drawn_as_large_as_it_is(
    make_model: Callable[..., Model], browser: Page, tmp_path: Path, scene: str
) -> None:
    """Whether the driver's angle is known before the run or a state."""
    model = make_model(scene, ('end = "267 deg" }', 'end = "267 deg", rise = "10 deg" }'))
    browser.open(model.explore(tmp_path / "page.html"))
    browser.wait(DONE)
    both = browser.value(
        "[numbers, data].map((own) => own.linkage.forces.find((force) => force.name === 'force.punch').y)"
    )
    native, solved = (_at(one, ())[0] for one in both)
    assert np.count_nonzero((native > 100.0) & (native < 8800.0)) > 20  # it is on its way there
    assert np.max(np.abs(native - solved)) < 2.0


@needs_browser
@needs_compiler
@pytest.mark.long
def test_means_of_a_machine_that_runs_up_take_as_many_samples_a_turn_where_it_is_fastest(
    make_model: Callable[..., Model], browser: Page, tmp_path: Path
) -> None:
    """The scene's samples are of a turn at the speed of t = 0, and of the whole run where that is none."""
    table = 'table = { time = ["0 s", "0.8 s"], speed = ["0 rpm", "600 rpm"] }'
    length = ("cycles = 4 ", 'duration = "1 s" '), ("transient_cycles = 2 ", "transient_cycles = 0 ")
    model = make_model("punching_press", ('speed = "500 rpm"', table), *length)
    browser.open(model.explore(tmp_path / "page.html"))
    found = shown(browser)
    rms = model.quantities(["rms:ball.force"])["rms:ball.force"].value
    assert found["rms_ball_force"] == pytest.approx(rms, rel=1e-3)
    (bearing,) = model.life().bearings
    assert bearing.life is not None
    assert found["life"] == pytest.approx(bearing.hours(bearing.life), rel=1e-4)


@needs_browser
@needs_compiler
@pytest.mark.long
def test_work_and_spectrum_of_a_run_that_ends_within_a_turn_are_those_of_whole_turns(
    make_model: Callable[..., Model], browser: Page, tmp_path: Path
) -> None:
    """Of an engine, whose loads repeat after two."""
    model = make_model("engine", ("cycles = 8 ", "cycles = 7.6 "))
    browser.open(model.explore(tmp_path / "page.html"))
    work = model.quantities(["drive_work"], cycles=8)["drive_work"].value
    assert shown(browser)["drive_work"] == pytest.approx(work, rel=1e-4)
    steady = model.simulate().steady()
    count = 3 * model.run_settings.samples_per_cycle
    motion = [1e6 * (steady[f"inner.{axis}"] - steady[f"outer.{axis}"])[-1 - count : -1] for axis in "xy"]
    native = 2.0 / count * np.hypot(*(np.abs(np.fft.rfft(one)) for one in motion))[1:121]
    lines = np.array(browser.value("spectrumOf(current, 0)"))
    assert lines[:, 0] == pytest.approx(np.arange(1, 121) / (3.0 * model.period()), rel=1e-9)
    assert lines[:, 1] == pytest.approx(native, abs=1e-3 * float(native.max()))


#: Sizes of all texts [px], those of pictures as they are scaled.
SIZES = """(() => {
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), sizes = [];
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const parent = node.parentElement, range = document.createRange();
    range.selectNodeContents(node);
    if (!node.textContent.trim() || range.getBoundingClientRect().width < 1) continue;
    const scale = parent.closest("svg") ? Math.hypot(parent.getScreenCTM().a, parent.getScreenCTM().b) : 1;
    sizes.push(scale * parseFloat(getComputedStyle(parent).fontSize));
  }
  return sizes;
})()"""


@needs_browser
@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize("width", [390, 1280])
def test_all_words_of_a_page_can_be_read_and_no_panel_is_half_blank(page: Path, browser: Page, width: int) -> None:
    """On a telephone ball numbers had 5 px; on a screen the panel beside the orbit was blank for 300 px."""
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 500)
    browser.open(page)
    browser.wait(DONE)
    assert min(browser.value(SIZES)) >= 9.0
    assert browser.value("document.documentElement.scrollWidth") <= width
    panels = "[...document.querySelectorAll('#charts section')]"
    below = "one.getBoundingClientRect().bottom - one.lastElementChild.getBoundingClientRect().bottom"
    blank = browser.value(f"{panels}.map((one) => {below})")
    assert len(blank) > 3
    assert max(blank) < 140.0


def _signals(numbers: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(numbers, dict):
        if "decimals" in numbers:
            yield path
        else:
            for name, value in numbers.items():
                if name != "solver":
                    yield from _signals(value, (*path, name))
    elif isinstance(numbers, list):
        for k, value in enumerate(numbers):
            yield from _signals(value, (*path, k))


def _at(numbers: Any, path: tuple[Any, ...]) -> tuple[np.ndarray, int]:
    """Values of a signal, and its decimals."""
    for key in path:
        numbers = numbers[key]
    values = numbers["all"] if "all" in numbers else np.array(numbers["values"]) / 10.0 ** numbers["decimals"]
    return np.asarray(values), numbers["decimals"]


def test_page_needs_nothing_but_itself(press: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(explore, "web_assembly", lambda _: b"\0asm")
    text = explore_page(press, press.simulate(cycles=2, transient=1))
    assert set(re.findall(r"\w+://[^\s\"'`)]*", text)) == {"http://www.w3.org/2000/svg"}  # a name, never fetched
    assert "default-src 'none'" in text
    assert not re.search(r"""(src|href)=(?!"data:,")|@import|url\(|fetch\(|XMLHttp|import\(""", text)
    assert text.count("</script>") == 2
    assert "/*" not in re.sub(r"/\* .*? \*/", "", text)  # every mark is filled


def test_sliders_hold_the_value_stay_within_bounds_and_begin_with_clearance(press: Model) -> None:
    manifest = press.manifest
    values = {info.name: info.default for info in manifest.parameters}
    rows = sliders(manifest, values, {"bearing.clearance": "um"})
    for row, info in zip(rows, manifest.parameters, strict=True):
        assert row["low"] < row["high"]
        assert row["low"] <= row["value"] <= row["high"], row
        assert info.above is None or row["low"] > info.above
        assert info.least is None or row["low"] >= info.least
        assert info.most is None or row["high"] <= info.most
    first = sorted((row["first"], row["name"], row["unit"]) for row in rows if row["first"] is not None)
    assert first[0][1:] == ("bearing.clearance", "um")
    assert first[1][1:] == ("bearing.damping.ratio", "s*mm^0.5")
    assert {row["name"]: row["low"] for row in rows}["bearing.clearance"] == pytest.approx(-10e-6)


def test_units_are_those_of_the_scene_file(press: Model) -> None:
    units = scene_units(shipped_scenes()["press"], press.manifest)
    assert units["bearing.clearance"] == "um"
    assert units["mechanism.driver.speed"] == "rpm"
    assert units["mechanism.forces.punch.force.y"] == "N"
    assert units["mechanism.bodies.rod.inertia"] == "kg*mm^2"
    assert "bearing.share" not in units


def test_a_missing_compiler_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, press: Model) -> None:
    real = importlib.util.find_spec
    missing = ("ziglang",)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *more: None if name in missing else real(name, *more))
    with pytest.raises(RequestError, match=r'ziglang, which is not installed.*pip install "ballpass\[compiler\]"'):
        press.explore(tmp_path / "page.html")
    asked = ["explore", str(shipped_scenes()["press"]), "--out", str(tmp_path / "out")]
    answer = CliRunner().invoke(app, asked)
    assert answer.exit_code == 2
    assert "ballpass[compiler]" in answer.stderr
    assert not list(tmp_path.iterdir())


@needs_browser
@needs_compiler
@pytest.mark.long
def test_a_page_refuses_and_warns_in_the_words_of_native_runs(press: Model, page: Path, browser: Page) -> None:
    browser.open(page)
    shown(browser)
    said = "[...document.querySelectorAll('#warned p')].map((one) => one.textContent)"
    assert browser.value(said) == []
    for numbers in (
        {"mechanism.forces.punch.force.y": 89648.0},
        {"bearing.clearance": 0.5e-3, "bearing.contact.outer_groove_radius": 4.6e-3},
        {"mechanism.forces.punch.window.start": 0.0716, "mechanism.forces.punch.window.end": 0.0803},
    ):
        with pytest.warns(UnusualWarning):
            native = summarize(press, press.simulate(parameters=numbers))["warnings"]
        browser.value("own.forEach((value, k) => { values[k] = value; })")
        for name, value in numbers.items():
            browser.value(f"change(isNumber.get('{name}'), {value!r})")
        browser.wait(f"{DONE} && {said}.length === {len(native)}")
        assert browser.value(said) == [f"warning: {text}" for text in native]
    for numbers in ({"mechanism.forces.punch.force.y": 4e6}, {"bearing.clearance": 20e-3}):
        browser.value("own.forEach((value, k) => { values[k] = value; })")
        for name, value in numbers.items():
            browser.value(f"change(isNumber.get('{name}'), {value!r})")
        with pytest.raises(SimulationError) as refused, warnings.catch_warnings(action="ignore"):
            press.simulate(parameters=numbers)
        status, why = str(refused.value).splitlines()
        browser.wait(f"!get('fault').hidden && get('fault').textContent.includes({status!r})")
        assert browser.value("get('fault').textContent").splitlines()[-1] in why
        assert browser.value(said) == []
    assert not browser.complaints
