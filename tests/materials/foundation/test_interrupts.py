"""Ctrl-C waits for what may not be cut in two, and is not lost."""

from __future__ import annotations

import signal
import threading

import pytest

from materials.foundation.interrupts import held_back


def interrupted(done: list[str], times: int = 1, error: Exception | None = None) -> None:
    """Be interrupted in the middle of something."""
    with held_back():
        for _ in range(times):
            signal.raise_signal(signal.SIGINT)
        done.append("whole")
        if error is not None:
            raise error


def test_an_interrupt_is_delivered_after_the_body_and_not_within():
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        interrupted(done)
    assert done == ["whole"]


def test_many_interrupts_are_one_and_none_is_left_over():
    with pytest.raises(KeyboardInterrupt):
        interrupted([], times=3)
    with held_back():
        pass


def test_handlers_are_put_back_whatever_the_body_does():
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        with pytest.raises(ValueError, match="broken"):
            interrupted([], error=ValueError("broken"))
        assert heard == [signal.SIGINT]
        signal.raise_signal(signal.SIGINT)
        assert heard == [signal.SIGINT] * 2
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_have_no_signals_to_hold():
    done = []

    def work():
        with held_back():
            done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]
