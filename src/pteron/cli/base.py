"""`pteron base`: the base inertial parameters."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Literal

from rich.markup import escape
from typer import Option, echo

from pteron.cli.arguments import Elbows, Json, Robot
from pteron.cli.progress import spinner
from pteron.cli.robots import load_robot
from pteron.cli.screen import is_terminal, show, show_json, table

if TYPE_CHECKING:
    from pteron.reduction import BaseParameters

__all__ = ["base"]


class Method(StrEnum):
    """How the rank is found."""

    EXACT = "exact"
    SVD = "svd"
    QR = "qr"


class Format(StrEnum):
    """How the base parameters are written."""

    TEXT = "text"
    SYMPY = "sympy"
    LATEX = "latex"
    JSON = "json"


COMMENTS = {Format.SYMPY: "#", Format.LATEX: "%"}
"""What begins a line that is for the reader, not for SymPy or LaTeX."""


def base(
    robot: Robot,
    method: Annotated[
        Method, Option("--method", help="Exact arithmetic with a proof, or a numerical rank.")
    ] = Method.EXACT,
    keep: Annotated[
        str | None,
        Option("--keep", metavar="NAMES", help="Parameters to keep before others: I_l1,m_l4."),
    ] = None,
    shared: Annotated[
        bool, Option("--shared", help="All legs share one set of inertial parameters.")
    ] = False,
    format: Annotated[Format, Option("--format", help="How they are written.")] = Format.TEXT,  # noqa: A002
    symbols: Annotated[
        bool, Option("--symbols", help="Write the coefficients in symbols of the geometry.")
    ] = False,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Find the base inertial parameters: the sums of parameters that act on the forces."""
    machine = load_robot(robot, elbows)
    with spinner(f"Grouping the inertial parameters of {machine.name}"):
        from pteron.reduction import base_parameters

        names = None if keep is None else [name.strip() for name in keep.split(",")]
        found = base_parameters(machine, method.value, names, shared=shared)
    if json or format is Format.JSON:
        data = found.as_dict()
        if symbols:
            data["symbolic"] = list(found.expressions(symbols=True))
            data["geometry"] = found.geometry_values
        show_json(data)
    elif format is Format.TEXT:
        _show(found, symbols=symbols)
    else:
        form: Literal["sympy", "latex"] = "sympy" if format is Format.SYMPY else "latex"
        for expression in found.expressions(form, symbols=symbols):
            echo(str(expression))
        for line in (*_meanings(found, symbols=symbols), *_proof(found)):
            echo(f"{COMMENTS[format]} {line}")


def _show(found: BaseParameters, *, symbols: bool) -> None:
    expressions = found.expressions(symbols=symbols)
    closing = [escape(line) for line in (*_meanings(found, symbols=symbols), *_proof(found))]
    if not is_terminal():
        show(*(escape(line) for line in expressions), "", *closing)
        return
    made = table("", "base parameter", "value", "unit", numbers=("", "value"))
    for i, (line, value, unit) in enumerate(
        zip(expressions, found.values(), _units(found), strict=True), start=1
    ):
        made.add_row(str(i), escape(line), f"{value:.5g}", unit)
    show(
        f"[bold]{escape(found.robot.name)}[/bold]: {found.rank} base parameters of "
        f"{len(found.columns)} inertial parameters",
        made,
        *closing,
    )


def _units(found: BaseParameters) -> list[str]:
    from pteron.manipulator import parameter_names, parameter_units

    robot = found.robot
    of_kind = {
        name.split("_")[0]: unit
        for name, unit in zip(parameter_names(robot), parameter_units(robot), strict=True)
    }
    return [of_kind[name.split("_")[0]] for name in found.names]


def _meanings(found: BaseParameters, *, symbols: bool) -> list[str]:
    """Return a line that says what the symbols stand for, if there are any."""
    if not symbols:
        return []
    values = (f"{name} = {value:g}" for name, value in found.geometry_values.items())
    return [f"In metres: {', '.join(values)}."]


def _proof(found: BaseParameters) -> list[str]:
    return found.certificate.summary().splitlines()
