"""The command `pteron` before its package is imported: Ctrl-C ends it quietly from the start.

It stands outside the package, whose import takes a while already.
"""

from __future__ import annotations

import gc
import os
import signal
from types import FrameType
from typing import NoReturn

_INTERRUPTED = 130

_THREADS = "OPENBLAS_NUM_THREADS"
"""Read once, when NumPy is imported."""

_PLUGINS = "PYDANTIC_DISABLE_PLUGINS"
"""Read when Pydantic makes its first model: it would look for plugins in all that is installed."""

_ALIVE = 1_000_000
"""Objects made before Python looks for cycles among them: imports make many, and no garbage."""


def main() -> None:
    """Run the command line."""
    # Matrices are small: more threads wait more than they work, and add up in another order.
    os.environ.setdefault(_THREADS, "1")
    os.environ.setdefault(_PLUGINS, "__all__")
    gc.set_threshold(_ALIVE, *gc.get_threshold()[1:])
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        # An exception would be lost, or become an ImportError, in what is written in C.
        signal.signal(signal.SIGINT, _leave)
    from pteron.cli.main import main as run

    try:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        _leave()
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        # `python -m` ends by the signal, whatever the exit code, where the last text that was
        # executed, as dataclasses do, was interrupted.
        exec("")
        # What is left is freed with the process: Python need not look for cycles in it as it ends.
        gc.freeze()


def _leave(number: int = signal.SIGINT, frame: FrameType | None = None) -> NoReturn:
    os.write(2, b"Interrupted\n")
    os._exit(_INTERRUPTED)
