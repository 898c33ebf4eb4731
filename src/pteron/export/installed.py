"""Exports that installed packages bring, by the names of their entry points."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from pteron.errors import ModelError
from pteron.extensions import extension_names, extension_value, load_extension
from pteron.manipulator import RobotLike, as_manipulator

GROUP = "pteron.export"
"""The group of entry points by which installed packages add exports."""


def export_names() -> tuple[str, ...]:
    """Return the names of the exports that installed packages bring.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> from pteron.export import export_names
    >>> isinstance(export_names(), tuple)
    True
    """
    return extension_names(GROUP)


def export_named(name: str) -> Callable[[RobotLike, str | Path], list[Path]]:
    """Return an installed package's export: a function that writes a machine to a folder.

    A package names it as an entry point of the group `pteron.export`: a function of a
    `Manipulator` and a folder, `pathlib.Path`, which returns the paths of the files it wrote.
    `pteron export FILE --target NAME=DIR` calls it.

    Parameters
    ----------
    name : str
        Of the entry point.

    Returns
    -------
    callable
        It takes the machine and the folder, and returns the paths of the files.

    Raises
    ------
    ModelError
        If no installed package has it, or if it is no function, or returns something else.
    """
    write: Any = load_extension(GROUP, name)
    if write is None:
        known = ", ".join(export_names()) or "none is installed"
        raise ModelError(f"export: {name!r} is not known; choose from: {known}")
    if not callable(write):
        raise ModelError(f"{extension_value(GROUP, name)} is no function")

    def export(robot: RobotLike, folder: str | Path) -> list[Path]:
        """Write a robot's files to a folder and return their paths; raise if none are listed."""
        written: Any = write(as_manipulator(robot), Path(folder))
        if not isinstance(written, Iterable) or isinstance(written, str | bytes):
            written = None
        paths = None if written is None else list(written)
        if paths is None or not all(isinstance(path, str | Path) for path in paths):
            raise ModelError(
                f"{extension_value(GROUP, name)} returns no list of the files that it wrote"
            )
        return [Path(path) for path in paths]

    return export
