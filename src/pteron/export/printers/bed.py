"""Choice of a Delta's bed for Klipper: the level, z = 0 there, that its platform reaches well."""

from __future__ import annotations

import math

import numpy as np

from pteron.errors import ModelError
from pteron.export.printers.centers import SAME
from pteron.export.printers.sections import INSTEAD, number
from pteron.export.start_pose import measures_of
from pteron.kernels import Array
from pteron.manipulator import Manipulator

_BELOW = 1e-3
"""Depth below the bed at which Klipper's rotary_delta.py begins to home a machine, m."""

_GOOD = 0.05
"""Least measure of poses at the bed: the type-I measure, or twice the type-II measure."""

_LEVELS, _RINGS, _DIRECTIONS = 200, 20, 24
"""Heights tried, and at each one the rings of poses and the poses on a ring."""


def find_bed(robot: Manipulator, reach: float, low: float, high: float) -> tuple[float, float]:
    """Return P's z at the bed, and the usable radius about the axis there, at most `reach`, m.

    The tool is at 0 there if the machine can work at 0 and below the end stops; else the bed is the
    lowest level between `low` and `high` on which P goes far.

    Raises
    ------
    ModelError
        If no level is within reach.
    """
    tool = tool_of(robot)[2]
    if low < -tool - _BELOW and -tool < high:
        radius = _radius(robot, reach, -tool)
        if radius > 0.0:
            return -tool, radius
    levels = np.arange(math.ceil(1e3 * (low + _BELOW)), math.floor(1e3 * high)) / 1e3
    levels = levels[:: max(1, len(levels) // _LEVELS)]
    radii = np.array([_radius(robot, reach, level) for level in levels])
    if len(levels) == 0 or radii.max() == 0.0:
        raise ModelError(
            f"{robot.name}: on the z axis it is nowhere well in reach below its end stops, and "
            f"Klipper homes there; {INSTEAD}"
        )
    best = int(radii.argmax())
    return float(levels[best]), float(radii[best])


def bed_comments(robot: Manipulator, level: float, good: float, most: float) -> tuple[str, ...]:
    """Return comment lines on the bed: its height, and the usable part of Klipper's range."""
    tool = tool_of(robot)
    who = "the tool's" if tool.any() else "the pose's"
    comments = [
        f"Klipper's z = 0, the bed, is {who} z = {1000.0 * (level + tool[2]) + 0.0:.6g} mm."
    ]
    if good < most:
        comments.append(
            f"At the bed P reaches {1000.0 * good:.0f} mm from the z axis on all sides; Klipper "
            f"checks no leg, and lets it go to {1000.0 * most:.0f} mm."
        )
    if np.abs(tool[:2]).max() > SAME:
        x, y = (number(-1000.0 * part) for part in tool[:2])
        comments.append(
            "Klipper's Deltas have P on the z axis: X and Y are P's, until "
            f"SET_GCODE_OFFSET X={x} Y={y} makes them the tool's."
        )
    return tuple(comments)


def tool_of(robot: Manipulator) -> Array:
    """Return the vector from P to the tool, m, base frame, of a platform that does not turn."""
    return np.asarray(np.array(robot.platform.tool) @ np.array(robot.platform.frame))


def _radius(robot: Manipulator, reach: float, level: float) -> float:
    """Return the radius, m, within which all of a level is usable; 0 if homing cannot begin."""
    angles = np.linspace(0.0, 2.0 * math.pi, _DIRECTIONS, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(_DIRECTIONS)], axis=-1)
    radii = np.linspace(0.0, reach, _RINGS + 1)
    poses = radii[:, None, None] * ring + [0.0, 0.0, level]
    poses[0] -= [0.0, 0.0, _BELOW]
    good = (measures_of(robot, poses) >= _GOOD).all(axis=-1)
    return float(radii[max(0, int(np.argmin(np.append(good, False))) - 1)])
