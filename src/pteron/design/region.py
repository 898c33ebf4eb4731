"""Sample poses of a required workspace: a box, a cube or a cylinder at some orientations."""

from __future__ import annotations

from itertools import product

import numpy as np

from pteron.design.spec import WorkspaceTable
from pteron.kernels import Array


def workspace_poses(workspace: WorkspaceTable, angles: Array, samples: int | None = None) -> Array:
    """Return poses (N, m) over a workspace at orientations (A, m); with 2 samples its corners."""
    positions = _positions(workspace, samples or workspace.samples)
    found = np.repeat(angles, len(positions), axis=0)
    found[:, : positions.shape[1]] = np.tile(positions, (len(angles), 1))
    return found


def _positions(workspace: WorkspaceTable, count: int) -> Array:
    line = np.linspace(-1.0, 1.0, count)
    if workspace.shape != "cylinder":
        low, high = (np.array(end) for end in workspace.ends)
        units = np.array(list(product(line, repeat=len(low))))
        return np.asarray((low + high) / 2.0 + units * (high - low) / 2.0)
    assert workspace.radius is not None  # the shape says so
    assert workspace.height is not None
    along = "xyz".index(workspace.axis)
    turns = np.linspace(0.0, 2.0 * np.pi, 4 * count, endpoint=False)
    radii = np.linspace(0.0, workspace.radius, max(2, (count + 1) // 2))
    found = [
        (r * np.cos(a), r * np.sin(a), h * workspace.height / 2.0)
        for h in line
        for r in radii
        for a in (turns if r else turns[:1])
    ]
    # The last is along the axis.
    order = [(along + 1) % 3, (along + 2) % 3, along]
    positions = np.empty((len(found), 3))
    positions[:, order] = found
    return np.asarray(positions + np.array(workspace.center))
