"""Additions of installed packages, as entry points of the groups in `EXTENSION_GROUPS`.

A package is imported when its name is asked for, not before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pteron.errors import ModelError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

EXTENSION_GROUPS = {
    "pteron.legs": "a kind of leg",
    "pteron.platforms": "a kind of platform",
    "pteron.indices": "an index of performance",
    "pteron.export": "an export",
    "pteron.design": "a quantity of designs",
}
"""Groups of entry points, and what each of their names stands for."""


def extension_names(group: str) -> tuple[str, ...]:
    """Return the names of all entry points that installed packages have in a group, sorted."""
    return tuple(sorted({entry_point.name for entry_point in _entry_points(group)}))


def load_extension(group: str, name: str) -> Any:
    """Return the object of an entry point by group and name; None if no package has it.

    Raises
    ------
    ModelError
        If the package cannot be imported.
    """
    entry_point = _entry_point(group, name)
    if entry_point is None:
        return None
    try:
        return entry_point.load()
    except Exception as error:
        raise ModelError(f"{entry_point.value}: {type(error).__name__}: {error}") from error


def extension_value(group: str, name: str) -> str:
    """Return where an entry point's object is, such as "my_legs:SliderRod"; '' if there is none."""
    entry_point = _entry_point(group, name)
    return "" if entry_point is None else entry_point.value


def _entry_point(group: str, name: str) -> EntryPoint | None:
    """Return the entry point with this group and name; None if no package has it."""
    return next((point for point in _entry_points(group) if point.name == name), None)


def _entry_points(group: str) -> tuple[EntryPoint, ...]:
    """Return all entry points that installed packages declare in a group."""
    from importlib.metadata import entry_points

    return tuple(entry_points(group=group))
