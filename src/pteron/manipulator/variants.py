"""Variants of a machine: its working modes, and the machine turned as a whole."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.vectors import Vector, vector
from pteron.errors import ModelError
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.robot_like import RobotLike, as_manipulator
from pteron.tolerances import ROUNDING


def working_modes(robot: RobotLike) -> tuple[Manipulator, ...]:
    """Return the machine in each of its 2^n working modes (signs of n elbows).

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its own choice of elbows is one of those returned.

    Returns
    -------
    tuple of Manipulator
        In binary order of the elbows, leg 1 first: all +1 comes first, all -1 last.

    Examples
    --------
    >>> import pteron
    >>> modes = pteron.working_modes(pteron.load("quadrupteron"))
    >>> len(modes), [leg.elbow for leg in modes[1].legs]
    (16, [1, 1, 1, -1])
    """
    robot = as_manipulator(robot)
    branches = (leg.branches for leg in robot.legs)
    return tuple(with_elbows(robot, signs) for signs in product(*branches))


def with_elbows(robot: Manipulator, signs: Sequence[int]) -> Manipulator:
    """Return the machine in the working mode with these elbows, +1 or -1 for each leg.

    The home in the machine's file applies to the file's working mode only.
    """
    legs = tuple(replace(leg, elbow=sign) for leg, sign in zip(robot.legs, signs, strict=True))
    return replace(robot, legs=legs, home=robot.home if legs == robot.legs else None)


def elbow_signs(elbows: Iterable[float]) -> str:
    """Return a working mode's elbows as text, + or - for each leg."""
    return "".join("+" if elbow > 0 else "-" for elbow in elbows)


def turned(robot: RobotLike, rotation: ArrayLike, *, gravity: bool = True) -> Manipulator:
    """Return the machine rotated rigidly about the origin of the base frame.

    Parameters
    ----------
    robot : Manipulator, name or path
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
    robot = as_manipulator(robot)
    matrix = np.asarray(rotation, dtype=float)
    if matrix.shape != (3, 3) or not np.allclose(matrix @ matrix.T, np.eye(3), atol=ROUNDING):
        raise ModelError(f"rotation: not an orthogonal 3x3 matrix: {matrix.tolist()}")
    if np.linalg.det(matrix) < 0:
        raise ModelError("rotation: the matrix is a reflection (determinant -1); negate one column")

    def turn(v: Vector) -> Vector:
        """Return the vector rotated by the matrix."""
        return vector((matrix @ v).tolist(), "rotation")

    # A 2R platform's frame is the base frame at angles zero.
    on_platform = robot.platform.second_axis is not None
    legs = tuple(leg.map_vectors(turn, platform=on_platform) for leg in robot.legs)
    platform, home = robot.platform.map_vectors(turn), robot.home
    if home is not None:
        count = len(platform.lengths)
        place = matrix @ (np.array(home[:count]) @ robot.platform.directions)
        home = (*(platform.directions @ place).tolist(), *home[count:])
    return replace(
        robot,
        platform=platform,
        legs=legs,
        tools=tuple(tool.turned(turn) for tool in robot.tools) if on_platform else robot.tools,
        home=home,
        gravity=turn(robot.gravity) if gravity else robot.gravity,
    )
