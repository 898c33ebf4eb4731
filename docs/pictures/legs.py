"""Draw each kind of leg with its frames, for docs/robot-file.md: legs/TYPE.svg.

The points and axes are those of the leg's equations in one pose; only the names are put by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from pteron.bodies import PlanarInertia, RodInertia
from pteron.bodies.inertia import SpatialInertia
from pteron.bodies.motion import PointMotion, RotationMotion, Turn
from pteron.kernels import Array
from pteron.legs import (
    PRR,
    PRRR,
    PRRS,
    PRS,
    PRUR,
    PSS,
    RPR,
    RPS,
    RPUR,
    RRR,
    RRS,
    RSS,
    RUPU,
    SRRR,
    UPS,
    UPU,
    LegKind,
)

INK, MUTED, PAPER = "#1c2630", "#8a949e", "#ffffff"
UPPER, LOWER, PLATE, GIVEN = "#0072b2", "#d55e00", "#3d6b8f", "#00795a"
"""Base end, platform end, platform, and the vectors that a file gives."""

_BODY = PlanarInertia.of_body(1.0, (0.0, 0.0), 1.0)
_ROD = RodInertia.of_body(1.0, (0.0,), 1.0)
_SOLID = SpatialInertia(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
_FRAME = 0.055
"""Length of a frame's axes, m."""

Way = tuple[float, float]
"""From a point to its name, in the picture: 1 is `_AWAY`."""

_AWAY = 13.0
"""Points of type between a point and its name."""


class Sheet:
    """A figure on which points of space are drawn in parallel projection."""

    def __init__(self, azimuth: float, elevation: float, size: tuple[float, float]) -> None:
        a, e = np.radians(azimuth), np.radians(elevation)
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        self.view = np.array([right, np.cross(eye, right)])
        self.figure = Figure(figsize=size, layout="constrained")
        self.figure.patch.set_facecolor(PAPER)
        self.axes = self.figure.add_subplot()
        self.axes.set_aspect("equal")
        self.axes.set_axis_off()

    def line(self, points: Sequence[Any], color: str, width: float, **look: Any) -> None:
        """Draw a line through points."""
        x, y = self.view @ np.array(points).T
        self.axes.plot(x, y, color=color, linewidth=width, solid_capstyle="round", **look)

    def mark(self, point: Any, color: str, size: float = 6.0) -> None:
        """Draw a joint."""
        x, y = self.view @ point
        self.axes.plot(
            [x], [y], "o", ms=size, mfc=PAPER, mec=color, mew=1.4, linestyle="none", zorder=5
        )

    def name(self, point: Any, text: str, color: str, way: Way) -> None:
        """Write beside a point, in a direction of the picture."""
        x, y = self.view @ point
        offset = _AWAY * np.array(way)
        self.axes.annotate(
            text,
            (x, y),
            xytext=tuple(offset),
            textcoords="offset points",
            color=color,
            fontsize=10,
            ha="center",
            va="center",
            zorder=6,
        )

    def arrow(
        self,
        start: Any,
        end: Any,
        text: str,
        color: str,
        way: Way = (0.0, 0.8),
        share: float = 0.5,
        **look: Any,
    ) -> None:
        """Draw a vector, its name beside a share of its way."""
        a, b = self.view @ start, self.view @ end
        style: dict[str, Any] = {
            "arrowstyle": "-|>",
            "mutation_scale": 11.0,
            "shrinkA": 0.0,
            "shrinkB": 0.0,
        }
        style |= {"color": color, "linewidth": 1.4, "zorder": 4, **look}
        self.axes.add_patch(FancyArrowPatch(tuple(a), tuple(b), **style))
        self.axes.update_datalim(np.array([a, b]))
        self.name(np.array(start) + share * (np.array(end) - start), text, color, way)

    def frame(self, origin: Array, axes: Any, names: str, color: str, size: float = _FRAME) -> None:
        """Draw a frame's axes, each named at its end; what points at the eye is left out."""
        for axis, name in zip(axes, names.split(), strict=True):
            way = self.view @ axis
            if np.linalg.norm(way) > 0.2:
                a, b = 0.75 * way / np.linalg.norm(way)
                end = origin + size * np.array(axis)
                look = {"linewidth": 1.1, "mutation_scale": 8.0}
                self.arrow(origin, end, f"${name}$", color, (a - 0.7 * b, b + 0.7 * a), 1.0, **look)

    def arc(self, center: Array, start: Array, end: Array, text: str, way: Way) -> None:
        """Draw an angle from one vector to another of the same length, with an arrow's head."""
        normal = np.cross(start, end)
        normal = normal / np.linalg.norm(normal)
        total = np.arctan2(np.cross(start, end) @ normal, start @ end)
        ways = [
            np.cos(t) * start + np.sin(t) * np.cross(normal, start)
            for t in np.linspace(0.0, total, 25)
        ]
        self.line([center + v for v in ways], INK, 1.0)
        self.arrow(center + ways[-2], center + ways[-1], "", INK, linewidth=1.0, mutation_scale=9)
        self.name(center + ways[12], text, INK, way)

    def axle(self, point: Array, axis: Array, half: float, color: str = GIVEN) -> None:
        """Draw an axis of rotation."""
        ends = [point - half * axis, point + half * axis]
        self.line(ends, color, 1.0, linestyle=(0, (6, 2, 1, 2)))

    def save(self, path: Path) -> None:
        """Write the drawing; the same drawing gives the same file."""
        x, y = self.axes.dataLim.get_points().T
        rim = 0.06 * max(np.ptp(x), np.ptp(y))
        self.axes.set(xlim=(x[0] - rim, x[1] + rim), ylim=(y[0] - rim, y[1] + rim))
        with mpl.rc_context({"svg.hashsalt": "pteron", "svg.fonttype": "path"}):
            self.figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


class Posed:
    """A leg that carries a point at c: its joints' points, and its bodies' places and axes."""

    def __init__(self, leg: LegKind, c: Array, phi: float = 0.0) -> None:
        rest = ca.SX(3, 1)
        point = PointMotion(ca.SX(c), rest, rest)
        turns = (Turn(ca.SX([0, 0, 1]), ca.SX(0), ca.SX(0)),) if leg.follows_angle else ()
        motion = leg.equations().motion(point, RotationMotion(turns, ca.SX(phi)))
        self.leg, self.c = leg, c
        self.coordinate = float(ca.evalf(motion.coordinate))
        self.points = [_vector(joint.point) for joint in motion.chain]
        self.links: list[Any] = [None if link is None else _vector(link) for link in motion.links]
        self.bodies = {
            letter: [_vector(v) for v in (body.position, body.x, body.y) if v is not None]
            for letter, body in motion.bodies.items()
        }


def _vector(value: Any) -> Array:
    return np.array(ca.evalf(value)).ravel()


def _scene(sheet: Sheet, posed: Posed, p: Array, corners: Sequence[Any], up: bool = True) -> None:
    """Draw base frame, platform, and what files give of both: r, s0 and t0."""
    leg = posed.leg
    r, s0, t0 = (np.array(v) for v in (leg.guide_point, leg.platform_point, leg.fixed_offset))
    axes, names = (np.eye(3), "x y z") if up else (np.eye(3)[:2], "x y")
    sheet.frame(np.zeros(3), axes, names, INK)
    sheet.name(np.zeros(3), "base", INK, (-1.3, -0.9))
    plate = [p + corner for corner in (*corners, corners[0])]
    sheet.axes.fill(*(sheet.view @ np.array(plate).T), color=PLATE, alpha=0.22, linewidth=0)
    sheet.line(plate, PLATE, 1.2)
    sheet.frame(p, axes, "x' y' k" if up else "x' y'", PLATE)
    sheet.mark(p, PLATE, 4.0)
    sheet.name(p, "P", PLATE, (-0.6, -0.9))
    sheet.arrow(np.zeros(3), r, "$r$", GIVEN, (0.0, 0.9), 0.35, linestyle=(0, (4, 2)))
    if s0.any():
        sheet.arrow(p, p + s0, "$s_0$", GIVEN, (0.0, 0.9))
    if t0.any():
        sheet.arrow(p + s0, p + s0 + t0, "$t_0$", GIVEN, (0.9, 0.5))


def _plate(x: float, y: float) -> list[Array]:
    """Return the corners of a rectangle about P."""
    return [np.array([i * x, j * y, 0.0]) for i, j in _SQUARE]


def _other_elbow(sheet: Sheet, posed: Posed, way: Way = (0.0, 1.1)) -> None:
    """Draw the leg's other branch, pale, with the elbow that it has."""
    other = Posed(replace(posed.leg, elbow=-posed.leg.elbow), posed.c)
    start = other.c - sum(link for link in other.links if link is not None)
    points = [start, *([start + other.links[0]] if other.links[0] is not None else []), other.c]
    sheet.line(points, MUTED, 1.4, linestyle=(0, (3, 2)))
    knee = points[-2]
    sheet.mark(knee, MUTED, 4.0)
    sheet.name(knee, f"elbow = {other.leg.elbow}", MUTED, way)


def _rods(sheet: Sheet, start: Array, end: Array, bar: Array, half: float) -> None:
    """Draw two parallel rods and the bars at their ends."""
    for side in (-half, half):
        sheet.line([start + side * bar, end + side * bar], LOWER, 2.2)
        for point in (start, end):
            sheet.mark(point + side * bar, LOWER, 4.5)
    for point in (start, end):
        sheet.line([point - half * bar, point + half * bar], LOWER, 1.2)
    sheet.line([start, end], LOWER, 0.8, linestyle=(0, (2, 2)))


def _slider(sheet: Sheet, tip: Array, e: Array) -> None:
    """Draw a slider's block, broad as it is seen."""
    along = sheet.view @ e
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    center = sheet.view @ tip
    square = [center + 0.024 * i * along + 0.013 * j * across for i, j in _SQUARE]
    sheet.axes.fill(*np.array(square).T, color=UPPER, alpha=0.4, linewidth=0)


_SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def _lengths(sheet: Sheet, posed: Posed, upper: Way, lower: Way) -> None:
    """Name the links' lengths."""
    l_u, l_l = posed.links
    assert l_l is not None
    sheet.name(posed.c - 0.5 * l_l, "$l_l$", LOWER, lower)
    if l_u is not None:
        sheet.name(posed.c - l_l - 0.35 * l_u, "$l_u$", UPPER, upper)


def prrr(kind: type[PRRR] = PRRR) -> Sheet:
    """Draw a P-R-R-R leg, or one that ends in a ball joint: the slider along y."""
    leg = kind((0.16, 0, 0.06), (0, 1, 0), (-0.08, 0, 0), 0.16, 0.17, 1.0, _BODY, _BODY)
    p = np.array([0.46, 0.13, 0.17])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-62.0, 20.0, (6.6, 4.4))
    r, d, (r1, r2) = np.array(leg.guide_point), np.array([0.0, 1.0, 0.0]), posed.points[1:3]
    sheet.line([r - 0.08 * d, r + 0.26 * d], MUTED, 3.0)
    sheet.arrow(r + 0.22 * d, r + 0.32 * d, "$e$ (default: $d$)", GIVEN, (-1.0, 0.9), 1.0)
    _slider(sheet, r1, d)
    for point in (r1, r2, *((posed.c,) if kind is PRRR else ())):
        sheet.axle(point, d, 0.06)
    sheet.arrow(r2, r2 + 0.08 * d, "$d$", GIVEN, (0.6, 0.3), 1.0)
    sheet.arrow(r, r1, "$q$", INK, (-0.7, 0.6), 0.4)
    _other_elbow(sheet, posed)
    sheet.line([r1, r2], UPPER, 3.2)
    sheet.line([r2, posed.c], LOWER, 3.2)
    _lengths(sheet, posed, (-0.5, -0.9), (-0.8, 0.3))
    _scene(sheet, posed, p, [(-0.08, 0, 0), (0.05, -0.07, 0), (0.06, 0.06, 0)])
    ankle = posed.c, "R3" if kind is PRRR else "ball joint", (-1.2, 0.4)
    _ends(sheet, posed, (r1, "R1", (-0.4, 1.3)), (r2, "R2", (-0.2, -1.2)), ankle)
    return sheet


def _ends(sheet: Sheet, posed: Posed, *joints: tuple[Array, str, Way]) -> None:
    """Draw the joints with their names, and the frames of the bodies."""
    for letter, color in (("u", UPPER), ("l", LOWER)):
        if letter in posed.bodies and len(posed.bodies[letter]) > 1:
            origin, *axes = posed.bodies[letter]
            names = " ".join(f"{name}_{letter}" for name in "xy"[: len(axes)])
            sheet.frame(origin, axes, names, color, 1.3 * _FRAME)
    for point, name, way in joints:
        sheet.mark(point, INK)
        sheet.name(point, name, INK, way)


def pss() -> Sheet:
    """Draw a P-S-S leg with a vertical guide, the rods behind the slider along e."""
    bar = np.array([0.0, 1.0, 0.0])
    leg = PSS((0.12, 0, 0.16), (0, 0, 1), (-0.08, 0, 0), 0.3, 1.0, _ROD, elbow=-1)
    p = np.array([0.44, 0.02, 0.03])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-58.0, 22.0, (6.0, 4.8))
    r, e, tip = np.array(leg.guide_point), np.array([0.0, 0.0, 1.0]), posed.points[1]
    sheet.line([r - 0.22 * e, r + 0.2 * e], MUTED, 3.0)
    sheet.arrow(r + 0.17 * e, r + 0.26 * e, "$e$", GIVEN, (0.7, 0.2), 1.0)
    _slider(sheet, tip, e)
    sheet.arrow(r, tip, "$q$", INK, (-0.8, 0.0), 0.4)
    _other_elbow(sheet, posed, (0.0, -1.1))
    _rods(sheet, tip, posed.c, bar, 0.035)
    sheet.arrow(tip, tip + 0.08 * bar, "bar_direction", GIVEN, (2.6, 0.6), 1.0)
    _lengths(sheet, posed, (0, 0), (1.1, 1.1))
    _scene(sheet, posed, p, _plate(0.08, 0.06))
    _ends(sheet, posed, (tip, "tip", (-1.3, 0.4)), (posed.c, "", (0, 0)))
    return sheet


def rss() -> Sheet:
    """Draw an R-S-S leg under an articulated platform: s0 leads to the hinge, t0 from there."""
    t0 = (0.07, 0.05, 0.0)
    ends = (0.34, 0.0, 0.1), (0, 1, 0), (1, 0, 0), (0.09, 0.0, 0.0)
    leg = RSS(*ends, 0.17, 0.3, _BODY, _ROD, -1, fixed_offset=t0)
    p = np.array([0.13, 0.02, -0.2])
    posed = Posed(leg, p + leg.platform_point + leg.fixed_offset)
    sheet = Sheet(-42.0, 24.0, (6.0, 5.2))
    r, d, a = np.array(leg.guide_point), np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    crank, elbow = posed.links[0], posed.points[1]
    sheet.axle(r, d, 0.07)
    sheet.arrow(r, r + 0.09 * d, "$d$", GIVEN, (0.3, 0.8), 1.0)
    sheet.arrow(r, r + 0.15 * a, "$a$", GIVEN, (0.7, 0.2), 1.0)
    sheet.arc(r, 0.13 * a, 0.13 * crank / 0.17, "$q$", (0.9, 0.0))
    _other_elbow(sheet, posed)
    sheet.line([r, elbow], UPPER, 3.6)
    _rods(sheet, elbow, posed.c, d, 0.035)
    _lengths(sheet, posed, (-0.8, -0.8), (2.2, 0.2))
    hinge = p + np.array(leg.platform_point)
    sheet.axle(hinge, np.array([0.0, 0.0, 1.0]), 0.04, PLATE)
    sheet.line([hinge - 0.7 * np.array(t0), posed.c], PLATE, 4.0)
    _scene(sheet, posed, p, _plate(0.09, 0.03))
    _ends(sheet, posed, (r, "R1", (-0.9, 0.7)), (elbow, "tip", (1.0, 0.5)), (posed.c, "", (0, 0)))
    return sheet


def rrr(kind: type[RRR] = RRR) -> Sheet:
    """Draw a planar R-R-R leg, or one that ends in a ball joint, seen along d."""
    leg = kind((0.1, 0.09, 0), (0, 0, 1), (1, 0, 0), (-0.08, -0.04, 0), 0.15, 0.17, _BODY, _BODY, 1)
    p = np.array([0.42, 0.1, 0.0])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-90.0, 90.0, (6.4, 4.2))
    r, elbow = np.array(leg.guide_point), posed.points[1]
    sheet.arrow(r, r + np.array([0.11, 0, 0]), "$a$", GIVEN, (0.8, 0.0), 1.0)
    sheet.arc(r, np.array([0.08, 0, 0]), 0.08 * posed.links[0] / 0.15, "$q$", (0.8, 0.2))
    _other_elbow(sheet, posed, (0.0, -1.1))
    sheet.line([r, elbow], UPPER, 3.6)
    sheet.line([elbow, posed.c], LOWER, 3.2)
    _lengths(sheet, posed, (0.7, -0.7), (0.8, 0.7))
    _scene(sheet, posed, p, [(-0.08, -0.04, 0), (0.08, -0.04, 0), (0, 0.1, 0)], up=False)
    _out_of_page(sheet, r)
    ankle = posed.c, "R3" if kind is RRR else "ball joint", (0.0, -1.2)
    _ends(sheet, posed, (r, "R1, $d$", (-1.9, 0.2)), (elbow, "R2", (0, 1.2)), ankle)
    return sheet


def _out_of_page(sheet: Sheet, point: Array) -> None:
    """Draw a vector that points at the eye."""
    sheet.mark(point, GIVEN, 13.0)
    x, y = sheet.view @ point
    sheet.axes.plot([x], [y], "o", ms=3.0, color=GIVEN, zorder=7)


def prr(kind: type[PRR] = PRR) -> Sheet:
    """Draw a planar P-R-R leg, or one that ends in a ball joint, seen along d."""
    ends = (0.1, 0.05, 0), (0.8, 0.6, 0), (-0.05, -0.05, 0)
    leg = kind(*ends, 0.2, 1.0, _BODY, 1, direction=(0.0, 0.0, 1.0))
    p = np.array([0.46, 0.14, 0.0])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-90.0, 90.0, (6.4, 4.2))
    r, e, tip = np.array(leg.guide_point), np.array(leg.slider_direction), posed.points[1]
    sheet.line([r - 0.05 * e, r + 0.42 * e], MUTED, 3.0)
    sheet.arrow(r + 0.4 * e, r + 0.48 * e, "$e$", GIVEN, (0.6, 0.6), 1.0)
    _slider(sheet, tip, e)
    sheet.arrow(r, tip, "$q$", INK, (-0.5, 0.7), 0.5)
    _other_elbow(sheet, posed, (-2.9, 0.7))
    sheet.line([tip, posed.c], LOWER, 3.2)
    _lengths(sheet, posed, (0, 0), (0.5, 0.9))
    _scene(sheet, posed, p, [(-0.05, -0.05, 0), (0.1, -0.05, 0), (0.03, 0.08, 0)], up=False)
    _out_of_page(sheet, posed.c if kind is PRR else tip)
    tip_name, end_name = ("tip", "$d$") if kind is PRR else ("tip, $d$", "ball joint")
    _ends(sheet, posed, (tip, tip_name, (0.2, -1.3)), (posed.c, end_name, (-0.9, -0.7)))
    return sheet


def rpr(kind: type[RPR] = RPR) -> Sheet:
    """Draw a planar R-P-R leg, or one that ends in a ball joint, seen along d."""
    ends = (0.12, 0.06, 0), (-0.05, -0.05, 0)
    leg = kind(*ends, _BODY, _BODY, (0.3, 0.5), direction=(0.0, 0.0, 1.0))
    p = np.array([0.5, 0.3, 0.0])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-90.0, 90.0, (6.4, 4.2))
    r, n = np.array(leg.guide_point), posed.bodies["u"][1]
    length, beside = float(np.linalg.norm(posed.c - r)), 0.05 * np.cross([0.0, 0.0, 1.0], n)
    sheet.line([r, r + 0.6 * length * n], UPPER, 6.5)
    sheet.line([posed.c, posed.c - 0.6 * length * n], LOWER, 2.8)
    both: dict[str, Any] = {"arrowstyle": "<|-|>", "linewidth": 0.9}
    sheet.arrow(r + beside, posed.c + beside, "$q$", INK, (-0.6, 0.8), **both)
    _scene(sheet, posed, p, [(-0.05, -0.05, 0), (0.1, -0.05, 0), (0.03, 0.08, 0)], up=False)
    _out_of_page(sheet, posed.c if kind is RPR else r)
    base_name, end_name = ("base joint", "$d$") if kind is RPR else ("$d$", "ball joint")
    _ends(sheet, posed, (r, base_name, (0.3, -1.3)), (posed.c, end_name, (-0.9, -0.7)))
    return sheet


def ups(kind: type[UPS] | type[UPU] = UPS) -> Sheet:
    """Draw a U-P-S leg, or a U-P-U leg."""
    leg = kind((0.14, 0.05, 0.0), (-0.1, 0.03, 0.0), _ROD, _ROD, (0.2, 0.5), direction=(1, 0, 0))
    p = np.array([0.36, 0.02, 0.26])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-60.0, 20.0, (5.6, 4.6))
    r, n = np.array(leg.guide_point), posed.bodies["u"][1]
    length, d = float(np.linalg.norm(posed.c - r)), np.array([1.0, 0.0, 0.0])
    sheet.axle(r, d, 0.05)
    sheet.axle(r, np.cross(d, n), 0.05)
    sheet.line([r, r + 0.6 * length * n], UPPER, 6.5)
    sheet.line([posed.c, posed.c - 0.6 * length * n], LOWER, 2.8)
    beside = np.array([0.045, 0.0, -0.02])
    both: dict[str, Any] = {"arrowstyle": "<|-|>", "linewidth": 0.9}
    sheet.arrow(r + beside, posed.c + beside, "$q$", INK, (0.8, -0.2), **both)
    _scene(sheet, posed, p, _plate(0.1, 0.06))
    end = "ball joint"
    if kind is UPU:
        end = "universal joint"
        sheet.axle(posed.c, d, 0.05)
        sheet.axle(posed.c, np.cross(d, n), 0.05)
        sheet.arrow(r, r + 0.08 * d, "$u$", GIVEN, (0.8, -0.4), 1.0)
    _ends(sheet, posed, (r, "base joint", (-0.6, -1.2)), (posed.c, end, (-2.4, 0.6)))
    return sheet


_AXES = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
"""The axes a and b of a platform with five freedoms."""


def prur() -> Sheet:
    """Draw a P-R-U-R leg with a slider across a."""
    ends = (0.1, -0.1, 0.05), (0, 1, 0), (-0.08, 0.0, 0.0)
    leg = PRUR(*ends, 0.2, 0.2, 1.0, _BODY, _SOLID).with_platform_rotation(_AXES, None)
    p = np.array([0.36, 0.36, 0.14])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-62.0, 22.0, (6.6, 4.8))
    r, e = np.array(leg.guide_point), np.array(leg.slider_direction)
    r1, center = posed.points[1:3]
    sheet.line([r - 0.06 * e, r + 0.3 * e], MUTED, 3.0)
    sheet.arrow(r + 0.26 * e, r + 0.35 * e, "$e$", GIVEN, (0.6, 0.3), 1.0)
    _slider(sheet, r1, e)
    sheet.arrow(r, r1, "$q$", INK, (-0.7, 0.6), 0.4)
    sheet.line([r1, center], UPPER, 3.2)
    _five_axes(sheet, posed, p, (r1, "R1", (-0.4, 1.2)), center)
    return sheet


def rpur() -> Sheet:
    """Draw an R-P-U-R leg."""
    ends = (0.1, 0.0, 0.05), (-0.08, 0.0, 0.0), _BODY, _SOLID, (0.1, 0.5)
    leg = RPUR(*ends, lower_length=0.2, piston=_BODY).with_platform_rotation(_AXES, None)
    p = np.array([0.42, 0.36, 0.14])
    posed = Posed(leg, p + leg.platform_point)
    sheet = Sheet(-62.0, 22.0, (6.6, 4.8))
    r, center = posed.points[0], posed.points[2]
    sheet.line([r, r + 0.6 * (center - r)], UPPER, 6.5)
    sheet.line([center, center - 0.6 * (center - r)], LOWER, 2.8)
    beside = np.array([0.0, 0.0, -0.03])
    both: dict[str, Any] = {"arrowstyle": "<|-|>", "linewidth": 0.9}
    sheet.arrow(r + beside, center + beside, "$q$", INK, (0.6, -0.8), **both)
    _five_axes(sheet, posed, p, (r, "base joint", (-0.4, 1.2)), center)
    return sheet


def _five_axes(
    sheet: Sheet, posed: Posed, p: Array, first: tuple[Array, str, Way], center: Array
) -> None:
    """Draw the last link of a leg with five axes, its axes a and b, and the platform."""
    a, b = (np.array(axis) for axis in _AXES)
    for point in (first[0], center):
        sheet.axle(point, a, 0.06)
    for point in (center, posed.c):
        sheet.axle(point, b, 0.06)
    sheet.arrow(center, center + 0.09 * a, "$a$", GIVEN, (0.7, 0.3), 1.0)
    sheet.arrow(center, center + 0.09 * b, "$b$", GIVEN, (0.5, -0.7), 1.0)
    sheet.line([center, posed.c], LOWER, 3.2)
    _lengths(sheet, posed, (0.3, 0.9), (-0.9, 0.5))
    _scene(sheet, posed, p, _plate(0.1, 0.06))
    _ends(sheet, posed, first, (center, "U", (-0.9, -0.7)), (posed.c, "R4", (0.3, 1.2)))


def srrr() -> Sheet:
    """Draw a spherical R-R-R leg about its centre."""
    frame = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    leg = SRRR((0, 0, -1), (1, 0, 0), (-0.06, 0.17, 0.06), 1.2, 1.4, _BODY, _SOLID)
    center = np.array([0.3, 0.2, 0.3])
    leg = leg.with_platform_rotation(frame, tuple(center))
    posed = Posed(leg, center + leg.platform_point)
    sheet = Sheet(-52.0, 22.0, (5.6, 5.0))
    start, knee, _ = (point - center for point in posed.points)
    for arm, color, name in (
        (start, UPPER, "$u$"),
        (knee, INK, "$w$"),
        (posed.c - center, LOWER, "$v$"),
    ):
        sheet.line([center, center + 1.25 * arm], MUTED, 1.0, linestyle=(0, (6, 2, 1, 2)))
        sheet.name(center + 1.3 * arm, name, color, (0.5, 0.5))
    for one, other, color, name in (
        (start, knee, UPPER, "crank"),
        (knee, posed.c - center, LOWER, "link"),
    ):
        ways = [(1 - t) * one + t * other for t in np.linspace(0.0, 1.0, 30)]
        arc = [center + np.linalg.norm(one) * v / np.linalg.norm(v) for v in ways]
        sheet.line(arc, color, 3.2)
        sheet.name(arc[15], name, color, (1.6, 0.3))
    sheet.arrow(center, center + 0.15 * np.array([1.0, 0.0, 0.0]), "$a_0$", GIVEN, (0.8, 0.0), 1.0)
    _scene(sheet, posed, center, _plate(0.08, 0.06))
    _ends(sheet, posed, *((point, "", (0.0, 0.0)) for point in posed.points))
    return sheet


def rupu() -> Sheet:
    """Draw a telescopic shaft."""
    leg = RUPU((0.16, 0, 0.34), (0.0, 0.0, 0.0), _ROD, _ROD).with_platform_frame(
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    )
    p, k = np.array([0.36, 0.02, 0.02]), np.array([0.0, 0.0, 1.0])
    posed = Posed(leg, p, 0.9)
    sheet = Sheet(-60.0, 24.0, (5.6, 5.0))
    r, n = np.array(leg.guide_point), posed.bodies["u"][1]
    length = float(np.linalg.norm(posed.c - r))
    sheet.axle(r, k, 0.1)
    turn, turned = np.array([1.0, 0.0, 0.0]), np.array([np.cos(0.9), np.sin(0.9), 0.0])
    sheet.arc(r + 0.07 * k, 0.09 * turn, 0.09 * turned, "$q$", (0.9, 0.3))
    sheet.arc(p, 0.12 * turn, 0.12 * turned, "$\\varphi$", (0.9, 0.3))
    sheet.line([r, r + 0.58 * length * n], UPPER, 5.5)
    sheet.line([posed.c, posed.c - 0.62 * length * n], LOWER, 2.6)
    beside = np.array([0.06, 0.0, 0.05])
    both: dict[str, Any] = {"arrowstyle": "<|-|>", "linewidth": 0.9}
    sheet.arrow(r + beside, posed.c + beside, "travel", INK, (1.6, 0.6), **both)
    _scene(sheet, posed, p, _plate(0.1, 0.06))
    _ends(sheet, posed, (r, "base joint", (-2.6, 0.2)), (posed.c, "", (0, 0)))
    return sheet


DRAWINGS: dict[str, Callable[[], Sheet]] = {
    "PRRR": prrr,
    "PSS": pss,
    "RSS": rss,
    "RRR": rrr,
    "PRR": prr,
    "RPR": rpr,
    "RUPU": rupu,
    "UPS": ups,
    "RPS": partial(rpr, RPS),
    "PRS": partial(prr, PRS),
    "RRS": partial(rrr, RRS),
    "PRRS": partial(prrr, PRRS),
    "PRUR": prur,
    "RPUR": rpur,
    "SRRR": srrr,
    "UPU": partial(ups, UPU),
}


def draw(docs: Path) -> None:
    """Write all drawings."""
    (docs / "legs").mkdir(exist_ok=True)
    for name, drawn in DRAWINGS.items():
        drawn().save(docs / "legs" / f"{name}.svg")
