"""Steps that Ctrl-C may not cut in two: the signal waits until they are done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_HELD = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def held_back() -> Iterator[None]:
    """Hold interrupts back while the body runs; one that came is delivered at its end, to whom it was meant for.

    Signals reach the main thread alone: elsewhere there is nothing to hold.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []

    def remember(number: int, frame: FrameType | None) -> None:
        came.append(number)

    before = {number: signal.getsignal(number) for number in _HELD}
    # A handler that Python did not set (None) could not be put back.
    held = [number for number, handler in before.items() if handler is not None]
    try:
        for number in held:
            signal.signal(number, remember)
        yield
    finally:
        for number in held:
            signal.signal(number, before[number])
        for number in came[:1]:
            signal.raise_signal(number)
