"""Arguments and options that several subcommands share."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from typer import Argument, Option

__all__ = ["Elbows", "Failure", "Json", "OnFailure", "Out", "Robot", "TableFile"]


class Failure(StrEnum):
    """What becomes of a row that cannot be served."""

    RAISE = "raise"
    NAN = "nan"


Robot = Annotated[
    str,
    Argument(metavar="ROBOT", help="A machine of the catalog (see pteron catalog) or a TOML file."),
]
Json = Annotated[bool, Option("--json", help="Print data for a program, as JSON.")]
Out = Annotated[
    str | None,
    Option("--out", metavar="FILE", help="Write the result to a .csv or .parquet file."),
]
TableFile = Annotated[
    str | None,
    Option(
        "--table",
        metavar="FILE",
        help="Take the rows of a .csv or .parquet file; - is CSV on standard input.",
    ),
]
OnFailure = Annotated[
    Failure,
    Option("--on-failure", help="Stop at a row that fails, or leave its results empty."),
]
Elbows = Annotated[
    str | None,
    Option("--elbows", metavar="SIGNS", help="The working mode, one sign a leg, such as ++-+."),
]
