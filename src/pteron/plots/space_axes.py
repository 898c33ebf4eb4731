"""Axes in which a machine in space is drawn, seen from any azimuth, a little from above.

Things are drawn one over the other, the farthest first, by the distance of their middles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Line3D, Line3DCollection, Poly3DCollection  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.proj3d import proj_transform  # type: ignore[import-untyped]

from pteron.kernels import Array
from pteron.plots.canvas import GRID, Picture
from pteron.plots.machine_axes import MachineAxes

_ELEVATION, _AZIMUTH = 24.0, -52.0
"""Degrees from which the machine is seen; `turn` adds to the azimuth."""

_WHOLE = 0.0, 0.0, 1.0, 1.0
"""The box that is all of a figure."""

_MARGIN = 0.04
"""Margin on each side, as a share of the box that is filled."""


def upright_rotation(vertical: Array) -> Array:
    """Return a rotation (3, 3) that takes a direction to z, with x, or y, nearly unchanged."""
    z = vertical / np.linalg.norm(vertical)
    near = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    y = np.cross(z, near)
    y = y / np.linalg.norm(y)
    return np.array([np.cross(y, z), y, z])


class SpaceAxes(MachineAxes):
    """Matplotlib's three-dimensional axes, with a vertical, that draw in order of distance.

    They take a `box` of the figure: left, bottom, width and height, as shares of it.
    """

    _line = Line3D

    def __init__(
        self,
        figure: Figure,
        vertical: Array,
        box: tuple[float, float, float, float] = _WHOLE,
        *,
        small: bool = False,
    ) -> None:
        axes = figure.add_subplot(projection="3d", computed_zorder=False)
        assert isinstance(axes, Axes3D)
        super().__init__(axes, small=small)
        axes.set_axis_off()
        axes.set_proj_type("persp", focal_length=1.6)
        self.rotation = upright_rotation(vertical)
        self._box = box
        self.turn(0.0)

    def turn(self, angle: float) -> None:
        """Set the viewpoint: turned about the vertical by an angle from the first, rad.

        From then on things are drawn in the order of their distance from there.
        """
        self.angle = angle
        azimuth, elevation = np.radians(_AZIMUTH) + angle, np.radians(_ELEVATION)
        self.axes.view_init(elev=_ELEVATION, azim=float(np.degrees(azimuth)))
        level = np.cos(elevation)
        self._towards_eye = np.array(
            [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        )

    def _to_axes(self, points: Array, *, extends: bool = True) -> Array:
        """Return points (..., 3) in the upright frame; with `extends`, `fill` includes them."""
        placed = np.asarray(points @ self.rotation.T)
        if extends:
            self._drawn.append(placed)
        return placed

    def _order(self, points: Array) -> float:
        """Return the drawing order of points (K, 3): the nearer to the eye, the later."""
        return 10.0 + float(points.mean(axis=0) @ self._towards_eye)

    def _polygons(self, faces: list[Array], **look: Any) -> Artist:
        """Add filled polygons in space to the axes."""
        polygons: Artist = Poly3DCollection(faces, **look)
        self.axes.add_collection3d(polygons)
        return polygons

    def side_direction(self, away: Array, line_direction: Array) -> Array:
        """Return the unit vector in the picture's plane, across a line, nearest to `away`."""
        normal = np.cross(line_direction, self.rotation.T @ self._towards_eye)
        normal = normal / max(float(np.linalg.norm(normal)), 1e-12)
        return np.asarray(np.copysign(1.0, normal @ away) * normal)

    def turn_with_eye(self, point: Array, center: Array) -> Array:
        """Return a point of the upright frame, turned with the eye, in the base frame."""
        x, y, _ = point - center
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        moved = np.array([cos * x - sin * y - x, sin * x + cos * y - y, 0.0])
        return np.asarray(self.rotation.T @ (point + moved))

    def fill(self, angles: Sequence[float] = (0.0,)) -> None:
        """Place the axes so that all things fit into the box, seen from any of the angles, rad.

        Later things leave them where they are.
        """
        drawn = self.drawn_points
        low, high = drawn.min(axis=0), drawn.max(axis=0)
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        self.axes.set_box_aspect(high - low)
        if not isinstance(self.figure, Picture) and self._box == _WHOLE:
            return  # the other figure's grid places them
        if isinstance(self.figure, Picture):
            self.figure.set_layout_engine("none")
        self.axes.set_position((0.0, 0.0, 1.0, 1.0))
        self.axes.apply_aspect()
        corners = np.array([self._figure_corners(drawn, angle) for angle in angles])
        self.turn(angles[0])
        first, last = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
        start, room = np.array(self._box[:2]), np.array(self._box[2:])
        scale = (1.0 - 2.0 * _MARGIN) * float((room / (last - first)).min())
        corner = start + room / 2.0 - scale * (first + last) / 2.0
        self.axes.set_position((corner[0], corner[1], scale, scale))

    def _figure_corners(self, points: Array, angle: float) -> tuple[Array, Array]:
        """Return the bounding corners in the figure of points (K, 3), seen from an angle."""
        self.turn(angle)
        x, y, _ = proj_transform(*points.T, self.axes.get_proj())
        seen = self.figure.transSubfigure.inverted().transform(
            self.axes.transData.transform(np.column_stack([x, y]))
        )
        return seen.min(axis=0), seen.max(axis=0)

    def ground(self, low: Array, high: Array, step: float) -> None:
        """Draw a grid of squares of a side below everything, a margin wider than it."""
        first, last = np.floor(low / step) - 0.5, np.ceil(high / step) + 0.5
        x, y = (np.arange(first[i] + 0.5, last[i], 1.0) * step for i in (0, 1))
        z = low[2]
        self._drawn.append(np.array([(a, b, z) for a in (x[0], x[-1]) for b in (y[0], y[-1])]))
        lines = [[(a, y[0], z), (a, y[-1], z)] for a in x]
        lines += [[(x[0], b, z), (x[-1], b, z)] for b in y]
        squares = Line3DCollection(lines, colors=GRID, linewidths=0.7, zorder=0.0)
        self.axes.add_collection3d(squares)
        self.things.append(squares)
