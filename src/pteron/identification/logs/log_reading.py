"""Logs opened and read from files, by their descriptions."""

from __future__ import annotations

from pathlib import Path

from pteron.errors import DataError, shorten
from pteron.identification.logs.description import Description
from pteron.identification.logs.description_file import (
    collect_undeclared,
    find_description,
    read_description,
)
from pteron.identification.logs.log import Log
from pteron.identification.logs.log_file import LogFile
from pteron.manipulator import RobotLike, as_manipulator
from pteron.progress import Progress
from pteron.tables import Dialect, open_table


def open_log(
    path: str | Path, robot: RobotLike, *, description: Description | str | Path | None = None
) -> LogFile:
    """Open a log to read it in pieces: its columns are found, its first rows checked.

    Parameters and errors are those of `read_log`.
    """
    robot = as_manipulator(robot)
    described_by = (find_description(path) or Description()) if description is None else description
    origin, about = (
        (path, described_by) if isinstance(described_by, Description) else (described_by, None)
    )
    about = about or read_description(origin)
    try:
        about.check(robot)
    except DataError as error:
        raise DataError(f"{shorten(str(origin), bare=True, longest=1000)}: {error}") from None

    def open_described(described: Description) -> LogFile:
        """Return the opened log file, read as the description says."""
        dialect = described.csv or Dialect()
        return LogFile(open_table(path, noun="log", dialect=dialect), robot, described)

    def check_described(described: Description) -> None:
        """Read the first piece of the log as the description says; raise on faults."""
        next(open_described(described).pieces(), None)

    try:
        return open_described(about)
    except DataError as error:
        raise collect_undeclared(error, about, check_described, robot.legs[0].joint) from None


def read_log(
    path: str | Path,
    robot: RobotLike,
    *,
    description: Description | str | Path | None = None,
    progress: Progress | None = None,
) -> Log:
    """Read a whole log: t, rho1.., force1.. (at cranks theta, torque), x y z phi if measured.

    Parameters
    ----------
    path : str or path
        A CSV or Parquet file; its ending says which.
    robot : Manipulator, name or path
        The machine it belongs to.
    description : Description or path, optional
        The description; the TOML file of the same stem where it is not given.
    progress : callable, optional
        Takes the share of the rows that is read.

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
    robot = as_manipulator(robot)
    file = open_log(path, robot, description=description)
    if progress is None:
        return file.read()
    total, done = file.rows_estimate or 1, 0

    def count_rows(rows: int) -> None:
        """Add rows to those read and report the log's share, 0 to 1."""
        nonlocal done
        done += rows
        progress(min(done / total, 1.0))

    log = file.read(count_rows)
    progress(1.0)
    return log
