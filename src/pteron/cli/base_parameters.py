"""`pteron base` and `pteron table1`: the base inertial parameters, and the paper's own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from typer import Exit, echo

from pteron.cli.arguments import Elbows, Json, Robot, load_robot, option
from pteron.cli.completion import parameters
from pteron.cli.progress import spinner
from pteron.cli.terminal import is_terminal, plain, show, show_json, table

if TYPE_CHECKING:
    from pteron.reduction import BaseParameters
    from pteron.reduction.result import Symbols


Format = Literal["text", "sympy", "latex", "booktabs", "json"]
"""Forms in which base parameters are printed."""

_COMMENTS = {"sympy": "#", "latex": "%", "booktabs": "%"}
"""Signs before a comment, by form."""


def base(
    robot: Robot,
    method: Annotated[
        Literal["exact", "svd", "qr"],
        option("method", "Exact arithmetic with a proof, or a numerical rank."),
    ] = "exact",
    keep: Annotated[
        str | None,
        option(
            "keep",
            "Parameters to keep before others: I_l1,m_l4.",
            "NAMES",
            autocompletion=parameters,
        ),
    ] = None,
    shared: Annotated[
        bool, option("shared", "All legs share one set of inertial parameters.")
    ] = False,
    format: Annotated[Format, option("format", "How they are written.")] = "text",  # noqa: A002
    symbols: Annotated[
        bool, option("symbols", "Write the coefficients in symbols of the geometry.")
    ] = False,
    leg_symbols: Annotated[
        bool, option("leg-symbols", "The same, and equal lengths of several legs share no symbol.")
    ] = False,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Find the base inertial parameters: the sums of parameters that act on the forces.

    Formats latex and booktabs are lines of mathematics, and a table with values for a paper.
    """
    written: Symbols = "leg" if leg_symbols else symbols
    machine = load_robot(robot, elbows)
    with spinner(f"Grouping the inertial parameters of {machine.name}"):
        from pteron.reduction import base_parameters

        names = None if keep is None else [name.strip() for name in keep.split(",")]
        found = base_parameters(machine, method, names, shared=shared)
    if json or format == "json":
        data = found.as_dict()
        if written:
            data["symbolic"] = list(found.expressions(symbols=written))
            data["geometry"] = _geometry(found, written)
            data["shared_symbols"] = {} if written == "leg" else found.shared_symbols
        show_json(data)
    elif format == "text":
        _show(found, written)
    else:
        if format == "booktabs":
            echo(found.to_latex(symbols=written))
        else:
            echo("\n".join(map(str, found.expressions(format, symbols=written))))
        for line in _closing(found, written):
            echo(f"{_COMMENTS[format]} {line}")


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


def table1(json: Json = False) -> None:
    """Print the paper's Table 1, as printed and as computed; exit with 1 if they disagree."""
    with spinner("Computing Table 1"):
        from pteron.report.table1 import rows as computed

        found = computed()
    wrong = sum(not row.agrees for row in found)
    if json:
        names = ("parameter", "kept", "printed", "computed", "agrees", "restored")
        show_json([{name: getattr(row, name) for name in names} for row in found])
    else:
        verdicts = {True: "yes", False: "[bold red]NO[/bold red]"}
        texts = ((r.parameter, plain(r.printed), plain(r.computed)) for r in found)
        marks = (verdicts[r.agrees] + " *" * r.restored for r in found)
        rows = ((*text, mark) for text, mark in zip(texts, marks, strict=True))
        note = "* damaged in the scan of the paper; restored from its legible rows"
        agree = f"{len(found) - wrong} of {len(found)} rows agree."
        show(table("", "printed", "computed", "agrees", rows=rows), agree, note)
    if wrong:
        raise Exit(1)
