"""A small table in HTML for notebooks: what `_repr_html_` of a value returns.

It takes the notebook's own colours and font, so that it is read in a light and in a dark one; its
style is for tables of its class alone, and nothing is fetched.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from markupsafe import escape

_STYLE = """\
<style>
.pteron-value {overflow-x: auto; margin: .4em 0}
.pteron-value table {border-collapse: collapse; margin: .3em 0; color: inherit; border: none;
  font-size: .95em}
.pteron-value caption {text-align: left; color: inherit; padding: 0 0 .3em}
.pteron-value tr, .pteron-value th, .pteron-value td {background: transparent; color: inherit}
.pteron-value th, .pteron-value td {padding: .15em .8em; text-align: left; border: none;
  border-bottom: 1px solid rgba(128, 128, 128, .35); vertical-align: baseline;
  white-space: nowrap}
.pteron-value th {font-weight: 600; border-bottom: 1px solid rgba(128, 128, 128, .9)}
.pteron-value .number {text-align: right; font-variant-numeric: tabular-nums}
.pteron-value .long {white-space: normal}
.pteron-value p {margin: .2em 0; opacity: .8; max-width: 60em}
</style>"""

_DIGITS = 5


class Column(NamedTuple):
    """A column: its heading, and what stands in it: numbers go to the right, long texts wrap."""

    heading: str
    kind: Literal["", "number", "long"] = ""


Cell = str | float | int | None


def html_table(
    title: str,
    about: str,
    columns: Sequence[Column],
    rows: Iterable[Sequence[Cell]],
    notes: Iterable[str] = (),
) -> str:
    """Return a table with a title and what is said about it, as HTML that needs nothing else.

    Parameters
    ----------
    title, about : str
        What stands above it, the title in bold.
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
    kinds = [f' class="{column.kind}"' if column.kind else "" for column in columns]
    head = "".join(
        f"<th{kind}>{escape(column.heading)}</th>"
        for kind, column in zip(kinds, columns, strict=True)
    )
    body = "\n".join(
        "<tr>"
        + "".join(f"<td{k}>{_cell(value)}</td>" for k, value in zip(kinds, row, strict=True))
        + "</tr>"
        for row in rows
    )
    below = "".join(f"\n<p>{escape(note)}</p>" for note in notes)
    return (
        f'<div class="pteron-value">{_STYLE}\n<table>\n'
        f"<caption><b>{escape(title)}</b> {escape(about)}</caption>\n"
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>{below}\n</div>"
    )


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return str(escape(value))
    text = f"{value:.{_DIGITS}g}" if isinstance(value, float) else str(value)
    return text.replace("-", "\u2212").replace("nan", "").replace("inf", "\u221e")
