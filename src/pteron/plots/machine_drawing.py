"""The drawing of a machine, in space or in its plane: guides, cranks, links, platform, frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from matplotlib.figure import Figure

from pteron.kernels import Array
from pteron.motion import Guide, JointPoints, Part
from pteron.plots.canvas import INK, MUTED, PAPER, REACH
from pteron.plots.leg_curves import LEG_COLORS
from pteron.plots.machine_axes import MachineAxes
from pteron.plots.plane_axes import PlaneAxes
from pteron.plots.space_axes import SpaceAxes, upright_rotation
from pteron.plots.ticks import nice_step

_PLATFORM_AXES = ("x\u2032", "y\u2032", "z\u2032")
"""x, y and z with a prime."""

_AXLE = 0.03
"""Half the length of a crank's axle, as a share of the machine's size."""

APART = 0.018
"""Half the distance of parallel rods in pictures, as a share of the machine's size."""

_SQUARES = 10.0
"""Squares of the grid, about, along the machine's size."""

Box = tuple[float, float, float, float]
"""Left, bottom, width and height, as shares of a figure."""

_NONE = 1e-9
"""Share of gravity that lies in a plane, below which none is drawn there."""


@dataclass(frozen=True)
class Scene:
    """The parts of a picture that all pictures of a machine share.

    Attributes
    ----------
    guides : tuple of Guide
        The guides of the actuated joints.
    plane : array, shape (2, 3), or None
        Of a planar machine: the unit vectors along which its poses count.
    gravity : array, shape (3,), or None
        m/s^2; None where no picture shows it.
    vertical : array, shape (3,)
        The direction that points up in space.
    low, high : array, shape (3,) or (2,)
        The machine's box in the upright frame, or in its plane, m.
    step : float
        Side of the squares behind it, m.
    base : array, shape (k, 3)
        The centres of the cranks' circles and the rams' base joints, in the order round them.
    """

    guides: tuple[Guide, ...]
    plane: Array | None
    gravity: Array | None
    vertical: Array
    low: Array
    high: Array
    step: float
    base: Array

    @property
    def size(self) -> float:
        """The machine's greatest extent, m."""
        return float((self.high - self.low).max())

    @property
    def aspect(self) -> float:
        """Height over width of a planar machine."""
        wide, tall = self.high - self.low
        return float(tall / wide)

    def sheet(self, figure: Figure, box: Box | None = None, *, small: bool = False) -> MachineAxes:
        """Return axes for the machine in a box of a figure: left, bottom, width, height."""
        if self.plane is not None:
            return PlaneAxes(figure, self.plane, self.step, box, small=small)
        return SpaceAxes(figure, self.vertical, box or (0.0, 0.0, 1.0, 1.0), small=small)


def scene_of(points: JointPoints, guides: Sequence[Guide], gravity: Array | None) -> Scene:
    """Return the scene of a machine that has its joints at points, in one pose or in several."""
    everything = _all_points(points, guides)
    vertical = np.zeros(3)
    if points.plane is None:
        upwards = points.axes.reshape(-1, 3, 3)[0, 2]
        vertical = upwards if gravity is None else -gravity
        flat = everything @ upright_rotation(vertical).T
    else:
        flat = everything @ points.plane.T
        if gravity is not None:
            pull = points.plane.T @ (points.plane @ gravity)
            gravity = pull if np.linalg.norm(pull) > _NONE * np.linalg.norm(gravity) else None
    return Scene(
        tuple(guides),
        points.plane,
        gravity,
        vertical,
        flat.min(axis=0),
        flat.max(axis=0),
        grid_step(points, guides),
        base_outline(points, guides),
    )


def draw_surroundings(sheet: MachineAxes, scene: Scene) -> None:
    """Draw the ground, the base and the guides."""
    if isinstance(sheet, SpaceAxes):
        sheet.ground(scene.low, scene.high, scene.step)
    if len(scene.base) > 1:
        sheet.faces([scene.base], MUTED, 0.18, raised=-0.03)
        sheet.line(np.vstack([scene.base, scene.base[:1]]), MUTED, 2.0, raised=-0.02)
    for guide in scene.guides:
        _draw_guide(sheet, guide)


def draw_directions(sheet: MachineAxes, scene: Scene) -> None:
    """Draw the directions of the base frame's axes and of gravity."""
    low, high, size = scene.low, scene.high, scene.size
    if isinstance(sheet, SpaceAxes):
        # At the near corner of the ground, in the upright frame: beside the machine, not in it.
        near = low + size * np.array([-0.09, -0.17, 0.0])
        corner = sheet.turn_with_eye(near, (low + high) / 2.0)
        for axis, name in zip(np.eye(3), "xyz", strict=True):
            sheet.line(np.array([corner, corner + 0.13 * size * axis]), INK, 1.6, raised=1.0)
            sheet.text(corner + 0.17 * size * axis, name, INK)
        start = near + size * np.array([-0.16, -0.02, 0.30])
        start = sheet.turn_with_eye(start, (low + high) / 2.0)
    else:
        start = np.array([low[0] - 0.06 * size, high[1]]) @ scene.plane
    if scene.gravity is not None:
        _draw_gravity(sheet, start, scene.gravity, size)


def draw_machine(sheet: MachineAxes, scene: Scene, points: JointPoints, angle: str = "") -> None:
    """Draw sliders, cranks, links and the platform with its frame in one pose.

    The `angle` stands, in words, beside the platform frame's x axis.
    """
    for i, guide in enumerate(scene.guides):
        _draw_leg(sheet, points, guide, i, scene.size)
    for part in points.parts:
        _draw_part(sheet, part)
    _draw_frame(sheet, points, scene.size, angle)


def draw_path(sheet: MachineAxes, path: Array) -> None:
    """Draw the path (T, 3) of a point in the base frame, m."""
    sheet.line(path, INK, 1.2, raised=1.0, style=(0, (1.5, 1.2)))


def _all_points(points: JointPoints, guides: Sequence[Guide]) -> Array:
    """Return the points (K, 3) that a picture must show."""
    lines = (line.reshape(-1, 3) for line in points.links)
    return np.vstack([*lines, *(guide.path for guide in guides)])


def grid_step(points: JointPoints, guides: Sequence[Guide]) -> float:
    """Return the side of the squares, m, behind a picture of a machine, in one pose or several."""
    everything = _all_points(points, guides)
    if points.plane is not None:
        everything = everything @ points.plane.T
    return nice_step(float(np.ptp(everything, axis=0).max()) / _SQUARES)


def base_outline(points: JointPoints, guides: Sequence[Guide]) -> Array:
    """Return the centres (k, 3) of cranks' circles and rams' base joints, in order round them."""
    legs = zip(points.links, guides, points.rams, strict=True)
    turning = [
        line for line, guide, ram in legs if ram or (not guide.is_prismatic and len(guide.path) > 1)
    ]
    base = np.array([line[..., 0, :].reshape(-1, 3)[0] for line in turning])
    if len(base) < 3:
        return base.reshape(-1, 3)
    away = base - base.mean(axis=0)
    x, y = np.linalg.svd(away)[2][:2] @ away.T
    return np.asarray(base[np.argsort(np.arctan2(y, x), kind="stable")])


def rods(line: Array, bar: Array | None, size: float) -> list[Array]:
    """Return the line (2, 3) of a leg's last link, or both lines and the bars between them."""
    if bar is None:
        return [line[-2:]]
    first_rod, second_rod = (line[-2:] + side * APART * size * bar for side in (1.0, -1.0))
    return [first_rod, second_rod, *np.stack([first_rod, second_rod], axis=1)]


def _draw_guide(sheet: MachineAxes, guide: Guide) -> None:
    """Draw the guide of a joint: a rail with its ends, or the dashed circle of a crank."""
    if not guide.is_prismatic:
        sheet.line(guide.path, MUTED, 0.9, raised=-0.01, style=(0, (2.0, 2.0)))
        return
    sheet.line(guide.path, MUTED, 3.4, raised=-0.01)
    for end in guide.path:
        sheet.mark(end, MUTED, MUTED, 3.0, raised=-0.01)


def _draw_leg(sheet: MachineAxes, points: JointPoints, guide: Guide, i: int, size: float) -> None:
    """Draw leg `i` from its actuated joint to the platform, with its number."""
    color, line = LEG_COLORS[i], points.links[i]
    if guide.is_prismatic:
        sheet.faces(_block(line[0], guide.axis, size), color, 0.95)
    else:
        axle = _AXLE * size * guide.axis
        sheet.line(np.array([line[0] - axle, line[0] + axle]), MUTED, 6.0, raised=-0.01)
    for pair in pairwise(line[:-1]):
        sheet.line(np.array(pair), color, 6.4 if points.rams[i] else 4.6)
    for ends in rods(line, points.bars[i], size):
        sheet.line(ends, color, 3.0 if points.bars[i] is None else 2.0)
    for joint in line[::2] if points.rams[i] else line:
        sheet.mark(joint, PAPER, color, 5.0)
    direction = guide.axis if guide.is_prismatic else line[1] - line[0]
    away = sheet.side_direction(line[0] - points.reference, direction)
    sheet.text(line[0] + 0.075 * size * away, str(i + 1), color, bold=True)


def _block(center: Array, direction: Array, size: float) -> list[Array]:
    """Return the six faces of a slider's block."""
    frame = upright_rotation(direction)
    half = size * np.array([0.02, 0.02, 0.036])
    loop = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return [
        center + (np.insert(loop, axis, side, axis=1) * half) @ frame
        for axis, side in product(range(3), (-1, 1))
    ]


def _draw_part(sheet: MachineAxes, part: Part) -> None:
    """Draw a part of the platform: its faces, its arms from the hub, and the hub."""
    if len(part.corners) > 2:
        solid = part.triangles
        faces = [part.corners] if solid is None else list(part.corners[solid])
        sheet.faces(faces, REACH, 0.55)
    for corner in part.corners:
        sheet.line(np.array([part.hub, corner]), REACH, 2.4, raised=-2e-3)
    sheet.mark(part.hub, PAPER, REACH, 5.0)


def _draw_frame(sheet: MachineAxes, points: JointPoints, size: float, angle: str) -> None:
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


def _draw_gravity(sheet: MachineAxes, start: Array, gravity: Array, size: float) -> None:
    """Draw an arrow in the direction of gravity, from a point, labelled g."""
    down = gravity / np.linalg.norm(gravity)
    tip = start + 0.2 * size * down
    sheet.line(np.array([start, tip]), MUTED, 1.6, raised=1.0)
    side = 0.03 * size * sheet.side_direction(np.ones(3), down)
    for sign in (-1.0, 1.0):
        barb = tip - 0.05 * size * down + sign * side
        sheet.line(np.array([tip, barb]), MUTED, 1.6, raised=1.0)
    sheet.text(start - 0.05 * size * down, "g", MUTED)
