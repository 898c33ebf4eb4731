"""The machine in space: rails, sliders, links, platform and frames."""

from __future__ import annotations

from itertools import product

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import (  # type: ignore[import-untyped]
    Line3DCollection,
    Poly3DCollection,
)
from mpl_toolkits.mplot3d.proj3d import proj_transform  # type: ignore[import-untyped]

from pteron.kernels import Array
from pteron.motion import JointPoints
from pteron.plots.canvas import FONT_SIZE, blank
from pteron.plots.colors import GRID, INK, LEG_COLORS, MUTED, PAPER, REACH

__all__ = ["outline", "robot_figure", "upright"]

_ELEVATION, _AZIMUTH = 24.0, -52.0
"""Degrees, from which the machine is seen."""

_MARGIN = 0.04
"""Of the figure, on each side."""

_PLATFORM_AXES = ("x\u2032", "y\u2032", "z\u2032")
"""x, y and z with a prime."""

_GRID_STEP = 0.1
"""Of the ground's squares, m."""


def robot_figure(
    points: JointPoints,
    rails: Array,
    *,
    gravity: Array | None = None,
    path: Array | None = None,
    angle: str = "",
) -> Figure:
    """Return the machine in one pose, with the vertical upwards.

    Parameters
    ----------
    points : JointPoints
        Of one pose.
    rails : array, shape (n, 2, 3)
        The ends of each guide, m.
    gravity : array, shape (3,), optional
        Drawn as an arrow; without it the platform frame's z points up.
    path : array, shape (T, 3), optional
        Positions of P in a motion.
    angle : str
        The orientation, in words, beside the platform frame's x axis.

    Returns
    -------
    matplotlib Figure
    """
    figure = blank(5.6, 4.7)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    assert isinstance(axes, Axes3D)
    axes.patch.set_alpha(0.0)
    axes.set_axis_off()
    axes.set_proj_type("persp", focal_length=1.6)
    axes.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    vertical = points.axes[2] if gravity is None else -gravity
    scene = _Scene(axes, upright(vertical))

    corners = np.vstack([points.sliders, points.elbows, points.platform_points, *rails])
    turned = corners @ scene.rotation.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    size = float((high - low).max())
    scene.ground(low, high)
    for i, ends in enumerate(rails):
        _draw_leg(scene, points, ends, i, size)
    _draw_platform(scene, points, size, angle)
    if path is not None:
        scene.line(path, INK, 1.2, raised=1.0, style=(0, (1.5, 1.2)))
    _draw_base_frame(scene, low, size, gravity)
    scene.fill(figure)
    return figure


def outline(points: JointPoints) -> list[int]:
    """Return the legs in the order in which their platform points go round the platform's axis."""
    arms = points.platform_points - points.platform_points.mean(axis=-2, keepdims=True)
    x, y, _ = points.axes
    return [int(i) for i in np.argsort(np.arctan2(arms @ y, arms @ x), kind="stable")]


def upright(vertical: Array) -> Array:
    """Return a rotation (3, 3) that takes a direction to z, and x as nearly to x as it can."""
    z = vertical / np.linalg.norm(vertical)
    near = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    y = np.cross(z, near)
    y = y / np.linalg.norm(y)
    return np.array([np.cross(y, z), y, z])


class _Scene:
    """Axes onto which segments and faces are put in the order of their distance."""

    def __init__(self, axes: Axes3D, rotation: Array) -> None:
        self.axes = axes
        self.rotation = rotation
        self._drawn: list[Array] = []
        elevation, azimuth = np.radians(_ELEVATION), np.radians(_AZIMUTH)
        self._towards_eye = np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )

    def _order(self, points: Array, raised: float) -> float:
        return 10.0 + float(points.mean(axis=0) @ self._towards_eye) + raised

    def line(
        self,
        points: Array,
        color: str,
        width: float,
        *,
        raised: float = 0.0,
        style: str | tuple[float, tuple[float, ...]] = "-",
    ) -> None:
        p = points @ self.rotation.T
        self._drawn.append(p)
        self.axes.plot(
            *p.T,
            color=color,
            linewidth=width,
            linestyle=style,
            solid_capstyle="round",
            zorder=self._order(p, raised),
        )

    def mark(self, point: Array, face: str, edge: str, size: float, raised: float = 2e-3) -> None:
        p = (point @ self.rotation.T)[None]
        self.axes.plot(
            *p.T,
            marker="o",
            markersize=size,
            markerfacecolor=face,
            markeredgecolor=edge,
            markeredgewidth=1.4,
            linestyle="none",
            zorder=self._order(p, raised),
        )

    def faces(self, faces: list[Array], color: str, alpha: float, raised: float = 0.0) -> None:
        turned = [f @ self.rotation.T for f in faces]
        collection = Poly3DCollection(
            turned, facecolors=color, edgecolors=PAPER, linewidths=0.6, alpha=alpha
        )
        collection.set_zorder(self._order(np.vstack(turned), raised))
        self.axes.add_collection3d(collection)

    def text(self, point: Array, text: str, color: str, *, bold: bool = False) -> None:
        p = point @ self.rotation.T
        self._drawn.append(p[None])
        self.axes.text(
            *p,
            text,
            color=color,
            fontsize=FONT_SIZE,
            fontweight="bold" if bold else "normal",
            ha="center",
            va="center",
            zorder=30.0,
        )

    def fill(self, figure: Figure) -> None:
        """Place the axes so that what was drawn fills the figure."""
        drawn = np.vstack(self._drawn)
        low, high = drawn.min(axis=0), drawn.max(axis=0)
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        self.axes.set_box_aspect(high - low)
        figure.set_layout_engine("none")
        self.axes.set_position((0.0, 0.0, 1.0, 1.0))
        self.axes.apply_aspect()
        x, y, _ = proj_transform(*drawn.T, self.axes.get_proj())
        seen = figure.transFigure.inverted().transform(
            self.axes.transData.transform(np.column_stack([x, y]))
        )
        left, right = seen.min(axis=0), seen.max(axis=0)
        scale = (1.0 - 2.0 * _MARGIN) / float((right - left).max())
        corner = 0.5 - scale * (left + right) / 2.0
        self.axes.set_position((corner[0], corner[1], scale, scale))

    def ground(self, low: Array, high: Array) -> None:
        """Draw squares under everything, one rim wider than it."""
        first, last = np.floor(low / _GRID_STEP) - 0.5, np.ceil(high / _GRID_STEP) + 0.5
        x, y = (np.arange(first[i] + 0.5, last[i], 1.0) * _GRID_STEP for i in (0, 1))
        z = low[2]
        self._drawn.append(np.array([(a, b, z) for a in (x[0], x[-1]) for b in (y[0], y[-1])]))
        lines = [[(a, y[0], z), (a, y[-1], z)] for a in x]
        lines += [[(x[0], b, z), (x[-1], b, z)] for b in y]
        self.axes.add_collection3d(Line3DCollection(lines, colors=GRID, linewidths=0.7, zorder=0.0))


def _draw_leg(scene: _Scene, points: JointPoints, ends: Array, i: int, size: float) -> None:
    color = LEG_COLORS[i]
    slider, elbow, platform = points.sliders[i], points.elbows[i], points.platform_points[i]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    scene.line(ends, MUTED, 3.4, raised=-0.01)
    for end in ends:
        scene.mark(end, MUTED, MUTED, 3.0, raised=-0.01)
    scene.line(np.array([slider, elbow]), color, 4.6)
    scene.line(np.array([elbow, platform]), color, 3.0)
    scene.faces(_block(slider, along, size), color, 0.95)
    for joint in (slider, elbow, platform):
        scene.mark(joint, PAPER, color, 5.0)
    away = slider - points.reference
    away = away - (away @ along) * along
    away = away / max(float(np.linalg.norm(away)), 1e-12)
    scene.text(slider + 0.085 * size * away, str(i + 1), color, bold=True)


def _block(center: Array, along: Array, size: float) -> list[Array]:
    """Return the six faces of a slider's block."""
    frame = upright(along)
    half = size * np.array([0.02, 0.02, 0.036])
    corners = {
        signs: center + (np.array(signs) * half) @ frame for signs in product((-1, 1), repeat=3)
    }
    faces = []
    for axis, side in product(range(3), (-1, 1)):
        loop = []
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            signs = [a, b]
            signs.insert(axis, side)
            loop.append(corners[signs[0], signs[1], signs[2]])
        faces.append(np.array(loop))
    return faces


def _draw_platform(scene: _Scene, points: JointPoints, size: float, angle: str) -> None:
    scene.faces([points.platform_points[outline(points)]], REACH, 0.55)
    p = points.reference
    for corner in points.platform_points:
        scene.line(np.array([p, corner]), REACH, 2.0, raised=-2e-3)
    for axis, name in zip(points.axes, _PLATFORM_AXES, strict=True):
        tip = p + 0.13 * size * axis
        scene.line(np.array([p, tip]), INK, 1.3, raised=0.5)
        label = f"{name} ({angle})" if angle and name == _PLATFORM_AXES[0] else name
        scene.text(p + 0.16 * size * axis, label, INK)
    scene.mark(p, INK, PAPER, 5.0, raised=0.6)


def _draw_base_frame(scene: _Scene, low: Array, size: float, gravity: Array | None) -> None:
    # At the near corner of the ground, in the upright frame: beside the machine, not in it.
    corner = scene.rotation.T @ (low + size * np.array([-0.02, -0.10, 0.0]))
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        scene.line(np.array([corner, corner + 0.13 * size * axis]), INK, 1.6, raised=1.0)
        scene.text(corner + 0.17 * size * axis, name, INK)
    if gravity is not None:
        down = gravity / np.linalg.norm(gravity)
        start = corner + size * (scene.rotation.T @ np.array([-0.16, -0.02, 0.30]))
        tip = start + 0.2 * size * down
        scene.line(np.array([start, tip]), MUTED, 1.6, raised=1.0)
        side = 0.03 * size * scene.rotation[0]
        for sign in (-1.0, 1.0):
            barb = tip - 0.05 * size * down + sign * side
            scene.line(np.array([tip, barb]), MUTED, 1.6, raised=1.0)
        scene.text(start - 0.05 * size * down, "g", MUTED)
