"""Ctrl-C that is never lost, wherever the program is when it comes."""

from __future__ import annotations

import _thread
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

from pteron.errors import PteronError

if TYPE_CHECKING:
    from sys import UnraisableHookArgs
    from types import FrameType

_AGAIN = 0.02
"""Seconds until an interrupt that was discarded is raised again."""


@contextmanager
def insistent_interrupts() -> Iterator[None]:
    """Raise an interrupt from the keyboard again if it was raised where errors are discarded.

    Python runs the handler of a signal between any two steps of the main thread, also in a callback
    of the garbage collector or of a weak reference. What is raised there is printed and dropped:
    the work would go on to its end. An extension that is interrupted while it is imported, or calls
    Python, may report an error of its own instead, such as an ImportError.
    """
    usual, heard = sys.unraisablehook, []
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler

    def handler(number: int, frame: FrameType | None) -> None:
        heard.append(number)
        signal.default_int_handler(number, frame)

    def hook(args: UnraisableHookArgs) -> None:
        if not issubclass(args.exc_type, KeyboardInterrupt):
            usual(args)
            return
        # Not at once: that would still be inside the callback.
        again = Timer(_AGAIN, _thread.interrupt_main)
        again.daemon = True
        again.start()

    sys.unraisablehook = hook
    if ours:
        signal.signal(signal.SIGINT, handler)
    try:
        yield
    except (PteronError, OSError):
        raise
    except Exception as error:
        if heard or isinstance(error.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise
    finally:
        sys.unraisablehook = usual
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
