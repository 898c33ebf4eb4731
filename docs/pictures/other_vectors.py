"""Draw the vectors of tilting, direct position, indices, calibration and clearances.

`vectors` writes them, docs/theory/vectors/NAME.svg. Points are those of the numbers by hand, of
docs/theory/biglide.toml where it fits them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from legs import GIVEN, INK, LOWER, MUTED, PLATE, UPPER, Sheet

import pteron
from pteron.kernels import Array

BIGLIDE = Path(__file__).parents[1] / "theory" / "biglide.toml"

_THIN: dict[str, Any] = {"linestyle": (0, (4, 2))}


def ram() -> Sheet:
    """Draw a ram and a platform that rises and pitches, seen along y."""
    sheet = Sheet(-90.0, 0.0, (4.6, 3.2))
    r, p, s = np.zeros(3), np.array([0.2, 0.0, 0.4]), np.array([0.1, 0.0, 0.0])
    c, turned = p + s, 1.2 * np.cross([0.0, 1.0, 0.0], s)
    n, up = c / np.linalg.norm(c), np.array([0.0, 0.0, 0.1])
    corners = [p - 0.14 * s / 0.1, c, p - np.array([0.02, 0.0, 0.06]), p - 0.14 * s / 0.1]
    sheet.line(corners, PLATE, 1.2)
    sheet.line([r, 0.55 * c], UPPER, 5.0)
    sheet.line([0.55 * c, c], LOWER, 2.6)
    sheet.arrow(r, 0.3 * n, "$n$", GIVEN, (-0.7, 0.4), 0.8)
    sheet.name(0.4 * c, r"$w = q\,n$", INK, (1.9, -0.3))
    sheet.arrow(p, c, "$s$", PLATE, (0.0, 0.7), 0.5)
    sheet.arrow(p, p + up, "$v$", INK, (-0.7, 0.0), 0.7)
    sheet.arrow(c, c + up, "$v$", INK, (-0.7, 0.0), 0.7)
    sheet.arrow(c, c + turned, r"$\omega \times s$", GIVEN, (1.6, 0.0), 0.7)
    for point, name, way in ((r, "$r$", (-0.9, 0.0)), (p, "P", (-0.6, -0.7)), (c, "$c$", (1, 0.3))):
        sheet.mark(point, INK)
        sheet.name(point, name, INK, way)
    return sheet


def spheres() -> Sheet:
    """Draw three rods of 0.3 m from points 0.3 m out on the axes: they meet in two poses."""
    sheet = Sheet(25.0, 28.0, (4.6, 3.6))
    axes, second = np.eye(3), np.full(3, 0.2)
    sheet.frame(np.zeros(3), axes, "x y z", MUTED, 0.4)
    sheet.line([-0.08 * second / 0.2, 1.5 * second], MUTED, 1.2, **_THIN)
    for axis in axes:
        sheet.line([0.3 * axis, np.zeros(3)], LOWER, 1.6, **_THIN)
        sheet.line([0.3 * axis, second], LOWER, 3.0)
        sheet.mark(0.3 * axis, INK)
    for k, way in enumerate(((0.2, -1.0), (0.6, -1.0), (-1.2, 0.2)), start=1):
        sheet.name(0.3 * axes[k - 1], f"$a_{k}$", INK, way)
    for point, name, way in (
        (np.zeros(3), "$p = 0$", (-1.7, 0.4)),
        (second, "$p = (0.2, 0.2, 0.2)$", (3.2, 0.9)),
    ):
        sheet.mark(point, INK, 7.0)
        sheet.name(point, name, INK, way)
    return sheet


def _biglide(sheet: Sheet, longer: float = 0.0, **look: Any) -> Array:
    """Draw the machine with its sliders 0.3 m to either side, its links longer; return P."""
    robot = pteron.load(BIGLIDE)
    length: dict[str, Any] = {"lower_length": 0.5 + longer}
    legs = tuple(replace(leg, **length) for leg in robot.legs)
    both = pteron.direct_kinematics(replace(robot, legs=legs), [-0.3, 0.3])
    x, y = max(both, key=lambda pose: pose[1])
    for side in (-0.3, 0.3):
        sheet.line([(side, 0.0, 0.0), (x, y, 0.0)], LOWER, 3.0, **look)
    return np.array([x, y, 0.0])


def ellipse() -> Sheet:
    """Draw the platform's velocities that sliders of one unit of speed give."""
    sheet = Sheet(-90.0, 90.0, (4.6, 2.9))
    sheet.line([(-0.5, 0, 0), (0.5, 0, 0)], MUTED, 2.4)
    p = _biglide(sheet)
    angles = np.linspace(0.0, 2.0 * np.pi, 121)
    rates = np.stack([np.cos(angles), np.sin(angles)])
    found = np.linalg.inv(pteron.jacobian(BIGLIDE, p[:2])) @ rates
    scale = 0.22
    ring = p + scale * np.stack([*found, 0.0 * angles], axis=-1)
    sheet.line([*ring], GIVEN, 1.6)
    most, least = scale / np.sqrt(2.0), scale * 0.75 / np.sqrt(2.0)
    sheet.arrow(p, p + np.array([most, 0, 0]), "0.707", INK, (1.4, -0.8), 1.0)
    sheet.arrow(p, p + np.array([0, least, 0]), "0.530", INK, (1.4, 0.0), 0.5)
    for point, name, way in (
        (p, "P", (-0.9, 0.4)),
        (np.array([-0.3, 0, 0]), r"$\rho_1$", (0.0, -1.2)),
        (np.array([0.3, 0, 0]), r"$\rho_2$", (0.0, -1.2)),
    ):
        sheet.mark(point, INK)
        sheet.name(point, name, INK, way)
    return sheet


def longer() -> Sheet:
    """Draw the machine with its links as drawn, and longer than that: the platform is higher."""
    sheet = Sheet(-90.0, 90.0, (4.4, 2.9))
    sheet.line([(-0.5, 0, 0), (0.5, 0, 0)], MUTED, 2.4)
    drawn = _biglide(sheet)
    built = _biglide(sheet, 0.05, alpha=0.55, linestyle=(0, (4, 2)))
    sheet.arrow(drawn, built, r"$\mathrm{d}y$", GIVEN, (0.9, 0.0), 0.5)
    sheet.name((-0.15, 0.2, 0), "0.5", INK, (1.0, -0.6))
    sheet.name((-0.15, 0, 0), "0.3", INK, (0.0, -0.8))
    sheet.line([drawn, (0, 0, 0)], INK, 0.9)
    sheet.name(0.5 * drawn, "0.4", INK, (0.9, -0.2))
    for point in (drawn, built, np.array([-0.3, 0, 0]), np.array([0.3, 0, 0])):
        sheet.mark(point, INK)
    return sheet


def segments() -> Sheet:
    """Draw two segments and their nearest points."""
    sheet = Sheet(-68.0, 24.0, (4.6, 2.9))
    p, u = np.zeros(3), np.array([0.4, 0.0, 0.0])
    q, v = np.array([0.0, -0.2, 0.1]), np.array([0.3, 0.4, 0.0])
    sheet.line([p, p + u], UPPER, 5.0, alpha=0.35)
    sheet.line([q, q + v], LOWER, 5.0, alpha=0.35)
    sheet.arrow(p, p + u, "$u$", UPPER, (0.4, -0.9), 0.75)
    sheet.arrow(q, q + v, "$v$", LOWER, (0.2, 0.9), 0.8)
    sheet.arrow(q, p, "$w$", GIVEN, (-0.2, -0.8), 0.4)
    near = p + 0.375 * u, q + 0.5 * v
    sheet.line(near, INK, 1.2)
    sheet.name(0.5 * (near[0] + near[1]), "0.1", INK, (1.0, 0.0))
    for point, name, way in ((p, "$p$", (-0.2, -1.0)), (q, "$q$", (-0.8, -0.4))):
        sheet.mark(point, INK)
        sheet.name(point, name, INK, way)
    for point, name, way in (
        (near[0], "$s = 0.375$", (0.4, -1.0)),
        (near[1], "$t = 0.5$", (-2, 0.7)),
    ):
        sheet.mark(point, INK, 4.0)
        sheet.name(point, name, INK, way)
    return sheet


def rams() -> Sheet:
    """Draw three rams at 120 degrees that hold a point, and its weight."""
    sheet = Sheet(-90.0, 90.0, (3.8, 3.4))
    angles = np.radians([90.0, 210.0, 330.0])
    p = np.zeros(3)
    for k, angle in enumerate(angles, start=1):
        r = 0.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
        sheet.line([r, 0.45 * r], UPPER, 5.0)
        sheet.line([0.45 * r, p], LOWER, 2.6)
        sheet.mark(r, INK)
        sheet.name(1.1 * r, f"$r_{k}$", INK, (0.0, 0.0))
    sheet.arrow(p, np.array([0.0, -0.22, 0.0]), "30 N", GIVEN, (1.1, 0.0), 0.7)
    sheet.mark(p, INK)
    sheet.name(p, "P", INK, (0.9, 0.5))
    return sheet


DRAWINGS: dict[str, Callable[[], Sheet]] = {
    one.__name__: one for one in (ram, spheres, ellipse, longer, segments, rams)
}
