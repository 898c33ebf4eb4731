"""What the command line shows: on standard output the result, on standard error the rest."""

from __future__ import annotations

import json
import math
import sys
from io import TextIOWrapper
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from typer import echo

__all__ = ["complain", "is_terminal", "note", "show", "show_json", "table", "write"]

_PIECE = 1 << 16


def is_terminal() -> bool:
    """Say whether a person reads standard output."""
    return sys.stdout.isatty()


def show(*things: str | Table) -> None:
    """Print texts, with Rich's markup, and tables on standard output."""
    console = Console(highlight=False, emoji=False)
    for thing in things:
        # A terminal cuts text into lines; whoever reads a pipe wants it as it is.
        console.print(thing, soft_wrap=isinstance(thing, str) and not is_terminal())


def write(text: str) -> None:
    """Write text on standard output as it is: data is UTF-8 whatever the locale."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8")
    # In pieces: who stops reading is noticed at the next one, also where nothing is buffered.
    for start in range(0, len(text), _PIECE):
        sys.stdout.write(text[start : start + _PIECE])


def show_json(data: Any) -> None:
    """Print data on standard output as JSON."""
    write(json.dumps(_finite(data), indent=2, allow_nan=False) + "\n")


def _finite(data: Any) -> Any:
    """Return data with null for the numbers that JSON does not have."""
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def table(*columns: str, numbers: tuple[str, ...] = (), title: str | None = None) -> Table:
    """Return a table without rows; the columns in `numbers` are set to the right, unbroken."""
    made = Table(
        box=SIMPLE_HEAD, title=title, title_justify="left", pad_edge=False, collapse_padding=True
    )
    for name in columns:
        number = name in numbers
        made.add_column(
            escape(name),
            justify="right" if number else "left",
            no_wrap=number,
            overflow="fold",
        )
    return made


def note(message: str) -> None:
    """Print a line on standard error."""
    echo(" ".join(message.splitlines()), err=True)


def complain(message: str) -> None:
    """Print an error as one line on standard error."""
    console = Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)
    console.print(f"[bold red]Error:[/bold red] {escape(' '.join(message.splitlines()))}")
