"""`as_manipulator`: the machine of an argument `robot`, a value, catalog name or file path."""

from __future__ import annotations

from pathlib import Path

from pteron.errors import ModelError
from pteron.manipulator.files import load
from pteron.manipulator.manipulator import Manipulator

RobotLike = Manipulator | str | Path
"""The types that public functions take for `robot`."""


def as_manipulator(robot: RobotLike) -> Manipulator:
    """Return a machine as it is; load it if its name or path is given.

    Parameters
    ----------
    robot : Manipulator, str or Path
        The machine, a catalog name, or the path of a TOML file. A file is read again at every call,
        so that changes take effect.

    Returns
    -------
    Manipulator

    Raises
    ------
    ModelError
        If it is none of these; or as `load`.

    Examples
    --------
    >>> from pteron.manipulator import as_manipulator
    >>> as_manipulator("delta")
    <Manipulator 'delta': 3 RSS under a 3T platform>
    """
    if isinstance(robot, Manipulator):
        return robot
    if isinstance(robot, str | Path):
        return load(robot)
    raise ModelError(
        f"robot: {type(robot).__name__} given, a Manipulator expected, the name of one "
        "(see pteron.catalog()), or the path of its file"
    )
