"""Progress of long calls: a bar where somebody looks, nothing elsewhere, and calls that end as before."""

from __future__ import annotations

import io
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.app.commands import shared
from ballpass.runtime.many import ensemble
from ballpass.runtime.quantity.quantity_run import EvaluatedQuantities, QuantityRun
from ballpass.runtime.show import progress
from ballpass.runtime.show.progress import shown, shown_steps, silent

SCRIPT = """
import sys, time
from ballpass.runtime.show import progress
progress.PATIENCE, progress.REFRESH = 0.02, 0.02
with progress.shown("simulating") as tell:
    print("told" if tell else "silent", flush=True)
    for k in range(int(sys.argv[1])):
        time.sleep(0.02)
        if tell:
            tell((k + 1) / 20)
print("done")
"""


def on_terminal(count: int, interrupt: bool = False, **environment: str) -> tuple[int, str, str]:
    """Exit code, stdout, and what a terminal was sent as stderr."""
    ours, theirs = pty.openpty()
    how: dict[str, Any] = {"env": {**os.environ, "TERM": "xterm", **environment}, "text": True}
    child = subprocess.Popen([sys.executable, "-c", SCRIPT, str(count)], stdout=subprocess.PIPE, stderr=theirs, **how)
    os.close(theirs)
    said: list[bytes] = []

    def read() -> None:
        asked = not interrupt
        try:
            while part := os.read(ours, 4096):
                said.append(part)
                if not asked and b"25%" in b"".join(said):
                    child.send_signal(signal.SIGINT)  # once: where Python ends already, another is a traceback more
                    asked = True
        except OSError:  # the other side is closed
            pass

    reader = threading.Thread(target=read)
    reader.start()
    out, _ = child.communicate(timeout=60)
    reader.join()
    os.close(ours)
    return child.returncode, out, b"".join(said).decode()


def test_a_terminal_shows_a_bar_that_goes_away() -> None:
    code, out, said = on_terminal(20)
    assert (code, out.split()) == (0, ["told", "done"])
    assert "simulating" in said
    percents = [int(number) for number in re.findall(r"(\d+)%", said)]
    assert percents == sorted(percents)
    assert len(set(percents)) > 3
    assert said.rstrip().endswith("\x1b[2K")  # the line is erased


def test_an_interrupt_ends_a_call_with_a_bar() -> None:
    begin = time.perf_counter()
    code, out, said = on_terminal(100_000, interrupt=True)
    assert code in (-signal.SIGINT, 130)
    assert "done" not in out
    assert said.count("KeyboardInterrupt") == 1
    assert time.perf_counter() - begin < 30


def test_a_bar_can_be_turned_off_and_short_calls_show_none() -> None:
    assert on_terminal(3, BALLPASS_PROGRESS="0")[1:] == ("silent\ndone\n", "")
    assert on_terminal(0)[1:] == ("told\ndone\n", "")


def test_pipes_and_logs_get_nothing() -> None:
    child = subprocess.run([sys.executable, "-c", SCRIPT, "5"], capture_output=True, text=True, check=True)
    assert (child.stdout, child.stderr) == ("silent\ndone\n", "")


def test_a_command_in_a_pipe_writes_how_far_a_long_stage_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr(shared, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    with shared.Stages() as stages:
        stages("simulating")
        for second in range(1, 31):
            now[0] = float(second)
            stages.fraction(second / 40)
    lines = [line.strip() for line in capsys.readouterr().err.splitlines()]
    assert lines == ["0.0 s  simulating", *(f"{s}.0 s  simulating, {100 * s // 40} %" for s in (10, 20, 30))]


def test_one_bar_shows_at_a_time() -> None:
    with shown("outer", True) as outer, shown("inner", True) as inner:
        assert outer is not None
        assert inner is None
    with silent(), shown("within a program", True) as tell:
        assert tell is None
    with shown("again", True) as tell:
        assert tell is not None
    seen: list[float] = []
    with shown("told by a caller", seen.append) as tell:
        assert tell is not None
        tell(0.5)
    with shown("asked for none", False) as tell:
        assert tell is None
    assert seen == [0.5]


def test_a_notebook_gets_a_bar_that_leaves_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    shown_there: list[dict[str, str]] = []

    def display(content: dict[str, str], *, raw: bool, display_id: bool = False) -> Any:
        shown_there.append(content)
        return SimpleNamespace(update=display)

    ipython, module = ModuleType("IPython"), ModuleType("IPython.display")
    ipython.get_ipython = lambda: SimpleNamespace(kernel=None)  # type: ignore[attr-defined]
    module.display = display  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    monkeypatch.setattr(progress, "PATIENCE", 0.01)
    monkeypatch.setattr(progress, "REFRESH", 0.01)
    monkeypatch.delenv("BALLPASS_PROGRESS", raising=False)
    with shown_steps("first") as tell:
        assert tell is not None
        while not shown_there:
            time.sleep(0.01)
        tell("<second>", 0.25)
        while 'value="0.2500"' not in shown_there[-1]["text/html"]:
            time.sleep(0.01)
    assert re.fullmatch(r"first: \d+ s", shown_there[0]["text/plain"])
    assert '<progress max="1">' in shown_there[0]["text/html"]
    assert re.fullmatch(r"<second>: \d+ s", shown_there[-1]["text/plain"])
    assert re.fullmatch(r"<small>&lt;second&gt;: \d+ s</small>", shown_there[-1]["text/html"])


def test_an_interrupt_between_the_runs_of_a_call_is_no_result(press: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """Differences are interrupted, or the second ensemble: what was not run is neither a derivative nor a verdict."""
    plain, measure, calls = ensemble.run_chunks, QuantityRun.measure, []

    def interrupted_run(*given: Any) -> EvaluatedQuantities:
        calls.append(True)
        if len(calls) == 7:
            raise KeyboardInterrupt
        return measure(*given)

    def interrupted(*given: Any) -> bool:
        calls.append(plain(*given))
        return len(calls) == 2

    with monkeypatch.context() as patched:
        patched.setattr(QuantityRun, "measure", interrupted_run)
        with pytest.raises(KeyboardInterrupt):
            press.sensitivity("rms:inner.y", "bearing.clearance", cycles=1, transient=0.5)
    calls.clear()
    monkeypatch.setattr(ensemble, "run_chunks", interrupted)
    table = {"bearing.clearance": [5e-6, 8e-6]}
    found = press.simulate_many(table, "rms:inner.y", cycles=1, transient=0.5, uncertainty=True)
    assert found.interrupted
    assert len(calls) == 2


def test_a_bar_changes_no_bit(rotor: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    runs = [rotor.simulate(cycles=25, progress=shown_or_not) for shown_or_not in (False, True)]
    np.testing.assert_array_equal(runs[0].x, runs[1].x)


def test_a_stage_without_fractions_says_that_it_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A first compilation of a page's solver was silent for a minute."""
    monkeypatch.setattr(shared, "QUIET", 0.05)
    with shared.Stages() as stages:
        stages("compiling")
        time.sleep(0.4)
    said = capsys.readouterr().err
    assert said.count("still compiling") >= 2
    time.sleep(0.1)
    assert capsys.readouterr().err == ""  # nothing comes after the end
