"""`pteron inverse`, `direct` and `forces`: poses, joint coordinates and actuator forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import MOTION, Failure, MachineArgument, about_pivot, parsed_numbers
from pteron.cli.motion_argument import pose_numbers
from pteron.cli.table_rows import (
    TableRows,
    check_destination,
    deliver,
    given_rows,
    rows_of_table,
    single_row,
)
from pteron.cli.terminal import note, plain
from pteron.errors import DataError
from pteron.tolerances import ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pteron.cli.typed_row import TypedRow
    from pteron.manipulator import Manipulator
    from pteron.tables import Table


def inverse(
    machine: MachineArgument,
    pose: list[str] | None = None,
    *,
    table: str | None = None,
    pivot: str | None = None,
    out: str | None = None,
    on_failure: Failure = "raise",
    json: bool = False,
) -> None:
    """Compute the joint coordinates at poses.

    A table has the columns x y z phi or x y z roll pitch yaw, those that the machine has, in m and
    rad, or in units that their names state: x (mm), roll (deg). The result has its columns, in SI
    units, and rho1, rho2, ... of sliders, m, or theta1, theta2, ... of cranks, rad, as the drives
    count them if a leg has a `reading`. A crank is at 0 along its zero_direction, positive by the
    right-hand rule about its axis, `direction`; pteron check describes each joint.

    Arguments
    ---------
    POSE: The pose x y z phi, x y z roll pitch yaw, or what the machine has, m and rad; or home.

    Examples
    --------
    pteron inverse quadrupteron 0.01 0.02 -0.03 0.1
    pteron inverse tripteron --table poses.csv --out joints.csv
    """
    from pteron.kinematics import inverse_kinematics
    from pteron.manipulator.readings import from_readings, to_readings

    machine = about_pivot(machine, pivot)
    columns = machine.coordinates
    rows = given_rows(machine, table, pose, "pose", columns)
    added = machine.joint_names
    check_destination(out, table, rows.table, added)
    joints = rows.evaluate(
        machine,
        lambda poses: to_readings(
            machine, inverse_kinematics(machine, poses, on_failure=on_failure)
        ),
        columns,
        on_failure,
    )
    _note_limits(machine, from_readings(machine, joints))
    with_joints = rows.table.with_columns(dict(zip(added, joints.T, strict=True)))
    name = plain(machine.name)
    joints_text = dict.fromkeys(f"{leg.joint.noun} {leg.joint.coordinate}" for leg in machine.legs)
    nouns = ", ".join(joints_text)
    caption = f"[bold]{name}[/bold]: coordinates of the actuated joints ({nouns})"
    deliver(machine, with_joints, added, out=out, as_json=json, caption=caption, single=rows.single)


def direct(
    machine: MachineArgument,
    joints: list[str] | None = None,
    *,
    table: str | None = None,
    pivot: str | None = None,
    out: str | None = None,
    on_failure: Failure | None = None,
    json: bool = False,
) -> None:
    """Compute every pose that has the joint coordinates: all assembly modes.

    A table has the columns rho1, theta2, ... as the machine's joints are; the result has one row
    for each real pose, with the table's row (from 1) and its columns, the assembly mode (from 1)
    and x y z phi, those that the machine has. Without a real pose, these are empty. Of a machine
    with five freedoms (3T2R) a search finds poses, and others may exist.

    Arguments
    ---------
    JOINTS: Joint coordinates, one a leg: rho of a slider, m; theta of a crank, rad.

    Options
    -------
    --on-failure: If no pose has the joint coordinates, stop (raise) or leave the row empty (nan).
        [default: raise for coordinates typed here, nan for a table]

    Examples
    --------
    pteron direct quadrupteron 0.03 0.02 0.01 0.02
    pteron direct quadrupteron --table log.csv --out poses.parquet
    """
    from pteron.kinematics import direct_kinematics
    from pteron.manipulator.readings import from_readings

    machine = about_pivot(machine, pivot)
    columns = machine.joint_names
    rows = given_rows(machine, table, joints, "joints", columns)
    failure: Failure = on_failure or ("raise" if rows.single else "nan")
    added = ["row", "mode", *machine.coordinates]
    check_destination(out, table, rows.table, added)
    poses = rows.evaluate(
        machine,
        lambda joint_rows: direct_kinematics(
            machine, from_readings(machine, joint_rows), on_failure=failure
        ),
        columns,
        failure,
    )
    _note_limits(machine, from_readings(machine, rows.table.numbers(columns, failure)))
    with_poses = _modes(rows.table, poses, machine.coordinates)
    shown = added[1:] if rows.single else added
    is_search = bool(machine.platform.second_axis and machine.platform.lengths)
    modes = "others may exist" if is_search else "all assembly modes"
    caption = f"[bold]{plain(machine.name)}[/bold]: poses of these joint coordinates, {modes}"
    deliver(machine, with_poses, shown, out=out, as_json=json, caption=caption)


def _note_limits(machine: Manipulator, joints: NDArray[Any]) -> None:
    """Print a note on joint coordinates (B, n) beyond limits; the results are unchanged."""
    import numpy as np

    violations = []
    for name, leg, coordinates in zip(machine.joint_names, machine.legs, joints.T, strict=True):
        low, high = leg.limits or (-np.inf, np.inf)
        beyond = np.nan_to_num(np.maximum(low - coordinates, coordinates - high), nan=-np.inf)
        if beyond.max(initial=0.0) > ROUNDING:
            rows = (
                f"in {(beyond > ROUNDING).sum()} of {len(coordinates)} rows, "
                if len(coordinates) > 1
                else ""
            )
            limits = f"limits {low:g} to {high:g} {leg.joint.unit}"
            violations.append(f"{name} ({rows}{coordinates[beyond.argmax()]:.4g}, {limits})")
    if violations:
        note(f"Note: beyond the joints' limits: {', '.join(violations)}")


def _modes(
    table: Table | TypedRow, poses: NDArray[Any], coordinates: tuple[str, ...]
) -> Table | TypedRow:
    """Return a row for each real pose, and a row without a pose where there is none."""
    from dataclasses import replace

    import numpy as np

    from pteron.cli.typed_row import TypedRow

    real = ~np.isnan(poses).any(axis=-1)
    lost = ~real.any(axis=-1)
    real[lost, 0] = True
    row, mode = np.nonzero(real)
    columns = dict(zip(coordinates, poses[row, mode].T, strict=True))
    if isinstance(table, TypedRow):
        numbers = [None] if lost.any() else (mode + 1).tolist()
        return table.repeat_modes(numbers, coordinates).with_columns(columns)
    import polars as pl

    frame = table.frame.drop("row", "mode", *coordinates, strict=False)[row]
    frame.insert_column(0, pl.Series("row", row + 1))
    modes = pl.Series("mode", mode + 1, dtype=pl.Int64)
    frame = frame.hstack([modes.zip_with(~pl.Series(lost[row]), pl.Series([None], dtype=pl.Int64))])
    return replace(table, frame=frame).with_columns(columns)


def forces(
    machine: MachineArgument,
    *,
    pose: str | None = None,
    velocity: str | None = None,
    acceleration: str | None = None,
    wrench: str | None = None,
    drives: bool = False,
    table: str | None = None,
    pivot: str | None = None,
    out: str | None = None,
    on_failure: Failure = "raise",
    json: bool = False,
) -> None:
    """Compute the actuator forces of a motion.

    A table has the columns x y z phi dx dy dz dphi ddx ddy ddz ddphi and, if a wrench acts on the
    platform, fx fy fz mk: of each four those that the machine's pose has, or roll, pitch and yaw in
    place of phi; a platform that tilts has fx fy fz mx my mz. The result has its columns and
    force1, force2, ... of sliders, N, or torque1, torque2, ... of cranks, N m. These forces move
    the bodies; with --drives they include friction and the motors' inertia. A note says if they
    exceed a drive's limits in the machine's file.

    Options
    -------
    --pose NUMBERS: Pose x y z phi, or what the machine has, m and rad; or home.
    --velocity NUMBERS: Time derivative of the pose. [default: 0]
    --acceleration NUMBERS: Second time derivative of the pose. [default: 0]
    --wrench NUMBERS: External wrench on the platform at its point P: fx fy fz mk, or fx fy fz mx my
        mz of a platform that tilts; N and N m.
    --drives: Forces of the drives: with friction and the motors' inertia.

    Examples
    --------
    pteron forces quadrupteron --pose 0.01 0.02 -0.03 0.1 --velocity 0 0 0.5 0
    pteron forces quadrupteron --table motion.csv --out forces.csv
    """
    import numpy as np

    from pteron.dynamics import drive_forces, inverse_dynamics
    from pteron.kinematics import inverse_kinematics, joint_rates
    from pteron.manipulator.readings import reading_scales
    from pteron.motion import overloads

    machine = about_pivot(machine, pivot)
    m, n = machine.freedom, machine.joint_count
    names = machine.column_names
    loads = names["wrench"]
    motion = [*names["pose"], *names["velocity"], *names["acceleration"]]
    typed = [pose, velocity, acceleration, wrench]
    if table is not None and all(text is None for text in typed):
        rows = rows_of_table(machine, table, "pose", motion)
    elif table is not None:
        raise DataError("pose and --table given; give one of them")
    else:
        rows = _typed_row(machine, typed, motion, loads)
    columns = [*motion, *(loads if set(loads) & set(rows.table.columns) else ())]
    added = machine.force_names
    check_destination(out, table, rows.table, added)

    limiting = ("max_force", "max_speed", "curve", "winding")
    limited = any(getattr(leg.drive, key, None) for leg in machine.legs for key in limiting)

    def serve(states: NDArray[Any]) -> NDArray[Any]:
        """Return forces to deliver, and forces and rates to hold against the drives' limits."""
        # A wrench has six components where the platform tilts.
        parts = np.split(states, [k for k in (m, 2 * m, 3 * m) if k < len(columns)], axis=-1)
        if not (drives or limited):
            return inverse_dynamics(machine, *parts, on_failure=on_failure)
        driven = drive_forces(machine, *parts, on_failure=on_failure)
        requested = driven if drives else inverse_dynamics(machine, *parts, on_failure=on_failure)
        rates = joint_rates(machine, *parts[:2], on_failure=on_failure).actuated
        return np.concatenate([requested, driven, rates], axis=-1)

    served = rows.evaluate(machine, serve, columns, on_failure)
    delivered = served[:, :n] * reading_scales(machine)
    poses = rows.table.numbers(columns[:m], on_failure)
    _note_limits(machine, inverse_kinematics(machine, poses, on_failure="nan"))
    for text in overloads(machine, served[:, n : 2 * n], served[:, 2 * n :]) if limited else ():
        note(f"Note: {text}")
    with_forces = rows.table.with_columns(dict(zip(added, delivered.T, strict=True)))
    caption = _forces_caption(machine, drives=drives)
    deliver(machine, with_forces, added, out=out, as_json=json, caption=caption, single=rows.single)


def _forces_caption(robot: Manipulator, *, drives: bool) -> str:
    """Return the caption of a table of drive forces, with friction or without."""
    terms = "with friction and motor inertia"
    if not drives:
        terms = "without friction and motor inertia (--drives adds them)"
    return f"[bold]{plain(robot.name)}[/bold]: drive forces {terms}"


def _typed_row(
    machine: Manipulator, typed: list[str | None], motion: list[str], loads: tuple[str, ...]
) -> TableRows:
    """Return a single row of the typed pose, rates, accelerations and wrench; 0 by default."""
    m = len(motion) // 3
    if typed[0] is None:
        raise DataError(f"no pose given; give --pose with {' '.join(motion[:m])}, or --table FILE")
    names = motion[:m]
    numbers = pose_numbers(machine, [typed[0]], MOTION[0])
    parts = (motion[m : 2 * m], motion[2 * m :], loads)
    for name, text, part in zip(MOTION[1:], typed[1:], parts, strict=True):
        if text is None and name == "--wrench":
            continue
        names += part
        numbers += [0.0] * len(part) if text is None else parsed_numbers([text], part, name)
    return single_row(names, numbers)
