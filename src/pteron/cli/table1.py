"""`pteron table1`: the paper's Table 1 beside what Pteron computes."""

from __future__ import annotations

from rich.markup import escape
from typer import Exit

from pteron.cli.arguments import Json
from pteron.cli.progress import spinner
from pteron.cli.screen import show, show_json, table

__all__ = ["table1"]

DISAGREEMENT = 1


def table1(json: Json = False) -> None:
    """Print the paper's Table 1, as printed and as computed; exit with 1 if they disagree."""
    with spinner("Computing Table 1"):
        from pteron.report.table1 import rows

        found = rows()
    wrong = sum(not row.agrees for row in found)
    if json:
        names = ("parameter", "kept", "printed", "computed", "agrees", "restored")
        show_json([{name: getattr(row, name) for name in names} for row in found])
    else:
        made = table("", "printed", "computed", "agrees")
        for row in found:
            verdict = "yes" if row.agrees else "[bold red]NO[/bold red]"
            verdict += " *" if row.restored else ""
            made.add_row(row.parameter, escape(row.printed), escape(row.computed), verdict)
        note = "* damaged in the scan of the paper; restored from its legible rows"
        show(made, f"{len(found) - wrong} of {len(found)} rows agree.", note)
    if wrong:
        raise Exit(DISAGREEMENT)
