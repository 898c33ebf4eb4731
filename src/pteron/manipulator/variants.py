"""Variants of a machine: its working modes, the machine turned as a whole, another point P."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain, product

import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.inertia import about_point
from pteron.bodies.vectors import Vector, vector
from pteron.errors import ModelError, warn_unlikely
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.robot_like import RobotLike, as_manipulator
from pteron.tolerances import ROUNDING

_FAR = 20.0
"""Distance of a pivot over the legs' size from which it is likely in another unit."""


def working_modes(robot: RobotLike) -> tuple[Manipulator, ...]:
    """Return the machine in each of its working modes: 2^k of k signs, one or two for each leg.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its own choice of elbows is one of those returned.

    Returns
    -------
    tuple of Manipulator
        In binary order of the signs, leg 1 first: all +1 comes first, all -1 last. A P-R-U-R leg
        has two signs, `elbow` and `second_elbow`; an R-P-U-R leg `second_elbow`; others `elbow`.

    Examples
    --------
    >>> import pteron
    >>> modes = pteron.working_modes(pteron.load("quadrupteron"))
    >>> len(modes), [leg.elbow for leg in modes[1].legs]
    (16, [1, 1, 1, -1])
    """
    robot = as_manipulator(robot)
    return tuple(with_elbows(robot, signs) for signs in mode_elbows(robot))


def elbows_of(robot: Manipulator) -> tuple[int, ...]:
    """Return the signs of a machine's working mode, +1 or -1: one or two for each leg, in order."""
    return tuple(sign for leg in robot.legs for sign in leg.signs.values())


def mode_elbows(robot: Manipulator) -> list[tuple[int, ...]]:
    """Return the signs of each working mode of a machine, in the order of `working_modes`."""
    return [tuple(chain(*signs)) for signs in product(*(leg.sign_choices() for leg in robot.legs))]


def with_elbows(robot: Manipulator, signs: Sequence[int]) -> Manipulator:
    """Return the machine in the working mode with these signs, +1 or -1.

    They are those of `elbows_of`, or one for each leg, its first. The home in the machine's file
    applies to the file's working mode only.
    """
    names = [list(leg.signs) for leg in robot.legs]
    if len(signs) == len(names):
        names = [leg_names[:1] for leg_names in names]
    if len(signs) != (count := sum(map(len, names))):
        raise ModelError(f"elbows: {len(signs)} signs given, {count} expected", subject=robot.name)
    remaining = iter(signs)
    legs = tuple(
        replace(leg, **{name: next(remaining) for name in leg_names})
        for leg, leg_names in zip(robot.legs, names, strict=True)
    )
    return replace(robot, legs=legs, home=robot.home if legs == robot.legs else None)


def elbow_signs(elbows: Iterable[float]) -> str:
    """Return a working mode's signs as text, + or - each."""
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


def with_pivot(robot: RobotLike, point: Sequence[float]) -> Manipulator:
    """Return the same machine with poses that refer to another point of the platform.

    The pivot becomes P: a change of the angles alone turns the platform about it. Platform points,
    tools, inertia and home are converted; joints, forces and limits remain as they were.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    point : vector
        The pivot in the platform's frame, m.

    Returns
    -------
    Manipulator
        The machine about the pivot. Its geometry's digest differs from the first one's.

    Raises
    ------
    ModelError
        If a joint, planes or sliding parts determine the platform's P, as in wrists and tripods, or
        if the pivot of a planar machine is out of its plane.

    Warns
    -----
    UnlikelyValue
        If the pivot is so far away that it is likely in mm.

    Examples
    --------
    >>> import pteron
    >>> from pteron.manipulator import with_pivot
    >>> at_head = with_pivot("stewart", [0.0, 0.0, 0.8])
    >>> pose = [0.1, 0.0, 2.0, 0.0, 0.0, 0.2]
    >>> joints = pteron.inverse_kinematics("stewart", pose)
    >>> about_head = pteron.inverse_kinematics(at_head, [0.1, 0.0, 2.8, 0.0, 0.0, 0.2])
    >>> bool(abs(joints - about_head).max() < 1e-12)
    True
    """
    robot = as_manipulator(robot)
    platform, pivot = robot.platform, vector(point, "pivot")
    size = max(leg.size for leg in robot.legs)
    if size and math.hypot(*pivot) > _FAR * size:
        warn_unlikely(
            f"pivot: {math.hypot(*pivot):g} m from P, the legs are {size:.3g} m: is it in mm?"
        )
    if not platform.kind.point_is_free:
        raise ModelError(
            f"pivot: {robot.name}'s platform {platform.kind.freedom_text}: its point P cannot be "
            "chosen",
            subject=robot.name,
        )
    if platform.planar and pivot[2]:
        raise ModelError(
            f"pivot: {pivot[2]:g} m out of the plane of {robot.name}; z = 0 expected",
            subject=robot.name,
        )

    def relative(place: Vector) -> Vector:
        """Return a point of the platform's frame as seen from the pivot."""
        return vector(np.subtract(place, pivot).tolist(), "pivot")

    home = robot.home
    if home is not None:
        place, axes = platform.placement(np.array(home))
        count = len(platform.lengths)
        home = (*(platform.directions @ (place + pivot @ axes)).tolist(), *home[count:])
    return replace(
        robot,
        platform=replace(
            platform,
            inertia=about_point(platform.inertia, pivot),
            tool=relative(platform.tool),
            bars=tuple(replace(bar, hinge=relative(bar.hinge)) for bar in platform.bars),
        ),
        legs=tuple(replace(leg, platform_point=relative(leg.platform_point)) for leg in robot.legs),
        tools=tuple(
            replace(
                tool,
                point=relative(tool.point),
                center_of_mass=tool.center_of_mass and relative(tool.center_of_mass),
            )
            for tool in robot.tools
        ),
        home=home,
    )
