"""`pteron forces`: from a motion to actuator forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from pteron.cli.arguments import Elbows, Failure, Json, OnFailure, Out, Robot, TableFile
from pteron.cli.numbers import parsed_numbers
from pteron.cli.results import check_destination, deliver
from pteron.cli.robots import load_robot
from pteron.cli.rows import Rows, rows_of_table, single_row
from pteron.errors import DataError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["forces"]

_LOADS = ("fx", "fy", "fz", "mk")


def _vector(name: str, text: str) -> Any:
    return Option(f"--{name}", metavar="NUMBERS", help=text, show_default=False)


def forces(
    robot: Robot,
    pose: Annotated[str | None, _vector("pose", "x y z phi, or x y z for 3T; m and rad.")] = None,
    velocity: Annotated[str | None, _vector("velocity", "Its rate; at rest if left out.")] = None,
    acceleration: Annotated[
        str | None, _vector("acceleration", "The rate of that; zero if left out.")
    ] = None,
    wrench: Annotated[
        str | None, _vector("wrench", "fx fy fz mk on the platform at P; N and N m.")
    ] = None,
    table: TableFile = None,
    out: Out = None,
    elbows: Elbows = None,
    on_failure: OnFailure = Failure.RAISE,
    json: Json = False,
) -> None:
    """Compute the actuator forces of a motion.

    A table has the columns x y z phi dx dy dz dphi ddx ddy ddz ddphi (3T: without the angles) and,
    if a wrench acts on the platform, fx fy fz mk (3T: fx fy fz); the result has its columns and
    force1, force2, ...
    """
    from pteron.dynamics import inverse_dynamics

    machine = load_robot(robot, elbows)
    coordinates, m = machine.coordinates, machine.freedom
    loads = _LOADS[:m]
    motion = [f"{rate}{name}" for rate in ("", "d", "dd") for name in coordinates]
    typed = {"pose": pose, "velocity": velocity, "acceleration": acceleration, "wrench": wrench}
    rows = rows_of_table(table, any(v is not None for v in typed.values()), "pose", motion)
    if rows is None:
        rows = _typed_row(typed, coordinates, loads)
    found = [name for name in loads if name in rows.table.columns]
    columns = [*motion, *(loads if found else ())]
    added = [f"force{i}" for i in range(1, m + 1)]
    check_destination(out, table, rows.table, added)

    def serve(values: NDArray[Any]) -> NDArray[Any]:
        parts = (values[:, k : k + m] for k in range(0, len(columns), m))
        return inverse_dynamics(machine, *parts, on_failure=on_failure.value)

    result = rows.table.extended(
        dict(zip(added, rows.served(serve, columns, on_failure).T, strict=True))
    )
    deliver(result, added, out=out, as_json=json, single=rows.single)


def _typed_row(
    typed: dict[str, str | None], coordinates: tuple[str, ...], loads: tuple[str, ...]
) -> Rows:
    if typed["pose"] is None:
        raise DataError(f"no pose given; give --pose with {' '.join(coordinates)}")
    names: list[str] = []
    values: list[float] = []
    for what, prefix in (("pose", ""), ("velocity", "d"), ("acceleration", "dd"), ("wrench", "")):
        given = typed[what]
        parts = loads if what == "wrench" else [prefix + name for name in coordinates]
        if given is not None:
            values += parsed_numbers([given], parts, f"--{what}")
        elif what != "wrench":
            values += [0.0] * len(parts)
        else:
            continue
        names += parts
    return single_row(names, values)
