"""Required workspaces as regions that proofs take, as shapes that are placed, as sample poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.design.kind_evaluator import KindEvaluator
from pteron.design.workspace_samples import orientations, poses_about_tool
from pteron.design.workspace_tables import WorkspaceTable
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion.trajectories.tool import arm_motion, carries, tool_motion
from pteron.platforms import Platform
from pteron.workspace import Box, Cylinder, Region
from pteron.workspace.shape_samples import Shape, shape_samples
from pteron.workspace.tilts import OrientedRegion, tilt_angles

_RING = 24
"""Points round a cylinder's rim."""

_TILTS, _TURNS = 6, 3
"""Sampled directions of the greatest tilt, beside the level one, and angles of a range."""


def workspace_shape(workspace: WorkspaceTable, count: int) -> tuple[Shape, float]:
    """Return a workspace's shape in `count` coordinates, scaled to edge 1, and its edge, m."""
    sides = np.array(workspace.dimensions(count))
    edge = float(sides.max())
    half = sides / edge
    if workspace.shape != "cylinder":
        return Shape(half, lambda v: np.abs(v / half).max(axis=-1), np.empty((0, count))), edge
    axis = "xyz".index(workspace.axis)
    radial = [k for k in range(3) if k != axis]
    turns = 2.0 * np.pi * np.arange(_RING) / _RING
    rim = np.zeros((5, _RING, 3))
    rim[..., radial] = half[radial] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    rim[..., axis] = half[axis] * np.linspace(-1.0, 1.0, 5)[:, None]

    def gauge(vectors: Array) -> Array:
        """Return the scale (...) of the cylinder that vectors (..., 3) reach: 1 at its surface."""
        scaled = vectors / half
        away = np.linalg.norm(scaled[..., radial], axis=-1)
        return np.asarray(np.maximum(away, np.abs(scaled[..., axis])))

    return Shape(half, gauge, rim.reshape(-1, 3)), edge


def workspace_poses(workspace: WorkspaceTable, angles: Array, samples: int) -> Array:
    """Return poses (N, m) over a workspace at orientations (A, m); of a box 2 give its corners."""
    center = np.mean(workspace.ends, axis=0)
    if not len(center):
        return angles
    shape, edge = workspace_shape(workspace, len(center))
    return shape_samples(shape, angles, samples).shape_poses(center, edge)


def workspace_region(table: WorkspaceTable, pose: Array, share: float = 1.0) -> Region:
    """Return the places of a workspace, scaled by `share`, at a pose's orientation."""
    if table.shape == "cylinder":
        assert table.radius is not None  # the shape says so
        assert table.height is not None
        x, y, z = np.eye(3)["xyz".index(table.axis)].tolist()
        center = placed_pose(pose, np.array(table.center))
        return Cylinder(center, share * table.radius, share * table.height, (x, y, z))
    low, high = (np.array(end) for end in table.ends)
    inset = 0.5 * (1.0 - share) * (high - low)
    return Box(placed_pose(pose, low + inset), placed_pose(pose, high - inset))


def oriented_region(
    places: Region, workspace: WorkspaceTable | None, platform: Platform, share: float = 1.0
) -> Region:
    """Return a region of places at all orientations of a workspace, their ranges scaled."""
    if workspace is None or not workspace.has_ranges:
        return places
    low, high = places.box[:, platform.angular]
    if workspace.tilt is not None:
        low[:2], high[:2] = -share * workspace.tilt, share * workspace.tilt
    for name, (first, last) in (workspace.angles or {}).items():
        at, inset = platform.angles.index(name), 0.5 * (1.0 - share) * (last - first)
        low[at], high[at] = first + inset, last - inset
    tilt = None if workspace.tilt is None else share * workspace.tilt
    return OrientedRegion(places, tuple(low.tolist()), tuple(high.tolist()), tilt)


def sampled_orientations(
    workspace: WorkspaceTable | None, platform: Platform, poses: Array
) -> Array:
    """Return poses (A, m) at sampled tilts and angles of a workspace, about each pose (B, m)."""
    if workspace is not None and workspace.tilt is not None:
        rim = 2.0 * np.pi * np.arange(_TILTS) / _TILTS
        leans = np.vstack([[0.0, 0.0], tilt_angles(workspace.tilt, rim)])
        poses = np.repeat(poses[:, None], 1 + _TILTS, axis=1)
        poses[..., np.flatnonzero(platform.angular)[:2]] = leans
        poses = poses.reshape(-1, poses.shape[-1])
    for name, ends in ((workspace and workspace.angles) or {}).items():
        poses = np.repeat(poses[:, None], _TURNS, axis=1)
        poses[..., platform.coordinates.index(name)] = np.linspace(*ends, _TURNS)
        poses = poses.reshape(-1, poses.shape[-1])
    return poses


def placed_pose(pose: Array, position: Array) -> tuple[float, ...]:
    """Return the pose (m,) with the given position and the angles of `pose`."""
    return (*position.tolist(), *pose[len(position) :].tolist())


@dataclass(frozen=True)
class TurnedTool:
    """Poses whose tool is in a box, for a platform that turns about an axis beside the tool.

    Parameters
    ----------
    of_tool : Box
        Positions of the tool, as `tool_motion` has them, then the angle of the turn, m and rad.
    platform : Platform
        The platform that carries the tool.
    """

    of_tool: Box
    platform: Platform

    @property
    def box(self) -> Array:
        """Least and greatest pose of the box around the region (2, m)."""
        low, high = self.of_tool.box
        at, away = self._arm(low[None], high[None])
        return np.array([low - at[0] - away[0], high - at[0] + away[0]])

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return whether poses (..., m) lie in the region."""
        zeros = np.zeros_like(poses)
        return self.of_tool.holds(tool_motion(self.platform, poses, zeros, zeros)[0])

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return for boxes with corners (B, m) whether each certainly lies outside the region."""
        at, away = self._arm(low, high)
        return self.of_tool.misses(low + at - away, high + at + away)

    def _arm(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the vector (B, m) from P to the tool at each box's middle angle, with its error.

        Over half the box's range of angles the tool moves by at most this half range times the
        vector's length, which is the error.
        """
        platform, angular = self.platform, self.platform.angular
        middle, half = 0.5 * (low + high)[:, angular], 0.5 * (high - low)[:, -1:]
        zeros = np.zeros_like(middle)
        at, away = np.zeros_like(low), np.zeros_like(low)
        at[:, ~angular] = arm_motion(platform, middle, zeros, zeros)[0]
        away[:, ~angular] = (1.0 + 1e-12) * np.hypot(*platform.tool[:2]) * half
        return at, away


def kind_regions(evaluator: KindEvaluator, robot: Manipulator, middle: Array) -> list[Region]:
    """Return the workspace as regions of poses: one for each listed pose, or each orientation.

    A range of turns without tilts is a coordinate of one box.
    """
    space, count = evaluator.job.workspace, len(robot.platform.lengths)
    if space.poses is not None:
        return [Box(tuple(pose), tuple(pose)) for pose in middle + evaluator.poses]
    if space.turn is not None and not space.tilts and space.radius is None:
        return [_turned_box(evaluator, robot, middle)]
    boxes: list[Region] = []
    half = np.zeros(robot.freedom)
    half[:count] = evaluator.half[:count]
    for pose in middle + poses_about_tool(robot, orientations(evaluator.job, robot)):
        if space.radius is not None and space.height is not None:
            boxes.append(Cylinder(tuple(pose.tolist()), space.radius, space.height))
        else:
            boxes.append(Box(tuple((pose - half).tolist()), tuple((pose + half).tolist())))
    return boxes


def _turned_box(evaluator: KindEvaluator, robot: Manipulator, middle: Array) -> Region:
    """Return the box of positions and turns of a workspace with a range of turns."""
    platform, count = robot.platform, len(robot.platform.lengths)
    assert evaluator.job.workspace.turn is not None  # the caller has checked it
    zeros = np.zeros((1, robot.freedom))
    level = tool_motion(platform, middle[None], zeros, zeros)[0][0]
    low, high = level.copy(), level.copy()
    low[:count] -= evaluator.half[:count]
    high[:count] += evaluator.half[:count]
    low[-1], high[-1] = evaluator.job.workspace.turn
    box = Box(tuple(low.tolist()), tuple(high.tolist()))
    return TurnedTool(box, platform) if carries(platform) and any(platform.tool[:2]) else box
