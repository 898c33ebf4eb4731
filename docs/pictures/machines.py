"""Draw whole machines that the theory computes with: docs/theory/vectors/NAME.svg.

`vectors` writes them. Points are those that the library computes; only the names are put by hand.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from legs import GIVEN, INK, LOWER, MUTED, PLATE, UPPER, Sheet

import pteron
from pteron.legs import PRRR, RRR, RSS

THEORY = Path(__file__).parents[1] / "theory"

_THIN: dict[str, Any] = {"linestyle": (0, (4, 2))}


def five_bar() -> Sheet:
    """Draw the five-bar with upright cranks, with the vectors of its first leg."""
    robot, sheet = pteron.load(THEORY / "five-bar.toml"), Sheet(-90.0, 90.0, (5.0, 3.8))
    p = np.array([0.0, 0.6, 0.0])
    cranks, _ = pteron.kinematics.link_vectors(robot, p[:2])
    for i, (leg, crank) in enumerate(zip(robot.legs, cranks, strict=True), 1):
        assert isinstance(leg, RRR)
        r = np.array(leg.guide_point)
        tip, side = r + crank, -1.0 if i == 1 else 1.0
        sheet.line([r - np.array([0.06, 0.03, 0]), r, r + np.array([0.06, -0.03, 0])], MUTED, 1.6)
        sheet.line([r, tip], UPPER, 4.0)
        sheet.line([tip, p], LOWER, 4.0)
        sheet.line([r, r + np.array([0.16, 0.0, 0.0])], MUTED, 1.0, **_THIN)
        start = np.array([0.11, 0.0, 0.0])
        sheet.arc(r, start, 0.11 * crank / np.linalg.norm(crank), f"$q_{i}$", (0.8, 0.5))
        for point in (r, tip):
            sheet.mark(point, INK)
        sheet.name(r, f"$r_{i}$", INK, (0.0, -1.2))
        sheet.name(r + 0.5 * crank, "0.3", UPPER, (1.2 * side, 0.0))
        sheet.name(0.5 * (tip + p), "0.5", LOWER, (0.5 * side, 1.0))
        sheet.arrow(tip, tip + np.array([-0.17, 0, 0]), f"$t'_{i}$", GIVEN, (0.0, 0.8), 0.7)
    r1 = np.array(robot.legs[0].guide_point)
    sheet.arrow(r1, p, "$u_1$", GIVEN, (0.9, -0.7), 0.6, **_THIN)
    sheet.frame(np.zeros(3), np.eye(3)[:2], "x y", INK, 0.14)
    sheet.mark(p, PLATE, 9.0)
    sheet.name(p, "P, 1 kg", PLATE, (0.0, 1.2))
    return sheet


def school() -> Sheet:
    """Draw the school machine: three legs at right angles that hold P itself."""
    robot, sheet = pteron.load(THEORY / "school.toml"), Sheet(32.0, 24.0, (5.4, 4.4))
    uppers, lowers = pteron.kinematics.link_vectors(robot, np.zeros(3))
    names = (
        ((-2.5, 0.6), (-1.0, 0.4), (1.2, 0.6), (-0.3, -1.0)),
        ((-1.4, -1.0), (1.0, 0.9), (1.2, -0.2), (0.5, 0.8)),
        ((-2.4, 0.6), (1.1, 0.4), (-0.6, 1.0), (0.5, 0.8)),
    )
    for i, (leg, upper, lower) in enumerate(zip(robot.legs, uppers, lowers, strict=True), 1):
        assert isinstance(leg, PRRR)
        r1, d = np.array(leg.guide_point), np.array(leg.direction)
        sheet.line([r1 - 0.22 * d, r1 + 0.22 * d], MUTED, 2.6)
        sheet.arrow(r1 + 0.1 * d, r1 + 0.24 * d, f"$d_{i}$", GIVEN, names[i - 1][3], 1.0)
        sheet.line([r1, r1 + upper], UPPER, 4.0)
        sheet.line([r1 + upper, r1 + upper + lower], LOWER, 4.0)
        for point in (r1, r1 + upper, r1 + upper + lower):
            sheet.axle(point, d, 0.05)
            sheet.mark(point, INK, 5.0)
        sheet.name(r1, f"slider {i}", INK, names[i - 1][0])
        sheet.name(r1 + 0.5 * upper, "0.3", UPPER, names[i - 1][1])
        sheet.name(r1 + upper + 0.5 * lower, "0.4", LOWER, names[i - 1][2])
    sheet.frame(np.zeros(3), np.eye(3), "x y z", INK, 0.16)
    sheet.mark(np.zeros(3), PLATE, 9.0)
    sheet.name(np.zeros(3), "P", PLATE, (0.9, -0.9))
    return sheet


def delta() -> Sheet:
    """Draw the Delta of the first result, with the vectors of its first leg."""
    robot, sheet, pose = pteron.load("delta"), Sheet(-70.0, 18.0, (5.4, 4.6)), DELTA_POSE
    ends = [np.array(leg.guide_point) for leg in robot.legs]
    points = [pose + np.array(leg.platform_point) for leg in robot.legs]
    sheet.line([*ends, ends[0]], MUTED, 1.4)
    sheet.axes.fill(*(sheet.view @ np.array(points).T), color=PLATE, alpha=0.22, linewidth=0)
    sheet.line([*points, points[0]], PLATE, 1.4)
    for leg, q, c in zip(robot.legs, pteron.inverse_kinematics(robot, pose), points, strict=True):
        assert isinstance(leg, RSS)
        d, a, r = (np.array(v) for v in (leg.direction, leg.zero_direction, leg.guide_point))
        crank = leg.upper_length * (np.cos(q) * a + np.sin(q) * np.cross(d, a))
        first = leg is robot.legs[0]
        look: dict[str, Any] = {} if first else {"alpha": 0.35}
        sheet.line([r, r + crank], UPPER, 4.0, **look)
        for side in (-0.05, 0.05):
            sheet.line([r + crank + side * d, c + side * d], LOWER, 1.8, **look)
        for point in (r + crank, c):
            sheet.line([point - 0.05 * d, point + 0.05 * d], LOWER, 1.2, **look)
        sheet.axle(r, d, 0.12)
        if first:
            tip = r + crank
            sheet.arrow(r, tip, "$l_u$", UPPER, (0.0, 0.8), linewidth=2.4)
            sheet.arrow(tip, c, "$b$", LOWER, (1.0, 0.0), linewidth=1.6)
            sheet.arrow(r, c, "$w$", GIVEN, (-0.8, 0.0), 0.55, **_THIN)
            sheet.arrow(r, r + 0.2 * d, "$d$", GIVEN, (-0.9, -0.2), 1.0)
            sheet.arrow(pose, c, "$s$", PLATE, (0.0, -0.8), 0.5)
            names = ((r, "$r$", (-0.2, 1.0)), (tip, "tip", (1.4, 0.4)), (c, "$c$", (1.0, -0.5)))
            for point, name, way in names:
                sheet.mark(point, INK)
                sheet.name(point, name, INK, way)
    sheet.frame(np.zeros(3), np.eye(3), "x y z", INK, 0.2)
    sheet.mark(pose, PLATE, 4.0)
    sheet.name(pose, "P", PLATE, (-0.6, -0.9))
    return sheet


def quadrupteron() -> Sheet:
    """Draw the catalog's Quadrupteron with the axes of its legs and of its platform."""
    robot, sheet = pteron.load("quadrupteron"), Sheet(-52.0, 32.0, (5.6, 4.6))
    pose = np.zeros(4)
    uppers, lowers = pteron.kinematics.link_vectors(robot, pose)
    coordinates = pteron.inverse_kinematics(robot, pose)
    points = []
    ways = ((1.0, 0.3), (0.2, -1.2), (0.8, -0.9), (0.6, 0.9))
    for i, leg in enumerate(robot.legs):
        assert isinstance(leg, PRRR)
        d = np.array(leg.direction)
        e = d if leg.slider_direction is None else np.array(leg.slider_direction)
        r1 = np.array(leg.guide_point) + coordinates[i] * e
        r2, c = r1 + uppers[i], r1 + uppers[i] + lowers[i]
        sheet.line([r1 - 0.1 * e, r1 + 0.1 * e], MUTED, 2.6)
        sheet.arrow(r1 + 0.04 * e, r1 + 0.11 * e, f"$d_{i + 1}$", GIVEN, ways[i], 1.0)
        sheet.line([r1, r2], UPPER, 4.0)
        sheet.line([r2, c], LOWER, 4.0)
        for point in (r1, r2, c):
            sheet.axle(point, d, 0.025)
            sheet.mark(point, INK, 5.0)
        points.append(c)
    sheet.axes.fill(*(sheet.view @ np.array(points).T), color=PLATE, alpha=0.22, linewidth=0)
    sheet.line([*points, points[0]], PLATE, 1.4)
    sheet.arrow(np.zeros(3), np.array([0.0, 0.0, 0.09]), "$k$", PLATE, (0.8, 0.2), 0.9)
    sheet.mark(np.zeros(3), PLATE, 4.0)
    sheet.name(np.zeros(3), "P", PLATE, (0.5, -1.8))
    return sheet


DELTA_POSE = np.array([0.1, 0.05, -0.95])
"""The pose of the first result."""


DRAWINGS: dict[str, Callable[[], Sheet]] = {
    one.__name__: one for one in (five_bar, school, delta, quadrupteron)
}
