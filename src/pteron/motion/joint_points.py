"""Points of a machine's joints and platform in given poses, and of the joints' guides, to draw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.kernels import Array, as_array
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.legs import LegKind
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.renamed import former_attribute
from pteron.shapes import PerJoint, PoseLike
from pteron.tolerances import ROUNDING

_FLAT = 1e-6
"""Thickness over width of a part below which it is flat."""

_SPARE = 0.25
"""Length of a guide without limits, beyond what poses use, as a share of the leg's size."""

_ARC = np.radians(5.0)
"""Angle between two points of an arc, rad."""


class Part(NamedTuple):
    """A rigid part of the platform: arms from a hub to its corners."""

    hub: Array
    """(..., 3): P, or the hinge of a part that does not turn."""
    corners: Array
    """(..., k, 3), in order round the platform's axis; none is at the hub."""

    @property
    def triangles(self) -> NDArray[np.intp] | None:
        """Triangles (F, 3) of the part's convex hull, as corner indices; None if it is flat.

        Seen from outside, the corners of a triangle are in anticlockwise order.
        """
        corners = self.corners[(0,) * (self.corners.ndim - 2)]
        away = corners - corners[:1]
        if len(away) < 4 or np.linalg.matrix_rank(away, _FLAT * np.abs(away).max()) < 3:
            return None
        hull = scipy.spatial.ConvexHull(away)
        a, b, c = np.moveaxis(away[hull.simplices], 1, 0)
        inwards = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
        return np.asarray(np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices))


@dataclass(frozen=True)
class JointPoints:
    """The points of a machine in poses, in the base frame, m.

    Attributes
    ----------
    chain : array, shape (..., n, j, 3)
        A point on each joint of each leg, from the base to the platform point; NaN for a joint that
        a leg has not. Of a P-R-R-R leg: r on the guide, R1 on the slider, the elbow R2, then R3.
    links : tuple of array, shape (..., k, 3)
        Each leg as a line: the points where its bodies meet, from the slider, the crank's centre or
        the ram's base, to the platform point. A ram's cylinder ends within its line.
    platform_points : array, shape (..., n, 3)
        Where the legs carry the platform.
    parts : tuple of Part
        The platform: what moves as one with P, then, of an articulated platform, each part that
        does not turn.
    reference, tool : array, shape (..., 3)
        P, and the tool's centre point.
    axes : array, shape (..., 3, 3)
        The platform frame's x, y and z, one a row.
    coordinates : array, shape (..., n)
        The joint coordinates, m or rad.
    bars : tuple of (array, shape (3,), or None)
        The unit vector along which a leg's parallel rods, its last link, stand side by side.
    plane : array, shape (2, 3), or None
        The unit vectors along which x and y of a planar machine's poses count.
    rams : tuple of bool
        Whether a leg is a ram, whose cylinder ends at the second point of its line.
    """

    chain: Array
    links: tuple[Array, ...]
    platform_points: Array
    parts: tuple[Part, ...]
    reference: Array
    tool: Array
    axes: Array
    coordinates: PerJoint
    bars: tuple[Array | None, ...]
    plane: Array | None
    rams: tuple[bool, ...]

    def at(self, index: int) -> JointPoints:
        """Return the joint points at pose number `index` of several."""
        return replace(
            self,
            chain=self.chain[index],
            links=tuple(line[index] for line in self.links),
            platform_points=self.platform_points[index],
            parts=tuple(Part(part.hub[index], part.corners[index]) for part in self.parts),
            reference=self.reference[index],
            tool=self.tool[index],
            axes=self.axes[index],
            coordinates=self.coordinates[index],
        )


@dataclass(frozen=True)
class Guide:
    """The path along which an actuated joint guides its body.

    Attributes
    ----------
    is_prismatic : bool
        Whether it is a slider's guide, and not a crank's circle.
    axis : array, shape (3,)
        Unit vector along which the slider moves, or about which the crank, or a ram, turns.
    path : array, shape (K, 3)
        The path of the slider, or of the crank's end, from one limit to the other, m; of a joint
        that only turns the platform, and of a ram, where it is fixed, K = 1.
    """

    is_prismatic: bool
    axis: Array
    path: Array

    slides = former_attribute("slides", "is_prismatic")


def joint_points(robot: RobotLike, pose: PoseLike) -> JointPoints:
    """Return the positions of all joints and platform points at poses, m.

    Parameters
    ----------
    robot : Manipulator, name or path
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
    robot = as_manipulator(robot)
    poses = as_array(pose, "pose", (robot.freedom,), columns=robot.coordinates)
    coordinates = inverse_kinematics(robot, poses)
    chain: Array = evaluate_kernel(robot, "joint_points", "raise", poses)
    points: Array = evaluate_kernel(robot, "platform_points", "raise", poses)
    p, axes = robot.platform.placement(poses)
    links = tuple(
        _links(leg, chain[..., i, :, :], coordinates[..., i], points[..., i, :])
        for i, leg in enumerate(robot.legs)
    )
    return JointPoints(
        chain,
        links,
        points,
        _parts(robot, poses, p),
        p,
        p + robot.platform.tool @ axes,
        axes,
        coordinates,
        tuple(None if leg.bar is None else np.array(leg.bar) for leg in robot.legs),
        None if robot.platform.plane_normal is None else robot.platform.directions,
        tuple(leg.cylinder is not None for leg in robot.legs),
    )


def _links(leg: LegKind, chain: Array, coordinate: Array, end: Array) -> Array:
    """Return the points (..., k, 3) of a leg's line from its base to its platform point, m."""
    start = chain[..., 0, :]
    if "p" in leg.bodies and leg.joint_axis is not None:
        start = start + np.multiply.outer(coordinate, leg.joint_axis)
    same = ROUNDING * float(np.abs(end - start).max(initial=0.0))
    line = [start]
    if leg.cylinder is not None:
        way = end - start
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        return np.stack([start, start + np.minimum(leg.cylinder / length, 1.0) * way, end], axis=-2)
    for k in range(1, chain.shape[-2]):
        point = chain[..., k, :]
        if np.abs(point - line[-1]).max(initial=0.0) > same:
            line.append(point)
        if np.abs(point - end).max(initial=0.0) <= same:
            break
    return np.stack(line, axis=-2)


def _parts(robot: Manipulator, poses: Array, p: Array) -> tuple[Part, ...]:
    """Return the platform's rigid parts at poses (..., m), in the base frame, m.

    `p` (..., 3) are the positions of the platform's reference point P, the hub of the first part;
    each further part is at a hinge of the platform and does not turn with it.
    """
    platform = robot.platform
    frame = np.array(platform.frame)
    arms = np.array([leg.platform_point for leg in robot.legs])
    offsets = np.array([leg.fixed_offset for leg in robot.legs]) @ frame.T
    if not platform.angles:
        arms, offsets = arms + offsets, np.zeros_like(offsets)
    parts = [Part(p, p[..., None, :] + platform.arms(_corners(arms), poses))]
    for hinge in _distinct(arms):
        corners = _corners(offsets[np.abs(arms - hinge).max(axis=-1) <= ROUNDING])
        if len(corners):
            hub = p + platform.arms(hinge[None], poses)[..., 0, :]
            parts.append(Part(hub, hub[..., None, :] + corners @ frame))
    return tuple(parts)


def _corners(arms: Array) -> Array:
    """Return the distinct non-zero vectors (k, 3) from a hub, ordered by angle about z."""
    arms_out = _distinct(arms[np.abs(arms).max(axis=-1) > ROUNDING])
    offsets = arms_out - arms_out.mean(axis=0) if len(arms_out) else arms_out
    return arms_out[np.argsort(np.arctan2(offsets[:, 1], offsets[:, 0]), kind="stable")]


def _distinct(points: Array) -> Array:
    """Return the distinct points (k, 3), in order of their first occurrence."""
    differs = np.abs(points[:, None] - points).max(axis=-1) > ROUNDING
    return points[[bool(differs[i, :i].all()) for i in range(len(points))]]


def joint_guides(robot: RobotLike, poses: PoseLike) -> tuple[Guide, ...]:
    """Return the path of each leg's actuated joint over its travel, for pictures.

    Within the joints' limits; a guide without limits is a little longer than the poses need, a
    crank without limits goes all the way round.

    Parameters
    ----------
    robot : Manipulator, name or path
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
    robot = as_manipulator(robot)
    array = as_array(poses, "poses", (robot.freedom,), columns=robot.coordinates)
    points = joint_points(robot, array.reshape(-1, robot.freedom))
    guides = []
    for i, leg in enumerate(robot.legs):
        coordinates, is_prismatic = points.coordinates[:, i], "p" in leg.bodies
        axis = np.array(leg.base_axis)
        if not is_prismatic and not leg.goes_round:
            path = points.links[i][0, :1]
        elif is_prismatic:
            spare = _SPARE * leg.size
            limits = leg.limits or (coordinates.min() - spare, coordinates.max() + spare)
            path = np.array(leg.guide_point) + np.multiply.outer(np.array(limits), axis)
        else:
            low, high = leg.limits or (coordinates[0] - np.pi, coordinates[0] + np.pi)
            angles = np.linspace(low, high, 2 + int((high - low) / _ARC)) - coordinates[0]
            center, end = points.links[i][0, :2]
            rotations = scipy.spatial.transform.Rotation.from_rotvec(np.outer(angles, axis))
            path = center + rotations.apply(end - center)
        guides.append(Guide(is_prismatic, axis, path))
    return tuple(guides)
