"""`pteron inverse`: from poses to sliders."""

from __future__ import annotations

from typing import Annotated

from typer import Argument

from pteron.cli.arguments import Failure, Json, OnFailure, Out, Robot, TableFile
from pteron.cli.numbers import parsed_numbers
from pteron.cli.results import check_destination, deliver
from pteron.cli.robots import load_robot
from pteron.cli.rows import rows_of_table, single_row

__all__ = ["inverse"]


def inverse(
    robot: Robot,
    pose: Annotated[
        list[str] | None,
        Argument(
            metavar="POSE",
            help="x y z phi, or x y z for 3T; metres and radians.",
            show_default=False,
        ),
    ] = None,
    table: TableFile = None,
    out: Out = None,
    on_failure: OnFailure = Failure.RAISE,
    json: Json = False,
) -> None:
    """Compute the sliders' coordinates at poses.

    A table has the columns x y z phi (x y z for 3T); the result has its columns and rho1, rho2, ...
    """
    from pteron.kinematics import inverse_kinematics

    machine = load_robot(robot)
    columns = machine.coordinates
    rows = rows_of_table(table, bool(pose), "pose", columns)
    if rows is None:
        rows = single_row(columns, parsed_numbers(pose or [], columns, "pose"))
    added = [f"rho{i}" for i in range(1, machine.freedom + 1)]
    check_destination(out, table, rows.table, added)
    sliders = rows.served(
        lambda poses: inverse_kinematics(machine, poses, on_failure=on_failure.value),
        columns,
        on_failure,
    )
    result = rows.table.extended(dict(zip(added, sliders.T, strict=True)))
    deliver(result, added, out=out, as_json=json, single=rows.single)
