"""A slice through the reach: coloured surfaces in the viewer's picture, or a map in its panel.

Two lengths have a plane in space. A slice along an angle has none, and is a map.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from matplotlib.figure import Figure

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.plots.printing import svg
from pteron.plots.reach import reach_figure
from pteron.workspace import reach_slice
from pteron.workspace.reach_slices import Plane, slice_coordinates

POINTS = 111
"""Points along each side of a slice."""

_COARSE = 61
"""The same of the slice that shows how wide it is."""

SERVES, BEYOND = "#2f7fc4", "#e0a030"
"""Colours of poses in reach, and of those in reach but beyond a joint's limit."""

NONE = "none"
"""The choice of no slice."""


def choices(robot: Manipulator) -> dict[str, Plane | None]:
    """Return the planes of a slice by label: none, two lengths such as "xy", or a pair of names."""
    planes: dict[str, Plane | None] = {NONE: None}
    for first, second in combinations(slice_coordinates(robot), 2):
        if {first, second} <= set(robot.platform.lengths):
            planes[first + second] = first + second
        else:
            planes[f"{first}, {second}"] = first, second
    return planes


def slice_parts(
    robot: Manipulator, pose: Array, plane: str, span: Array
) -> list[tuple[str, list[Array]]]:
    """Return the parts of a slice through a pose: a colour, and rings (K, 3) in space, m.

    They bound where poses serve, and where only a joint's limit forbids them; what an odd number
    of rings goes round belongs to the part. The slice is as wide as both, or ends with the least
    and the greatest of each coordinate (2, m) where it has no end soon after.
    """
    i, j = (robot.coordinates.index(name) for name in plane)
    extent = _sides(robot, pose, plane, (*map(float, span[:, i]), *map(float, span[:, j])))
    cut = reach_slice(robot, pose, plane, extent=extent, points=POINTS)
    legs = cut.leg_margins.min(axis=-1)
    parts = []
    for field, color in ((cut.margin, SERVES), (np.minimum(legs, -cut.margin), BEYOND)):
        rings = _rings(cut.first, cut.second, field)
        parts.append((color, [_base_points(robot, pose, i, j, ring) for ring in rings]))
    return parts


def slice_map(robot: Manipulator, pose: Array, plane: Plane, span: Array) -> str:
    """Return the map of a slice along an angle, in HTML; see `slice_parts`, `reach_figure`."""
    i, j = (robot.coordinates.index(name) for name in plane)
    (first_low, first_high), (low, high) = (map(float, span[:, k]) for k in (i, j))
    cut = reach_slice(robot, pose, plane, extent=(first_low, first_high, low, high), points=POINTS)
    return str(svg(reach_figure(cut), name="slice", title=f"Reach over {' and '.join(plane)}"))


def _sides(
    robot: Manipulator, pose: Array, plane: str, sides: tuple[float, ...]
) -> tuple[float, float, float, float]:
    """Return the sides of the reach in a slice; one beyond which the reach goes on is unchanged."""
    first_low, first_high, low, high = sides
    wide, tall = first_high - first_low, high - low
    extent = first_low - wide, first_high + wide, low - tall, high + tall
    cut = reach_slice(robot, pose, plane, extent=extent, points=_COARSE)
    is_reached = cut.leg_margins.min(axis=-1) >= 0.0
    extent_ends = list[float]()
    for coordinates, axis, ends in (
        (cut.first, 0, (first_low, first_high)),
        (cut.second, 1, (low, high)),
    ):
        at, step = np.flatnonzero(is_reached.any(axis=axis)), float(coordinates[1] - coordinates[0])
        if not len(at):
            at = np.array([0, len(coordinates) - 1])
        extent_ends += [
            ends[0] if at[0] == 0 else float(coordinates[at[0]]) - step,
            ends[1] if at[-1] == len(coordinates) - 1 else float(coordinates[at[-1]]) + step,
        ]
    return extent_ends[0], extent_ends[1], extent_ends[2], extent_ends[3]


def _rings(first: Array, second: Array, field: Array) -> list[Array]:
    """Return the closed outlines (K, 2) of the region where a field (B, A) is not negative."""
    if not field.max() > 0.0:
        return []
    axes = Figure().add_subplot()
    drawn = axes.contourf(first, second, field, levels=[0.0, np.inf], colors=[SERVES])
    return [np.asarray(ring) for path in drawn.get_paths() for ring in path.to_polygons()]


def _base_points(robot: Manipulator, pose: Array, i: int, j: int, flat: Array) -> Array:
    """Return points (..., 2) of a slice in the base frame, (..., 3)."""
    lengths = np.zeros((*flat.shape[:-1], len(robot.platform.lengths)))
    lengths[:] = pose[~robot.platform.angular]
    lengths[..., i], lengths[..., j] = flat[..., 0], flat[..., 1]
    return np.asarray(lengths @ robot.platform.directions)
