"""The command `pteron` and the list of its subcommands."""

from __future__ import annotations

from collections.abc import Callable
from inspect import cleandoc
from typing import Annotated

from typer import Context, Exit, Option, Typer, echo
from typer.core import TyperCommand

from pteron.cli.base import base
from pteron.cli.catalog import catalog
from pteron.cli.check import check
from pteron.cli.direct import direct
from pteron.cli.excite import excite
from pteron.cli.export import export
from pteron.cli.forces import forces
from pteron.cli.identify import identify
from pteron.cli.inverse import inverse
from pteron.cli.numbers import NumbersCommand
from pteron.cli.program import Program
from pteron.cli.report import report
from pteron.cli.table1 import table1

__all__ = ["app", "main"]

app = Typer(
    name="pteron",
    cls=Program,
    rich_markup_mode="rich",
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _paragraphs(text: str | None) -> str:
    """Return a docstring with one line a paragraph, for the terminal to cut."""
    return "\n\n".join(" ".join(part.split()) for part in cleandoc(text or "").split("\n\n"))


def _examples(*lines: str) -> str:
    return "\n\n".join(["[bold]Examples[/bold]", *lines])


def _add(
    function: Callable[..., None], *examples: str, cls: type[TyperCommand] = TyperCommand
) -> None:
    app.command(cls=cls, help=_paragraphs(function.__doc__), epilog=_examples(*examples))(function)


@app.callback(
    invoke_without_command=True,
    epilog=_examples(
        "pteron catalog",
        "pteron report quadrupteron --out report",
        "pteron inverse quadrupteron 0.01 0.02 -0.03 0.1",
    ),
)
def pteron(
    context: Context,
    version: Annotated[bool, Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Kinematics, dynamics and base parameters of parallel manipulators (Quadrupteron, Tripteron).

    SI units and radians everywhere.
    """
    if version:
        from pteron import __version__

        echo(f"pteron {__version__}")
        raise Exit
    if context.invoked_subcommand is None:
        echo(context.get_help())
        raise Exit


_add(catalog, "pteron catalog --json")
_add(check, "pteron check my-robot.toml")
_add(report, "pteron report quadrupteron --out report")
_add(
    inverse,
    "pteron inverse quadrupteron 0.01 0.02 -0.03 0.1",
    "pteron inverse tripteron --table poses.csv --out sliders.csv",
    cls=NumbersCommand,
)
_add(
    direct,
    "pteron direct quadrupteron 0.03 0.02 0.01 0.02",
    "pteron direct quadrupteron --table log.csv --out poses.parquet",
    cls=NumbersCommand,
)
_add(
    forces,
    "pteron forces quadrupteron --pose 0.01 0.02 -0.03 0.1 --velocity 0 0 0.5 0",
    "pteron forces quadrupteron --table motion.csv --out forces.csv",
    cls=NumbersCommand,
)
_add(
    base,
    "pteron base quadrupteron --symbols",
    "pteron base quadrupteron --keep I_l1,m_l4 --format latex",
)
_add(
    export,
    "pteron export quadrupteron --c controller",
    "pteron export my-robot.toml --c controller --float --function inverse_kinematics",
    "pteron export quadrupteron --st plc",
)
_add(
    excite,
    "pteron excite quadrupteron --out exciting.csv",
    "pteron excite my-robot.toml --out exciting.csv --period 5 --speed 0.5 --force 60",
)
_add(
    identify,
    "pteron identify log.csv --robot quadrupteron --out identified",
    "pteron identify a.csv b.csv --held-out c.csv --robot my-robot.toml --out identified",
)
_add(table1, "pteron table1")


def main() -> None:
    """Run the command line."""
    app()
