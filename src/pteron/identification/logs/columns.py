"""The columns of a file that hold the parts of a log, and their units.

Columns are those declared in the description, else the documented ones, else those whose names say
what they hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pteron.errors import DataError, shorten
from pteron.identification.logs.clock import Clock
from pteron.identification.logs.column_names import SoughtColumn
from pteron.identification.logs.description import Description, joint_symbols
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.names import is_synonym, parse_column_name
from pteron.identification.logs.search import ColumnSearch, Group
from pteron.manipulator import Manipulator
from pteron.tables import Table, join_names

_ONCE = ("rho", "theta", "force", "torque")
"""Documented words of columns of which a leg has one."""


class Columns(NamedTuple):
    """The columns of a file that hold the parts of a log."""

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
    needed += d.joint_columns or [f"{joint.coordinate}{i}" for i, joint in enumerate(joints, 1)]
    needed += d.force_columns or [f"{joint.force}{i}" for i, joint in enumerate(joints, 1)]
    search = ColumnSearch(tuple(names), units, len(joints), needed, source, hint)
    travels = [
        SoughtColumn("joints", joint.coordinate, f"{joint.noun}s", joint.unit, unit)
        for joint, unit in zip(joints, d.joint_units(robot), strict=True)
    ]
    raw = d.column_force_unit
    units_of_forces = [joint.force_unit if raw in ("N", "N m") else raw for joint in joints]
    actuators = [
        SoughtColumn("forces", joint.force, f"{joint.force}s", joint.force_unit, unit)
        for joint, unit in zip(joints, units_of_forces, strict=True)
    ]
    numbers = range(1, len(joints) + 1)
    time = search.time(SoughtColumn("time", "t", "time", "s", d.time_unit), d.time_column)
    coordinates = search.group(travels, d.joint_columns, numbers)
    forces = search.group(actuators, d.force_columns, numbers)
    if len({unit if unit not in ("N", "N m") else "SI" for unit in forces.units}) > 1:
        raise DataError(
            f"{source}: {join_names(forces.names)} are in {', '.join(forces.units)}; give all in "
            "their SI units, or all in one unit of the drives"
        )
    declared = {"m": d.length_unit, "rad": d.angle_unit}
    pose = [
        SoughtColumn("pose", name, "pose", unit, declared[unit])
        for name, unit in zip(robot.coordinates, robot.units, strict=True)
    ]
    measured, payload = search.pose(pose, d.pose_columns), search.payload(d.payload_column)
    return Columns(time, coordinates, forces, measured, payload, tuple(search.findings))


def check_names(repeated: Mapping[str, str], source: str) -> None:
    """Raise a `DataError` where a file has a column of a joint or a force twice."""
    for name in repeated.values():
        parts = parse_column_name(name)
        if parts and any(is_synonym(parts.word, stem) for stem in _ONCE):
            raise _duplicate_error(name, source)


def repeated_times(repeated: Mapping[str, str], columns: Columns, source: str) -> tuple[str, ...]:
    """Return the further columns of times with the first's name, where each channel has its own.

    `repeated` are the names that a file has more than once, as they are told apart.

    Raises
    ------
    DataError
        If another column that is used has its name twice.
    """
    used = [name for group in columns[1:5] for name in group.names]
    for name in repeated.values():
        if name in used:
            raise _duplicate_error(name, source)
    return tuple(new for new, name in repeated.items() if name in columns.time.names)


def check_times(table: Table, first: str, others: Sequence[str]) -> None:
    """Raise a `DataError` where a channel was sampled at another time than the first."""
    for name in others:
        differs = (table.frame[name] != table.frame[first]).fill_null(value=True)
        if differs.any():
            row = int(np.argmax(differs.to_numpy()))
            first_time, other_time = (shorten(str(table.frame[key][row])) for key in (first, name))
            raise DataError(
                f"{table.place(row)}: its channels were not sampled at one time: {first} is "
                f"{first_time}, {name} is {other_time}; record all channels with one sample time, "
                "or export them with one time column"
            )


def reading_findings(
    source: str,
    dialect_notes: Sequence[str],
    columns: Columns,
    description: Description,
    clock: Clock,
    repeated: Sequence[str],
) -> tuple[Finding, ...]:
    """Return a finding that states how a file was read, if not documented or declared.

    `dialect_notes` state what is unlike a plain CSV file, `repeated` are the `repeated_times`.
    """
    parts = list(dialect_notes)
    time = columns.time.phrase("time")
    if clock.format is not None:
        time = f"{time.removesuffix(' in s')} as text, {clock.format}"
    elif clock.guessed:
        time = f"{time.removesuffix(' in s')} in {clock.unit} (guessed from its size)"
    if columns.time.reported or clock.guessed or (clock.format and not description.time_format):
        parts.append(time)
    if repeated:
        parts.append(f"{len(repeated) + 1} equal columns of times")
    groups = {"joints": columns.joints, "forces": columns.forces, "pose": columns.pose}
    parts += [group.phrase(noun) for noun, group in groups.items() if group.reported]
    if not parts:
        return ()
    guessed = any(group.guessed for group in (columns.time, *groups.values()))
    advice = "; columns are taken by name: declare them in its TOML file to be sure" * guessed
    return (Finding("read", f"{source}: read as: {', '.join(parts)}{advice}"),)


def _duplicate_error(name: str, source: str) -> DataError:
    """Return the error that two columns have the same name."""
    return DataError(f"{source}: two columns are called {shorten(name)}; rename or remove one")
