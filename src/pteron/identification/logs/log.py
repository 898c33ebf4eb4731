"""A log, the recorded motion of a machine in SI units, and the joining of its pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError
from pteron.identification.errors import LogSourceMixin
from pteron.identification.logs.description import Description, joint_symbols
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.gaps import gaps, stretches
from pteron.kernels import as_array
from pteron.kernels.named_columns import column_names, pick_columns
from pteron.legs.kind import SLIDER, ActuatedJoint
from pteron.legs.reading import Reading
from pteron.manipulator import RobotLike, as_manipulator
from pteron.renamed import former_attribute
from pteron.shapes import Columns, Int, JointsLike, PerCoordinate, PerJoint, PoseLike, Series

_ARRAYS = ("time", "joints", "forces", "pose", "payload", "rows_in_file")
"""Fields of a log with a row for each sample."""

_Phases = Int[np.ndarray, "*batch"]
"""Whole numbers, one a row."""


@dataclass(frozen=True)
class Log(LogSourceMixin):
    """Samples of a motion, or a part of them; the arrays are not copied and not to be changed.

    Parameters
    ----------
    source : str
        Name of the file in messages.
    time : array, shape (T,)
        s, rising.
    joints : array, shape (T, n)
        Joint coordinates, m; rad at a crank.
    forces : array, shape (T, n)
        Actuator forces in `description.force_unit`: N (at a crank N m), or the drive's own unit
        where no gains are known.
    pose : array, shape (T, m), optional
        Measured poses, m and rad.
    payload : array of int, shape (T,), optional
        1 where the payload is carried, 0 where not.
    description : Description
        Names, units and facts beside the numbers.
    findings : tuple of Finding
        Oddities that were left as they are.
    first_row : int
        Index from 0 of the first sample among the data rows of its file.
    step : float, optional
        The usual time step of the file, s; the median step of these samples if it is not given.
    symbols : tuple of ActuatedJoint, optional
        Names of each leg's joint; they are sliders if it is not given.
    coordinates : tuple of str, optional
        Names of the measured pose's coordinates; if it is not given x, y, z, phi, as many as there
        are.
    rows_in_file : array of int, shape (T,), optional
        Index from 0 of each sample among the data rows of its file, where some are left out.
    readings : tuple of Reading or None, optional
        Each leg's `reading`, by which joints and forces were converted from what the drives read.
    payload_mass : float, optional
        What the payload's column says where it is carried: 1, or its mass, kg.

    Raises
    ------
    DataError
        If values of an array are masked or have another shape, if joints or times are not finite,
        or if the time does not rise.
    """

    source: str
    time: Series
    joints: PerJoint
    forces: PerJoint
    pose: PerCoordinate | None = None
    payload: _Phases | None = None
    description: Description = field(default_factory=Description)
    findings: tuple[Finding, ...] = ()
    first_row: int = 0
    step: float | None = None
    symbols: tuple[ActuatedJoint, ...] | None = None
    coordinates: tuple[str, ...] | None = None
    rows_in_file: _Phases | None = None
    readings: tuple[Reading | None, ...] = ()
    payload_mass: float | None = None

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            numbers = getattr(self, name)
            if isinstance(numbers, np.ma.MaskedArray):
                if count := int(np.ma.getmaskarray(numbers).sum()):
                    raise DataError(
                        f"{self.source}: {count} values of {name} are masked; leave their rows "
                        "out: a gap in time is understood"
                    )
                numbers = np.ma.getdata(numbers)
            if numbers is not None:
                object.__setattr__(self, name, self._rows_of_numbers(name, numbers))
        if self.joints.shape != self.forces.shape:
            raise DataError(
                f"{self.source}: joints of shape {self.joints.shape} and forces of shape "
                f"{self.forces.shape} given, one of each for each leg expected"
            )
        if self.symbols and len(self.symbols) != self.joints.shape[1]:
            raise DataError(
                f"{self.source}: {len(self.symbols)} symbols for {self.joints.shape[1]} legs given"
            )
        if (late := np.flatnonzero(np.diff(self.time) <= 0.0)).size:
            raise DataError(f"{self.place(int(late[0]) + 1)}: the time does not rise here")

    @classmethod
    def of(
        cls,
        robot: RobotLike,
        time: ArrayLike | Columns,
        joints: JointsLike | None = None,
        forces: JointsLike | None = None,
        *,
        pose: PoseLike | None = None,
        payload: ArrayLike | None = None,
        source: str = "log",
        description: Description | None = None,
    ) -> Log:
        """Return a log of arrays or tables, with the names of a machine's joints and coordinates.

        Parameters
        ----------
        robot : Manipulator, name or path
            The machine that moved.
        time : array, shape (T,), or table
            s, rising. Or one table of all: columns t, joints, forces, and those of pose and payload
            where there are any, named as in files of logs.
        joints : array or table, shape (T, n), optional
            Joint coordinates, m; rad at a crank.
        forces : array or table, shape (T, n), optional
            Actuator forces, N; N m at a crank.
        pose : array or table, shape (T, m), optional
            Measured poses, m and rad.
        payload : array of int, shape (T,), optional
            1 where the payload is carried, 0 where not.
        source : str
            Name in messages.
        description : Description, optional
            Facts beside the numbers, such as the period.

        Raises
        ------
        DataError
            If a column is missing, or as the constructor.

        Examples
        --------
        >>> import numpy as np
        >>> from pteron.identification import Log
        >>> time, joints, forces = np.arange(3) / 1000.0, np.zeros((3, 3)), np.ones((3, 3))
        >>> Log.of("tripteron", time, joints, forces).joint_names
        ('rho1', 'rho2', 'rho3')
        """
        machine = as_manipulator(robot)
        if joints is None and forces is None:
            table = time
            names = set(column_names(table))
            if not names:
                raise DataError(
                    f"{source}: time alone given; give joints and forces too, or one table of all"
                )
            time, joints, forces = _column(table, "t", source), table, table
            if pose is None and names.issuperset(machine.coordinates):
                pose = table
            if payload is None and "payload" in names:
                payload = _column(table, "payload", source)
        if joints is None or forces is None:
            missing = "joints" if joints is None else "forces"
            raise DataError(f"{source}: {missing}: missing; a column for each joint expected")
        n, names_of = machine.joint_count, machine.column_names
        return cls(
            source,
            np.asarray(time),
            as_array(joints, f"{source}: joints", (n,), columns=names_of["joints"]),
            as_array(forces, f"{source}: forces", (n,), columns=names_of["forces"]),
            pose=None
            if pose is None
            else as_array(pose, f"{source}: pose", (machine.freedom,), columns=names_of["pose"]),
            payload=None if payload is None else np.asarray(payload),
            description=description or Description(),
            symbols=joint_symbols(machine),
            coordinates=machine.coordinates,
        )

    def _rows_of_numbers(self, name: str, numbers: Any) -> Any:
        """Return an array of the log as numbers, a row for each time; raise on a wrong shape."""
        axes = 2 if name in ("joints", "forces", "pose") else 1
        integral = name in ("payload", "rows_in_file")
        array = numbers if integral else as_array(numbers, f"{self.source}: {name}", ())
        array = np.asarray(array)
        rows = len(array) if name == "time" else len(self.time)
        if array.ndim != axes or len(array) != rows:
            expected = ("T" if name == "time" else str(rows)) + (", n" if axes == 2 else ",")
            raise DataError(
                f"{self.source}: {name} of shape {array.shape} given, ({expected}) expected"
            )
        # Forces that are none are told where they count, and poses may be missing.
        if name not in ("pose", "forces") and not np.isfinite(array).all():
            row = int(np.flatnonzero(~np.isfinite(array.reshape(rows, -1)).all(axis=1))[0])
            raise DataError(
                f"{self.place(row)}, {name}: a finite number expected; leave the row out, a gap in "
                "time is understood"
            )
        return array

    def __len__(self) -> int:
        return len(self.time)

    @property
    def rows(self) -> int:
        """Number of samples T."""
        return len(self.time)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.time[-1] - self.time[0]) if self.rows else 0.0

    @property
    def rate(self) -> float:
        """Samples a second: one over the usual step, Hz; NaN for fewer than two samples."""
        if self.step is not None:
            return 1.0 / self.step
        return 1.0 / float(np.median(np.diff(self.time))) if self.rows > 1 else float("nan")

    @property
    def segments(self) -> tuple[slice, ...]:
        """The stretches without a gap, in order; together they are the whole log."""
        if not self.rows:
            return ()
        return tuple(slice(a, b) for a, b in stretches(gaps(self.time, 1.0 / self.rate)))

    @property
    def phases(self) -> list[tuple[int, int]]:
        """First row, and row behind the last, of each stretch with one payload."""
        if self.payload is None:
            return [(0, self.rows)]
        return stretches(np.diff(self.payload) != 0)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The columns of joint coordinates: rho1 ..., theta1 ... at cranks."""
        return tuple(f"{symbol.coordinate}{j}" for j, symbol in enumerate(self._symbols, start=1))

    @property
    def force_names(self) -> tuple[str, ...]:
        """The columns of actuator forces: force1 ..., torque1 ... at cranks."""
        return tuple(f"{symbol.force}{j}" for j, symbol in enumerate(self._symbols, start=1))

    @property
    def _symbols(self) -> tuple[ActuatedJoint, ...]:
        """The joints' symbols; sliders where the log names none."""
        return self.symbols or (SLIDER,) * self.joints.shape[1]

    def place(self, index: int) -> str:
        """Return where in its file a sample is, its row counted from 1."""
        row = self.first_row + index if self.rows_in_file is None else self.rows_in_file[index]
        return f"{self.source}: row {row + 1}"

    def part(self, start: int, stop: int) -> Log:
        """Return the samples from `start` up to, not including, `stop`, as views.

        The findings stay those of the whole file; their rows are rows of the file.
        """
        start, stop, _ = slice(start, stop).indices(self.rows)
        first = self.first_row + start
        if self.rows_in_file is not None and start < self.rows:
            first = int(self.rows_in_file[start])
        return replace(self._take_samples(slice(start, stop)), first_row=first)

    def with_gains(self, description: Description, finding: Finding) -> Log:
        """Return the log with forces times a description's gains, and a finding that says so."""
        forces = self.forces * np.array(description.gains)
        findings = (*self.findings, finding)
        return replace(self, forces=forces, description=description, findings=findings)

    def drop_samples(self, rows: NDArray[np.bool_]) -> Log:
        """Return the log without samples where `rows` (T,) is true; gaps replace them."""
        return replace(self, rows_in_file=rows_of(self))._take_samples(np.flatnonzero(~rows))

    def _take_samples(self, rows: slice | NDArray[np.int64]) -> Log:
        """Return the log's samples at rows, a slice or their numbers."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        changed: dict[str, Any] = {
            name: samples[rows] for name, samples in arrays.items() if samples is not None
        }
        return replace(self, **changed)

    without = former_attribute("without", "drop_samples")


def join_logs(pieces: Sequence[Log]) -> Log:
    """Return consecutive pieces as a single log, with the metadata of the first."""
    if len(pieces) > 1 and any(piece.rows_in_file is not None for piece in pieces):
        pieces = [replace(piece, rows_in_file=rows_of(piece)) for piece in pieces]
    first = pieces[0]
    if len(pieces) == 1:
        return first
    changed: dict[str, Any] = {
        name: np.concatenate([getattr(piece, name) for piece in pieces])
        for name in _ARRAYS
        if getattr(first, name) is not None
    }
    return replace(first, **changed)


def rows_of(log: Log) -> NDArray[np.int64]:
    """Return the index of each sample among the data rows of its file."""
    if log.rows_in_file is not None:
        return log.rows_in_file
    return log.first_row + np.arange(log.rows)


def _column(table: Any, name: str, source: str) -> NDArray[np.float64]:
    """Return a column of a table as an array (T,)."""
    return np.asarray(pick_columns(table, (name,), source))[..., 0]
