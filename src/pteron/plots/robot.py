"""The machine in space, or in its plane: guides and cranks, links, platform and frames."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
from matplotlib.figure import Figure

from pteron.kernels import Array
from pteron.motion import Guide, JointPoints, Part
from pteron.plots.canvas import INK, LEG_COLORS, MUTED, PAPER, REACH, blank, nice_step
from pteron.plots.sheet import Sheet
from pteron.plots.space import Space, upright

_PLATFORM_AXES = ("x\u2032", "y\u2032", "z\u2032")
"""x, y and z with a prime."""

_AXLE = 0.03
"""Half the length of a crank's axle, as a share of the machine's size."""

APART = 0.018
"""Half the distance of parallel rods, as a share of the machine's size: files do not say it."""

_SQUARES = 10.0
"""About so many squares of the grid are as long as the machine."""

_WIDTH = 5.6
"""Inches."""

_NONE = 1e-9
"""A part of gravity, over the whole, that is none but for rounding."""


def robot_figure(
    points: JointPoints,
    guides: Sequence[Guide],
    *,
    gravity: Array | None = None,
    path: Array | None = None,
    angle: str = "",
) -> Figure:
    """Return the machine in one pose: in space with the vertical upwards, or in its plane.

    The points are those of one pose, the guides those of `pteron.motion.joint_guides`; the `path`
    (T, 3) of a point in the base frame is in m. Gravity (3,) is drawn as an arrow, where the
    picture's plane has it; in space without it the platform frame's z points up. The `angle`
    stands, in words, beside the platform frame's x axis.
    """
    everything = _everything(points, guides)
    step = grid_step(points, guides)
    sheet: Space | Sheet
    if points.plane is None:
        figure = blank(_WIDTH, 4.4)
        sheet = space = Space(figure, points.axes[2] if gravity is None else -gravity)
        turned = everything @ space.rotation.T
        low, high = turned.min(axis=0), turned.max(axis=0)
        space.ground(low, high, step)
    else:
        flat = everything @ points.plane.T
        low, high = flat.min(axis=0), flat.max(axis=0)
        wide, tall = high - low
        figure = blank(_WIDTH, float(np.clip(0.6 + (_WIDTH - 0.6) * tall / wide, 2.6, 5.6)))
        sheet = Sheet(figure, points.plane, step)
        if gravity is not None:
            pull = points.plane.T @ (points.plane @ gravity)
            gravity = pull if np.linalg.norm(pull) > _NONE * np.linalg.norm(gravity) else None
    size = float((high - low).max())
    base = base_outline(points, guides)
    if len(base) > 1:
        sheet.faces([base], MUTED, 0.18, raised=-0.03)
        sheet.line(np.vstack([base, base[:1]]), MUTED, 2.0, raised=-0.02)
    for i, guide in enumerate(guides):
        _draw_leg(sheet, points, guide, i, size)
    for part in points.parts:
        _draw_part(sheet, part)
    _draw_frame(sheet, points, size, angle)
    if path is not None:
        sheet.line(path, INK, 1.2, raised=1.0, style=(0, (1.5, 1.2)))
    if isinstance(sheet, Space):
        # At the near corner of the ground, in the upright frame: beside the machine, not in it.
        corner = sheet.rotation.T @ (low + size * np.array([-0.02, -0.10, 0.0]))
        for axis, name in zip(np.eye(3), "xyz", strict=True):
            sheet.line(np.array([corner, corner + 0.13 * size * axis]), INK, 1.6, raised=1.0)
            sheet.text(corner + 0.17 * size * axis, name, INK)
        start = corner + size * (sheet.rotation.T @ np.array([-0.16, -0.02, 0.30]))
    else:
        start = np.array([low[0] - 0.06 * size, high[1]]) @ sheet.plane
    if gravity is not None:
        _draw_gravity(sheet, start, gravity, size)
    sheet.fill()
    return figure


def _everything(points: JointPoints, guides: Sequence[Guide]) -> Array:
    """Return the points (K, 3) that a picture must hold."""
    return np.vstack([*points.links, *(guide.path for guide in guides)])


def grid_step(points: JointPoints, guides: Sequence[Guide]) -> float:
    """Return the side of the squares, m, behind a picture of a machine in one pose."""
    everything = _everything(points, guides)
    if points.plane is not None:
        everything = everything @ points.plane.T
    return nice_step(float(np.ptp(everything, axis=0).max()) / _SQUARES)


def base_outline(points: JointPoints, guides: Sequence[Guide]) -> Array:
    """Return the centres (k, 3) of the cranks' circles in one pose, in the order round them."""
    pairs = zip(points.links, guides, strict=True)
    base = np.array([line[0] for line, guide in pairs if not guide.slides and len(guide.path) > 1])
    if len(base) < 3:
        return base.reshape(-1, 3)
    away = base - base.mean(axis=0)
    x, y = np.linalg.svd(away)[2][:2] @ away.T
    return np.asarray(base[np.argsort(np.arctan2(y, x), kind="stable")])


def rods(line: Array, bar: Array | None, size: float) -> list[Array]:
    """Return what a leg's last link is drawn as: its line (2, 3), or two and the bars between."""
    if bar is None:
        return [line[-2:]]
    one, other = (line[-2:] + side * APART * size * bar for side in (1.0, -1.0))
    return [one, other, *np.stack([one, other], axis=1)]


def _draw_leg(sheet: Space | Sheet, points: JointPoints, guide: Guide, i: int, size: float) -> None:
    color, line = LEG_COLORS[i], points.links[i]
    if guide.slides:
        sheet.line(guide.path, MUTED, 3.4, raised=-0.01)
        for end in guide.path:
            sheet.mark(end, MUTED, MUTED, 3.0, raised=-0.01)
        sheet.faces(_block(line[0], guide.axis, size), color, 0.95)
    else:
        sheet.line(guide.path, MUTED, 0.9, raised=-0.01, style=(0, (2.0, 2.0)))
        axle = _AXLE * size * guide.axis
        sheet.line(np.array([line[0] - axle, line[0] + axle]), MUTED, 6.0, raised=-0.01)
    for pair in pairwise(line[:-1]):
        sheet.line(np.array(pair), color, 4.6)
    for ends in rods(line, points.bars[i], size):
        sheet.line(ends, color, 3.0 if points.bars[i] is None else 2.0)
    for joint in line:
        sheet.mark(joint, PAPER, color, 5.0)
    along = guide.axis if guide.slides else line[1] - line[0]
    away = sheet.beside(line[0] - points.reference, along)
    sheet.text(line[0] + 0.075 * size * away, str(i + 1), color, bold=True)


def _block(center: Array, along: Array, size: float) -> list[Array]:
    """Return the six faces of a slider's block."""
    frame = upright(along)
    half = size * np.array([0.02, 0.02, 0.036])
    loop = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return [
        center + (np.insert(loop, axis, side, axis=1) * half) @ frame
        for axis, side in product(range(3), (-1, 1))
    ]


def _draw_part(sheet: Space | Sheet, part: Part) -> None:
    if len(part.corners) > 2:
        sheet.faces([part.corners], REACH, 0.55)
    for corner in part.corners:
        sheet.line(np.array([part.hub, corner]), REACH, 2.4, raised=-2e-3)
    sheet.mark(part.hub, PAPER, REACH, 5.0)


def _draw_frame(sheet: Space | Sheet, points: JointPoints, size: float, angle: str) -> None:
    """Draw the platform's frame and the tool's centre point."""
    p, tool = points.reference, points.tool
    shown = 3 if points.plane is None else 2
    for axis, name in list(zip(points.axes, _PLATFORM_AXES, strict=True))[:shown]:
        tip = p + 0.13 * size * axis
        sheet.line(np.array([p, tip]), INK, 1.3, raised=0.5)
        label = f"{name} ({angle})" if angle and name == _PLATFORM_AXES[0] else name
        sheet.text(p + 0.16 * size * axis, label, INK)
    if np.any(tool != p):
        sheet.line(np.array([p, tool]), REACH, 3.4, raised=0.4)
        sheet.mark(tool, REACH, INK, 5.0, raised=0.6)
    sheet.mark(p, INK, PAPER, 5.0, raised=0.6)


def _draw_gravity(sheet: Space | Sheet, start: Array, gravity: Array, size: float) -> None:
    down = gravity / np.linalg.norm(gravity)
    tip = start + 0.2 * size * down
    sheet.line(np.array([start, tip]), MUTED, 1.6, raised=1.0)
    side = 0.03 * size * sheet.beside(np.ones(3), down)
    for sign in (-1.0, 1.0):
        barb = tip - 0.05 * size * down + sign * side
        sheet.line(np.array([tip, barb]), MUTED, 1.6, raised=1.0)
    sheet.text(start - 0.05 * size * down, "g", MUTED)
