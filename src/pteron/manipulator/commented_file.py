"""`commented_text`: a template of a robot file, with a comment on each key."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pteron.errors import shorten
from pteron.manipulator.dimensions import with_dimensions
from pteron.manipulator.files import DEFAULT_KIND, document, load
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.names import LONGEST_NAME
from pteron.manipulator.saving import document_of
from pteron.manipulator.writing import robot_text

_FOLLOWS = {
    "base_radius": "Base radius {} m: every guide_point follows from it.",
    "platform_radius": "Platform radius {} m: every platform_point follows from it.",
    "crank": "Cranks or upper links of {} m: their section stays where no stock is given.",
    "rod": "Rods or lower links of {} m: their section stays where no stock is given.",
    "limits": "Joint coordinates from {}.",
    "stock": "Masses and inertias of links from {}: a first guess, without their ends and joints.",
    "platform_mass": "Platform of {} kg: its inertia is in proportion.",
}
"""The file's comment for each argument of `with_dimensions`."""

LEVEL = "horizontal"
"""The direction, in words, of cranks that point neither up nor down at 0."""


def commented_text(name_or_path: str | Path, dimensions: Mapping[str, Any] | None = None) -> str:
    """Return the TOML text of a machine file based on another, with a comment on each key.

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
    robot, tables = load(name_or_path), document(name_or_path)
    name = robot.name
    about = [f"Made after {shorten(name, bare=True)}. Put in your numbers, then: pteron check FILE"]
    if dimensions:
        tables = document_of(with_dimensions(robot, **dimensions))
        about += [
            _FOLLOWS[key].format(_dimension_text(dimension))
            for key, dimension in dimensions.items()
        ]
        about += kept_numbers_sentence(robot, dimensions)
    legs = [{"type": DEFAULT_KIND, **leg} for leg in tables["legs"]]
    document_ = {**tables, "name": f"my {name}"[:LONGEST_NAME], "legs": legs}
    return robot_text(_with_centers(document_), explained=True, about=about)


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


def kept_numbers_sentence(robot: Manipulator, dimensions: Mapping[str, Any]) -> list[str]:
    """Return a sentence, or [], on masses and angles that changed dimensions leave as they were.

    The list is empty if no dimension is changed, or all numbers depend on those changed.
    """
    if not dimensions:
        return []
    changed = with_dimensions(robot, **dimensions)
    mass = changed.platform.inertia.mass + sum(bar.mass for bar in changed.platform.bars)
    links, zero = _masses(changed, dimensions.get("stock", {})), crank_direction_text(changed)
    phrases = []
    if "platform_mass" not in dimensions:
        phrases.append(f"mass of the platform, {mass:.3g} kg (--platform-mass)")
    if links:
        phrases.append(f"cross-sections of the links, masses now {links} (--mass-from)")
    if "limits" not in dimensions:
        phrases.append("joint limits (--limits)")
    if zero not in ("", LEVEL):
        phrases.append(f"direction of cranks at 0, {zero}")
    unchanged = f"Unchanged from {shorten(robot.name, bare=True)}, check them"
    return [f"{unchanged}: {'; '.join(phrases)}."] if phrases else []


def _masses(robot: Manipulator, stock: Mapping[str, Any]) -> str:
    """Return as text the masses of the first leg's links that are not cut from stock."""
    leg: Any = robot.legs[0]
    links = {key: leg.bodies[letter].mass for letter, (key, *_) in leg.extents.items()}
    return " and ".join(f"{key} {mass:.3g} kg" for key, mass in links.items() if key not in stock)


def crank_direction_text(robot: Manipulator) -> str:
    """Return as text the direction of cranks at angle 0: "5.33 deg below horizontal"; '' without.

    The text is empty without gravity, too.
    """
    down = np.array(robot.gravity)
    zeros = [leg.crank_at_zero for leg in robot.legs if leg.crank_at_zero is not None]
    if not zeros or not down.any():
        return ""
    sines = np.array(zeros) @ down / np.linalg.norm(down)
    angles = np.degrees(np.arcsin(np.clip(sines, -1.0, 1.0))).round(2) + 0.0
    if not angles.any():
        return LEVEL
    texts = dict.fromkeys(
        f"{abs(angle):g} deg {'below' if angle > 0.0 else 'above'} horizontal" if angle else LEVEL
        for angle in angles.tolist()
    )
    return ", ".join(texts)


def _dimension_text(dimension: Any) -> str:
    """Return a dimension as text: a number, a range, or the stock of each link."""
    if isinstance(dimension, Mapping):
        return ", ".join(f"{stock} ({key})" for key, stock in dimension.items())
    return (
        " to ".join(f"{number:g}" for number in dimension)
        if isinstance(dimension, tuple)
        else f"{dimension:g}"
    )
