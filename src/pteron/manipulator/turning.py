"""A whole machine turned in space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.vectors import Vector, vector
from pteron.errors import ModelError
from pteron.manipulator.manipulator import Manipulator

_TOLERANCE = 1e-9


def turned(robot: Manipulator, rotation: ArrayLike, *, gravity: bool = True) -> Manipulator:
    """Return the machine turned as a whole about the base frame's origin.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    rotation : array, shape (3, 3)
        A rotation matrix R; a point at x goes to R x.
    gravity : bool
        Whether gravity turns too, which only renames the base frame's axes and changes no force.
        False mounts the machine otherwise: on a wall, upside down.

    Returns
    -------
    Manipulator
        The turned machine. The pose (p, phi) of the first is (R p, phi) of the second.

    Raises
    ------
    ModelError
        If the matrix is not a rotation.
    """
    try:
        matrix = np.asarray(rotation, dtype=float)
    except (TypeError, ValueError):
        raise ModelError("rotation: not an array of real numbers") from None
    if matrix.shape != (3, 3) or not np.allclose(matrix @ matrix.T, np.eye(3), atol=_TOLERANCE):
        raise ModelError(f"rotation: not an orthogonal 3x3 matrix: {matrix.tolist()}")
    if np.linalg.det(matrix) < 0:
        raise ModelError("rotation: the matrix is a reflection (determinant -1); negate one column")

    def turn(v: Vector) -> Vector:
        return vector((matrix @ v).tolist(), "rotation")

    x, _, axis = robot.platform.frame
    return replace(
        robot,
        platform=replace(robot.platform, axis=turn(axis), x_axis=turn(x)),
        legs=tuple(leg.turned(turn) for leg in robot.legs),
        gravity=turn(robot.gravity) if gravity else robot.gravity,
    )
