"""A browser without a screen, in real time: opens pages, presses keys, notes what they ask the network for."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

BROWSER = shutil.which("chromium")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium on PATH")


class Page:
    """A page in Chromium, by its debugging protocol over a pipe.

    Attributes
    ----------
    asked : addresses that the page asked for
    complaints : errors of its scripts, and what it writes to the console
    """

    def __init__(self, read: int, write: int) -> None:
        self._read, self._write, self._rest, self._count = read, write, b"", 0
        self._session: dict[str, str] = {}
        self.asked: list[str] = []
        self.complaints: list[str] = []
        target = next(one for one in self.call("Target.getTargets")["targetInfos"] if one["type"] == "page")
        session = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        self._session = {"sessionId": session}
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        self._count += 1
        text = json.dumps({"id": self._count, "method": method, "params": parameters, **self._session})
        os.write(self._write, text.encode() + b"\0")
        while True:
            message = self._message()
            if message.get("id") == self._count:
                assert "error" not in message, message
                return message["result"]
            self._note(message)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            some = os.read(self._read, 1 << 20)
            assert some, "the browser has ended"
            self._rest += some
        text, _, self._rest = self._rest.partition(b"\0")
        return dict(json.loads(text))

    def _note(self, event: dict[str, Any]) -> None:
        given = event.get("params", {})
        if event["method"] == "Network.requestWillBeSent":
            self.asked.append(given["request"]["url"])
        elif event["method"] == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(given["exceptionDetails"]))
        elif event["method"] in ("Runtime.consoleAPICalled", "Log.entryAdded"):
            self.complaints.append(json.dumps(given))

    def open(self, path: Path, place: str = "") -> None:
        self.call("Page.navigate", url="about:blank")
        self.asked.clear()
        self.call("Page.navigate", url=f"{path.as_uri()}{place}")

    def value(self, expression: str) -> Any:
        """Of an expression in the page."""
        found = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, condition: str) -> None:
        """Until a condition holds in the page; a minute at most."""
        end = time.monotonic() + 60.0
        while not self.value(condition):
            assert time.monotonic() < end, f"{condition} never held; {self.complaints}"
            time.sleep(0.02)

    def press(self, key: str, times: int = 1) -> None:
        """A key, where the focus is."""
        for _ in range(times):
            for kind in ("keyDown", "keyUp"):
                self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=_KEYS[key])


_KEYS = {"ArrowRight": 39, "ArrowLeft": 37, "Tab": 9, "Home": 36, "End": 35}


@contextmanager
def opened(home: Path) -> Iterator[Page]:
    """A browser with an empty page; names of the network resolve to nothing."""
    assert BROWSER is not None
    quiet = ("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic")
    (its_read, write), (read, its_write) = os.pipe(), os.pipe()
    started = subprocess.Popen(
        ["bash", "-c", f'exec "$@" 3<&{its_read} 4>&{its_write}', "bash", BROWSER, "--headless", "--no-sandbox",
         "--disable-gpu", "--no-first-run", *quiet, "--host-resolver-rules=MAP * ~NOTFOUND",
         f"--user-data-dir={home}", "--remote-debugging-pipe", "about:blank"],
        pass_fds=(its_read, its_write), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(its_read)
    os.close(its_write)
    try:
        yield Page(read, write)
    finally:
        started.terminate()
        started.wait(30.0)
        os.close(read)
        os.close(write)
