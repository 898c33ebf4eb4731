"""What the command line shows: on standard output the result, on standard error the rest."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table
from typer import echo

from pteron.atomic import plain as plain_data

if TYPE_CHECKING:
    from rich.progress import Progress

_PIECE = 1 << 16

_ANY_WIDTH = 10_000
"""More columns than any screen has."""


def is_terminal() -> bool:
    """Say whether a person reads standard output."""
    return sys.stdout.isatty()


def is_watched() -> bool:
    """Say whether a person watches standard error.

    Rich takes FORCE_COLOR for one, which Jupyter and build servers set: colours are meant, not
    pictures that move.
    """
    return sys.stderr.isatty()


def plain(text: str) -> str:
    r"""Return a text in which neither Rich nor a terminal finds a command.

    Names come from files that anyone may have written.

    Examples
    --------
    >>> print(plain("[red]odd\x1b[2J"))
    \[red]odd\x1b[2J
    """
    return escape(_visible(text))


def _visible(text: str) -> str:
    """Return a text on one line, with control characters as Python writes them."""
    spaced = " ".join(text.splitlines())
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in spaced)


def show(*things: str | Table) -> None:
    """Print texts, with Rich's markup, and tables on standard output."""
    console = Console(highlight=False, emoji=False)
    for thing in things:
        if isinstance(thing, Table):
            _fit(thing, console)
        # A terminal cuts text into lines; whoever reads a pipe wants it as it is.
        console.print(thing, soft_wrap=isinstance(thing, str) and not is_terminal())


def _fit(made: Table, console: Console) -> None:
    """Break the headings of a table at their blanks if it is wider than the screen."""
    wide = console.options.update(max_width=_ANY_WIDTH)
    if Measurement.get(console, wide, made).maximum <= console.width:
        return
    for column in made.columns:
        column.header = str(column.header).replace(" ", "\n")


def write(text: str) -> None:
    """Write text on standard output as it is: data is UTF-8 whatever the locale."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8")
    # In pieces: who stops reading is noticed at the next one, also where nothing is buffered.
    for start in range(0, len(text), _PIECE):
        sys.stdout.write(text[start : start + _PIECE])


def show_json(data: Any) -> None:
    """Print data on standard output as JSON, null for the numbers that it does not have."""
    write(json.dumps(plain_data(data), indent=2, allow_nan=False) + "\n")


def table(*columns: str, numbers: tuple[str, ...] = (), caption: str | None = None) -> Table:
    """Return a table without rows; the columns in `numbers` are set to the right, unbroken."""
    made = Table(box=SIMPLE_HEAD, caption=caption, pad_edge=False, collapse_padding=True)
    for name in columns:
        number = name in numbers
        justify: Any = "right" if number else "left"
        made.add_column(plain(name), justify=justify, no_wrap=number, overflow="fold")
    return made


def percent(share: float) -> str:
    """Return a share in percent; what is little is not shown as nothing."""
    return "under 0.1 %" if 0.0 < share < 1e-3 else f"{100.0 * share:.3g} %"


def note(message: str) -> None:
    """Print a line on standard error."""
    echo(_visible(message), err=True)


def complain(message: str) -> None:
    """Print an error as one line on standard error; lines to paste into a file stay lines."""
    console = Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)
    told, start, lines = message.partition("\n[")
    console.print(f"[bold red]Error:[/bold red] {plain(told)}")
    for line in (start + lines).split("\n")[1:]:
        console.print(plain(line))


@contextmanager
def spinner(task: str) -> Iterator[None]:
    """Show a person on standard error that work of unknown length goes on."""
    if not is_watched():
        yield
        return
    with Console(stderr=True).status(plain(task)):
        yield


@contextmanager
def progress_bar(task: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a person how much of the work is done; yields what is called with each amount done."""
    with _bar() as progress:
        number = progress.add_task(plain(task), total=total)
        yield lambda done: progress.update(number, advance=done)


@contextmanager
def stages(task: str, rows: int) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar for each stage of long work, and between them that the work goes on.

    Yields what is to be told a stage's name, how many of its rows are done, and how many there are:
    no more than are done where the stage does not know, which then has `rows`.
    """
    with _bar() as progress:
        number = progress.add_task(plain(task), total=None)
        stage, before = "", 0

        def tell(name: str, done: int, total: int) -> None:
            nonlocal before, stage
            if name != stage:
                progress.reset(number, total=max(total, rows), description=plain(name))
                stage, before = name, 0
            # The rows of a stage's next file are counted anew.
            progress.update(number, advance=done - before if done >= before else done)
            before = done
            if done >= max(total, rows):
                progress.reset(number, total=None, description=plain(task))
                stage = ""

        yield tell


def _bar() -> Progress:
    from rich import progress

    return progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not is_watched(),
        transient=True,
    )
