"""Where the joints of a machine are, for pictures of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.evaluate import evaluated
from pteron.legs import LegKind
from pteron.legs.kind import SLIDER
from pteron.manipulator import Manipulator
from pteron.shapes import PerJoint, PoseLike

_SAME = 1e-9
"""Share of a leg's size within which two of its joints are at one point."""

_SPARE = 0.25
"""Length of a guide without limits, beyond what poses use, as a share of the leg's size."""

_ARC = np.radians(5.0)


@dataclass(frozen=True)
class JointPoints:
    """The points of a machine in poses, in the base frame, m.

    Attributes
    ----------
    chain : array, shape (..., n, j, 3)
        A point on each joint of each leg, from the base to the platform point; NaN for a joint that
        a leg has not. Of a P-R-R-R leg: r on the guide, R1 on the slider, the elbow R2, then R3.
    links : tuple of array, shape (..., k, 3)
        Each leg as a line: the points where its bodies meet, from the slider, or the crank's
        centre, to the platform point.
    platform_points : array, shape (..., n, 3)
        Where the legs carry the platform.
    reference : array, shape (..., 3)
        P.
    axes : array, shape (..., 3, 3)
        The platform frame's x, y and z, one a row.
    coordinates : array, shape (..., n)
        The joint coordinates, m or rad.
    """

    chain: Array
    links: tuple[Array, ...]
    platform_points: Array
    reference: Array
    axes: Array
    coordinates: PerJoint


@dataclass(frozen=True)
class Guide:
    """Where an actuated joint lets its body go.

    Attributes
    ----------
    slides : bool
        Whether it is a slider's guide, and not a crank's circle.
    axis : array, shape (3,)
        Unit vector along which the slider moves, or about which the crank turns.
    path : array, shape (K, 3)
        The way of the slider, or of the crank's end, from one limit to the other, m.
    """

    slides: bool
    axis: Array
    path: Array


def joint_points(robot: Manipulator, pose: PoseLike) -> JointPoints:
    """Return where the joints are.

    Parameters
    ----------
    robot : Manipulator
        The machine; its elbows choose the branch.
    pose : array, shape (..., m)
        The poses, m and rad.

    Returns
    -------
    JointPoints

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import joint_points
    >>> points = joint_points(pteron.load("tripteron"), [0.0, 0.0, 0.0])
    >>> points.platform_points.round(6) + 0.0
    array([[0.  , 0.05, 0.  ],
           [0.  , 0.  , 0.05],
           [0.05, 0.  , 0.  ]])
    """
    given = np.asarray(pose, dtype=float)
    coordinates = inverse_kinematics(robot, given)
    chain: Array = evaluated(robot, "joint_points", "raise", given)
    points: Array = evaluated(robot, "platform_points", "raise", given)
    x, y, z = (np.array(axis) for axis in robot.platform.frame)
    angle = (given[..., 3] if robot.platform.turns else np.zeros(given.shape[:-1]))[..., None]
    axes = np.stack(
        [
            np.cos(angle) * x + np.sin(angle) * y,
            np.cos(angle) * y - np.sin(angle) * x,
            np.broadcast_to(z, (*angle.shape[:-1], 3)),
        ],
        axis=-2,
    )
    links = tuple(
        _links(leg, chain[..., i, :, :], coordinates[..., i]) for i, leg in enumerate(robot.legs)
    )
    return JointPoints(chain, links, points, given[..., :3], axes, coordinates)


def _links(leg: LegKind, chain: Array, coordinate: Array) -> Array:
    start = chain[..., 0, :]
    if leg.joint is SLIDER:
        start = start + np.multiply.outer(coordinate, leg.joint_axis)
    line = [start]
    for k in range(1, chain.shape[-2]):
        apart = np.abs(chain[..., k, :] - line[-1]).max(initial=0.0)
        if apart > _SAME * leg.size:  # NaN, a joint that it has not, compares false
            line.append(chain[..., k, :])
    return np.stack(line, axis=-2)


def joint_guides(robot: Manipulator, poses: PoseLike) -> tuple[Guide, ...]:
    """Return where each actuated joint lets its body go, for pictures.

    Within the joints' limits; a guide without limits is a little longer than the poses need, a
    crank without limits goes all the way round.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    poses : array, shape (..., m)
        At least one pose, m and rad.

    Returns
    -------
    tuple of Guide
        One for each leg.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import joint_guides
    >>> joint_guides(pteron.load("tripteron"), [0.0, 0.0, 0.0])[0].path[:, 0]
    array([-0.3,  0.3])
    """
    points = joint_points(robot, np.reshape(poses, (-1, robot.freedom)))
    found = []
    for i, leg in enumerate(robot.legs):
        used, axis = points.coordinates[:, i], np.array(leg.joint_axis)
        if leg.joint is SLIDER:
            spare = _SPARE * leg.size
            limits = leg.limits or (used.min() - spare, used.max() + spare)
            path = np.array(leg.guide_point) + np.multiply.outer(np.array(limits), axis)
        else:
            low, high = leg.limits or (used[0] - np.pi, used[0] + np.pi)
            angles = np.linspace(low, high, 2 + int((high - low) / _ARC)) - used[0]
            center, end = points.links[i][0, :2]
            path = center + _turned(end - center, axis, angles)
        found.append(Guide(leg.joint is SLIDER, axis, path))
    return tuple(found)


def _turned(vector: Array, axis: Array, angles: Array) -> Array:
    """Return a vector turned about an axis by angles (K,)."""
    along = (vector @ axis) * axis
    x, y = vector - along, np.cross(axis, vector)
    return np.asarray(along + np.outer(np.cos(angles), x) + np.outer(np.sin(angles), y))
