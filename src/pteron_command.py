"""The command `pteron` before its package is imported: Ctrl-C ends it quietly from the start.

It stands outside the package: importing anything inside loads NumPy and CasADi first.
"""

from __future__ import annotations

import os
import signal
from types import FrameType
from typing import NoReturn

_INTERRUPTED = 130


def main() -> None:
    """Run the command line."""
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


def _leave(number: int = signal.SIGINT, frame: FrameType | None = None) -> NoReturn:
    os.write(2, b"Interrupted\n")
    os._exit(_INTERRUPTED)
