"""Sample poses and shape of a required workspace: a box, cube or cylinder at some orientations."""

from __future__ import annotations

from itertools import product

import numpy as np

from pteron.design.workspace_tables import WorkspaceTable
from pteron.kernels import Array
from pteron.workspace import Box, Cylinder, Region
from pteron.workspace.shape_samples import Shape

_RING = 24
"""Points round a cylinder's rim."""


def workspace_shape(workspace: WorkspaceTable, count: int) -> tuple[Shape, float]:
    """Return the shape of a workspace in `count` coordinates, and its edge: the greatest side."""
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
        scaled = vectors / half
        away = np.linalg.norm(scaled[..., radial], axis=-1)
        return np.asarray(np.maximum(away, np.abs(scaled[..., axis])))

    return Shape(half, gauge, rim.reshape(-1, 3)), edge


def workspace_poses(workspace: WorkspaceTable, angles: Array, samples: int | None = None) -> Array:
    """Return poses (N, m) over a workspace at orientations (A, m); with 2 samples its corners."""
    positions = _positions(workspace, samples or workspace.samples)
    poses = np.repeat(angles, len(positions), axis=0)
    poses[:, : positions.shape[1]] = np.tile(positions, (len(angles), 1))
    return poses


def _positions(workspace: WorkspaceTable, count: int) -> Array:
    line = np.linspace(-1.0, 1.0, count)
    if workspace.shape != "cylinder":
        low, high = (np.array(end) for end in workspace.ends)
        units = np.array(list(product(line, repeat=len(low))))
        return np.asarray((low + high) / 2.0 + units * (high - low) / 2.0)
    assert workspace.radius is not None  # the shape says so
    assert workspace.height is not None
    axis = "xyz".index(workspace.axis)
    turns = np.linspace(0.0, 2.0 * np.pi, 4 * count, endpoint=False)
    radii = np.linspace(0.0, workspace.radius, max(2, (count + 1) // 2))
    points = [
        (r * np.cos(a), r * np.sin(a), h * workspace.height / 2.0)
        for h in line
        for r in radii
        for a in (turns if r else turns[:1])
    ]
    # The last is along the axis.
    order = [(axis + 1) % 3, (axis + 2) % 3, axis]
    positions = np.empty((len(points), 3))
    positions[:, order] = points
    return np.asarray(positions + np.array(workspace.center))


def workspace_region(table: WorkspaceTable, pose: Array, share: float = 1.0) -> Region:
    """Return a workspace that has its place, at the orientation of a pose, or a share of it."""
    if table.shape == "cylinder":
        assert table.radius is not None  # the shape says so
        assert table.height is not None
        x, y, z = np.eye(3)["xyz".index(table.axis)].tolist()
        center = placed_pose(pose, np.array(table.center))
        return Cylinder(center, share * table.radius, share * table.height, (x, y, z))
    low, high = (np.array(end) for end in table.ends)
    inset = 0.5 * (1.0 - share) * (high - low)
    return Box(placed_pose(pose, low + inset), placed_pose(pose, high - inset))


def placed_pose(pose: Array, position: Array) -> tuple[float, ...]:
    """Return a position with the angle of a pose."""
    return (*position.tolist(), *pose[len(position) :].tolist())
