"""Output of subcommands: results to standard output, notes and errors to standard error.

Results are text, tables or JSON. `show` prints Rich's markup, in text and in a table: what comes
from a file goes through `plain` first. `write` prints text as it is; `note` and `complain` escape
theirs themselves.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable
from io import TextIOWrapper
from typing import TYPE_CHECKING, Any, TextIO

from typer import echo

from pteron.json_values import json_ready

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_PIECE = 1 << 16
"""Characters written at a time: a reader of a pipe that leaves is noticed at the next piece."""

_ANY_WIDTH = 10_000
"""Columns of a table for a file or a pipe: wider than any screen."""


GRADE_COLORS = {"trustworthy": "green", "usable with care": "yellow", "not trustworthy": "red"}
"""Colours of the grades of a verdict."""


def is_terminal() -> bool:
    """Return whether a person reads standard output; TTY_COMPATIBLE, 1 or 0, decides (Rich)."""
    return _is_watched(sys.stdout, "TTY_COMPATIBLE")


def is_interactive() -> bool:
    """Return whether a person watches standard error; TTY_INTERACTIVE, 1 or 0, decides.

    Rich takes FORCE_COLOR for a person too, which Jupyter and build servers set: colours are meant,
    not pictures that move.
    """
    return _is_watched(sys.stderr, "TTY_INTERACTIVE")


def _is_watched(stream: TextIO, variable: str) -> bool:
    """Return what an environment variable (1 or 0) decides, else whether it is a terminal."""
    decision = {"0": False, "1": True}.get(os.environ.get(variable, ""))
    return stream.isatty() if decision is None else decision


def plain(text: str) -> str:
    r"""Return a text in which neither Rich nor a terminal finds a command.

    Names come from files that anyone may have written.

    Examples
    --------
    >>> print(plain("[red]odd\x1b[2J"))
    \[red]odd\x1b[2J
    """
    from rich.markup import escape

    return escape(_visible(text))


def _visible(text: str) -> str:
    """Return a text on one line, with control characters as Python writes them."""
    spaced = " ".join(text.splitlines())
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in spaced)


def show(*things: str | Table) -> None:
    """Print texts, with Rich's markup, and tables on standard output."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, emoji=False)
    for thing in things:
        if isinstance(thing, Table):
            _fit(thing, console)
        # A terminal cuts text into lines; whoever reads a pipe wants it as it is.
        console.print(thing, soft_wrap=isinstance(thing, str) and not is_terminal())


def _fit(shown_table: Table, console: Console) -> None:
    """Break the headings that are wider than their cells if a table is wider than the screen."""
    from rich.measure import Measurement

    wide = console.options.update(max_width=_ANY_WIDTH)
    if Measurement.get(console, wide, shown_table).maximum <= console.width:
        return
    for column in shown_table.columns:
        heading = str(column.header)
        widths = [Measurement.get(console, wide, cell).maximum for cell in column.cells]
        if len(heading) > max(widths[1:], default=0):
            column.header = heading.replace(" ", "\n")


def write(text: str) -> None:
    """Write text on standard output as it is: data is UTF-8 whatever the locale."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8")
    for start in range(0, len(text), _PIECE):
        sys.stdout.write(text[start : start + _PIECE])


def show_json(record: Any) -> None:
    """Print data on standard output as JSON, with null for NaN and infinity."""
    write(json.dumps(json_ready(record), indent=2, allow_nan=False) + "\n")


def table(
    *columns: str,
    rows: Iterable[Iterable[str]] = (),
    numbers: tuple[str, ...] = (),
    names: tuple[str, ...] = (),
    caption: str | None = None,
) -> Table:
    """Return a table; columns in `numbers` and `names` are unbroken, numbers set to the right.

    Rows may hold Rich's markup; the headings are plain text.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown_table = Table(box=SIMPLE_HEAD, caption=caption, pad_edge=False, collapse_padding=True)
    for name in columns:
        number = name in numbers
        justify: Any = "right" if number else "left"
        unbroken = number or name in names
        shown_table.add_column(plain(name), justify=justify, no_wrap=unbroken, overflow="fold")
    for row in rows:
        shown_table.add_row(*row)
    return shown_table


def file_lines(*paths: object) -> list[str]:
    """Return a line for each file that was written."""
    return [f"Written: {plain(str(path))}" for path in paths]


def percent(share: float) -> str:
    """Return a share in percent; a small one is not rounded to zero."""
    return "under 0.1 %" if 0.0 < share < 1e-3 else f"{100.0 * share:.3g} %"


def significant(number: float, digits: int = 3) -> str:
    """Return a number with significant digits, without an exponent below a million.

    Examples
    --------
    >>> significant(5526.8), significant(0.31437)
    ('5527', '0.314')
    """
    text = f"{number:.{digits}g}"
    return f"{number:.0f}" if "e+" in text and abs(number) < 1e6 else text


def ascii_number(text: str) -> str:
    """Return a typeset number with the minus that every terminal has."""
    return text.replace("\u2212", "-").replace("\u221e", "inf")


def note(message: str) -> None:
    """Print a line on standard error, above a bar that is there."""
    # What `err=True` writes to is the stream behind that of the bar.
    echo(_visible(message), file=sys.stderr)


def warn(messages: Iterable[str], source: str = "") -> None:
    """Print a line on standard error for each warning; `source` is its beginning."""
    for message in messages:
        note(f"Warning: {source}{message}")


def complain(message: str) -> None:
    """Print an error on standard error; lines to paste into a file are not wrapped."""
    from rich.console import Console

    console = Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)
    first_line, start, lines = message.partition("\n[")
    console.print(f"[bold red]Error:[/bold red] {plain(first_line)}")
    for line in (start + lines).split("\n")[1:]:
        console.print(plain(line))
