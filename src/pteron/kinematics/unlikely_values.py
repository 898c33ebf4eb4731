"""Tests for values that are possible but likely in another unit, millimetres or degrees."""

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
    """Return the length, m, above which one of a pose or a part was likely in millimetres."""
    return 10.0 * max(
        hypot(*leg.guide_point) + leg.size + hypot(*leg.platform_point) for leg in robot.legs
    )


def unlikely_values(robot: Manipulator, columns: Sequence[str], values: Array) -> tuple[str, ...]:
    """Return a line on each value of poses or joint coordinates that is likely in another unit.

    Values (..., C), m and rad, are those of the columns, such as ``x``, ``phi`` or ``rho1``;
    columns of other names are not looked at.
    """
    length, limits = unlikely_length(robot), robot.platform.angle_limits
    # Angles of a platform that tilts repeat beyond half a turn.
    least = np.pi if robot.platform.tilts else 2.0 * np.pi
    turns = {name: _turn(limits.get(name), least) for name in robot.platform.angles}
    far, angles = dict.fromkeys(COORDINATES, length) | turns, set(turns)
    for name, leg in zip(robot.joint_names, robot.legs, strict=True):
        far[name] = length
        if leg.joint.unit == "rad":
            least = 2.0 * np.pi if leg.limits else _WOUND
            far[name] = max((_turn(leg.limits, least), *turns.values()))
            angles.add(name)
    found = []
    for turning, question in (
        (False, "are these mm? m are expected"),
        (True, "are these degrees? rad are expected"),
    ):
        chosen = [
            k for k, name in enumerate(columns) if name in far and turning is (name in angles)
        ]
        sizes = np.nan_to_num(np.abs(values[..., chosen]), nan=0.0, posinf=0.0)
        if (sizes > [far[columns[k]] for k in chosen]).any():
            names = ", ".join(columns[k] for k in chosen)
            found.append(f"{names} up to {float(sizes.max()):g}: {question}")
    return tuple(found)


def _turn(limits: tuple[float, float] | None, least: float) -> float:
    """Return the angle beyond which degrees are likelier, at least one: more where limits allow."""
    return max((least, *map(abs, limits or ())))


def warn_of_unlikely(
    robot: Manipulator, columns: Sequence[str], values: Array, source: str = ""
) -> None:
    """Issue a warning, `UnlikelyValue`, of what is likely in another unit."""
    for text in unlikely_values(robot, columns, values):
        warn_unlikely(f"{source}{text}")
