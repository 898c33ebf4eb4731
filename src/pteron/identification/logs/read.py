"""Logs from files: opened to be streamed, or read whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pteron.errors import DataError
from pteron.identification.logs.description import Description
from pteron.identification.logs.description_files import find_description, read_description
from pteron.identification.logs.log import Log
from pteron.identification.logs.log_file import LogFile
from pteron.manipulator import Manipulator
from pteron.tables import ENDINGS

__all__ = ["open_log", "read_log"]


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
    file = Path(path)
    if file.is_dir():
        raise DataError(f"{path}: is a folder; name a file in it")
    if file.suffix.lower() not in ENDINGS:
        given = f"unknown ending {file.suffix!r}" if file.suffix else "no ending"
        raise DataError(f"{path}: {given}; a log's file ends in {' or '.join(ENDINGS)}")
    if not file.exists():
        raise DataError(f"{path}: no such file")
    if not file.is_file():
        raise DataError(f"{path}: is no regular file, and a log is read twice; save it as a file")
    beside = find_description(file) if description is None else description
    if beside is None:
        beside = Description()
    origin = str(path)
    if not isinstance(beside, Description):
        origin = str(beside)
        beside = read_description(beside)
    try:
        beside.check(robot.freedom, robot.coordinates)
    except DataError as error:
        raise DataError(f"{origin}: {error}") from None
    try:
        return LogFile(file, robot, beside)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from None


def read_log(
    path: str | Path,
    robot: Manipulator,
    *,
    description: Description | str | Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> Log:
    """Read a whole log: columns t, rho1.., force1.. (or current1..), and x y z phi if measured.

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
        slider or force holds one value throughout. The message names the row and the column.

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
    >>> log.rows, log.sliders.shape, round(log.rate), log.findings
    (500, (500, 3), 1000, ())
    """
    file = open_log(path, robot, description=description)
    pieces = list(file.pieces(progress=progress))
    first = pieces[0]
    if len(pieces) == 1:
        return replace(first, findings=file.findings)
    return replace(
        first,
        time=np.concatenate([p.time for p in pieces]),
        sliders=np.concatenate([p.sliders for p in pieces]),
        forces=np.concatenate([p.forces for p in pieces]),
        pose=None
        if first.pose is None
        else np.concatenate([p.pose for p in pieces if p.pose is not None]),
        payload=None
        if first.payload is None
        else np.concatenate([p.payload for p in pieces if p.payload is not None]),
        findings=file.findings,
    )
