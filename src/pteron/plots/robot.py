"""The machine in space: guides and cranks, links, platform and frames."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
from matplotlib.figure import Figure

from pteron.kernels import Array
from pteron.motion import Guide, JointPoints
from pteron.plots.canvas import INK, LEG_COLORS, MUTED, PAPER, REACH, blank
from pteron.plots.space import Space, upright

_PLATFORM_AXES = ("x\u2032", "y\u2032", "z\u2032")
"""x, y and z with a prime."""

_AXLE = 0.03
"""Half the length of a crank's axle, as a share of the machine's size."""


def robot_figure(
    points: JointPoints,
    guides: Sequence[Guide],
    *,
    gravity: Array | None = None,
    path: Array | None = None,
    angle: str = "",
) -> Figure:
    """Return the machine in one pose, with the vertical upwards.

    The points are those of one pose, the guides those of `pteron.motion.joint_guides`; the `path`
    (T, 3) of P is in m. Gravity (3,) is drawn as an arrow; without it the platform frame's z points
    up. The `angle` stands, in words, beside the platform frame's x axis.
    """
    figure = blank(5.6, 4.4)
    space = Space(figure, points.axes[2] if gravity is None else -gravity)

    paths = [guide.path for guide in guides if guide.slides]
    corners = np.vstack([*points.links, *paths])
    turned = corners @ space.rotation.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    size = float((high - low).max())
    space.ground(low, high)
    base = [line[0] for line, guide in zip(points.links, guides, strict=True) if not guide.slides]
    if len(base) > 1:
        space.faces([np.array(base)], MUTED, 0.18)
        space.line(np.array([*base, base[0]]), MUTED, 2.0, raised=-0.02)
    for i, guide in enumerate(guides):
        _draw_leg(space, points, guide, i, size)
    _draw_platform(space, points, size, angle)
    if path is not None:
        space.line(path, INK, 1.2, raised=1.0, style=(0, (1.5, 1.2)))
    _draw_base_frame(space, low, size, gravity)
    space.fill()
    return figure


def outline(points: JointPoints) -> list[int]:
    """Return the legs in the order in which their platform points go round the platform's axis."""
    arms = points.platform_points - points.platform_points.mean(axis=-2, keepdims=True)
    x, y, _ = points.axes
    return [int(i) for i in np.argsort(np.arctan2(arms @ y, arms @ x), kind="stable")]


def _draw_leg(space: Space, points: JointPoints, guide: Guide, i: int, size: float) -> None:
    color, line = LEG_COLORS[i], points.links[i]
    if guide.slides:
        space.line(guide.path, MUTED, 3.4, raised=-0.01)
        for end in guide.path:
            space.mark(end, MUTED, MUTED, 3.0, raised=-0.01)
        space.faces(_block(line[0], guide.axis, size), color, 0.95)
    else:
        space.line(guide.path, MUTED, 0.9, raised=-0.01, style=(0, (2.0, 2.0)))
        axle = _AXLE * size * guide.axis
        space.line(np.array([line[0] - axle, line[0] + axle]), MUTED, 6.0, raised=-0.01)
    for k, ends in enumerate(pairwise(line)):
        space.line(np.array(ends), color, 4.6 if k == 0 else 3.0)
    for joint in line:
        space.mark(joint, PAPER, color, 5.0)
    along = guide.axis if guide.slides else line[1] - line[0]
    away = space.beside(line[0] - points.reference, along)
    space.text(line[0] + 0.075 * size * away, str(i + 1), color, bold=True)


def _block(center: Array, along: Array, size: float) -> list[Array]:
    """Return the six faces of a slider's block."""
    frame = upright(along)
    half = size * np.array([0.02, 0.02, 0.036])
    loop = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return [
        center + (np.insert(loop, axis, side, axis=1) * half) @ frame
        for axis, side in product(range(3), (-1, 1))
    ]


def _draw_platform(space: Space, points: JointPoints, size: float, angle: str) -> None:
    space.faces([points.platform_points[outline(points)]], REACH, 0.55)
    p = points.reference
    for corner in points.platform_points:
        space.line(np.array([p, corner]), REACH, 2.0, raised=-2e-3)
    for axis, name in zip(points.axes, _PLATFORM_AXES, strict=True):
        tip = p + 0.13 * size * axis
        space.line(np.array([p, tip]), INK, 1.3, raised=0.5)
        label = f"{name} ({angle})" if angle and name == _PLATFORM_AXES[0] else name
        space.text(p + 0.16 * size * axis, label, INK)
    space.mark(p, INK, PAPER, 5.0, raised=0.6)


def _draw_base_frame(space: Space, low: Array, size: float, gravity: Array | None) -> None:
    # At the near corner of the ground, in the upright frame: beside the machine, not in it.
    corner = space.rotation.T @ (low + size * np.array([-0.02, -0.10, 0.0]))
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        space.line(np.array([corner, corner + 0.13 * size * axis]), INK, 1.6, raised=1.0)
        space.text(corner + 0.17 * size * axis, name, INK)
    if gravity is not None:
        down = gravity / np.linalg.norm(gravity)
        start = corner + size * (space.rotation.T @ np.array([-0.16, -0.02, 0.30]))
        tip = start + 0.2 * size * down
        space.line(np.array([start, tip]), MUTED, 1.6, raised=1.0)
        side = 0.03 * size * space.rotation[0]
        for sign in (-1.0, 1.0):
            barb = tip - 0.05 * size * down + sign * side
            space.line(np.array([tip, barb]), MUTED, 1.6, raised=1.0)
        space.text(start - 0.05 * size * down, "g", MUTED)
