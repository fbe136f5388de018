"""Interrupts (Ctrl-C) at moments that cannot bear one: held back, and raised behind.

Python raises `KeyboardInterrupt` between any two instructions of the main thread: also where a process was started and
nobody knows its number yet.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Hold an interrupt that arrives within until the end, which must be near; then it takes its usual way.

    In other threads than the main one, which never hear interrupts, and where interrupts are ignored, this does
    nothing.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    arrived: list[FrameType | None] = []
    signal.signal(signal.SIGINT, lambda _number, frame: arrived.append(frame))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if arrived:
            before(signal.SIGINT, arrived[0])
