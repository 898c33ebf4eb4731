"""A plane slice through the reach, as coloured surfaces of the viewer's picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.viewer.meshes import Mesh, cells
from pteron.workspace import BEYOND_LIMITS, REACHABLE, reach_slice
from pteron.workspace.reach_slices import slice_planes

POINTS = 111
"""Points along each side of a slice."""

SERVES, BEYOND = "#2f7fc4", "#e0a030"
"""Colours of poses in reach, and of those in reach but beyond a joint's limit."""

NONE = "none"
"""The choice of no slice."""


def choices(robot: Manipulator) -> tuple[str, ...]:
    """Return the choices of a slice: none, or a plane of the pose's lengths."""
    if len(robot.platform.lengths) < 2:
        return (NONE,)
    return (NONE, *(plane for plane in slice_planes(robot) if isinstance(plane, str)))


def slice_meshes(
    robot: Manipulator, pose: Array, plane: str, span: Array
) -> list[tuple[Mesh, str]]:
    """Return the parts of a slice through a pose, each with its colour.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (m,)
        The pose it goes through, whose orientation holds for all of it.
    plane : {"xy", "xz", "yz"}
        The two coordinates that vary.
    span : array, shape (2, m)
        Least and greatest of each coordinate.

    Returns
    -------
    list of (mesh, color)
        Where poses serve, and where only a joint's limit forbids them.
    """
    chosen = next(one for one in slice_planes(robot) if one == plane)
    i, j = (robot.coordinates.index(letter) for letter in plane)
    (left, right), (low, high) = (map(float, span[:, k]) for k in (i, j))
    extent = left, right, low, high
    cut = reach_slice(robot, pose, chosen, extent=extent, points=POINTS)
    found = []
    for status, color in ((REACHABLE, SERVES), (BEYOND_LIMITS, BEYOND)):
        flat, faces = cells(cut.first, cut.second, np.asarray(cut.status == status))
        found.append(((_in_space(robot, pose, i, j, flat), faces), color))
    return found


def _in_space(robot: Manipulator, pose: Array, i: int, j: int, flat: Array) -> NDArray[np.float64]:
    """Return points (V, 2) of a slice in the base frame, (V, 3)."""
    directions = robot.platform.directions
    lengths = np.tile(pose[~robot.platform.angular], (len(flat), 1))
    lengths[:, i], lengths[:, j] = flat[:, 0], flat[:, 1]
    return np.asarray(lengths @ directions)
