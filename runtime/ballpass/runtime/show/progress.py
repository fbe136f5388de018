"""Progress of long calls: a bar on a terminal or in a notebook, nothing in pipes, logs and other processes.

A bar appears when a call has taken `PATIENCE`.  One shows at a time: calls within calls, and in other threads, are
silent, and so are those of a program that shows its own progress (`silent`).
"""

from __future__ import annotations

import contextvars
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from html import escape
from typing import Any

#: Function that is called with the finished fraction; False: no progress; None: a bar on a terminal or in a notebook;
#: True: a bar although `SWITCH` is 0.
Progress = Callable[[float], None] | bool | None

#: Time that a call takes before its bar appears, and between two pictures of the bar [s].
PATIENCE, REFRESH = 1.0, 0.2

#: Set to 0, bars appear only where a call asks for one.
SWITCH = "BALLPASS_PROGRESS"

_one_bar = threading.Lock()


@contextmanager
def shown(words: str, progress: Progress = None) -> Iterator[Callable[[float], None] | None]:
    """Context with the function to call with the finished fraction; None for none.

    Parameters
    ----------
    words : beside the bar: "simulating"
    progress : as the caller of a public function gave it
    """
    if callable(progress):
        yield progress
        return
    with shown_steps(words, progress) as tell:
        yield None if tell is None else partial(tell, words)


@contextmanager
def shown_steps(
    words: str, progress: Callable[[str, float], None] | bool | None = None
) -> Iterator[Callable[[str, float], None] | None]:
    """The same for calls with named stages: the function takes words and a finished fraction."""
    if callable(progress):
        yield progress
        return
    if not (_someone_looks() if progress is None else progress) or not _one_bar.acquire(blocking=False):
        yield None
        return
    try:
        late = _LateBar(words)
        try:
            yield late.tell
        finally:
            late.close()
    finally:
        _one_bar.release()


@contextmanager
def silent() -> Iterator[None]:
    """No bar appears within, for a program that has its own."""
    mine = _one_bar.acquire(blocking=False)
    try:
        yield
    finally:
        if mine:
            _one_bar.release()


def _someone_looks() -> bool:
    """Whether the output of this process is interactive, and progress is not switched off."""
    workers = sys.modules.get("multiprocessing")  # its import takes longer than a run
    if os.environ.get(SWITCH) == "0" or (workers is not None and workers.parent_process() is not None):
        return False
    return _notebook() is not None or (sys.stderr is not None and sys.stderr.isatty())


def _notebook() -> Any:
    """IPython's shell where it runs in a notebook; None elsewhere.  Never imports IPython."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell if hasattr(shell, "kernel") else None


class _LateBar:
    """A bar from `PATIENCE` on, drawn by its own thread: runs may report rarely, or very often."""

    def __init__(self, words: str) -> None:
        self._told: tuple[str, float | None] = (words, None)
        self._over = threading.Event()
        # the context holds the cell of a notebook that the bar belongs to
        self._thread = threading.Thread(target=contextvars.copy_context().run, args=(self._draw,), daemon=True)
        self._thread.start()

    def tell(self, words: str, done: float) -> None:
        self._told = (words, done)

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def _draw(self) -> None:
        if self._over.wait(PATIENCE):
            return
        bar = _TerminalBar() if _notebook() is None else _NotebookBar()
        while True:
            bar.show(*self._told)
            if self._over.wait(REFRESH):
                bar.close(self._told[0])
                return


class _TerminalBar:
    """A line on stderr that is gone when the call ends."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(bar_width=30))
        self._progress = Progress(
            *(*columns, TextColumn("{task.fields[percent]:>4}"), TimeElapsedColumn(), TimeRemainingColumn()),
            console=Console(stderr=True, emoji=False),
            auto_refresh=False,
            transient=True,
        )
        self._task = self._progress.add_task("", total=None, percent="")
        self._progress.start()

    def show(self, words: str, done: float | None) -> None:
        if done is not None:
            self._progress.update(self._task, total=1.0, completed=done, percent=f"{100.0 * done:.0f}%")
        self._progress.update(self._task, description=words, refresh=True)

    def close(self, _words: str) -> None:
        self._progress.stop()


class _NotebookBar:
    """A browser's own bar, which needs no extension; the time that the call took stays."""

    def __init__(self) -> None:
        from IPython.display import display

        self._begin, self._display, self._handle = time.perf_counter() - PATIENCE, display, None

    def show(self, words: str, done: float | None) -> None:
        value, percent = ("", "") if done is None else (f' value="{done:.4f}"', f"{100.0 * done:.0f} %, ")
        self._put(f"{words}: {percent}{self._seconds}", f'<progress{value} max="1"></progress> ')

    def close(self, words: str) -> None:
        self._put(f"{words}: {self._seconds}")

    @property
    def _seconds(self) -> str:
        return f"{time.perf_counter() - self._begin:.0f} s"

    def _put(self, text: str, bar: str = "") -> None:
        content = {"text/plain": text, "text/html": f"<small>{bar}{escape(text)}</small>"}
        if self._handle is None:
            self._handle = self._display(content, raw=True, display_id=True)
        else:
            self._handle.update(content, raw=True)
