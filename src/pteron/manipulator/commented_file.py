"""`commented_text`: a template of a robot file, with a comment on each key."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pteron.errors import shorten
from pteron.manipulator.files import DEFAULT_KIND, catalog, document, load
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.names import LONGEST_NAME
from pteron.manipulator.saving import document_of
from pteron.manipulator.writing import robot_text


def commented_text(
    name_or_path: str | Path, changed: Manipulator | None = None, about: Sequence[str] = ()
) -> str:
    """Return the TOML text of a machine file based on another, with a comment on each key.

    Parameters
    ----------
    name_or_path : str or path
        A catalog name, or the path of a file.
    changed : Manipulator, optional
        The machine to write, made from the other; by default the other itself.
    about : sequence of str
        Sentences on it for the top of the file.

    Raises
    ------
    ModelError
        As `load`.
    """
    robot, tables = load(name_or_path), document(name_or_path)
    name = robot.name
    head = [f"Made after {shorten(name, bare=True)}. Put in your numbers, then: pteron check FILE"]
    if changed is not None:
        tables = document_of(changed)
    elif str(name_or_path) in catalog():
        tables = {**tables, "template": {"kind": str(name_or_path), "confirmed": []}}
    legs = [{"type": DEFAULT_KIND, **leg} for leg in tables["legs"]]
    document_ = {**tables, "name": f"my {name}"[:LONGEST_NAME], "legs": legs}
    return robot_text(_with_centers(document_), explained=True, about=[*head, *about])


def _with_centers(table: Any) -> Any:
    """Return a file's tables with each body's centre of mass instead of its first moment.

    If a user then edits the mass alone, the centre of mass stays. A body without mass keeps its
    first moment.
    """
    if isinstance(table, list | tuple):
        return [_with_centers(content) for content in table]
    if not isinstance(table, Mapping):
        return table
    mass, converted = table.get("mass"), {}
    for key, content in table.items():
        if key == "first_moment" and mass:
            center = [float(f"{moment / mass:.12g}") + 0.0 for moment in content]
            converted["center_of_mass"] = center
        else:
            converted[key] = _with_centers(content)
    return converted
