"""Ctrl-C that is never lost, wherever the program is when it comes."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from pteron.errors import PteronError

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

_AGAIN = 0.02
"""Seconds until an interrupt that was discarded, or must wait, comes again."""

_WAITS = 10
"""Times that an interrupt waits for a call of CasADi to end; a longer call looks for it itself."""


@contextmanager
def insistent_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt again, in a block, where Python or a library discarded it.

    Python runs the handler of a signal between any two steps of the main thread, also in a callback
    of the garbage collector or of a weak reference. An exception there is printed and dropped: the
    work would go on to its end. CasADi, too, drops exceptions while it looks which form of a
    function fits its arguments; an interrupt in such a call comes again when that is over. An
    extension that is interrupted while it is imported, or calls Python, may report an error of its
    own instead, such as an ImportError.
    """
    usual, waits, raised = sys.unraisablehook, 0, False
    timer = threading.Timer(_AGAIN, _interrupt)

    def again() -> None:
        """Start a timer that raises the interrupt again, unless it runs."""
        nonlocal timer
        if not timer.is_alive():
            timer = threading.Timer(_AGAIN, _interrupt)
            timer.daemon = True
            timer.start()

    def hook(args: UnraisableHookArgs) -> None:
        """Handle an exception that Python discards: raise an interrupt again, print all others."""
        if issubclass(args.exc_type, KeyboardInterrupt):
            again()  # not at once: that would still be inside the callback
        else:
            usual(args)

    def handler(number: int, frame: FrameType | None) -> None:
        """Handle SIGINT: try again later within CasADi, a few times, else raise an interrupt."""
        nonlocal waits, raised
        waits += 1
        if waits <= _WAITS and _is_in_casadi(frame):
            again()
        else:
            waits, raised = 0, True
            timer.cancel()
            signal.default_int_handler(number, frame)

    # A shell has programs in the background ignore Ctrl-C, and only the main thread may choose.
    ours = (
        signal.getsignal(signal.SIGINT) is signal.default_int_handler
        and threading.current_thread() is threading.main_thread()
    )
    sys.unraisablehook = hook
    if ours:
        signal.signal(signal.SIGINT, handler)
    try:
        yield
    except (PteronError, OSError):
        raise
    except Exception as error:
        if raised or isinstance(error.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise
    finally:
        timer.cancel()
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.unraisablehook = usual


@contextmanager
def ended_with_compilers() -> Iterator[None]:
    """On SIGTERM, end the compilers that the process started, then the process itself."""
    ours = (
        signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
        and threading.current_thread() is threading.main_thread()
    )
    if ours:
        signal.signal(signal.SIGTERM, _end)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _end(number: int, _: FrameType | None) -> None:
    """End the compilers, then this process as the signal would have ended it."""
    from pteron.kernels.compilers import end_all

    end_all()
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)


def _interrupt() -> None:
    """Interrupt the main thread, and on POSIX the system call in which it waits."""
    main = threading.main_thread().ident
    if os.name == "posix" and main is not None:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()


def _is_in_casadi(frame: FrameType | None) -> bool:
    """Return whether a CasADi function is running."""
    while frame is not None:
        if frame.f_globals.get("__name__") == "casadi.casadi":
            return True
        frame = frame.f_back
    return False
