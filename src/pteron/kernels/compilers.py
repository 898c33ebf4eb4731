"""Running of compilers as subprocesses, which another thread can end with all that they started."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from pteron.errors import ModelError

_RUNNING: set[subprocess.Popen[str]] = set()
"""Subprocesses that run now; guarded by `_CHANGES`."""

_CHANGES = threading.RLock()
"""Reentrant: a signal may come while it is held."""


def _begin_in_a_fork() -> None:
    """Reset lock and list of running compilers in a forked process."""
    global _CHANGES
    _CHANGES = threading.RLock()
    _RUNNING.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_in_a_fork)


def run(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; return its exit code, output and errors."""
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
        with process:  # which closes its pipes where Ctrl-C ends this
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


def compile_library(
    command: Sequence[str],
    flags: Iterable[str],
    sources: Mapping[str, str],
    library: Path,
    what: str,
    advice: str,
) -> None:
    """Write source files beside `library` and compile the C files into it.

    Raises
    ------
    ModelError
        If that fails: `what` could not be compiled, and `advice` says what to do.
    """
    for name, text in sources.items():
        (library.parent / name).write_text(text, encoding="utf-8")
    files = [str(library.parent / name) for name in sources if name.endswith(".c")]
    done = run([*command, *flags, *files, "-o", str(library), "-lm"])
    if done.returncode != 0 or not library.exists():
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}, no library"]
        failure = f"{what} could not be compiled with {' '.join(command)}: {lines[0]}"
        raise ModelError(f"{failure}; {advice}")


def end_all() -> None:
    """Kill all running compilers and the processes they started."""
    with _CHANGES:
        for process in _RUNNING:
            _end(process)


def _end(process: subprocess.Popen[str]) -> None:
    """Kill a compiler and its process group; on Windows the compiler alone."""
    with suppress(OSError):
        if sys.platform == "win32":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)
