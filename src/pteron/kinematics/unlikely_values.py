"""Tests for valid coordinates that are probably in another unit, millimetres or degrees."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import numpy as np

from pteron.errors import warn_unlikely
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import COORDINATES

_WOUND = 6.0 * np.pi
"""Angle of a crank without limits, rad, beyond which it is likelier in degrees: three turns."""


def unlikely_length(robot: Manipulator) -> float:
    """Return the length, m, above which a coordinate of the machine is likely in millimetres."""
    return 10.0 * max(
        hypot(*leg.guide_point) + leg.size + hypot(*leg.platform_point) for leg in robot.legs
    )


def unlikely_values(
    robot: Manipulator, columns: Sequence[str], coordinates: Array
) -> tuple[str, ...]:
    """Return a warning for each column of poses or joints that is probably in another unit.

    `coordinates` (..., C), m and rad, are the values of the columns, such as ``x``, ``phi`` or
    ``rho1``; columns of other names are ignored.
    """
    length, limits = unlikely_length(robot), robot.platform.angle_limits
    # Angles of a platform that tilts repeat beyond half a turn.
    least = 2.0 * robot.platform.angle_range
    turns = {name: _turn(limits.get(name), least) for name in robot.platform.angles}
    thresholds, angles = dict.fromkeys(COORDINATES, length) | turns, set(turns)
    for name, leg in zip(robot.joint_names, robot.legs, strict=True):
        thresholds[name] = length
        if leg.joint.unit == "rad":
            least = 2.0 * np.pi if leg.limits else _WOUND
            thresholds[name] = max((_turn(leg.limits, least), *turns.values()))
            angles.add(name)
    lines = []
    for turning, question in (
        (False, "are these mm? m are expected"),
        (True, "are these degrees? rad are expected"),
    ):
        chosen = [
            k
            for k, name in enumerate(columns)
            if name in thresholds and turning is (name in angles)
        ]
        sizes = np.nan_to_num(np.abs(coordinates[..., chosen]), nan=0.0, posinf=0.0)
        if (sizes > [thresholds[columns[k]] for k in chosen]).any():
            names = ", ".join(columns[k] for k in chosen)
            lines.append(f"{names} up to {float(sizes.max()):g}: {question}")
    return tuple(lines)


def _turn(limits: tuple[float, float] | None, least: float) -> float:
    """Return the angle, rad, beyond which degrees are likelier: `least`, or larger limits."""
    return max((least, *map(abs, limits or ())))


def warn_of_unlikely(
    robot: Manipulator, columns: Sequence[str], coordinates: Array, source: str = ""
) -> None:
    """Issue an `UnlikelyValue` warning for each column of coordinates probably in another unit."""
    for text in unlikely_values(robot, columns, coordinates):
        warn_unlikely(f"{source}{text}")
