"""`pteron base` and `pteron table1`: the base inertial parameters, and the paper's own."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Literal

from typer import echo

from pteron.cli.arguments import MachineArgument
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import is_terminal, plain, show, show_json, table
from pteron.json_values import json_fields

if TYPE_CHECKING:
    from pteron.reduction import BaseParameters
    from pteron.reduction.result import Symbols


Format = Literal["text", "sympy", "latex", "booktabs", "json"]
"""Forms in which base parameters are printed."""

_COMMENTS = {"sympy": "#", "latex": "%", "booktabs": "%"}
"""Characters that begin a comment, by form."""


def base(
    machine: MachineArgument,
    *,
    method: Literal["exact", "svd", "qr"] = "exact",
    keep: str | None = None,
    shared: bool = False,
    format_: Format = "text",
    symbols: bool = False,
    leg_symbols: bool = False,
) -> CommandResult:
    """Find the base inertial parameters: the sums of parameters that act on the forces.

    The format latex prints formulas, booktabs a LaTeX table with values.

    Options
    -------
    --method: Exact arithmetic with a proof, or a numerical rank by SVD or QR.
    --keep NAMES: Parameters by which sums are named in preference to others: I_l1,m_l4.
    --shared: All legs have the same inertial parameters.
    --format: Format of the output.
    --symbols: Write the coefficients in symbols of the geometry.
    --leg-symbols: The same, but equal lengths of different legs have different symbols.

    Examples
    --------
    pteron base quadrupteron --symbols
    pteron base quadrupteron --keep I_l1,m_l4 --format latex
    """
    written: Symbols = "leg" if leg_symbols else symbols
    with spinner(f"Grouping the inertial parameters of {machine.name}"):
        from pteron.reduction import base_parameters

        names = None if keep is None else [name.strip() for name in keep.split(",")]
        parameters = base_parameters(machine, method, names, shared=shared)
    record = parameters.as_dict()
    if written:
        record["symbolic"] = list(parameters.expressions(symbols=written))
        record["geometry"] = _geometry(parameters, written)
        record["shared_symbols"] = {} if written == "leg" else parameters.shared_symbols
    if format_ == "json":
        return CommandResult(record, partial(show_json, record))
    if format_ == "text":
        return CommandResult(record, partial(_show, parameters, written))
    return CommandResult(record, partial(_write, parameters, written, format_))


def _write(
    parameters: BaseParameters, symbols: Symbols, form: Literal["sympy", "latex", "booktabs"]
) -> None:
    """Write the base parameters to standard output in a form, closing lines as comments."""
    if form == "booktabs":
        echo(parameters.to_latex(symbols=symbols))
    else:
        echo("\n".join(map(str, parameters.expressions(form, symbols=symbols))))
    for line in _closing_lines(parameters, symbols):
        echo(f"{_COMMENTS[form]} {line}")


def _show(parameters: BaseParameters, symbols: Symbols) -> None:
    """Print the base parameters: a table with values and units on a terminal, else plain lines."""
    expressions = parameters.expressions(symbols=symbols)
    closing = [plain(line) for line in _closing_lines(parameters, symbols)]
    if not is_terminal():
        show(*(plain(line) for line in expressions), "", *closing)
        return
    units = [parameters.parameters[column].unit for column in parameters.kept]
    columns = zip(expressions, parameters.values(), units, strict=True)
    rows = ((str(i), plain(e), f"{v:.5g}", u) for i, (e, v, u) in enumerate(columns, start=1))
    show(
        f"[bold]{plain(parameters.robot.name)}[/bold]: {parameters.rank} base parameters, sums of "
        f"{len(parameters.columns)} inertial parameters; only these sums act on the drive forces.",
        table("", "base parameter", "value", "unit", rows=rows, numbers=("", "value")),
        SYMBOLS,
        *closing,
    )


SYMBOLS = (
    "Symbols: m mass, mgx mgy mgz first moment (mass times centre of mass), I inertia; of the "
    "bodies p slider, u upper link, l lower link with the leg's number, e platform."
)
"""The legend of inertial parameters."""


def _geometry(parameters: BaseParameters, symbols: Symbols) -> dict[str, float]:
    """Return the geometry's values by the names of the symbols that the expressions use."""
    return parameters.leg_geometry_values if symbols == "leg" else parameters.geometry_values


def _closing_lines(parameters: BaseParameters, symbols: Symbols) -> list[str]:
    """Return the values of the symbols, if there are any, and the proof."""
    lines = []
    if symbols:
        geometry = _geometry(parameters, symbols)
        lengths = ", ".join(f"{name} = {v:g}" for name, v in geometry.items())
        lines.append(f"Geometry in metres: {lengths}.")
        shared = parameters.shared_symbols.items()
        if shared and symbols == "leg":
            text = "; ".join(", ".join((symbol, *others)) for symbol, others in shared)
            lines.append(f"Equal but for their sign, each with its symbol: {text}.")
        elif shared:
            text = "; ".join(f"{s} stands for {', '.join(others)} too" for s, others in shared)
            lines.append(
                f"Values that are equal but for their sign share a symbol: {text}. With "
                "--leg-symbols each leg has its own."
            )
    return [*lines, *parameters.certificate.summary().splitlines()]


def table1() -> CommandResult:
    """Print the paper's Table 1, as printed and as computed; exit with 1 if they disagree.

    Examples
    --------
    pteron table1
    """
    with spinner("Computing Table 1"):
        from pteron.report.table1 import rows as computed

        computed_rows = computed()
    wrong = sum(not row.agrees for row in computed_rows)
    record = [
        json_fields(
            parameter=r.parameter,
            kept=r.kept,
            printed=r.printed,
            computed=r.computed,
            agrees=r.agrees,
            restored=r.restored,
        )
        for r in computed_rows
    ]
    verdicts = {True: "yes", False: "[bold red]NO[/bold red]"}
    rows = (
        (r.parameter, plain(r.printed), plain(r.computed), verdicts[r.agrees] + " *" * r.restored)
        for r in computed_rows
    )
    restored = [r.parameter for r in computed_rows if r.restored]
    agree = (
        f"{len(computed_rows) - wrong} of {len(computed_rows)} base parameters of the paper's "
        "Table 1 agree with those computed here."
    )
    if restored:
        agree += (
            f" Cells of {', '.join(restored)} (*) are damaged in our text of the paper and "
            "restored from its other rows."
        )
    headings = ("", "printed", "computed", "agrees")
    lines = [agree, table(*headings, rows=rows), SYMBOLS]
    return CommandResult(record, lines, code=1 if wrong else 0)
