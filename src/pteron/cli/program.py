"""How the command line ends: with an exit code and, if it fails, with one line and no traceback."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from io import StringIO
from typing import Any

from typer.core import TyperGroup

from pteron.cli.interrupts import insistent_interrupts
from pteron.cli.screen import complain
from pteron.errors import PteronError

__all__ = ["Program"]

USER_ERROR = 2
INTERRUPTED = 130
PIPE_CLOSED = 1


class Program(TyperGroup):
    """The group of all subcommands; it turns errors into lines and exit codes."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run a subcommand and exit; `standalone_mode` is always on."""
        _open_closed_streams()
        try:
            with insistent_interrupts():
                status = super().main(
                    args, prog_name, complete_var, False, windows_expand_args, **extra
                )
                sys.stdout.flush()
        except PteronError as error:
            complain(str(error))
            status = USER_ERROR
        except BrokenPipeError:
            _close_standard_output()
            status = PIPE_CLOSED
        except OSError as error:
            where = error.filename or "standard output"
            complain(f"{where}: {error.strerror or error}")
            _close_standard_output()
            status = USER_ERROR
        except KeyboardInterrupt:
            status = INTERRUPTED
        except Exception as error:
            # Typer's own errors have moved between modules; their method has kept its name.
            if not hasattr(error, "format_message"):
                raise
            complain(_usage(error))
            status = USER_ERROR
        sys.exit(status if isinstance(status, int) else 0)


def _open_closed_streams() -> None:
    """Let what is printed go nowhere if the caller has closed the stream (``>&-``)."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, StringIO())


def _usage(error: Any) -> str:
    message = " ".join(str(error.format_message()).split()).rstrip(".")
    message = message.replace("Value error, ", "")
    context = getattr(error, "ctx", None)
    if context is None:
        return message
    joint = " See" if message.endswith("?") else "; see"
    return f"{message}{joint} {context.command_path} --help"


def _close_standard_output() -> None:
    """Send Python's last flush nowhere: who read the output has left, or its disk is full."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
