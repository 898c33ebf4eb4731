"""A small table in HTML for notebooks, which `_repr_html_` of a value returns.

It takes the notebook's own colours and font, light or dark. Its style changes no other table, and
it loads nothing from the network.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

from markupsafe import Markup

from pteron.templates import template

if TYPE_CHECKING:
    import polars as pl

_DIGITS = 5
"""Significant digits of a number."""

_ROWS = 12
"""Rows of a longer table that are shown."""


class Column(NamedTuple):
    """A column: its heading, and its kind: numbers are right-aligned, long texts wrap."""

    heading: str
    kind: Literal["", "number", "long"] = ""


Cell = str | float | int | None


class Overview(NamedTuple):
    """The contents of an `html_table` of a result."""

    title: str
    about: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    notes: Sequence[str] = ()

    @property
    def text(self) -> str:
        """The overview as text: a line for each row of the table and each note.

        Examples
        --------
        >>> from pteron.html_table import Column, Overview
        >>> print(Overview("A", "two", [Column("sum"), Column("of")], [["3", 2]]).text)
        A: two
        sum 3, of 2
        """
        lines = [f"{self.title}: {self.about}"]
        for row in self.rows:
            cells = zip(self.columns, map(_cell, row), strict=True)
            lines.append(", ".join(f"{column.heading} {text}".strip() for column, text in cells))
        return "\n".join([*lines, *self.notes])


def html_table(
    title: str,
    about: str,
    columns: Sequence[Column],
    rows: Iterable[Sequence[Cell]],
    notes: Iterable[str] = (),
) -> str:
    """Return a table with a title and a subtitle as self-contained HTML.

    Parameters
    ----------
    title, about : str
        The caption, with the title in bold.
    columns : sequence of Column
        Headings.
    rows : iterable of sequences
        Cells: texts, numbers, which are printed to five digits, or None for nothing. What is
        HTML already is a `Markup`.
    notes : iterable of str
        Sentences below.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> from pteron.html_table import Column, html_table
    >>> "<td>1 &lt; 2</td>" in html_table("A", "", [Column("sum")], [["1 < 2"]])
    True
    """
    page = template("", "html_table.html.j2", cell=_cell, kind=_kind)
    cells = [list(zip(columns, row, strict=True)) for row in rows]
    return page.render(title=title, about=about, columns=columns, rows=cells, notes=notes)


def frame_overview(
    title: str, about: str, frame: pl.DataFrame, notes: Iterable[str] = ()
) -> Overview:
    """Return the first rows of a table as an `Overview`, with a note on omitted rows."""
    columns = [Column(c.name, "number" if c.dtype.is_numeric() else "") for c in frame]
    hidden = len(frame) - _ROWS
    hint = [f"{hidden} more rows: see table()"] if hidden > 0 else []
    return Overview(title, about, columns, [*frame.head(_ROWS).iter_rows()], (*notes, *hint))


def _kind(kind: str) -> Markup:
    """Return the HTML attribute `class` for a column's kind, with a leading blank, or ''."""
    return Markup(f' class="{kind}"') if kind else Markup("")


def _cell(cell: Cell) -> str:
    """Return a table cell as text: numbers rounded, None and NaN empty."""
    if cell is None or isinstance(cell, str):
        return cell or ""
    text = f"{cell:.{_DIGITS}g}" if isinstance(cell, float) else str(cell)
    return text.replace("-", "\u2212").replace("nan", "").replace("inf", "\u221e")
