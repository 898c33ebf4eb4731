"""Logs in files: opened, and read in pieces that are checked across their borders, or whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError, shown
from pteron.identification.logs.channels import Channel
from pteron.identification.logs.columns import find_columns
from pteron.identification.logs.description import Description, joint_symbols
from pteron.identification.logs.description_file import find_description, read_description
from pteron.identification.logs.log import Log, joined
from pteron.identification.logs.sizes import (
    check_bounds,
    check_forces,
    check_step,
    joint_bounds,
    joint_spans,
    pose_bounds,
    standstill,
)
from pteron.identification.logs.time_stamps import TimeStamps
from pteron.manipulator import Manipulator
from pteron.tables import CsvFile, Dialect, ParquetFile, open_table

_FEWEST = 50
_AHEAD = 10_000
"""Rows looked at when a log is opened: the usual step is their median."""
_PER_UNIT = {"ms": 1e3, "us": 1e6, "mm": 1e3, "um": 1e6}

Values = NDArray[np.float64]


class LogFile:
    """A log that is open for reading; each pass over its pieces reads the file anew.

    Attributes
    ----------
    source : str
        What messages call the file.
    description : Description
        What is known about it; its force unit is that of the columns found.
    rows_estimate : int or None
        About how many rows it has, for a progress bar; exact in Parquet.
    findings : tuple of Finding
        What was guessed and, after a full pass, all that was noticed.
    rows_in_memory : int
        Rows up to which `identify` reads it whole: 2 million, 150 MB for four joints.
    rows_in_piece : int
        Rows that it is read by otherwise.
    """

    rows_in_memory = 2_000_000
    rows_in_piece = 1 << 18

    def __init__(
        self, file: CsvFile | ParquetFile, robot: Manipulator, description: Description
    ) -> None:
        self.source = source = file.source
        self._robot, self._file = robot, file
        self._columns = c = find_columns(file.columns, robot, description, source, file.hint)
        if description.column_force_unit is None and description.gains is None:
            unit: Any = c.forces.units[0]
            description = replace(description, column_force_unit=unit)
        self.description = description
        self.rows_estimate = file.rows_estimate
        self.findings = c.findings
        self._groups = (c.time, c.joints, c.forces, c.pose, c.payload)
        self._names = tuple(name for group in self._groups for name in group.names)
        self._bounds = joint_bounds(robot), pose_bounds(robot)
        self._step = self._usual_step()

    def pieces(
        self, rows: int | None = None, progress: Callable[[int], None] | None = None
    ) -> Iterator[Log]:
        """Yield the log in pieces, checked across their borders, in bounded memory.

        Parameters
        ----------
        rows : int, optional
            Rows a piece, `rows_in_piece` if not given; the last may have fewer.
        progress : callable, optional
            Called with the number of rows of each piece, once it is read.

        Raises
        ------
        DataError
            As `read_log`; a dead channel is known only behind the last piece.
        """
        rows = self.rows_in_piece if rows is None else rows
        if rows < 1:
            raise DataError(f"rows: {rows} given; a piece has at least 1 row")
        stamps = TimeStamps(self._step, self._columns.time.shown[0], self.source)
        channels = self._channels()
        n = self._robot.freedom
        low, high = np.full(n, np.inf), np.full(n, -np.inf)
        first = 0
        for values in self._values(rows):
            piece = self._piece(values, first)
            stamps.take(piece.time)
            both = np.hstack([piece.joints, piece.forces])
            for channel, column in zip(channels, np.ascontiguousarray(both.T), strict=True):
                channel.take(column, piece.joints)
            low = np.minimum(low, piece.joints.min(axis=0))
            high = np.maximum(high, piece.joints.max(axis=0))
            first += piece.rows
            if progress is not None:
                progress(piece.rows)
            yield piece
        found = [finding for channel in channels for finding in channel.finish()]
        found += standstill(high - low, self._robot, self._columns.joints, self.source)
        self.findings = (*self._columns.findings, *stamps.findings(), *found)

    def read(self, progress: Callable[[int], None] | None = None) -> Log:
        """Return the whole log, with all findings."""
        return replace(joined(list(self.pieces(progress=progress))), findings=self.findings)

    def _values(self, rows: int) -> Iterator[Values]:
        """Yield the file's numbers in arrays of so many rows; columns as in `_names`."""
        held: list[Values] = []
        count = 0
        for table in self._file.tables(self._names):
            held.append(table.numbers(self._names))
            count += len(table)
            while count >= rows:
                whole = held[0] if len(held) == 1 else np.concatenate(held)
                yield whole[:rows]
                held = [whole[rows:]]
                count -= rows
        if count:
            yield np.concatenate(held)

    def _piece(self, values: Values, first: int) -> Log:
        c, source = self._columns, self.source
        edges = np.cumsum([len(group.names) for group in self._groups])[:-1]
        time, joints, forces, pose, payload = (
            np.ascontiguousarray(
                np.transpose([_in_si(*both) for both in zip(part.T, group.units, strict=True)])
            )
            for group, part in zip(self._groups, np.split(values, edges, axis=1), strict=True)
        )
        of_joints, of_pose = self._bounds
        check_bounds(joints, of_joints, c.joints, source, first)
        if self.description.gains is not None:
            forces = forces * np.array(self.description.gains)
        check_forces(forces, c.forces.shown, source, first)
        if c.pose.names:
            check_bounds(pose, of_pose, c.pose, source, first)
        return Log(
            source=source,
            time=time[:, 0],
            joints=joints,
            forces=forces,
            pose=pose if c.pose.names else None,
            payload=self._phases(payload[:, 0], first) if c.payload.names else None,
            description=self.description,
            first_row=first,
            step=self._step,
            symbols=joint_symbols(self._robot),
            coordinates=self._robot.coordinates,
        )

    def _phases(self, values: Values, first: int) -> NDArray[np.int64]:
        bad = (values != 0.0) & (values != 1.0)
        if bad.any():
            i = int(np.argmax(bad))
            raise DataError(
                f"{self.source}: row {first + i + 1}, column {self._columns.payload.shown[0]}: "
                f"{values[i]:g} given; 0 (without payload) or 1 (with) was expected"
            )
        return values.astype(np.int64)

    def _usual_step(self) -> float:
        ahead = next(self._values(_AHEAD), None)
        given = 0 if ahead is None else len(ahead)
        if ahead is None or given < _FEWEST:
            raise DataError(
                f"{self.source}: {given} rows given, at least {_FEWEST} expected: a motion of that "
                "length says nothing; record a longer one"
            )
        column = self._columns.time
        time = _in_si(ahead[:, 0], column.units[0])
        # A fault in the order of time is told with its row, before any step is judged.
        TimeStamps(1.0, column.shown[0], self.source).take(time)
        step = float(np.median(np.diff(time)))
        if not column.said:
            check_step(step, column.shown[0], self.source)
        return step

    def _channels(self) -> list[Channel]:
        spans, source, c = joint_spans(self._robot), self.source, self._columns
        limits = self.description.limits or (None,)
        joints = [Channel(name, source, spans, joint=j) for j, name in enumerate(c.joints.shown)]
        forces = zip(c.forces.shown, cycle(limits), strict=False)
        return joints + [Channel(name, source, spans, limits=pair) for name, pair in forces]


def _in_si(values: Values, unit: str) -> Values:
    """Return times or lengths in s or m, angles in rad, anything else as it is."""
    return np.radians(values) if unit == "deg" else values / _PER_UNIT.get(unit, 1.0)


def open_log(
    path: str | Path, robot: Manipulator, *, description: Description | str | Path | None = None
) -> LogFile:
    """Open a log to read it in pieces: its columns are found, its first rows checked.

    Parameters and errors are those of `read_log`.
    """
    given = (find_description(path) or Description()) if description is None else description
    origin, about = (path, given) if isinstance(given, Description) else (given, None)
    about = about or read_description(origin)
    try:
        about.check(robot)
    except DataError as error:
        raise DataError(f"{shown(str(origin), bare=True, longest=1000)}: {error}") from None
    return LogFile(open_table(path, noun="log", dialect=about.csv or Dialect()), robot, about)


def read_log(
    path: str | Path,
    robot: Manipulator,
    *,
    description: Description | str | Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> Log:
    """Read a whole log: t, rho1.., force1.. (at cranks theta, torque), x y z phi if measured.

    Parameters
    ----------
    path : str or path
        A CSV or Parquet file; its ending says which.
    robot : Manipulator
        The machine it belongs to.
    description : Description or path, optional
        What is known beside the numbers; the TOML file of the same stem where it is not given.
    progress : callable, optional
        Called with the number of rows just read.

    Returns
    -------
    Log
        In SI units, with all findings.

    Raises
    ------
    DataError
        If a column is missing or ambiguous; if a cell is empty, text or not finite; if time stamps
        are repeated or run backward; if there are fewer than 50 rows; if a unit cannot be; if a
        joint coordinate or force holds one value throughout. The message names the row and the
        column.

    Examples
    --------
    >>> import numpy as np, pteron, tempfile
    >>> from pathlib import Path
    >>> from pteron.identification.logs import Log, read_log, write_log
    >>> t = np.arange(500) / 1000
    >>> wave = np.sin(np.outer(t, [7.0, 9.0, 11.0]) + 1.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_log(Log("a motion", t, 0.05 * wave, 20.0 * wave), Path(folder) / "a.csv")
    ...     log = read_log(path, pteron.load("tripteron"))
    >>> log.rows, log.joints.shape, round(log.rate), log.findings
    (500, (500, 3), 1000, ())
    """
    return open_log(path, robot, description=description).read(progress)
