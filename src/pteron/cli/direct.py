"""`pteron direct`: from sliders to poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from pteron.cli.arguments import Failure, Json, Out, Robot, TableFile
from pteron.cli.numbers import parsed_numbers
from pteron.cli.results import check_destination, deliver
from pteron.cli.robots import load_robot
from pteron.cli.rows import rows_of_table, single_row

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pteron.tables import Table

__all__ = ["direct"]


def direct(
    robot: Robot,
    sliders: Annotated[
        list[str] | None,
        Argument(
            metavar="SLIDERS", help="rho1 rho2 ..., one for each leg; metres.", show_default=False
        ),
    ] = None,
    table: TableFile = None,
    out: Out = None,
    on_failure: Annotated[
        Failure | None,
        Option(
            "--on-failure",
            help="Stop where no pose has the sliders, or leave the row empty; raise for sliders "
            "typed here, nan for a table.",
            show_default=False,
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Compute every pose that has the sliders' coordinates: all assembly modes.

    A table has the columns rho1, rho2, ...; the result has one row for each real pose, with the
    table's row (from 1) and its columns, the assembly mode (from 1) and x y z phi. Where there is
    no real pose, these are empty.
    """
    from pteron.kinematics import direct_kinematics

    machine = load_robot(robot)
    columns = [f"rho{i}" for i in range(1, machine.freedom + 1)]
    rows = rows_of_table(table, bool(sliders), "sliders", columns)
    if rows is None:
        rows = single_row(columns, parsed_numbers(sliders or [], columns, "sliders"))
    failure = on_failure or (Failure.RAISE if rows.single else Failure.NAN)
    added = ["row", "mode", *machine.coordinates]
    check_destination(out, table, rows.table, added)
    poses = rows.served(
        lambda values: direct_kinematics(machine, values, on_failure=failure.value),
        columns,
        failure,
    )
    result = _modes(rows.table, poses, machine.coordinates)
    shown = added[1:] if rows.single else added
    deliver(result, shown, out=out, as_json=json)


def _modes(table: Table, poses: NDArray[Any], coordinates: tuple[str, ...]) -> Table:
    """Return one row for each real pose, and one without a pose where there is none."""
    from dataclasses import replace

    import numpy as np
    import polars as pl

    real = ~np.isnan(poses).any(axis=-1)
    lost = ~real.any(axis=-1)
    real[lost, 0] = True
    row, mode = np.nonzero(real)
    frame = table.frame.drop("row", "mode", *coordinates, strict=False)[row]
    frame.insert_column(0, pl.Series("row", row + 1))
    modes = pl.Series("mode", mode + 1, dtype=pl.Int64)
    frame = frame.hstack([modes.zip_with(~pl.Series(lost[row]), pl.Series([None], dtype=pl.Int64))])
    found = poses[row, mode].T
    return replace(table, frame=frame).extended(dict(zip(coordinates, found, strict=True)))
