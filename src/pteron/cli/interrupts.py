"""Ctrl-C that is never lost, wherever the program is when it comes."""

from __future__ import annotations

import _thread
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

_AGAIN = 0.02
"""Seconds until an interrupt that was discarded is raised again."""


@contextmanager
def insistent_interrupts() -> Iterator[None]:
    """Raise an interrupt from the keyboard again if it was raised where errors are discarded.

    Python runs the handler of a signal between any two steps of the main thread, also in a callback
    of the garbage collector or of a weak reference. What is raised there is printed and dropped:
    the work would go on to its end. An extension that is interrupted while it is imported reports
    an ImportError instead, whose cause is the interrupt.
    """
    usual = sys.unraisablehook

    def hook(args: UnraisableHookArgs) -> None:
        if not issubclass(args.exc_type, KeyboardInterrupt):
            usual(args)
            return
        # Not at once: that would still be inside the callback.
        again = Timer(_AGAIN, _thread.interrupt_main)
        again.daemon = True
        again.start()

    sys.unraisablehook = hook
    try:
        yield
    except ImportError as error:
        if isinstance(error.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise
    finally:
        sys.unraisablehook = usual
