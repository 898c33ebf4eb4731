"""`pteron base` and `pteron table1`: the base inertial parameters, and the paper's own."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Literal

from typer import echo

from pteron.cli.arguments import Machine
from pteron.cli.progress import spinner
from pteron.cli.result import Result
from pteron.cli.terminal import is_terminal, plain, show, show_json, table
from pteron.json_values import picked

if TYPE_CHECKING:
    from pteron.reduction import BaseParameters
    from pteron.reduction.result import Symbols


Format = Literal["text", "sympy", "latex", "booktabs", "json"]
"""Forms in which base parameters are printed."""

_COMMENTS = {"sympy": "#", "latex": "%", "booktabs": "%"}
"""Characters that begin a comment, by form."""


def base(
    machine: Machine,
    *,
    method: Literal["exact", "svd", "qr"] = "exact",
    keep: str | None = None,
    shared: bool = False,
    format_: Format = "text",
    symbols: bool = False,
    leg_symbols: bool = False,
) -> Result:
    """Find the base inertial parameters: the sums of parameters that act on the forces.

    The format latex prints lines of mathematics, booktabs a table with values for a paper.

    Options
    -------
    --method: Exact arithmetic with a proof, or a numerical rank.
    --keep NAMES: Parameters to keep before others: I_l1,m_l4.
    --shared: All legs share one set of inertial parameters.
    --format: The form in which they are printed.
    --symbols: Write the coefficients in symbols of the geometry.
    --leg-symbols: The same, with symbols of each leg: equal lengths share none.

    Examples
    --------
    pteron base quadrupteron --symbols
    pteron base quadrupteron --keep I_l1,m_l4 --format latex
    """
    written: Symbols = "leg" if leg_symbols else symbols
    with spinner(f"Grouping the inertial parameters of {machine.name}"):
        from pteron.reduction import base_parameters

        names = None if keep is None else [name.strip() for name in keep.split(",")]
        found = base_parameters(machine, method, names, shared=shared)
    data = found.as_dict()
    if written:
        data["symbolic"] = list(found.expressions(symbols=written))
        data["geometry"] = _geometry(found, written)
        data["shared_symbols"] = {} if written == "leg" else found.shared_symbols
    if format_ == "json":
        return Result(data, partial(show_json, data))
    if format_ == "text":
        return Result(data, partial(_show, found, written))
    return Result(data, partial(_write, found, written, format_))


def _write(
    found: BaseParameters, symbols: Symbols, form: Literal["sympy", "latex", "booktabs"]
) -> None:
    if form == "booktabs":
        echo(found.to_latex(symbols=symbols))
    else:
        echo("\n".join(map(str, found.expressions(form, symbols=symbols))))
    for line in _closing(found, symbols):
        echo(f"{_COMMENTS[form]} {line}")


def _show(found: BaseParameters, symbols: Symbols) -> None:
    expressions = found.expressions(symbols=symbols)
    closing = [plain(line) for line in _closing(found, symbols)]
    if not is_terminal():
        show(*(plain(line) for line in expressions), "", *closing)
        return
    units = [found.parameters[column].unit for column in found.kept]
    columns = zip(expressions, found.values(), units, strict=True)
    rows = ((str(i), plain(e), f"{v:.5g}", u) for i, (e, v, u) in enumerate(columns, start=1))
    show(
        f"[bold]{plain(found.robot.name)}[/bold]: {found.rank} base parameters of "
        f"{len(found.columns)} inertial parameters",
        table("", "base parameter", "value", "unit", rows=rows, numbers=("", "value")),
        *closing,
    )


def _geometry(found: BaseParameters, symbols: Symbols) -> dict[str, float]:
    return found.leg_geometry_values if symbols == "leg" else found.geometry_values


def _closing(found: BaseParameters, symbols: Symbols) -> list[str]:
    """Return the values of the symbols, if there are any, and the proof."""
    lines = []
    if symbols:
        given = _geometry(found, symbols)
        lengths = ", ".join(f"{name} = {v:g}" for name, v in given.items())
        lines.append(f"In metres: {lengths}.")
        shared = found.shared_symbols.items()
        if shared and symbols == "leg":
            text = "; ".join(", ".join((one, *others)) for one, others in shared)
            lines.append(f"Equal but for their sign, each with its symbol: {text}.")
        elif shared:
            text = "; ".join(f"{one} stands for {', '.join(others)} too" for one, others in shared)
            lines.append(
                f"Values that are equal but for their sign share a symbol: {text}. With "
                "--leg-symbols each leg has its own."
            )
    return [*lines, *found.certificate.summary().splitlines()]


def table1() -> Result:
    """Print the paper's Table 1, as printed and as computed; exit with 1 if they disagree.

    Examples
    --------
    pteron table1
    """
    with spinner("Computing Table 1"):
        from pteron.report.table1 import rows as computed

        found = computed()
    wrong = sum(not row.agrees for row in found)
    data = [picked(r, "parameter kept printed computed agrees restored") for r in found]
    verdicts = {True: "yes", False: "[bold red]NO[/bold red]"}
    rows = (
        (r.parameter, plain(r.printed), plain(r.computed), verdicts[r.agrees] + " *" * r.restored)
        for r in found
    )
    restored = [r.parameter for r in found if r.restored]
    agree = f"{len(found) - wrong} of {len(found)} rows agree."
    if restored:
        agree += (
            f" Cells of {', '.join(restored)} (*) are damaged in our text of the paper and "
            "restored from its other rows."
        )
    told = [table("", "printed", "computed", "agrees", rows=rows), agree]
    return Result(data, told, code=1 if wrong else 0)
