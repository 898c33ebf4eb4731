"""Sample poses and cycles of a job, relative to the middle of its workspace, for a kind.

Places are those of the tool's centre point: where the platform turns, P moves against it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from pteron.bodies.vectors import rotation_matrices
from pteron.design.job import Job
from pteron.design.kinds import angle_counts
from pteron.kernels import Array
from pteron.kinematics import pose_of
from pteron.manipulator import Manipulator
from pteron.motion.trajectories.tool import Curve, pose_motion, tool_motion

_ALONG, _ALONG_TILTED = 4, 3
"""Poses along each side of a box; where it is met at several tilts."""

_ROUND = 12
"""Poses round a cylinder."""

_RIM = 6
"""Directions round the rim of a cone of tilts."""

INSIDE = 1e-9
"""Tolerance of a place in the workspace, m or rad."""

_ROUNDS = 4
"""Halvings of the refinement's step."""


def platform_curve(robot: Manipulator, *curve: Array) -> Curve:
    """Return poses of P and two derivatives, about the middle, for a tool curve (..., m)."""
    pose, first, second = pose_motion(robot.platform, *curve)
    zeros = np.zeros((1, robot.freedom))
    return pose + tool_motion(robot.platform, zeros, zeros, zeros)[0], first, second


def poses_about_tool(robot: Manipulator, angles: Array) -> Array:
    """Return poses (A, m) with the given angles at which the tool stays in the middle."""
    poses = np.zeros((len(angles), robot.freedom))
    poses[:, len(robot.platform.lengths) :] = angles
    return platform_curve(robot, poses, np.zeros_like(poses), np.zeros_like(poses))[0]


def sample_poses(job: Job, robot: Manipulator, count: int | None = None) -> Array:
    """Return sample poses (N, m) over the workspace and its orientations, about its middle."""
    return _poses_at(job, robot, _places(job, robot, count or _positions_along(job)))


def refine_worst_values(
    job: Job,
    robot: Manipulator,
    values_of: Callable[[Array], Array],
    samples: int | None = None,
    keep: int = 1,
    besides: Array | None = None,
) -> tuple[Array, Array]:
    """Return the minimum of each column of values (C,), and its pose (C, m).

    `values_of` returns values (B, C) at poses (B, m) relative to the workspace's middle. They are
    evaluated at `sample_poses`, then at ever closer neighbours of the `keep` worst poses of each
    column, since near a singularity the minimum lies in a valley between samples. Poses `besides`
    those of the workspace are added as they are.
    """
    samples, space = samples or _positions_along(job), job.workspace
    count = len(robot.platform.lengths)
    places = _places(job, robot, samples)
    rows = values_of(_poses_at(job, robot, places))
    steps = np.zeros(robot.freedom)
    steps[:count] = job.workspace.half[:count] / (samples - 1)
    if space.tilt is not None:
        steps[count : count + 2] = 0.5 * space.tilt
    if space.turn is not None and space.directions is None:
        steps[-1] = 0.25 * (space.turn[1] - space.turn[0])
    if space.poses is not None:
        steps[:count] = 0.0
    ways = _neighbour_steps(steps, count)
    for _ in range(_ROUNDS if steps.any() else 0):
        worst = np.unique(np.argsort(rows, axis=0)[:keep])
        near = (places[worst][:, None] + steps * ways).reshape(-1, robot.freedom)
        places = _clip_to_workspace(job, near, count)
        rows = values_of(_poses_at(job, robot, places))
        steps /= 2.0
    poses = _poses_at(job, robot, places)
    if besides is not None and len(besides):
        poses, rows = np.vstack([poses, besides]), np.vstack([rows, values_of(besides)])
    return rows.min(axis=0), poses[rows.argmin(axis=0)]


def _neighbour_steps(steps: Array, count: int) -> Array:
    """Return all pose steps (W, m) to neighbours, in positions or in tilts but not both at once."""
    several = [(-1.0, 0.0, 1.0) if step else (0.0,) for step in steps]
    if not steps[count:-1].any():
        return np.array(list(product(*several)))
    fixed = [(0.0,)] * len(steps)
    parts = (several[:count] + fixed[count:], fixed[:count] + several[count:])
    return np.unique(np.vstack([list(product(*part)) for part in parts]), axis=0)


def _clip_to_workspace(job: Job, places: Array, count: int) -> Array:
    """Return places (N, m), relative to the middle, clipped to the workspace.

    Duplicates are removed.
    """
    space, half, clipped = job.workspace, job.workspace.half[:count], places.copy()
    if space.poses is None:
        clipped[:, :count] = np.clip(clipped[:, :count], -half, half)
    if space.radius is not None:
        clipped[:, :2] = _clip_to_radius(clipped[:, :2], space.radius)
    if space.tilt is not None:
        clipped[:, count : count + 2] = _clip_to_radius(clipped[:, count : count + 2], space.tilt)
    if space.turn is not None and space.directions is None:
        clipped[:, -1] = np.clip(clipped[:, -1], *space.turn)
    return np.unique(clipped, axis=0)


def _clip_to_radius(points: Array, radius: float) -> Array:
    """Return points (N, 2) moved radially into a circle about the origin."""
    shares = np.minimum(1.0, radius / np.maximum(np.hypot(*points.T), 1e-12))
    return np.asarray(points * shares[:, None])


def _positions_along(job: Job) -> int:
    """Return the number of sample positions along a side; fewer where the platform tilts."""
    return _ALONG_TILTED if job.workspace.tilts else _ALONG


def _places(job: Job, robot: Manipulator, count: int) -> Array:
    """Return places (N, m): tool positions relative to the middle, and platform angles.

    For a cone of tilts the angles are the leans towards x and y, and the turn about z.
    """
    points = _positions(job, count)[:, : len(robot.platform.lengths)]
    angles = orientations(job, robot)
    if job.workspace.tilt is not None:
        leans = [(*lean, turn) for turn in _turns(job) for lean in _leans(job.workspace.tilt)]
        angles = np.array(leans)[:, : len(robot.platform.angles)]
    return np.hstack([np.tile(points, (len(angles), 1)), np.repeat(angles, len(points), axis=0)])


def _poses_at(job: Job, robot: Manipulator, places: Array) -> Array:
    """Return poses (N, m) of places (N, m): the tool's positions and the platform's angles."""
    count = len(robot.platform.lengths)
    angles = places[:, count:]
    if job.workspace.tilt is not None:
        tilting, _ = angle_counts(robot.platform)
        angles = _tilted_angles(robot, angles[:, :tilting])
        angles[:, tilting:] += places[:, count + tilting :]
    poses = poses_about_tool(robot, angles)
    poses[:, :count] += places[:, :count]
    return poses


def pad_to_xyz(rows: object) -> Array:
    """Return rows of two or three numbers as (N, 3), padded with zeros."""
    array = np.asarray(rows, dtype=float)
    return np.pad(array, ((0, 0), (0, 3 - array.shape[1])))


def _positions(job: Job, count: int) -> Array:
    """Return sample positions (N, 3) over the workspace, relative to its middle, m."""
    space, half = job.workspace, job.workspace.half
    if space.poses is not None:
        points = pad_to_xyz(space.poses)
        return np.asarray(points - 0.5 * (points.min(axis=0) + points.max(axis=0)))
    line = np.linspace(-1.0, 1.0, count)
    upright = line if half[2] else np.zeros(1)
    if space.radius is None:
        return np.array(list(product(line, line, upright))) * half
    turns = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    circle = [(0.0, 0.0), *((np.cos(a), np.sin(a)) for a in turns)]
    circle += [(0.5 * x, 0.5 * y) for x, y in circle[1::3]]
    return np.array([(x, y, z) for x, y in circle for z in upright]) * half


def orientations(job: Job, robot: Manipulator) -> Array:
    """Return the platform angles (A, a), rad, that the workspace requires: tilts at each turn."""
    return np.concatenate([turn_angles(tilts(job, robot), angle) for angle in _turns(job)])


def _turns(job: Job) -> list[float]:
    """Return the turns about the vertical, rad, at which a workspace is sampled: ends and 0."""
    turn = job.workspace.turn
    return [0.0] if turn is None else [*([0.0] if turn[0] < 0.0 < turn[1] else []), *turn]


def tilts(job: Job, robot: Manipulator) -> Array:
    """Return platform angles (A, a), rad, of required tilts; of a cone its middle and rim."""
    space, count = job.workspace, len(robot.platform.angles)
    if space.tilt is not None:
        return _tilted_angles(robot, _leans(space.tilt))
    if space.directions is None:
        return np.zeros((1, count))
    directions = np.array(space.directions)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    away = np.linalg.norm(directions[:, :2], axis=1, keepdims=True)
    angle = np.arctan2(away, directions[:, 2:])
    return _tilted_angles(robot, directions[:, :2] / np.where(away > 0.0, away, 1.0) * angle)


def _leans(tilt: float) -> Array:
    """Return leans (L, 2) towards x and y, rad: zero, and equally spaced on the rim of a cone."""
    rim = 2.0 * np.pi * np.arange(_RIM) / _RIM
    return np.vstack([np.zeros((1, 2)), tilt * np.c_[np.cos(rim), np.sin(rim)]])


def _tilted_angles(robot: Manipulator, leans: Array) -> Array:
    """Return platform angles (L, a), rad, of leans (L, 2) towards x and y by the shortest turn.

    Two angles give its z axis the same direction.
    """
    vectors = np.c_[-leans[:, 1], leans[:, 0], np.zeros(len(leans))]
    matrices = rotation_matrices(vectors)
    if angle_counts(robot.platform) == (2, 0):
        return angles_of_directions(robot, matrices[..., 2])
    return np.array(pose_of(robot, np.zeros(3), matrices)[:, -len(robot.platform.angles) :])


def angles_of_directions(robot: Manipulator, directions: Array) -> Array:
    """Return alpha and beta (L, 2), rad, that give a platform's z axis directions (L, 3).

    Both axes are level at angles zero: with n their normal, z is sin(beta) axis + cos(beta)
    (cos(alpha) n - sin(alpha) second_axis), up to the sign of n . z.
    """
    first, second = (np.array(axis) for axis in robot.platform.rotation_axes)
    normal = np.cross(first, second)
    side = normal[2]
    sine = np.clip(side * directions @ first, -1.0, 1.0)
    alpha = np.arctan2(-side * directions @ second, side * directions @ normal)
    return np.column_stack([alpha, np.arcsin(sine)])


def turn_angles(angles: Array, turn: float) -> Array:
    """Return platform angles (A, a) with `turn` rad added about the vertical axis."""
    if not angles.shape[1]:
        return angles
    return np.asarray(angles + turn * np.eye(angles.shape[1])[-1])
