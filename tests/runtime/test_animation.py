"""What a moving picture shows, in a real browser, against the run it is made of."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ballpass.runtime import Model, Solution
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.plot.animate import animation_page, write_animation
from ballpass.runtime.plot.animation import Frames

BROWSER = shutil.which("chromium")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium on PATH")


def browse(page: Path, place: str, home: Path) -> tuple[str, str, set[str]]:
    """The page at a place when its script has run, what the browser says, and what the page asks the network for."""
    assert BROWSER is not None
    quiet = ("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic")
    log = home / "network.json"
    done = subprocess.run(
        [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", *quiet, "--enable-logging=stderr",
         "--host-resolver-rules=MAP * ~NOTFOUND", f"--log-net-log={log}", f"--user-data-dir={home}",
         "--virtual-time-budget=2000", "--dump-dom", f"file://{page}#{place}"],
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    noted = [event.get("params", {}) for event in json.loads(log.read_text(encoding="utf-8"))["events"]]
    # what the browser asks for by itself, for updates, is of no origin
    asked = {one["url"] for one in noted if "url" in one and one.get("initiator", "not an origin") != "not an origin"}
    return done.stdout, done.stderr, asked


def dom(page: Path, place: str, home: Path) -> str:
    """The page at a place, when its script has run; fails where the browser complains or a request leaves."""
    home.mkdir()
    text, complaints, asked = browse(page, place, home)
    assert "CONSOLE" not in complaints, complaints
    assert not asked
    return text


def shown(page: Path, place: str, home: Path) -> dict[str, str]:
    """Numbers that the page shows at a place, by quantity."""
    text = dom(page, place, home)
    found = dict(re.findall(r'<dd data-quantity="([^"]+)">([^<]*)</dd>', text))
    (found["now"],) = re.findall(r'<output id="now"[^>]*>([^<]*)</output>', text)
    return found


def numbers_of(page: str) -> dict[str, Any]:
    """The numbers in a page."""
    found: dict[str, Any] = json.loads(page.partition('id="data">')[2].partition("</script>")[0])
    return found


def compare(found: dict[str, str], expected: dict[str, float]) -> None:
    """Each number, to half of the last digit that is shown."""
    for name, value in expected.items():
        digits = len(found[name].partition(".")[2])
        assert float(found[name]) == pytest.approx(value, abs=0.501 * 10.0**-digits), name


def expected_of(solution: Solution, sample: int, prefix: str = "") -> dict[str, float]:
    """Ball forces, ring, load, torque and reactions at a sample, as a page names them."""
    force = solution[f"{prefix}ball.force"][sample]
    numbers = {f"{prefix}ball.force {number}": value for number, value in enumerate(force, start=1)}
    for axis in "xy":
        fixed = f"{prefix}outer.{axis}" not in solution
        outer = 0.0 if fixed else solution[f"{prefix}outer.{axis}"][sample]
        numbers[f"{prefix}inner.{axis}"] = 1e6 * (solution[f"{prefix}inner.{axis}"][sample] - outer)
        for name in [name for name in solution.outputs if re.fullmatch(rf"reaction\.\w+\.{axis}", name)]:
            numbers[name] = solution[name][sample]
    if "drive_torque" in solution:
        numbers["drive_torque"] = solution["drive_torque"][sample]
    return numbers


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> tuple[Model, Solution]:
    model = make_model("punching_press")
    return model, model.simulate(cycles=4)


@needs_browser
def test_browser_shows_the_run_at_the_angle_of_the_address(press: tuple[Model, Solution], tmp_path: Path) -> None:
    page = write_animation(*press, tmp_path / "press.html")
    solution = press[1]
    found = shown(page, "angle=90", tmp_path / "a")
    sample = len(solution) - 2001 + 500
    assert found["now"] == f"crank angle 90.0°, t = {1e3 * solution.t[sample]:.2f} ms"
    numbers = expected_of(solution, sample)
    assert len(numbers) == 8 + 2 + 2 + 1
    compare(found, numbers | {f"load.{axis}": 0.5 * solution[f"reaction.A.{axis}"][sample] for axis in "xy"})
    assert float(found["force.punch.y"]) == 0.0


def test_page_opens_at_the_highest_ball_force_which_no_thinning_misses(press: tuple[Model, Solution]) -> None:
    numbers = numbers_of(animation_page(*press))
    forces = press[1]["ball.force"][-2001:]
    sample, ball = np.unravel_index(np.argmax(forces), forces.shape)
    signal = numbers["bearings"][0]["force"][ball]
    assert signal["values"][numbers["peak"]] / 10.0 ** signal["decimals"] == pytest.approx(
        forces[sample, ball], abs=0.06
    )
    assert numbers["time"]["values"][numbers["peak"]] == pytest.approx(1e7 * press[1].t[-2001 + sample], abs=1.0)


def test_page_of_several_bearings_opens_at_the_highest_force_of_all() -> None:
    forces = [np.array(values) for values in ([1.0, 3.0, 2.0, 0.0], [0.0, 1.0, 0.0, 4.0])]
    records: list[Any] = [
        SimpleNamespace(bearing="", has_ball_force=True, highest_ball_force=one.copy) for one in forces
    ]
    for order in (records, records[::-1]):
        assert Frames(records=(*order,), samples=np.arange(4), turning=True).peak == 3


@needs_browser
@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "bearing", "cycle"),
    [
        ("rotor", "", 512),
        pytest.param("four_bar", "", 2000, marks=pytest.mark.extreme),
        ("punching_press_hinges", "pin", 2000),
    ],
)
def test_browser_shows_every_kind_of_scene(
    make_model: Callable[..., Model], tmp_path: Path, scene: str, bearing: str, cycle: int
) -> None:
    model = make_model(scene)
    solution = model.simulate()
    page = write_animation(model, solution, tmp_path / f"{scene}.html")
    found = shown(page, f"angle=225&bearing={bearing}", tmp_path / "home")
    compare(found, expected_of(solution, len(solution) - 1 - cycle + cycle * 5 // 8, f"{bearing}." if bearing else ""))


@needs_browser
@pytest.mark.long
def test_keys_clicks_and_play_move_the_page(press: tuple[Model, Solution], tmp_path: Path) -> None:
    """Arrow keys by a position, space for a second of a turn in six, a click in a chart to its place."""
    # a browser without a screen draws no frames: a clock in their place
    clock = "requestAnimationFrame = (f) => setTimeout(() => f(performance.now()), 16);"
    clock += "cancelAnimationFrame = clearTimeout;"
    actions = """
        const press = (key) => document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
        const note = (name) => { document.body.dataset[name] = get("now").textContent.match(/[0-9.]+/)[0]; };
        setTimeout(() => { note("begin"); press("ArrowRight"); note("right"); press(" "); }, 100);
        setTimeout(() => { press(" "); note("played"); }, 1100);
        setTimeout(() => {
          const chart = document.querySelector(".chart"), box = chart.getBoundingClientRect();
          chart.dispatchEvent(new PointerEvent("pointerdown", { clientX: box.left + box.width * 228 / 420 }));
          note("clicked");
        }, 1200);
    """
    text = animation_page(*press).replace('"use strict";', clock, 1)
    page = tmp_path / "press.html"
    page.write_text(text.replace("</body>", f"<script>{actions}</script></body>"), encoding="utf-8")
    found = re.search(r"<body ([^>]*)>", dom(page, "angle=90", tmp_path / "home"))
    assert found is not None
    noted = {name: float(value) for name, value in re.findall(r'data-(\w+)="([^"]+)"', found[1])}
    assert noted["begin"] == 90.0
    assert noted["right"] == pytest.approx(90.36, abs=0.1)
    assert noted["played"] - noted["right"] == pytest.approx(60.0, abs=3.0)
    assert noted["clicked"] == pytest.approx(180.0, abs=0.5)  # the middle of the axis


def test_page_needs_nothing_but_itself_and_is_small(press: tuple[Model, Solution]) -> None:
    text = animation_page(*press)
    assert len(text.encode()) < 300_000
    assert set(re.findall(r"\w+://[^\s\"'`)]*", text)) == {"http://www.w3.org/2000/svg"}  # a name, never fetched
    assert "default-src 'none'" in text
    assert not re.search(r"""(src|href)=(?!"data:,")|@import|url\(|fetch\(|XMLHttp|import\(""", text)
    assert text.count("</script>") == 2


@needs_browser
def test_no_request_leaves_the_page_whatever_stands_in_it(press: tuple[Model, Solution], tmp_path: Path) -> None:
    """What is elsewhere is not asked for; without the page's policy it is, and the network's log shows it."""
    addresses, policy = {"http://127.0.0.1:9/a.png", "http://127.0.0.1:9/b"}, r'<meta http-equiv="Content-S[^>]*>'
    strange = f'<img src="{min(addresses)}"><script>fetch("{max(addresses)}").catch(() => 0)</script>'
    text = animation_page(*press).replace("</body>", f"{strange}</body>")
    for name, written, expected in (("kept", text, set()), ("without", re.sub(policy, "", text), addresses)):
        page = tmp_path / f"{name}.html"
        page.write_text(written, encoding="utf-8")
        (tmp_path / name).mkdir()
        assert browse(page, "", tmp_path / name)[2] == expected


@pytest.mark.long
def test_words_of_a_scene_end_no_element(make_virtual: Callable[..., Model]) -> None:
    model = make_virtual("punching_press", ('title = "Punching machine of the paper"', 'title = "</script><b>&"'))
    text = animation_page(model, model.simulate(cycles=1, transient=0))
    assert text.count("</script>") == 2
    assert "<title>&lt;/script&gt;&lt;b&gt;&amp;</title>" in text


@pytest.mark.long
def test_a_movie_and_a_page_begin_with_the_bearing_that_is_named(
    make_virtual: Callable[..., Model], scene_text: Callable[..., str], tmp_path: Path
) -> None:
    text = scene_text("varying_compliance")
    bearing = text[text.index("[bearing]\n") : text.index("[run]")]
    two = "".join(re.sub(r"^\[bearing\b", f"[bearings.{name}", bearing, flags=re.MULTILINE) for name in ("a", "b"))
    outputs = re.search(r"outputs = \[.*?\]", text, re.DOTALL)
    assert outputs is not None
    model = make_virtual("varying_compliance", (bearing, two), (outputs[0], 'outputs = ["*.inner.*", "*.ball.force"]'))
    solution = model.simulate(cycles=0.1, transient=0, parameters={"bearings.b.clearance": 50e-6})
    films = {}
    for name in (None, "a", "b"):
        page = numbers_of(animation_page(model, solution, turns=0.1, bearing=name))
        assert page["bearings"][0]["name"] == (name or "a")
        moving = solution.plot.animate(turns=0.1, bearing=name)
        films[name] = moving.save(tmp_path / f"{name}.gif", pictures=2).read_bytes()
    assert films["a"] == films[None] != films["b"]
    with pytest.raises(RequestError, match=r"no bearing 'c'. There are: a, b\."):
        write_animation(model, solution, tmp_path / "c.gif", bearing="c", pictures=2)


def test_gif_has_as_many_pictures_as_asked_for(press: tuple[Model, Solution], tmp_path: Path) -> None:
    with Image.open(write_animation(*press, tmp_path / "a.gif", pictures=3)) as film:
        assert film.n_frames == 3
        pictures = []
        for number in range(3):
            film.seek(number)
            pictures.append(np.asarray(film.convert("L")))
    assert np.any(pictures[0] != pictures[1])
    assert np.any(pictures[1] != pictures[2])


@pytest.mark.long
@pytest.mark.parametrize("stopped", [False, True])
def test_a_failing_ffmpeg_is_told_and_an_interrupt_stays_one(
    press: tuple[Model, Solution], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stopped: bool
) -> None:
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho 'Unknown encoder' >&2\ncat > /dev/null\nexit 8\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")

    def stop(done: float) -> None:
        if stopped:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt if stopped else RequestError, match=None if stopped else "8: Unknown encoder"):
        write_animation(*press, tmp_path / "a.mp4", pictures=2, progress=stop)
    assert list(tmp_path.iterdir()) == [program]


def test_what_cannot_be_shown_is_refused(
    press: tuple[Model, Solution], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RequestError, match=r"'.avi' is not a kind of animation. Allowed: .html, .mp4, .gif"):
        write_animation(*press, tmp_path / "a.avi")
    with pytest.raises(RequestError, match="2 turns long, and 3 were asked for"):
        write_animation(*press, tmp_path / "a.html", turns=3)
    with pytest.raises(RequestError, match="2 or more"):
        write_animation(*press, tmp_path / "a.gif", pictures=1)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RequestError, match=r"ffmpeg, which is not on PATH.*--format gif or html"):
        write_animation(*press, tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())
