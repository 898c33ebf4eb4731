"""The command `pteron`: its subcommands, and the exit code that each ends with."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from inspect import cleandoc
from io import StringIO
from typing import Annotated, Any

from typer import Abort, Context, Exit, Option, Typer, echo
from typer.core import TyperGroup

from pteron.cli.arguments import Command, NumbersCommand, without_types
from pteron.cli.base_parameters import base, table1
from pteron.cli.cue import cue
from pteron.cli.cycle import cycle
from pteron.cli.design import design
from pteron.cli.excite import excite
from pteron.cli.export import export
from pteron.cli.film import film
from pteron.cli.identify import identify
from pteron.cli.interrupts import insistent_interrupts
from pteron.cli.inverse_direct_forces import direct, forces, inverse
from pteron.cli.machines import catalog, check, new
from pteron.cli.play import play
from pteron.cli.report import report
from pteron.cli.simulate import simulate
from pteron.cli.size import size
from pteron.cli.terminal import complain, note
from pteron.cli.view import view
from pteron.cli.workspace import workspace
from pteron.errors import PteronError

_USER_ERROR = 2
"""Exit code for a user's error."""

_INTERRUPTED = 130
"""Exit code after Ctrl-C."""

_PIPE_CLOSED = 1
"""Exit code where a program that reads the output has ended."""


class CommandGroup(TyperGroup):
    """All subcommands; errors become lines on standard error and exit codes."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, flags without a type in the help."""
        return without_types(super().get_params(ctx))

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run a subcommand and exit."""
        _open_closed_streams()
        try:
            with insistent_interrupts():
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
            where = error.filename or "standard output"
            complain(f"{where}: {error.strerror or error}")
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


def _open_closed_streams() -> None:
    """Discard output to a stream that the caller has closed (``>&-``)."""
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
    """Discard Python's last flush: the reader of the output has left, or its disk is full."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


app = Typer(
    name="pteron", cls=CommandGroup, rich_markup_mode="rich", pretty_exceptions_enable=False
)


_COMMANDS: dict[str, tuple[Callable[..., None], ...]] = {
    "Machines": (catalog, new, check, report),
    "See it": (view, play, film, workspace),
    "Compute": (inverse, direct, forces, base, table1),
    "Move": (cycle, cue, simulate, size),
    "Design": (design,),
    "From a log to a controller": (excite, identify, export),
}
"""The subcommands of each panel of the help."""

_NUMERIC = (inverse, direct, forces, cycle)
"""Subcommands whose arguments may be negative numbers."""

_EXAMPLES = """\
pteron catalog --json
pteron new
pteron new delta --out robot.toml
pteron check robot.toml
pteron report quadrupteron --out report
pteron report quadrupteron --motion motion.csv --out report
pteron view delta
pteron view quadrupteron --motion adept --payload 0.5
pteron view robot.toml --motion log.csv --port 9000 --no-browser
pteron play quadrupteron
pteron play quadrupteron motion.csv --out motion.html
pteron play my-robot.toml log.parquet --out log.html
pteron film delta -o cycle.mp4
pteron film quadrupteron --speed 0.4 --forces --turns 0.5 -o slow.mp4
pteron film robot.toml --cycle motion.csv --size 640x480 -o motion.gif
pteron workspace delta
pteron workspace quadrupteron --index kappa --slice z=0,phi=0 --out kappa.png
pteron workspace quadrupteron --index condition --slice phi=0 --out condition.vtk
pteron workspace robot.toml --index kappa --slice z=0 --points 400 --out kappa.zarr
pteron workspace delta --certify
pteron workspace delta --prove x=-0.2:0.2,y=-0.2:0.2,z=-1.0:-0.8
pteron inverse quadrupteron 0.01 0.02 -0.03 0.1
pteron inverse tripteron --table poses.csv --out joints.csv
pteron direct quadrupteron 0.03 0.02 0.01 0.02
pteron direct quadrupteron --table log.csv --out poses.parquet
pteron forces quadrupteron --pose 0.01 0.02 -0.03 0.1 --velocity 0 0 0.5 0
pteron forces quadrupteron --table motion.csv --out forces.csv
pteron base quadrupteron --symbols
pteron base quadrupteron --keep I_l1,m_l4 --format latex
pteron table1
pteron cycle quadrupteron
pteron cycle my-robot.toml --optimal --force 60 --payload 0.5 --out cycle.csv
pteron cycle tripteron --to 0.1 0 0.05 --back --acceleration 10 --out line.csv
pteron cycle delta --via poses.csv --corner 0.02 --duration 2 --out path.csv
pteron cue drive.csv --robot simulator.toml --out cue.csv
pteron cue flight.csv --robot simulator.toml --scale 0.3 --page cue.html
pteron simulate delta --payload 1.0
pteron simulate robot.toml --controller adaptive --model drawing.toml --cycles 10 --out run
pteron simulate quadrupteron --cycle motion.csv --encoder 1e-6 --delay 5e-4 --out run.csv
pteron size delta --payload 1.0
pteron size robot.toml --motors motors.csv --dwell 0.2 --out sizing
pteron size quadrupteron --cycle motion.csv --out sizing.csv
pteron design search.toml --out best
pteron design search.toml --out best --seed 7 --workers 4
pteron design search.toml --out all --sweep 100000 --scheduler tcp://host:8786
pteron excite quadrupteron --out exciting.csv
pteron excite my-robot.toml --out exciting.csv --period 5 --speed 0.5 --force 60
pteron excite delta --out exciting.csv --angle-unit deg --time-unit ms --decimal ,
pteron identify log.csv --robot quadrupteron --out identified
pteron identify a.csv b.csv --held-out c.csv --robot my-robot.toml --out identified
pteron export quadrupteron --c controller
pteron export my-robot.toml --c controller --float --function inverse_kinematics
pteron export quadrupteron --st plc
pteron export quadrupteron --fmu models
pteron export linear-delta --klipper printer
pteron export robot.toml --base result/identification.json --c controller
"""

_FIRST_EXAMPLES = """\
pteron catalog
pteron new delta --out robot.toml
pteron report quadrupteron --out report
pteron inverse quadrupteron 0.01 0.02 -0.03 0.1
"""


def _examples(lines: str, command: str = "") -> str:
    """Return the end of a help: the lines for a subcommand, or all."""
    own = [line for line in lines.splitlines() if line.split()[1] == command or not command]
    return "\n\n".join(["[bold]Examples[/bold]", *own])


@app.callback(invoke_without_command=True, epilog=_examples(_FIRST_EXAMPLES))
def pteron(
    context: Context,
    version: Annotated[bool, Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Kinematics, dynamics and base parameters of parallel manipulators (Quadrupteron, Delta, ...).

    SI units and radians everywhere.
    """
    if version:
        from pteron import __version__

        echo(f"pteron {__version__}")
        raise Exit
    if context.invoked_subcommand is None:
        echo(context.get_help())
        raise Exit


for _panel, _functions in _COMMANDS.items():
    for _function in _functions:
        # One line a paragraph, for the terminal to cut.
        _text = cleandoc(_function.__doc__ or "").split("\n\n")
        app.command(
            cls=NumbersCommand if _function in _NUMERIC else Command,
            help="\n\n".join(" ".join(part.split()) for part in _text),
            epilog=_examples(_EXAMPLES, _function.__name__),
            rich_help_panel=_panel,
        )(_function)


def main() -> None:
    """Run the command line."""
    app()
