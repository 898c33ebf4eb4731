"""`explained`: the text of a robot file with a comment that explains each key, to begin with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pteron.errors import shown
from pteron.manipulator.dimensions import with_dimensions
from pteron.manipulator.files import DEFAULT_KIND, document, load
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.names import LONGEST_NAME
from pteron.manipulator.saving import document_of
from pteron.manipulator.writing import written

_FOLLOWS = {
    "base_radius": "Base radius {} m: every guide_point follows from it.",
    "platform_radius": "Platform radius {} m: every platform_point follows from it.",
    "crank": "Cranks or upper links of {} m: their section stays where no stock is given.",
    "rod": "Rods or lower links of {} m: their section stays where no stock is given.",
    "limits": "Joint coordinates from {}.",
    "stock": "Masses and inertias of links from {}: a first guess, without their ends and joints.",
    "platform_mass": "Platform of {} kg: its inertia is in proportion.",
}
"""The sentence of the file for each argument of `with_dimensions`."""

LEVEL = "horizontal"
"""The direction, in words, of cranks that point neither up nor down at 0."""


def explained(name_or_path: str | Path, dimensions: Mapping[str, Any] | None = None) -> str:
    """Return the text of a robot file like a given one, with a comment that explains each key.

    Parameters
    ----------
    name_or_path : str or path
        A catalog name, or the path of a file.
    dimensions : mapping, optional
        Dimensions to change, as arguments of `with_dimensions`.

    Raises
    ------
    ModelError
        As `load` and `with_dimensions`.
    """
    robot, given = load(name_or_path), document(name_or_path)
    name = robot.name
    about = [f"Made after {shown(name, bare=True)}. Put in your numbers, then: pteron check FILE"]
    if dimensions:
        given = document_of(with_dimensions(robot, **dimensions))
        about += [_FOLLOWS[key].format(_told(value)) for key, value in dimensions.items()]
        about += kept(robot, dimensions)
    legs = [{"type": DEFAULT_KIND, **leg} for leg in given["legs"]]
    document_ = {**given, "name": f"my {name}"[:LONGEST_NAME], "legs": legs}
    return written(_with_centers(document_), explained=True, about=about)


def _with_centers(table: Any) -> Any:
    """Return a file's tables with each body's centre of mass in place of its first moment.

    So an edit of the mass alone leaves the centre of mass where it is. A body without mass keeps
    its first moment.
    """
    if isinstance(table, list | tuple):
        return [_with_centers(value) for value in table]
    if not isinstance(table, Mapping):
        return table
    mass, made = table.get("mass"), {}
    for key, value in table.items():
        if key == "first_moment" and mass:
            center = [float(f"{moment / mass:.12g}") + 0.0 for moment in value]
            made["center_of_mass"] = center
        else:
            made[key] = _with_centers(value)
    return made


def kept(robot: Manipulator, dimensions: Mapping[str, Any]) -> list[str]:
    """Return a sentence on the numbers of a machine that a change of dimensions keeps.

    The list is empty where nothing is changed, or nothing kept.
    """
    if not dimensions:
        return []
    made = with_dimensions(robot, **dimensions)
    mass = made.platform.inertia.mass + sum(bar.mass for bar in made.platform.bars)
    links, zero = _masses(made, dimensions.get("stock", {})), pointing(made)
    told = []
    if "platform_mass" not in dimensions:
        told.append(f"the platform of {mass:.4g} kg (--platform-mass)")
    if links:
        told.append(f"sections of links, {links} (--mass-from)")
    if "limits" not in dimensions:
        told.append("the joints' limits (--limits)")
    if zero not in ("", LEVEL):
        told.append(f"where a crank is at 0, {zero}")
    return [f"As in {shown(robot.name, bare=True)} still: {'; '.join(told)}."] if told else []


def _masses(robot: Manipulator, stock: Mapping[str, Any]) -> str:
    """Return in words the masses of the first leg's links for which no stock is given."""
    leg: Any = robot.legs[0]
    links = {key: leg.bodies[letter].mass for letter, (key, *_) in leg.extents.items()}
    return " and ".join(f"{mass:.4g} kg ({key})" for key, mass in links.items() if key not in stock)


def pointing(robot: Manipulator) -> str:
    """Return the direction of cranks at 0 in words: "5.33 deg below horizontal"; "" without cranks.

    It is "" without gravity, too.
    """
    down = np.array(robot.gravity)
    zeros = [leg.at_zero for leg in robot.legs if leg.at_zero is not None]
    if not zeros or not down.any():
        return ""
    sines = np.array(zeros) @ down / np.linalg.norm(down)
    angles = np.degrees(np.arcsin(np.clip(sines, -1.0, 1.0))).round(2) + 0.0
    if not angles.any():
        return LEVEL
    return f"{', '.join(f'{one:g}' for one in dict.fromkeys(angles.tolist()))} deg below horizontal"


def _told(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{stock} ({key})" for key, stock in value.items())
    return " to ".join(f"{one:g}" for one in value) if isinstance(value, tuple) else f"{value:g}"
