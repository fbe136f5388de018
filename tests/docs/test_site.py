"""The built site shows formulas in a browser without a network, and asks for nothing that is not there."""

from __future__ import annotations

import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from chromium import opened

SITE = Path(__file__).resolve().parents[2] / "docs" / "_build" / "html"
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(BROWSER is None, reason="there is no Chromium on PATH"),
    pytest.mark.skipif(not (SITE / "index.html").exists(), reason="`make docs` has not built the site"),
]


#: Of the page as a telephone shows it: sizes of its words [px], without formulas and pictures.
SIZES = """(() => {
  const walk = document.createTreeWalker(document.querySelector("article"), NodeFilter.SHOW_TEXT), sizes = [];
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const parent = node.parentElement;
    if (!node.textContent.trim() || parent.closest("svg, mjx-container, script, style")) continue;
    if (parent.getBoundingClientRect().width) sizes.push(parseFloat(getComputedStyle(parent).fontSize));
  }
  return sizes;
})()"""

#: Pages for users, each of which a telephone shows.
PAGES = [SITE / "index.html", SITE / "tutorial.html", SITE / "machines.html"]
PAGES += sorted(path for part in ("readers", "howto", "reference") for path in (SITE / part).rglob("*.html"))


class Recorder(SimpleHTTPRequestHandler):
    answers: list[tuple[str, int]]

    def log_request(self, code: object = 0, size: object = 0) -> None:
        self.answers.append((self.path, int(code)))  # type: ignore[call-overload]


@pytest.fixture
def site() -> Iterator[tuple[str, list[tuple[str, int]]]]:
    """Address of the site, and what has been answered."""
    Recorder.answers = []
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Recorder, directory=str(SITE))) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}", Recorder.answers
        server.shutdown()
        thread.join()


def rendered(address: str, profile: Path) -> str:
    """The page as the browser has it, which resolves no name."""
    quiet = ("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic")
    done = subprocess.run(
        (
            *(str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", *quiet),
            *(f"--user-data-dir={profile}", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"),
            *("--virtual-time-budget=20000", "--dump-dom", address),
        ),
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    return done.stdout


@pytest.mark.parametrize(
    ("page", "formulas", "shown"),
    [
        ("index.html", 0, "How fast"),
        ("machines.html", 0, "Toggle press"),
        ("live/punching_press.html", 0, 'data-result="peak_ball_force"'),
        ("theory/bearing.html", 20, "Energies, dissipation, virtual work"),
        ("theory/press.html", 50, "Equations"),
        ("auto_gallery/index.html", 0, "Eq. (1) from the geometry"),
    ],
)
def test_pages_show_without_a_network(
    site: tuple[str, list[tuple[str, int]]], page: str, formulas: int, shown: str, tmp_path: Path
) -> None:
    address, answers = site
    content = rendered(f"{address}/{page}", tmp_path)
    assert shown in content
    drawn = re.findall(r"<mjx-container.*?</mjx-container>", content, re.DOTALL)
    assert len(drawn) >= formulas
    assert all("<svg" in formula and "merror" not in formula for formula in drawn)
    assert content.count('class="math notranslate') <= len(drawn)
    asked = [name for name, code in answers if code >= 400 and name != "/favicon.ico"]
    assert not asked, "requests that failed"
    assert not re.findall(
        r'<(?:script|img)[^>]* src="https?://(?!127)|<link[^>]* rel="stylesheet" [^>]*href="http', content
    )


def test_pages_on_a_telephone_have_words_of_9_pixels_and_do_not_scroll_sideways(tmp_path: Path) -> None:
    """The result on the landing page had 8.6."""
    assert len(PAGES) > 90
    with opened(tmp_path / "home") as browser:
        browser.call("Emulation.setDeviceMetricsOverride", width=390, height=900, deviceScaleFactor=1, mobile=True)
        for page in PAGES:
            browser.open(page)
            browser.wait("document.readyState === 'complete' && !!document.querySelector('article')")
            assert min(browser.value(SIZES)) >= 9.0, page
            assert browser.value("document.documentElement.scrollWidth") <= 390, page
