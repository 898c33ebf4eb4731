"""A slice through the reach: coloured surfaces in the viewer's picture, or a map in its panel.

Two lengths have a plane in space. A slice along an angle has none, and is a map.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.plots.printing import svg
from pteron.plots.reach import reach_figure
from pteron.workspace import BEYOND_LIMITS, REACHABLE, ReachSlice, reach_slice
from pteron.workspace.reach_slices import Plane, slice_planes

POINTS = 111
"""Points along each side of a slice."""

SERVES, BEYOND = "#2f7fc4", "#e0a030"
"""Colours of poses in reach, and of those in reach but beyond a joint's limit."""

NONE = "none"
"""The choice of no slice."""


def choices(robot: Manipulator) -> dict[str, Plane | None]:
    """Return the choices of a slice: none, "xy" of two lengths, or a pair of names."""
    planes, lengths = slice_planes(robot), set(robot.platform.lengths)
    if robot.platform.tilts:
        pairs = combinations(robot.coordinates, 2)
        planes = tuple("".join(pair) if set(pair) <= lengths else pair for pair in pairs)
    return {NONE: None} | {
        plane if isinstance(plane, str) else ", ".join(plane): plane for plane in planes
    }


def slice_strips(
    robot: Manipulator, pose: Array, plane: str, span: Array
) -> list[tuple[str, Array]]:
    """Return the parts of a slice through a pose: a colour, and strips (S, 4, 3) in space, m.

    They are where poses serve, and where only a joint's limit forbids them, within the least and
    the greatest of each coordinate (2, m). A strip is a row of grid cells whose corners all do.
    """
    cut = _slice(robot, pose, plane, span)
    found = []
    for status, color in ((REACHABLE, SERVES), (BEYOND_LIMITS, BEYOND)):
        flat = _strips(cut.first, cut.second, np.asarray(cut.status == status))
        found.append((color, _in_space(robot, pose, *cut.places, flat)))
    return found


def slice_map(robot: Manipulator, pose: Array, plane: Plane, span: Array) -> str:
    """Return the map of a slice along an angle, in HTML; see `slice_strips`, `reach_figure`."""
    cut = _slice(robot, pose, plane, span)
    return str(svg(reach_figure(cut), name="slice", title=f"Reach over {' and '.join(plane)}"))


def _slice(robot: Manipulator, pose: Array, plane: Plane, span: Array) -> ReachSlice:
    i, j = (robot.coordinates.index(name) for name in plane)
    (left, right), (low, high) = (map(float, span[:, k]) for k in (i, j))
    return reach_slice(robot, pose, plane, extent=(left, right, low, high), points=POINTS)


def _strips(first: Array, second: Array, inside: NDArray[np.bool_]) -> Array:
    """Return the rows of cells of a grid (B, A) whose corners are inside, as (S, 4, 2)."""
    whole = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
    edges = np.diff(np.pad(whole.astype(int), ((0, 0), (1, 1))), axis=1)
    rows, starts = np.nonzero(edges == 1)
    ends = np.nonzero(edges == -1)[1]
    left, right, low, high = first[starts], first[ends], second[rows], second[rows + 1]
    corners = [(left, low), (right, low), (right, high), (left, high)]
    return np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1)


def _in_space(robot: Manipulator, pose: Array, i: int, j: int, flat: Array) -> Array:
    """Return points (..., 2) of a slice in the base frame, (..., 3)."""
    lengths = np.zeros((*flat.shape[:-1], len(robot.platform.lengths)))
    lengths[:] = pose[~robot.platform.angular]
    lengths[..., i], lengths[..., j] = flat[..., 0], flat[..., 1]
    return np.asarray(lengths @ robot.platform.directions)
