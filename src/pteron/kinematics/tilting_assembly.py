"""Direct kinematics of machines whose platforms tilt: every pose of given joint coordinates.

With its joint held a leg keeps its platform point on a sphere, or, where it stays in a plane of the
base, on a circle; `pose_paths` finds the poses that fit all of these.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.equations.closing import holds_planes, holds_spheres
from pteron.equations.machine import Machine
from pteron.equations.pose_paths import Closed
from pteron.kernels import Array
from pteron.kernels.path_programs import spheres_kernel
from pteron.kinematics.offset_poses import offset_poses
from pteron.kinematics.plane_poses import plane_poses
from pteron.kinematics.pose_paths import generic, positions_and_rotations, real_poses
from pteron.kinematics.searched_poses import searched_poses
from pteron.manipulator import Manipulator
from pteron.platforms.nearest_pose import nearest_pose
from pteron.tolerances import SAME

_HUGE = 1e30
"""Size of the spheres' centres and radii beyond which joints have no pose."""


def is_searched(robot: Manipulator) -> bool:
    """Return whether a machine's poses are searched by Newton's method, as none finds all."""
    machine = Machine.numeric(robot)
    return robot.platform.tilts and not (holds_planes(machine) or holds_spheres(machine))


def tilting_poses(
    robot: Manipulator, joints: Array
) -> tuple[NDArray[np.int64], Array, NDArray[np.bool_]]:
    """Return all poses of joint coordinates (B, n) of a tilting platform, with the row of each.

    The third result (B,) is whether the platform can move while a row's joints are held (a
    self-motion), for which no poses are listed. Poses of a tripod with the other solution of its
    yaw are excluded.
    """
    machine = Machine.numeric(robot)
    if holds_planes(machine):
        return plane_poses(robot, joints)
    none_moves = np.zeros(len(joints), dtype=bool)
    if is_searched(robot):
        return (*searched_poses(robot, joints), none_moves)
    if robot.platform.axis_offset is not None:
        return (*offset_poses(robot, joints), none_moves)
    centers, squares = spheres_kernel(robot)(joints)
    good = np.flatnonzero(
        (np.abs(centers) < _HUGE).all(axis=(-2, -1)) & (np.abs(squares) < _HUGE).all(axis=-1)
    )
    platform = robot.platform
    frame = np.array(platform.frame)
    a, b, r = _equations(robot, centers[good], squares[good])
    closed = Closed(
        len(robot.legs) + (platform.second_axis is not None),
        len(platform.planes),
        platform.center is None,
    )
    if closed.spheres == 6:
        ends = [leg.platform_point for leg in robot.legs]
        order = sorted(range(6), key=lambda k: ends.index(ends[k]))
        pairs = zip(order[::2], order[1::2], strict=True)
        closed = closed._replace(paired=all(ends[i] == ends[j] for i, j in pairs))
        a, b, r = a[:, order], b[order], r[:, order]
    base, top = np.zeros((len(good), 3)), np.zeros(3)
    if closed.moves:
        base, top = a[:, : closed.spheres].mean(axis=1), b[: closed.spheres].mean(axis=0)
    elif platform.center is not None:
        base = np.broadcast_to(np.array(platform.center), base.shape)
    r[:, closed.spheres :] -= (a[:, closed.spheres :] * base[:, None]).sum(axis=-1)
    a[:, : len(robot.legs)] -= base[:, None]
    b = b - top
    # The row of a 2R platform's unit axes has no size in metres.
    in_metres = slice(0, len(robot.legs))
    squares_of_ends = (a[:, in_metres] ** 2).sum(axis=-1) + (b[in_metres] ** 2).sum(axis=-1)
    size = np.sqrt(squares_of_ends.mean(axis=-1)) / generic(closed).size
    machines = np.concatenate([a, np.broadcast_to(b, a.shape), r[..., None]], axis=-1)
    machines[:, in_metres, :6] /= size[:, None, None]
    machines[:, closed.spheres :, 3:6] /= size[:, None, None]
    machines[:, in_metres, 6] /= size[:, None] ** 2
    machines[:, closed.spheres :, 6] /= size[:, None]
    which, z, move = real_poses(closed, machines)
    place, turned = positions_and_rotations(z)
    place = size[which, None] * place + base[which] - turned @ top
    rotation = turned @ frame.T
    poses = nearest_pose(platform, place, rotation)
    positions, axes = platform.placement(poses)
    distance = np.abs(positions - place).max(axis=-1) / size[which]
    distance += np.abs(np.swapaxes(axes, -1, -2) - rotation).max(axis=(-2, -1))
    own_side = distance < SAME
    moving = np.zeros(len(joints), dtype=bool)
    moving[good] = move
    return good[which[own_side]], poses[own_side], moving


def _equations(robot: Manipulator, centers: Array, squares: Array) -> tuple[Array, Array, Array]:
    """Return a, b, r of the closures: spheres |P + R b - a|^2 = r, planes a.(P + R b) = r."""
    platform, count = robot.platform, len(centers)
    points = np.array([leg.platform_point for leg in robot.legs]) @ np.array(platform.frame)
    if platform.second_axis is not None:  # whose angle with the first does not change
        first, second = np.array(platform.axis), np.array(platform.second_axis)
        centers = np.concatenate([centers, np.broadcast_to(first, (count, 1, 3))], axis=1)
        squares = np.column_stack([squares, np.full(count, 2.0 - 2.0 * first @ second)])
        points = np.vstack([points, second])
    if platform.planes:
        normals, origins = (np.array([p[k] for p in platform.planes]) for k in (0, 1))
        offsets = (normals * origins).sum(axis=-1)
        centers = np.concatenate([centers, np.broadcast_to(normals, (count, 3, 3))], axis=1)
        squares = np.column_stack([squares, np.broadcast_to(offsets, (count, 3))])
        points = np.vstack([points, points])
    return centers, points, squares
