"""Logs in files: opened, and read in pieces that are checked across their borders, or whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError, shown
from pteron.identification.logs.channels import Channel
from pteron.identification.logs.columns import find_columns
from pteron.identification.logs.description import Description
from pteron.identification.logs.description_file import find_description, read_description
from pteron.identification.logs.joints import in_si, joint_symbols
from pteron.identification.logs.log import Log, joined
from pteron.identification.logs.sizes import (
    check_forces,
    check_joints,
    check_pose,
    check_step,
    joint_spans,
    standstill,
)
from pteron.identification.logs.time_stamps import TimeStamps
from pteron.manipulator import Manipulator
from pteron.tables import CsvFile, ParquetFile, open_table

_FEWEST = 50
_AHEAD = 10_000
"""Rows looked at when a log is opened: the usual step is their median."""
_PIECE = 1 << 18

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
    """

    def __init__(
        self, file: CsvFile | ParquetFile, robot: Manipulator, description: Description
    ) -> None:
        self.source = source = file.source
        self._robot = robot
        self._file = file
        self._columns = find_columns(file.columns, robot, description, source, file.hint)
        if description.column_force_unit is None and description.gains is None:
            unit: Any = self._columns.force_unit
            description = replace(description, column_force_unit=unit)
        self.description = description
        self.rows_estimate = file.rows_estimate
        self.findings = self._columns.findings
        c = self._columns
        self._names = (c.time, *c.joints, *c.forces, *c.pose, *([c.payload] if c.payload else []))
        # As messages may show them: a name may hold anything.
        self._time, self._payload = shown(c.time, bare=True), shown(c.payload or "", bare=True)
        self._joints, self._forces, self._pose = (
            tuple(shown(name, bare=True) for name in names)
            for names in (c.joints, c.forces, c.pose)
        )
        self._step = self._usual_step()

    def pieces(
        self, rows: int = _PIECE, progress: Callable[[int], None] | None = None
    ) -> Iterator[Log]:
        """Yield the log in pieces, checked across their borders, in bounded memory.

        Parameters
        ----------
        rows : int
            Rows a piece; the last may have fewer.
        progress : callable, optional
            Called with the number of rows of each piece, once it is read.

        Raises
        ------
        DataError
            As `read_log`; a dead channel is known only behind the last piece.
        """
        if rows < 1:
            raise DataError(f"rows: {rows} given; a piece has at least 1 row")
        stamps = TimeStamps(self._step, self._time, self.source)
        channels = self._channels()
        n = self._robot.freedom
        low, high = np.full(n, np.inf), np.full(n, -np.inf)
        first = 0
        for values in self._values(rows):
            piece = self._piece(values, first)
            stamps.take(piece.time)
            both = np.hstack([piece.joints, piece.forces])
            for j, channel in enumerate(channels):
                channel.take(np.ascontiguousarray(both[:, j]), piece.joints)
            low = np.minimum(low, piece.joints.min(axis=0))
            high = np.maximum(high, piece.joints.max(axis=0))
            first += piece.rows
            if progress is not None:
                progress(piece.rows)
            yield piece
        found = [finding for channel in channels for finding in channel.finish()]
        units = self._columns.joint_units
        found += standstill(high - low, self._robot, units, self._joints, self.source)
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
        c, n = self._columns, self._robot.freedom
        joints = np.column_stack(
            [in_si(values[:, 1 + j], unit) for j, unit in enumerate(c.joint_units)]
        )
        check_joints(joints, self._robot, c.joint_units, self._joints, self.source, first)
        forces = np.ascontiguousarray(values[:, 1 + n : 1 + 2 * n])
        if self.description.gains is not None:
            forces = forces * np.array(self.description.gains)
        check_forces(forces, self._forces, self.source, first)
        pose = None
        if c.pose:
            units = [
                c.angle_unit if one == "phi" else c.length_unit for one in self._robot.coordinates
            ]
            pose = np.column_stack(
                [in_si(values[:, 1 + 2 * n + j], unit) for j, unit in enumerate(units)]
            )
            both = c.length_unit, c.angle_unit
            check_pose(pose, self._robot, both, self._pose, self.source, first)
        return Log(
            source=self.source,
            time=in_si(values[:, 0], c.time_unit),
            joints=joints,
            forces=forces,
            pose=pose,
            payload=None if c.payload is None else self._phases(values[:, -1], first),
            description=self.description,
            first_row=first,
            step=self._step,
            symbols=joint_symbols(self._robot),
        )

    def _phases(self, values: Values, first: int) -> NDArray[np.int64]:
        bad = (values != 0.0) & (values != 1.0)
        if bad.any():
            i = int(np.argmax(bad))
            raise DataError(
                f"{self.source}: row {first + i + 1}, column {self._payload}: {values[i]:g} given; "
                "0 (without payload) or 1 (with) was expected"
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
        time = in_si(ahead[:, 0], self._columns.time_unit)
        # A fault in the order of time is told with its row, before any step is judged.
        TimeStamps(1.0, self._time, self.source).take(time)
        step = float(np.median(np.diff(time)))
        if not self._columns.unit_of_time_known:
            check_step(step, self._time, self.source)
        return step

    def _channels(self) -> list[Channel]:
        spans, limits = joint_spans(self._robot), self.description.limits
        channels = [
            Channel(name, self.source, spans, joint=j) for j, name in enumerate(self._joints)
        ]
        for j, name in enumerate(self._forces):
            pair = None if limits is None else limits[j % len(limits)]
            channels.append(Channel(name, self.source, spans, limits=pair))
        return channels


def open_log(
    path: str | Path, robot: Manipulator, *, description: Description | str | Path | None = None
) -> LogFile:
    """Open a log to read it in pieces: its columns are found, its first rows checked.

    Parameters
    ----------
    path : str or path
        A CSV or Parquet file; its ending says which.
    robot : Manipulator
        The machine it belongs to.
    description : Description or path, optional
        What is known beside the numbers; the TOML file of the same stem where it is not given.

    Returns
    -------
    LogFile

    Raises
    ------
    DataError
        As `read_log`.
    """
    beside = find_description(path) if description is None else description
    if beside is None:
        beside = Description()
    origin = path
    if not isinstance(beside, Description):
        origin, beside = beside, read_description(beside)
    try:
        beside.check(robot)
    except DataError as error:
        raise DataError(f"{shown(str(origin), bare=True, longest=1000)}: {error}") from None
    file = open_table(path, noun="log", dialect=beside.csv, describable=True)
    return LogFile(file, robot, beside)


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
