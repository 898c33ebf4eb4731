"""A log that is open for reading: streamed in pieces, checked across their borders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.channels import Channel
from pteron.identification.logs.columns import find_columns
from pteron.identification.logs.csv_rows import CsvRows
from pteron.identification.logs.description import Description, ForceUnit
from pteron.identification.logs.log import Log
from pteron.identification.logs.parquet_rows import ParquetRows
from pteron.identification.logs.sizes import (
    check_forces,
    check_pose,
    check_sliders,
    check_step,
    size_of,
    standstill,
)
from pteron.identification.logs.time_stamps import TimeStamps
from pteron.manipulator import Manipulator

__all__ = ["LogFile"]

_FEWEST = 50
_AHEAD = 10_000
"""Rows looked at when a log is opened: the usual step is their median."""
_PER_UNIT = {"s": 1.0, "ms": 1e3, "us": 1e6, "m": 1.0, "mm": 1e3, "um": 1e6}

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

    def __init__(self, path: Path, robot: Manipulator, description: Description) -> None:
        self.source = str(path)
        self._robot = robot
        self._rows = (CsvRows if path.suffix.lower() == ".csv" else ParquetRows)(path, self.source)
        names = self._rows.columns
        legs, coordinates = robot.freedom, robot.coordinates
        self._columns = find_columns(
            names, legs, coordinates, description, self.source, self._rows.hint
        )
        if description.column_force_unit is None and description.gains is None:
            unit = cast(ForceUnit, self._columns.force_unit)
            description = replace(description, column_force_unit=unit)
        self.description = description
        self.rows_estimate = self._rows.rows_estimate
        self.findings = self._columns.findings
        c = self._columns
        self._slider_names = tuple(names[j] for j in c.sliders)
        self._force_names = tuple(names[j] for j in c.forces)
        self._pose_names = tuple(names[j] for j in c.pose)
        self._step = self._usual_step(names[c.time])

    def pieces(
        self, rows: int = 262_144, progress: Callable[[int], None] | None = None
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
        stamps = TimeStamps(self._step, self._rows.columns[self._columns.time], self.source)
        channels = self._channels()
        low, high = np.full(self._robot.freedom, np.inf), np.full(self._robot.freedom, -np.inf)
        first = 0
        for values in self._values(rows):
            piece = self._piece(values, first)
            stamps.take(piece.time)
            both = np.hstack([piece.sliders, piece.forces])
            for j, channel in enumerate(channels):
                channel.take(np.ascontiguousarray(both[:, j]), piece.sliders)
            low = np.minimum(low, piece.sliders.min(axis=0))
            high = np.maximum(high, piece.sliders.max(axis=0))
            first += piece.rows
            if progress is not None:
                progress(piece.rows)
            yield piece
        found = [finding for channel in channels for finding in channel.finish()]
        unit, names = self._columns.slider_unit, self._slider_names
        found += standstill(high - low, self._robot, unit, names, self.source)
        self.findings = (*self._columns.findings, *stamps.findings(), *found)

    def _values(self, rows: int) -> Iterator[Values]:
        """Yield the file's numbers in arrays of so many rows; columns as in `_indices`."""
        held: list[Values] = []
        count = 0
        for block in self._rows.blocks(self._indices()):
            held.append(block)
            count += len(block)
            while count >= rows:
                whole = held[0] if len(held) == 1 else np.concatenate(held)
                yield whole[:rows]
                held = [whole[rows:]]
                count -= rows
        if count:
            yield np.concatenate(held)

    def _indices(self) -> list[int]:
        c = self._columns
        payload = [] if c.payload is None else [c.payload]
        return [c.time, *c.sliders, *c.forces, *c.pose, *payload]

    def _piece(self, values: Values, first: int) -> Log:
        c, n = self._columns, self._robot.freedom
        sliders = np.ascontiguousarray(values[:, 1 : 1 + n]) / _PER_UNIT[c.slider_unit]
        check_sliders(sliders, self._robot, c.slider_unit, self._slider_names, self.source, first)
        forces = np.ascontiguousarray(values[:, 1 + n : 1 + 2 * n])
        if self.description.gains is not None:
            forces = forces * np.array(self.description.gains)
        check_forces(forces, self._force_names, self.source, first)
        pose = None
        if c.pose:
            pose = np.array(values[:, 1 + 2 * n : 1 + 2 * n + len(c.pose)], order="C")
            pose[:, :3] /= _PER_UNIT[c.length_unit]
            if c.angle_unit == "deg":
                pose[:, 3:] = np.radians(pose[:, 3:])
            units = c.length_unit, c.angle_unit
            check_pose(pose, self._robot, units, self._pose_names, self.source, first)
        return Log(
            source=self.source,
            time=values[:, 0] / _PER_UNIT[c.time_unit],
            sliders=sliders,
            forces=forces,
            pose=pose,
            payload=None if c.payload is None else self._phases(values[:, -1], first),
            description=self.description,
            first_row=first,
            step=self._step,
        )

    def _phases(self, values: Values, first: int) -> NDArray[np.int64]:
        bad = (values != 0.0) & (values != 1.0)
        if bad.any():
            i = int(np.argmax(bad))
            assert self._columns.payload is not None
            raise DataError(
                f"{self.source}: row {first + i + 1}, column "
                f"{self._rows.columns[self._columns.payload]}: {values[i]:g} given; 0 (without "
                "payload) or 1 (with) was expected"
            )
        return values.astype(np.int64)

    def _usual_step(self, column: str) -> float:
        ahead = next(self._values(_AHEAD), None)
        given = 0 if ahead is None else len(ahead)
        if ahead is None or given < _FEWEST:
            raise DataError(
                f"{self.source}: {given} rows given, at least {_FEWEST} expected: a motion of that "
                "length says nothing; record a longer one"
            )
        time = ahead[:, 0] / _PER_UNIT[self._columns.time_unit]
        # A fault in the order of time is told with its row, before any step is judged.
        TimeStamps(1.0, column, self.source).take(time)
        step = float(np.median(np.diff(time)))
        if not self._columns.unit_of_time_known:
            check_step(step, column, self.source)
        return step

    def _channels(self) -> list[Channel]:
        size = size_of(self._robot)
        limits = self.description.limits
        pairs = [
            None if limits is None else limits[j % len(limits)] for j in range(self._robot.freedom)
        ]
        return [
            Channel(name, self.source, size, slider=j) for j, name in enumerate(self._slider_names)
        ] + [
            Channel(name, self.source, size, limits=pair)
            for name, pair in zip(self._force_names, pairs, strict=True)
        ]
