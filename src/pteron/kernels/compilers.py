"""Running of compilers as subprocesses, which another thread can end with all that they started."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress

_RUNNING: set[subprocess.Popen[str]] = set()
"""Subprocesses that run now; guarded by `_CHANGES`."""

_CHANGES = threading.Lock()


def run(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, and return its code and what it printed."""
    # Messages may be in any language and encoding; what cannot be read of them does not matter.
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        # A group of its own, where there are groups: a compiler starts others, which end with it.
        process_group=0,
    )
    with _CHANGES:
        _RUNNING.add(process)
    try:
        out, error = process.communicate()
    except BaseException:
        _end(process)
        process.wait()
        raise
    finally:
        with _CHANGES:
            _RUNNING.discard(process)
    return subprocess.CompletedProcess(command, process.returncode, out, error)


def end_all() -> None:
    """End every command that runs, with all that it started."""
    with _CHANGES:
        for process in _RUNNING:
            _end(process)


def _end(process: subprocess.Popen[str]) -> None:
    with suppress(OSError):
        if sys.platform == "win32":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)
