"""Which columns of a file hold what, and in which unit: declared, documented or taken by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from pteron.errors import DataError
from pteron.identification.logs.description import Description, joint_symbols
from pteron.identification.logs.log import Finding
from pteron.identification.logs.search import Group, Search, Wanted
from pteron.manipulator import Manipulator
from pteron.tables import listed


class Columns(NamedTuple):
    """Where in a file the parts of a log are."""

    time: Group
    joints: Group
    forces: Group
    pose: Group
    payload: Group
    findings: tuple[Finding, ...]


def find_columns(
    names: Sequence[str],
    units: Mapping[str, str],
    robot: Manipulator,
    description: Description,
    source: str,
    hint: str,
) -> Columns:
    """Return where a file's columns are, after what is declared, documented, or else their names.

    `units` are those that a line of the file says, `source` is what messages call the file, `hint`
    what may be amiss with its header where nothing is found.

    Raises
    ------
    DataError
        If a needed column is missing, if several could be meant, or if a unit is unknown.
    """
    d, joints = description, joint_symbols(robot)
    needed = [d.time_column or "t"]
    needed += d.joint_columns or [f"{one.coordinate}{i}" for i, one in enumerate(joints, 1)]
    needed += d.force_columns or [f"{one.force}{i}" for i, one in enumerate(joints, 1)]
    search = Search(tuple(names), units, len(joints), needed, source, hint)
    travels = [
        Wanted("joints", one.coordinate, f"{one.noun}s", one.unit, unit)
        for one, unit in zip(joints, d.joint_units(robot), strict=True)
    ]
    si = d.column_force_unit in ("N", "N m")
    actuators = [
        Wanted(
            "forces",
            one.force,
            f"{one.force}s",
            one.force_unit,
            one.force_unit if si else d.column_force_unit,
        )
        for one in joints
    ]
    numbers = range(1, len(joints) + 1)
    time = search.time(Wanted("time", "t", "time", "s", d.time_unit), d.time_column)
    coordinates = search.group(travels, d.joint_columns, numbers)
    forces = search.group(actuators, d.force_columns, numbers)
    if len({unit if unit not in ("N", "N m") else "SI" for unit in forces.units}) > 1:
        raise DataError(
            f"{source}: {listed(forces.names)} are in {', '.join(forces.units)}; give all in their "
            "SI units, or all in one unit of the drives"
        )
    pose = [
        Wanted("pose", one, "pose", "rad", d.angle_unit)
        if one == "phi"
        else Wanted("pose", one, "pose", "m", d.length_unit)
        for one in robot.coordinates
    ]
    measured, payload = search.pose(pose, d.pose_columns), search.payload(d.payload_column)
    return Columns(time, coordinates, forces, measured, payload, tuple(search.findings))
