"""Where a table's results go: to a file, to a person or to a program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pteron.cli.screen import is_terminal, note, show, show_json, table, write
from pteron.errors import OutputError

if TYPE_CHECKING:
    from pteron.tables import Table

__all__ = ["check_destination", "deliver"]

SHOWN_ROWS = 40
"""More rows than that are no reading for a person."""
DECIMALS = {"m": 6, "rad": 6, "N": 4}


def check_destination(
    out: str | None, source: str | None, table: Table, added: Sequence[str]
) -> None:
    """Refuse, before the work begins, a file that cannot be written or would lose data.

    Parameters
    ----------
    out, source : str, optional
        The file to be written and the one that was read.
    table : Table
        The rows read.
    added : sequence of str
        The columns of the result; those the table has already are replaced.
    """
    replaced = [name for name in added if name in table.columns]
    if out is not None:
        from pteron.tables import check_output

        file = check_output(out)
        if replaced and source is not None and file.exists() and file.samefile(source):
            raise OutputError(
                f"{out}: its own {_columns(replaced)} would be lost; write to another file"
            )
    if replaced:
        note(f"Note: {table.source}: {_columns(replaced)} replaced by the result")


def deliver(
    result: Table,
    shown: Sequence[str],
    *,
    out: str | None,
    as_json: bool,
    single: bool = False,
) -> None:
    """Write or print a result.

    Parameters
    ----------
    result : Table
        All its columns go to a file or a program.
    shown : sequence of str
        The columns a person sees; the last one is empty in a row that failed.
    out : str, optional
        The file to be written.
    as_json : bool
        Whether a program reads standard output.
    single : bool
        Whether the result belongs to numbers that were typed.
    """
    empty = result.frame[shown[-1]].null_count()
    if out is not None:
        from pteron.tables import write_table

        write_table(result.frame, out)
        if as_json:
            show_json({"out": out, "rows": len(result), "empty": empty})
        else:
            note(f"Wrote {_count(len(result))} to {out}{_left_empty(empty)}")
    elif as_json:
        text = result.json()
        write(text[1:-1] if single else text)
        write("\n")
    elif is_terminal():
        _show(result, shown, single=single)
    else:
        for text in result.text():
            write(text)
        if empty and not single:
            note(f"Printed {_count(len(result))}{_left_empty(empty)}")


def _show(result: Table, shown: Sequence[str], *, single: bool) -> None:
    """Print the first rows for a person, with units."""
    frame = result.frame.select(shown)
    headings = tuple(_heading(name) for name in shown)
    numbered = not single and "mode" not in shown
    made = table(*(("row",) if numbered else ()), *headings, numbers=("row", *headings))
    for i, cells in enumerate(frame.head(SHOWN_ROWS).iter_rows(), start=1):
        texts = (_text(name, cell) for name, cell in zip(shown, cells, strict=True))
        made.add_row(*((str(i),) if numbered else ()), *texts)
    show(made)
    if len(result) > SHOWN_ROWS:
        note(f"{SHOWN_ROWS} of {_count(len(result))} shown; --out FILE writes them all")


def _heading(name: str) -> str:
    unit = _unit(name)
    return f"{name} ({unit})" if unit else name


def _unit(name: str) -> str:
    if name in ("row", "mode"):
        return ""
    if name.startswith("force"):
        return "N"
    return "rad" if name == "phi" else "m"


def _text(name: str, cell: float | int | None) -> str:
    if cell is None:
        return "-"
    unit = _unit(name)
    # Adding zero takes the sign from what was rounded to zero.
    return f"{round(cell, DECIMALS[unit]) + 0.0:.{DECIMALS[unit]}f}" if unit else str(cell)


def _columns(names: Sequence[str]) -> str:
    return f"{'column' if len(names) == 1 else 'columns'} {', '.join(names)}"


def _count(rows: int) -> str:
    return f"{rows} {'row' if rows == 1 else 'rows'}"


def _left_empty(rows: int) -> str:
    return f", {rows} of them without a result" if rows else ""
