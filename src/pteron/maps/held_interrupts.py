"""Ctrl-C held back while processes are started, which are not to hear it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread


@contextmanager
def held_interrupts() -> Iterator[None]:
    """Hold Ctrl-C back: here for so long, in processes that are started meanwhile for good.

    A process imports for seconds before it can be told to ignore it, and one that is broken off
    while it is started complains. Python's tracker of resources unblocks signals as it starts: it
    must run before, as it does once there is a pool of processes.
    """
    heard: list[int] = []
    usual = signal.getsignal(signal.SIGINT)
    # Signals are handled in the main thread alone; a handler that is not Python's stays.
    mine = usual is not None and current_thread() is main_thread()
    if mine:
        signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    masks = hasattr(signal, "pthread_sigmask")
    if masks:
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if mine:
            signal.signal(signal.SIGINT, usual)
        if heard:
            signal.raise_signal(signal.SIGINT)
