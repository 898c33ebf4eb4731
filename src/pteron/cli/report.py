"""`pteron report`: everything about a machine, in a folder."""

from __future__ import annotations

from typing import Annotated

from typer import Option

from pteron.cli.arguments import Elbows, Json, Robot
from pteron.cli.progress import spinner
from pteron.cli.robots import load_robot
from pteron.cli.screen import show, show_json

__all__ = ["report"]


def report(
    robot: Robot,
    out: Annotated[str, Option("--out", metavar="DIR", help="The folder to write it to.")],
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Write a report on a machine: tables, pictures and base parameters."""
    machine = load_robot(robot, elbows)
    with spinner(f"Writing the report on {machine.name}"):
        from pteron.report import write_report

        path = write_report(machine, out)
    if json:
        show_json({"robot": machine.name, "report": str(path)})
    else:
        show(f"{path}")
