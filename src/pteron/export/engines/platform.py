"""The platform's bodies in the opened mechanism: its main part, parts that do not turn, gears.

Platforms that slide have two halves. All bodies together have the platform's mass, first moment and
moment of inertia (`Platform.total_inertia`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.bodies.vectors import cross
from pteron.export.engines.inertia import (
    central_inertia,
    cube_moments,
    massless_inertia,
    plane_moments,
    shared_masses,
    spatial_moments,
)
from pteron.export.engines.parts import BASE, Closing, TreeBody, TreeJoint, displacement
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms import Platform
from pteron.platforms.joints import platform_joints
from pteron.tolerances import ROUNDING

_SIDE = 0.05
"""Side of the cube that stands for a part that does not turn, m."""

Pieces = tuple[list[TreeBody], list[int], list[Closing]]
"""Bodies; the number of the one at the end of each leg; points at which they close with others."""


def platform_bodies(robot: Manipulator, pose: Array) -> Pieces:
    """Return the platform's bodies at a pose, the body that each leg carries, and closings.

    The first bodies have the joints of the pose's coordinates, in their order.
    """
    platform = robot.platform
    if platform.slides:
        return _sliding_platform(robot, pose)
    if platform.turning_axis is not None:
        return _turning_platform(robot, pose)
    joints = _joints(platform, pose)
    if isinstance(platform.total_inertia, SpatialInertia):
        body = _tilting_body(platform, pose, joints, platform.total_inertia)
        if platform.axis_offset is not None:
            beyond = replace(body, parent=0, joints=body.joints[1:])
            return [_fork(platform, body), beyond], [1] * len(robot.legs), []
    else:
        body = _plane_body(platform, pose, joints, *central_inertia(platform.total_inertia))
    return [body], [0] * len(robot.legs), []


def _turning_platform(robot: Manipulator, pose: Array) -> Pieces:
    """Return a platform that turns, its gears, and the parts that hang on its hinges."""
    platform = robot.platform
    p, axes = platform.placement(pose)
    # What of a leg's fixed offset is along the axis turns with the platform as well as not.
    offsets = [cross(leg.fixed_offset, platform.axis) for leg in robot.legs]
    hung = [bool(np.abs(offset).max() > ROUNDING) for offset in offsets]
    points = [np.array(leg.platform_point) for leg in robot.legs]
    hinges = _distinct([point for point, hangs in zip(points, hung, strict=True) if hangs])
    masses, shares, remainder = _part_masses(platform, hinges, len(platform.geared))
    bodies = [_plane_body(platform, pose, _joints(platform, pose), *remainder)]
    bodies += _gears(platform, pose, shares, 1.0)
    first, closings = len(bodies), []
    for j, (hinge, mass) in enumerate(zip(hinges, masses, strict=True), start=1):
        at = p + hinge @ axes
        moves = [
            TreeJoint(f"bar{j}_{name}", True, direction, at, float(direction @ at))
            for name, direction in zip(platform.lengths, platform.directions, strict=True)
        ]
        closings.append(Closing(f"bar{j}", len(bodies), 0, at))
        bodies.append(_still_body(platform, f"bar{j}", BASE, moves, at, mass))
    carried = [
        first + _axis_index(hinges, point) if hangs else 0
        for point, hangs in zip(points, hung, strict=True)
    ]
    return bodies, carried, closings


def _sliding_platform(robot: Manipulator, pose: Array) -> Pieces:
    """Return a platform whose halves slide by its angle: a carrier, a tool that turns, and slides.

    The first moment of the whole per radian, h, is that of its mass m sliding by h / m; what of I
    that leaves, h.h / m less, turns by the angle.
    """
    platform = robot.platform
    turned, angle = _angle(platform, pose)
    p, _ = platform.placement(pose)
    frame = np.array(platform.frame)
    points = [np.array(leg.platform_point) for leg in robot.legs]
    halves = _distinct([point for point in points if np.abs(point).max() > ROUNDING])
    masses, shares, remainder = _part_masses(platform, halves, 2 + len(platform.geared))
    mass, center, about = remainder
    *moves, turn = _joints(platform, pose)
    carrier = _still_body(platform, "platform", BASE, moves, p, float(shares[0]))
    tool = _plane_body(platform, pose, [turn], float(shares[1]), np.zeros(2), about)
    bodies = [carrier, replace(tool, name="tool", parent=0)]
    bodies += _gears(platform, pose, shares[2:], 0.0)
    first = len(bodies) + 1
    slides = [("nacelle", center, mass)]
    slides += [
        (f"half{j}", half[:2], part_mass)
        for j, (half, part_mass) in enumerate(zip(halves, masses, strict=True), start=1)
    ]
    for name, v, part_mass in slides:
        by = float(np.linalg.norm(v))
        direction = v @ frame[:2] / by if by else frame[0]
        at = p + by * angle * direction
        follows = (turned, by)
        joint = TreeJoint(f"{name}_slide", True, direction, at, by * angle, None, follows)
        bodies.append(_still_body(platform, name, 0, [joint], at, part_mass))
    slide = [np.abs(point).max() > ROUNDING for point in points]
    carried = [
        first + _axis_index(halves, point) if away else 0
        for point, away in zip(points, slide, strict=True)
    ]
    return bodies, carried, []


def _part_masses(
    platform: Platform, places: Sequence[Array], others: int
) -> tuple[list[float], Array, tuple[float, Array, float]]:
    """Return the masses of parts at places and of others at P, and the platform's remainder.

    A part has the mass of the bars at its place, or a share of the platform's. The remainder is
    a mass, its centre (2,) and central moment; a bar without a part there is a point of it.
    """
    body = platform.inertia
    assert isinstance(body, PlanarInertia)  # what tilts has no parts
    mass, moment, inertia = body.mass, np.array(body.first_moment), body.inertia
    masses = [0.0] * len(places)
    for bar in platform.bars:
        hinge = np.array(bar.hinge)
        near = [k for k, place in enumerate(places) if _share_axis(place, hinge)]
        if near:
            masses[near[0]] += bar.mass
        else:
            mass, moment = mass + bar.mass, moment + bar.mass * hinge[:2]
            inertia += bar.mass * float(hinge[:2] @ hinge[:2])
    without = [k for k, part_mass in enumerate(masses) if part_mass == 0.0]
    at = np.zeros((len(without) + others, 2))
    for row, k in zip(at, without, strict=False):
        row[:] = places[k][:2]
    shares, mass, moment, inertia = shared_masses(mass, moment, inertia, at)
    for k, share in zip(without, shares, strict=False):
        masses[k] = float(share)
    center = moment / mass
    return masses, shares[len(without) :], (mass, center, inertia - mass * float(center @ center))


def _joints(platform: Platform, pose: Array) -> list[TreeJoint]:
    """Return the joints by which the platform moves, the tool's where its halves slide."""
    joints: list[TreeJoint] = []
    p, moved = platform.placement(pose)[0], np.eye(4)
    limits = platform.angle_limits
    for name, is_prismatic, axis, coordinate in platform_joints(platform, pose):
        axis = moved[:3, :3] @ axis
        # The first axis of a platform with an offset goes through its centre.
        on_first = platform.axis_offset is not None and not joints
        point = np.array(platform.center) if on_first else p
        joint = TreeJoint(name, is_prismatic, axis, point, float(coordinate), limits.get(name))
        if not is_prismatic:
            moved = displacement(joint, float(coordinate)) @ moved
        joints.append(joint)
    return joints


def _angle(platform: Platform, pose: Array) -> tuple[str, float]:
    """Return the name and value of the platform's single angle."""
    (name,), (angle,) = platform.angles, pose[platform.angular].tolist()
    return name, angle


def _plane_body(
    platform: Platform,
    pose: Array,
    joints: Sequence[TreeJoint],
    mass: float,
    center: Array,
    about: float,
) -> TreeBody:
    """Return a body that turns with the platform; its centre (2,) is in the platform's frame."""
    p, axes = platform.placement(pose)
    moments = plane_moments(mass, about, max(float(np.linalg.norm(center)), _SIDE))
    at = p + center @ axes[:2]
    return TreeBody("platform", BASE, tuple(joints), p, axes.T, mass, at, moments, 0)


def _tilting_body(
    platform: Platform, pose: Array, joints: Sequence[TreeJoint], inertia: SpatialInertia
) -> TreeBody:
    """Return a platform that turns about any axis."""
    p, axes = platform.placement(pose)
    center = np.array(inertia.center_of_mass)
    moments, products = spatial_moments(inertia, max(float(np.linalg.norm(center)), _SIDE))
    at = p + center @ axes
    return TreeBody(
        "platform", BASE, tuple(joints), p, axes.T, inertia.mass, at, moments, 0, products
    )


def _fork(platform: Platform, body: TreeBody) -> TreeBody:
    """Return the body without mass between the two axes of a platform whose axes do not meet."""
    mass, moments = massless_inertia(body.mass, body.moments)
    joint, center = body.joints[0], np.array(platform.center)
    return TreeBody("fork", BASE, (joint,), center, body.axes, mass, center, moments, 0)


def _still_body(
    platform: Platform, name: str, parent: int, joints: Sequence[TreeJoint], at: Array, mass: float
) -> TreeBody:
    """Return a body that does not rotate, with its mass at its origin."""
    axes, moments = np.array(platform.frame).T, cube_moments(mass, _SIDE)
    return TreeBody(name, parent, tuple(joints), at, axes, mass, at, moments, 0)


def _gears(platform: Platform, pose: Array, masses: Array, against: float) -> list[TreeBody]:
    """Return the bodies that gears turn, relative to a body that turns at ratio `against`."""
    p, axes = platform.placement(pose)
    turned, angle = _angle(platform, pose) if platform.geared else ("", 0.0)
    bodies = []
    for j, (part, mass) in enumerate(zip(platform.geared, masses, strict=True), start=1):
        by = part.ratio - against
        axis, follows = np.array(platform.axis), (turned, by)
        joint = TreeJoint(f"gear{j}", False, axis, p, by * angle, None, follows)
        moments = np.full(3, part.inertia)
        bodies.append(TreeBody(f"geared{j}", 0, (joint,), p, axes.T, float(mass), p, moments, 0))
    return bodies


def _share_axis(first: Array, second: Array) -> bool:
    """Return whether two places (3,) are on one line along the platform's axis."""
    return bool(np.abs(first - second)[:2].max() <= ROUNDING)


def _distinct(places: Sequence[Array]) -> list[Array]:
    """Return places without those on the axis of an earlier place."""
    return [
        place
        for k, place in enumerate(places)
        if not any(_share_axis(place, earlier) for earlier in places[:k])
    ]


def _axis_index(places: Sequence[Array], place: Array) -> int:
    """Return the index of the place on the same axis as another."""
    return next(k for k, candidate in enumerate(places) if _share_axis(candidate, place))
