"""Logs in files: opened, read whole or in pieces that are checked across their borders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import replace
from itertools import chain, cycle, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.errors import LogSourceMixin
from pteron.identification.logs.at_motor import joint_factors
from pteron.identification.logs.channels import Channel
from pteron.identification.logs.clock import Clock, find_clock
from pteron.identification.logs.columns import (
    check_names,
    check_times,
    find_columns,
    reading_findings,
    repeated_times,
)
from pteron.identification.logs.description import Description, joint_symbols
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.log import Log, join_logs
from pteron.identification.logs.recorded import check_forces
from pteron.identification.logs.sizes import (
    check_bounds,
    check_step,
    joint_bounds,
    joint_spans,
    pose_bounds,
    standstill_findings,
)
from pteron.identification.logs.spikes import MARGIN, Spikes
from pteron.identification.logs.time_stamps import TimeStamps
from pteron.manipulator import Manipulator
from pteron.manipulator.readings import from_readings, reading_scales
from pteron.tables import CsvFile, ParquetFile

_FEWEST = 50
"""Least rows of a log; a shorter one is refused."""

_AHEAD = 10_000
"""Rows that are read when a log is opened: the usual step is their median."""

_PER_METRE = {"mm": 1e3, "um": 1e6}

Values = NDArray[np.float64]


class LogFile(LogSourceMixin):
    """A log that is open for reading; each pass over its pieces reads the file anew.

    Attributes
    ----------
    source : str
        Name of the file in messages.
    description : Description
        Its description; the force unit is that of the columns found.
    rows_estimate : int or None
        About how many rows it has, for a progress bar; exact in Parquet.
    findings : tuple of Finding
        Notes on how it was read and, after a full pass, its oddities.
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
        names = [name for name in file.columns if name not in file.repeated]
        units = dict(zip(file.columns, file.units, strict=False))
        check_names(file.repeated, source)
        self._columns = c = find_columns(names, units, robot, description, source, file.hint)
        if description.column_force_unit is None and description.gains is None:
            unit: Any = c.forces.units[0]
            description = replace(description, column_force_unit=unit)
        self.description = description
        self.rows_estimate = file.rows_estimate
        self._groups = (c.joints, c.forces, c.pose, c.payload)
        self._factors = joint_factors(c.joints, robot, source)
        self._names = tuple(name for group in self._groups for name in group.names)
        self._again = repeated_times(file.repeated, c, source)
        self._bounds = joint_bounds(robot), pose_bounds(robot)
        self._mass: float | None = None
        self._clock, self._step = self._usual_step()
        self._read = (
            *reading_findings(source, file.found, c, description, self._clock, self._again),
            *c.findings,
        )
        self.findings = self._read

    def with_gains(self, description: Description, finding: Finding) -> LogFile:
        """Return the file with a description's gains to apply, and a finding that says so."""
        again = copy(self)
        again.description = description
        again._read = (*self._read, finding)
        again.findings = (*self.findings, finding)
        return again

    def pieces(
        self, rows: int | None = None, progress: Callable[[int], None] | None = None
    ) -> Iterator[Log]:
        """Yield the log in pieces, checked across their borders, in bounded memory.

        Rows that are spikes are left out, like a gap.

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
        buffer: Log | None = None
        for piece in self._remove_spikes(progress):
            buffer = piece if buffer is None else join_logs([buffer, piece])
            while buffer.rows >= rows:
                yield buffer.part(0, rows)
                buffer = buffer.part(rows, buffer.rows)
        if buffer is not None and buffer.rows:
            yield buffer

    def _remove_spikes(self, progress: Callable[[int], None] | None) -> Iterator[Log]:
        """Yield pieces without spikes, which are judged with the neighbouring pieces."""
        c = self._columns
        spikes = Spikes((*c.joints.printable_names, *c.forces.printable_names), self.source)
        previous: Log | None = None
        for piece, following in pairwise(chain(self._check_pieces(), [None])):
            assert piece is not None
            around = [previous, piece, following and following.part(0, MARGIN)]
            parts = [part for part in around if part is not None]
            joints, forces = (
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("joints", "forces")
            )
            start = previous.rows if previous is not None else 0
            inner = slice(start, start + piece.rows)
            out = spikes.find(joints, forces, inner, piece.first_row)
            previous = piece.part(max(piece.rows - MARGIN, 0), piece.rows)
            if progress is not None:
                progress(piece.rows)
            yield piece.drop_samples(out) if out.any() else piece
        self.findings += spikes.findings()

    def _check_pieces(self) -> Iterator[Log]:
        """Yield the file in pieces, in SI units; the last piece has all findings but spikes."""
        stamps = TimeStamps(self._step, self._columns.time.printable_names[0], self.source)
        channels = self._channels()
        n = self._robot.joint_count
        low, high = np.full(n, np.inf), np.full(n, -np.inf)
        first = 0
        for block in self._number_blocks(self.rows_in_piece):
            piece = self._log_piece(block, first)
            stamps.take(piece.time)
            both = np.hstack([piece.joints, piece.forces])
            for channel, column in zip(channels, np.ascontiguousarray(both.T), strict=True):
                channel.take(column, piece.joints)
            low = np.minimum(low, piece.joints.min(axis=0))
            high = np.maximum(high, piece.joints.max(axis=0))
            first += piece.rows
            yield piece
        findings = [finding for channel in channels for finding in channel.finish()]
        declared = any(unit is not None for unit in self.description.joint_units(self._robot))
        findings += standstill_findings(
            high - low, self._robot, self._columns.joints, self.source, declared=declared
        )
        self.findings = (*self._read, *stamps.findings(), *findings)

    def read(self, progress: Callable[[int], None] | None = None) -> Log:
        """Return the whole log, with all findings."""
        return replace(join_logs(list(self.pieces(progress=progress))), findings=self.findings)

    def _number_blocks(self, rows: int) -> Iterator[Values]:
        """Yield the file's numbers in arrays of so many rows: the time in s, then `_names`."""
        blocks: list[Values] = []
        count = 0
        clock = self._clock.fresh()
        for table in self._file.tables((*clock.columns, *self._names, *self._again)):
            check_times(table, self._columns.time.names[0], self._again)
            blocks.append(np.column_stack([clock.seconds(table), table.numbers(self._names)]))
            count += len(table)
            while count >= rows:
                rows_ready = blocks[0] if len(blocks) == 1 else np.concatenate(blocks)
                yield rows_ready[:rows]
                blocks = [rows_ready[rows:]]
                count -= rows
        if count:
            yield np.concatenate(blocks)

    def _log_piece(self, block: Values, first: int) -> Log:
        """Return a log of rows read from the file, in SI units; raise on impossible numbers."""
        c, source = self._columns, self.source
        edges = np.cumsum([len(group.names) for group in self._groups])[:-1]
        joints, forces, pose, payload = (
            np.ascontiguousarray(
                np.transpose([_to_si(*both) for both in zip(part.T, group.units, strict=True)])
            )
            for group, part in zip(self._groups, np.split(block[:, 1:], edges, axis=1), strict=True)
        )
        joints = from_readings(self._robot, joints * self._factors)
        of_joints, of_pose = self._bounds
        check_bounds(joints, of_joints, c.joints, source, first)
        if self.description.gains is not None:
            forces = forces * np.array(self.description.gains)
        forces = forces / reading_scales(self._robot)
        check_forces(forces, c.forces.printable_names, source, first)
        if c.pose.names:
            check_bounds(pose, of_pose, c.pose, source, first)
        return Log(
            source=source,
            time=np.ascontiguousarray(block[:, 0]),
            joints=joints,
            forces=forces,
            pose=pose if c.pose.names else None,
            payload=self._payload_phases(payload[:, 0], first) if c.payload.names else None,
            payload_mass=self._mass,
            description=self.description,
            first_row=first,
            step=self._step,
            symbols=joint_symbols(self._robot),
            coordinates=self._robot.coordinates,
            readings=tuple(leg.reading for leg in self._robot.legs),
        )

    def _payload_phases(self, masses: Values, first: int) -> NDArray[np.int64]:
        """Return the payload's phase (T,): 0 where the column is 0, 1 where it is 1 or the mass."""
        carried = masses[masses != 0.0]
        if self._mass is None and len(carried):
            self._mass = float(carried[0])
        bad = (masses != 0.0) & ((masses != self._mass) | ~(masses > 0.0))
        if bad.any():
            i = int(np.argmax(bad))
            raise DataError(
                f"{self.source}: row {first + i + 1}, column "
                f"{self._columns.payload.printable_names[0]}: {masses[i]:g} given; 0 (without "
                "payload) or 1 (with) was expected, or one mass in kg; give each payload its own "
                "log"
            )
        return np.asarray(masses != 0.0, dtype=np.int64)

    def _usual_step(self) -> tuple[Clock, float]:
        """Return the format of the file's times, and their median step, s."""
        c, about = self._columns, self.description
        column, names = c.time.printable_names[0], c.time.names
        table = next(self._file.tables((*names, *self._names)), None)
        count = 0 if table is None else len(table)
        if table is None or count < _FEWEST:
            raise DataError(
                f"{self.source}: {count} rows given, at least {_FEWEST} expected: a motion of that "
                "length says nothing; record a longer one"
            )
        table = replace(table, frame=table.frame.head(_AHEAD))
        unit = c.time.units[0] if c.time.unit_stated else None
        clock = find_clock(table, names, unit, about.time_format)
        time = clock.fresh().seconds(table)
        # A fault in the order of time is told with its row, before any step is judged.
        TimeStamps(1.0, column, self.source).take(time)
        step = float(np.median(np.diff(time)))
        if not (c.time.unit_stated or clock.format or len(names) > 1):
            check_step(step, column, self.source)
        return clock, step

    def _channels(self) -> list[Channel]:
        """Return a record for each column of joints and forces, to detect channels that stop."""
        spans, source, c = joint_spans(self._robot), self.source, self._columns
        limits = self.description.limits or (None,)
        joints = [
            Channel(n, source, spans, joint=j) for j, n in enumerate(c.joints.printable_names)
        ]
        forces = zip(
            c.forces.printable_names, cycle(limits), reading_scales(self._robot), strict=False
        )
        return joints + [
            Channel(name, source, spans, limits=pair and (pair[0] / scale, pair[1] / scale))
            for name, pair, scale in forces
        ]


def _to_si(readings: Values, unit: str) -> Values:
    """Return lengths in m, angles in rad, and other values unchanged."""
    return np.radians(readings) if unit == "deg" else readings / _PER_METRE.get(unit, 1.0)
