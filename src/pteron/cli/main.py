"""The command `pteron`: its subcommands, and the exit code of each way to end."""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from io import StringIO
from textwrap import wrap
from traceback import walk_tb
from typing import Any

from typer import Abort, Context, Exit, Typer, echo, style
from typer.core import TyperGroup
from typer.main import get_command

from pteron.cli.arguments import Command, NumbersCommand, hide_flag_types
from pteron.cli.base_parameters import base, table1
from pteron.cli.calibrate import calibrate
from pteron.cli.choose import choose
from pteron.cli.cue import cue
from pteron.cli.cycle import cycle
from pteron.cli.design import design
from pteron.cli.excite import excite
from pteron.cli.export import export
from pteron.cli.film import film
from pteron.cli.identify import identify
from pteron.cli.interrupts import ended_with_compilers, insistent_interrupts
from pteron.cli.inverse_direct_forces import direct, forces, inverse
from pteron.cli.machines import catalog, check
from pteron.cli.new import new
from pteron.cli.options import help_of, parsed_command
from pteron.cli.play import play
from pteron.cli.report import report
from pteron.cli.result import CommandResult
from pteron.cli.simulate import simulate
from pteron.cli.size import size
from pteron.cli.terminal import complain, note
from pteron.cli.tune import tune
from pteron.cli.view import view
from pteron.cli.workspace import workspace
from pteron.errors import PteronError, UnlikelyValue

_FIRST = "pteron catalog, pteron view delta, pteron new delta --out robot.toml"
"""Commands with which a new user begins."""

_USER_ERROR = 2
"""Exit code for a user's error."""

_INTERRUPTED = 130
"""Exit code after Ctrl-C."""

_PIPE_CLOSED = 1
"""Exit code where a program that reads the output has ended."""


class CommandGroup(TyperGroup):
    """All subcommands; errors become lines on standard error and exit codes."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options | {"commands": Commands()})

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, flags without a type in the help."""
        return hide_flag_types(super().get_params(ctx))

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write what the commands do, a line each in groups: all of it is to fit one screen."""
        lines = ["Usage: pteron COMMAND ...; pteron COMMAND --help explains a command.", ""]
        lines += [*wrap(" ".join((self.help or "").split()), formatter.width), ""]
        for panel, functions in _COMMANDS.items():
            lines.append(style(panel, bold=True))
            lines += [f"  {f.__name__:<10}{_clause(f.__doc__ or '')}" for f in functions]
        options = ", ".join(parameter.opts[0] for parameter in self.get_params(ctx))
        end = f"Options: {options}", f"Begin with: {_FIRST}"
        formatter.write("\n".join([*lines, "", *end, ""]))

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run a subcommand and exit."""
        _open_closed_streams()
        try:
            with insistent_interrupts(), ended_with_compilers(), warnings.catch_warnings():
                warnings.showwarning = _note_warnings
                warnings.simplefilter("default", UnlikelyValue)
                status = super().main(*args, **extra | {"standalone_mode": False})
                sys.stdout.flush()
            if status == _INTERRUPTED:  # Typer has caught it
                raise KeyboardInterrupt
        except PteronError as error:
            complain(str(error))
            status = _USER_ERROR
        except BrokenPipeError:
            _close_standard_output()
            status = _PIPE_CLOSED
        except OSError as error:
            where = error.filename or ("standard output" if _is_output_error(error) else "")
            complain(f"{where}{': ' * bool(where)}{error.strerror or error}")
            _close_standard_output()
            status = _USER_ERROR
        except MemoryError as error:
            complain(f"there is not enough memory: {str(error) or 'ask for less at once'}")
            status = _USER_ERROR
        except (Abort, KeyboardInterrupt):
            note("Interrupted")
            status = _INTERRUPTED
        except Exception as error:
            # Typer's own errors have moved between modules; their method has kept its name.
            if not hasattr(error, "format_message"):
                raise
            complain(_usage(error))
            status = _USER_ERROR
        sys.exit(status if isinstance(status, int) else 0)


def _clause(docstring: str) -> str:
    """Return the first clause of a docstring, as a sentence."""
    return f"{re.split('[:;,.]', docstring, maxsplit=1)[0]}."


def _note_warnings(message: Warning | str, category: type[Warning], *place: Any, **_: Any) -> None:
    """Print a warning as a note, one of arithmetic in words; in Python's format under `-W`."""
    if issubclass(category, UnlikelyValue):
        note(f"Note: {message}")
    elif sys.warnoptions:
        sys.stderr.write(warnings.formatwarning(message, category, *place[:2]))
    elif issubclass(category, RuntimeWarning):
        note(
            f"Note: a number was not finite on the way ({message}); results may be wrong: are all "
            "values in m, rad, kg and s?"
        )
    else:
        note(f"Note: {message}")


def _is_output_error(error: OSError) -> bool:
    """Return whether an error was raised by what writes to standard output, as on a full disk."""
    modules = [frame.f_globals.get("__name__", "") for frame, _ in walk_tb(error.__traceback__)]
    return "pteron.cli.terminal" in modules or modules[-1].partition(".")[0] in ("rich", "click")


def _open_closed_streams() -> None:
    """Discard output to a stream that the caller has closed (``>&-``)."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, StringIO())


def _usage(error: Any) -> str:
    """Return a usage error's message in a single line that names the command's `--help`."""
    message = " ".join(str(error.format_message()).split()).rstrip(".")
    message = message.replace("Value error, ", "")
    context = getattr(error, "ctx", None)
    if context is None:
        return message
    joint = " See" if message.endswith("?") else "; see"
    return f"{message}{joint} {context.command_path} --help"


def _close_standard_output() -> None:
    """Redirect standard output to the null device, so that Python's last flush cannot fail."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


_LOOKS: dict[str, Any] = {"rich_markup_mode": "rich", "pretty_exceptions_enable": False}

app = Typer(name="pteron", cls=CommandGroup, **_LOOKS)


_COMMANDS: dict[str, tuple[Callable[..., CommandResult | None], ...]] = {
    "Machines": (catalog, new, check, report),
    "See it": (view, play, film, workspace),
    "Compute": (inverse, direct, forces, base, table1),
    "Move": (cycle, cue, simulate, size, tune),
    "Design": (choose, design),
    "From a log to a controller": (calibrate, excite, identify, export),
}
"""The subcommands of each panel of the help."""

_NUMERIC = (inverse, direct, forces, cycle, cue)
"""Subcommands whose arguments may be negative numbers."""

_GENERAL = (check, report, workspace, base, table1, export)
"""Subcommands that one repeats after editing a number of a machine's file."""


class Commands(Mapping[str, Any]):
    """The subcommands by name, each created on first use."""

    def __init__(self) -> None:
        self._panels = {f.__name__: (panel, f) for panel, fs in _COMMANDS.items() for f in fs}
        self._made: dict[str, Any] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._panels)

    def __len__(self) -> int:
        return len(self._panels)

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            panel, function = self._panels[name]
            cls = NumbersCommand if function in _NUMERIC else Command
            command = parsed_command(function, general=function in _GENERAL)
            alone = Typer(add_completion=False, **_LOOKS)
            alone.command(cls=cls, rich_help_panel=panel, **help_of(command))(command)
            self._made[name] = get_command(alone)
        return self._made[name]


def pteron(context: Context, *, version: bool = False) -> None:
    """Kinematics, dynamics and base parameters of parallel manipulators (Delta, hexapod, ...).

    Quantities are in SI units and radians. Tables go to a pipe or a file as CSV; --json prints data
    for programs.

    Options
    -------
    --version: Print the version and exit.
    """
    if version:
        from pteron import __version__

        echo(f"pteron {__version__}")
        raise Exit
    if context.invoked_subcommand is None:
        echo(context.get_help())
        raise Exit


app.callback(invoke_without_command=True, **help_of(pteron))(pteron)


def main() -> None:
    """Run the command line."""
    app()
