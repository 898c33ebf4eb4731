"""`read_measurements`: reads a calibration's measurements from CSV, Parquet or controllers' files.

A row is a pose: the joints' readings and what was measured there. docs/calibration-logs.md has the
columns.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pteron.calibration.controller_logs import read_controller_log
from pteron.calibration.measurements import TEXTS, TOOL, VALUES, Measurements, Setup
from pteron.calibration.setup_file import join_setups, read_setup_file
from pteron.errors import DataError, shorten, warn_unlikely
from pteron.kinematics.unlikely_values import unlikely_length, unlikely_values
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.readings import from_readings
from pteron.tables import Dialect, Table, join_names, open_table, whole_table
from pteron.tables.units import FACTORS
from pteron.toml import joined_faults

Array = NDArray[np.float64]

_POSITION = ("x", "y", "z")
_NAMED = ("mark", "plane", "anchor")
_WITH_UNIT = re.compile(r"(.*?)[ _]*[\[(]([^\])]*)[\])]|(.*)_(mm|cm|um|deg|mrad|ms)")
"""A column's name with its unit: "x (mm)", "x [mm]", "x_mm"."""


def read_measurements(robot: RobotLike, *paths: str | Path) -> Measurements:
    r"""Read the measurements of a machine from one log or several.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine as drawn.
    *paths : str or path
        CSV or Parquet files, or files of controllers; see `read_controller_log`. The TOML file of
        the same stem, where there is one, says what the measurements refer to.

    Returns
    -------
    Measurements
        All rows, one log after the other. Readings are as the drives count them.

    Raises
    ------
    DataError
        If a column is missing or a cell no number; if a row measures a distance from nowhere; if a
        mark, plane or anchor is named that the TOML file does not describe. All faults of a log are
        reported at once, each with its line and column.

    Warns
    -----
    UnlikelyValue
        Where values are likely in mm or degrees, a distance is 0, a row measures nothing, or a
        column is not read.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from pteron.calibration.measured_log import read_measurements
    >>> text = "rho1,rho2,rho3,height (mm)\n0.11,0.10,0.12,0.02\n0.10,0.12,0.11,-0.01\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bed.csv"
    ...     _ = path.write_text(text)
    ...     found = read_measurements("linear-delta", path)
    >>> found.heights.tolist(), found.places
    ([2e-05, -1e-05], ('bed.csv, line 2', 'bed.csv, line 3'))
    """
    robot = as_manipulator(robot)
    if not paths:
        raise DataError("paths: none given; at least one log of measurements is needed")
    return _join_logs([_read(robot, path) for path in paths], [str(path) for path in paths])


def _read(robot: Manipulator, path: str | Path) -> Measurements:
    """Return the measurements of a file, with those of the file beside it; raise on faults."""
    setup_file = read_setup_file(path)
    measurements = read_controller_log(path, robot, setup_file.g33.radius)
    if measurements is None:
        measurements = _read_rows(robot, _open_table(robot, path, setup_file.csv), Path(path).name)
    measurements = replace(measurements, setup=setup_file.setup())
    source = shorten(str(path), bare=True, longest=1000)
    faults = [*_missing_descriptions(measurements)]
    if faults:
        raise DataError(joined_faults(faults), subject=source)
    for text in _unlikely_readings(robot, measurements, source):
        warn_unlikely(text)
    return measurements


class _Opened(NamedTuple):
    """A table, and by name the column that holds it and the factor to SI units."""

    table: Table
    columns: dict[str, tuple[str, float]]


def _open_table(robot: Manipulator, path: str | Path, dialect: Dialect | None) -> _Opened:
    """Return a log's table: plain if line 1 names the joints, else in a detected dialect."""
    units = {**dict.fromkeys(("t",), "s"), **dict.fromkeys((*_POSITION, "height", "distance"), "m")}
    units |= dict(zip(robot.coordinates, robot.units, strict=True))
    units |= {name: leg.joint.unit for name, leg in zip(robot.joint_names, robot.legs, strict=True)}
    units |= dict.fromkeys((*_NAMED, "from"), "")
    file = open_table(path, noun="log", dialect=dialect)
    if dialect is None and Path(path).suffix.lower() == ".csv":
        plain = {_name_and_unit(name)[0] for name in file.columns}
        if not plain >= set(robot.joint_names):
            file = open_table(path, noun="log", dialect=Dialect())
    columns: dict[str, tuple[str, float]] = {}
    faults, unread = [], []
    for k, column in enumerate(file.columns):
        name, unit = _name_and_unit(column)
        unit = (file.units[k] if k < len(file.units) else "") or unit
        if name not in units:
            unread.append(column)
            continue
        factor = FACTORS.get(units[name], {}).get(unit.strip("[]() ") or units[name])
        if factor is None and units[name]:
            valid = ", ".join(FACTORS[units[name]])
            faults.append(f"column {shorten(column, bare=True)}: its unit is none of {valid}")
        elif name in columns:
            faults.append(f"two columns are {name}: {join_names([columns[name][0], column])}")
        columns.setdefault(name, (column, factor or 1.0))
    if missing := [name for name in robot.joint_names if name not in columns]:
        faults.append(
            f"no column {join_names(missing)} (found: {join_names(file.columns)}); {file.hint}"
        )
    if faults:
        raise DataError(joined_faults(faults), subject=file.source)
    others = {*robot.force_names, *(f"{d}{name}" for d in ("d", "dd") for name in units)}
    if unread := [name for name in unread if name not in others]:
        text = f"{file.source}: {join_names(unread)}: not read; what is measured is called "
        text += join_names([*dict.fromkeys((*_POSITION, *robot.coordinates)), "height", "distance"])
        warn_unlikely(text)
    table = whole_table(file)
    first = _first_line(table)
    if first is not None:  # each is else looked for from the file's beginning
        table = replace(table, line_of=lambda i: first + i)
    return _Opened(table, columns)


def _name_and_unit(column: str) -> tuple[str, str]:
    """Return the name of a column in lower case, and its unit, if any."""
    match = _WITH_UNIT.fullmatch(column.strip())
    if match is None:
        return column.strip().lower(), ""
    return (match[1] or match[3] or "").strip().lower(), (match[2] or match[4] or "").strip()


def _read_rows(robot: Manipulator, opened: _Opened, source: str) -> Measurements:
    """Return the measurements of a table's rows; raise with all faults of its cells."""
    table, columns = opened
    faults: list[str] = []
    n = len(table)

    def column(name: str) -> Array:
        """Return a column (rows,) by name in SI units; NaN if the table lacks it."""
        if name not in columns:
            return np.full(n, np.nan)
        header, factor = columns[name]
        return factor * _numbers(table, header, faults)

    def texts(name: str) -> tuple[str, ...]:
        """Return a column's texts (rows,) by its name; TOOL where cell or column is missing."""
        if name not in columns:
            return (TOOL,) * n
        cells = table.frame[columns[name][0]].cast(pl.String).fill_null(TOOL)
        return tuple(cells.str.strip_chars().to_list())

    def several(names: Sequence[str]) -> Array:
        """Return columns (rows, k) by name in SI units; NaN where the table lacks a column."""
        return np.stack([column(name) for name in names], axis=-1) if names else np.empty((n, 0))

    def fault(row: np.integer[Any], text: str) -> None:
        """Append a fault's text, after the place of its row in the file, to the faults."""
        faults.append(f"{table.place_in_file(int(row))}{text}")

    readings = several(robot.joint_names)
    for i, j in np.argwhere(np.isnan(readings)):
        name = columns[robot.joint_names[j]][0]
        fault(i, f", column {name}: no number; a row needs every reading")
    times = column("t") if "t" in columns else None
    for i in () if times is None else np.flatnonzero(np.isnan(times)):
        fault(i, ", column t: no number; give each row its time, or none")
    measured_columns = several(_POSITION), several(robot.platform.angles), column("height")
    distances, start_rows, anchors = column("distance"), column("from"), texts("anchor")
    origins = np.full(n, -1)
    for i in np.flatnonzero(~np.isnan(start_rows)):
        row = start_rows[i]
        if row != int(row) or not 1 <= row <= n or row == i + 1:
            fault(i, f", column from: {row:g} given, another row from 1 to {n} expected")
        else:
            origins[i] = int(row) - 1
    has_distance = ~np.isnan(distances)
    starts = (~np.isnan(start_rows)).astype(int) + [bool(name) for name in anchors]
    for i in np.flatnonzero(has_distance & (starts != 1)):
        both = "both" if starts[i] else "neither"
        which = "give one, the row or the point that it is measured from"
        fault(i, f": a distance with {both} from and anchor; {which}")
    for i in np.flatnonzero(~has_distance & (starts > 0)):
        fault(i, ": from or anchor, but no distance; give all, or none")
    if faults:
        raise DataError(joined_faults(list(dict.fromkeys(faults))), subject=table.source)
    names = texts("mark"), texts("plane"), anchors, _places(table, source)
    closures = np.zeros((n, robot.redundancy))
    columns_of_rows = readings, *measured_columns, distances, origins, *names, times
    return Measurements(*columns_of_rows, closures=closures)


def _numbers(table: Table, column: str, faults: list[str]) -> Array:
    """Return a column (N,), NaN where empty; each cell that is not a number adds a fault."""
    try:
        return np.asarray(table.numbers([column], "nan")[:, 0])
    except DataError as error:
        if len(table) == 1:
            faults.append(error.message)
            return np.zeros(1)
    half, first, line_of = len(table) // 2, table.first_row, table.line_of
    later = line_of and (lambda i: line_of(half + i))
    parts = (
        replace(table, frame=table.frame[:half]),
        replace(table, frame=table.frame[half:], first_row=first + half, line_of=later),
    )
    return np.concatenate([_numbers(part, column, faults) for part in parts])


def _first_line(table: Table) -> int | None:
    """Return the first row's line number if rows are on consecutive lines, else None."""
    if table.line_of is None:
        return None
    first, last = table.line_of(0), table.line_of(len(table) - 1)
    return first if last - first == len(table) - 1 else None


def _places(table: Table, source: str) -> tuple[str, ...]:
    """Return each row's place for messages: its line, or its number where lines are slow."""
    first = _first_line(table)
    word, start = ("row", 1) if first is None else ("line", first)
    return tuple(f"{source}, {word} {start + i}" for i in range(len(table)))


def _missing_descriptions(measurements: Measurements) -> Iterator[str]:
    """Yield the marks, planes and anchors that rows name and the TOML file does not describe."""
    for part in ("marks", "planes", "anchors"):
        described = getattr(measurements.setup, part)
        for name in sorted({*getattr(measurements, part)} - {TOOL, *described}):
            row = getattr(measurements, part).index(name)
            yield (
                f"{measurements.places[row]}: {part[:-1]} {shorten(name)} is not described; give "
                f"[{part}.{name}] in the TOML file beside it"
            )


def _unlikely_readings(
    robot: Manipulator, measurements: Measurements, source: str
) -> Iterator[str]:
    """Yield warnings of readings that are implausible: units, limits, sizes, empty rows."""
    places = measurements.places
    size = 0.1 * unlikely_length(robot)
    measured = np.concatenate([measurements.positions, measurements.angles], axis=-1)
    names = (*robot.joint_names, *_POSITION, *robot.platform.angles)
    columns = np.concatenate([measurements.readings, measured], axis=-1)
    for text in unlikely_values(robot, names, columns):
        yield f"{source}: {text}"
    joints = from_readings(robot, measurements.readings)
    for j, leg in enumerate(robot.legs):
        low, high = leg.limits or (-np.inf, np.inf)
        beyond = np.maximum(low - joints[:, j], joints[:, j] - high)
        row = int(np.argmax(beyond))
        if beyond[row] > high - low:
            yield (
                f"{places[row]}: {robot.joint_names[j]} = {joints[row, j]:g} is far beyond "
                f"its limits {low:g} to {high:g} {leg.joint.unit}: is it in another unit?"
            )
    for name, lengths, most in (
        ("height", measurements.heights, size),
        ("distance", measurements.distances, 10.0 * size),  # an anchor may stand far away
    ):
        sizes = np.nan_to_num(np.abs(lengths))
        if (sizes > most).any():
            row = int(np.argmax(sizes))
            yield (
                f"{places[row]}: {name} {lengths[row]:g} is more than the machine's size, "
                f"{size:.3g} m: is it in mm? m are expected"
            )
    if len(none := np.flatnonzero(measurements.distances == 0.0)):
        yield f"{join_names([places[row] for row in none])}: a distance of 0: was it measured?"
    seen = ~np.isnan(np.column_stack([measured, measurements.heights, measurements.distances])).all(
        axis=1
    )
    seen[measurements.origins[measurements.origins >= 0]] = True
    if not seen.all() and robot.joint_count == robot.freedom:
        rows = [places[row] for row in np.flatnonzero(~seen)]
        yield f"{join_names(rows)}: nothing is measured there"


def _join_logs(parts: Sequence[Measurements], sources: Sequence[str]) -> Measurements:
    """Return the measurements of several files as a single log; raise where setups differ."""
    setup: Setup = join_setups([part.setup for part in parts], sources)
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *map(len, parts)])
    fields: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("readings", *VALUES)
    }
    fields |= {name: sum((getattr(part, name) for part in parts), ()) for name in TEXTS}
    if all(part.times is not None for part in parts):
        fields["times"] = np.concatenate([part.times for part in parts if part.times is not None])
    moved = [
        np.where(part.origins < 0, -1, part.origins + start)
        for part, start in zip(parts, starts, strict=False)
    ]
    return Measurements(**fields, origins=np.concatenate(moved), setup=setup)
