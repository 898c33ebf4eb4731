"""Draw the vectors of the theory, for docs/theory: vectors/NAME.svg.

Points and vectors are those that the library computes, of the machine docs/theory/school.toml
where they fit it; only the names are put by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import other_vectors
from legs import GIVEN, INK, LOWER, MUTED, PLATE, UPPER, Posed, Sheet
from matplotlib.patches import Circle

import pteron
from pteron.bodies import PlanarInertia, RodInertia
from pteron.kernels import Array
from pteron.legs import PRRR, RSS

SCHOOL = Path(__file__).parents[1] / "theory" / "school.toml"

_BODY = PlanarInertia.of_body(1.0, (0.0, 0.0), 1.0)
_ROD = RodInertia.of_body(1.0, (0.0,), 1.0)
_THIN: dict[str, Any] = {"linestyle": (0, (4, 2))}


def _school() -> tuple[Sheet, Array, Array, Array, Array]:
    """Return a sheet seen along leg 1's d, and R1, R2 and P of that leg, with l_u."""
    robot = pteron.load(SCHOOL)
    upper, lower = (links[0] for links in pteron.kinematics.link_vectors(robot, [0.0, 0.0, 0.0]))
    r1 = np.array(robot.legs[0].guide_point)
    sheet = Sheet(0.0, 0.0, (4.5, 2.8))
    assert np.allclose(r1 + upper + lower, 0.0)
    return sheet, r1, r1 + upper, np.zeros(3), upper


def _links(sheet: Sheet, r1: Array, r2: Array, c: Array) -> None:
    sheet.line([r1, r2], UPPER, 4.0)
    sheet.line([r2, c], LOWER, 4.0)
    for point in (r1, r2, c):
        sheet.mark(point, INK)


def triangle() -> Sheet:
    """Draw the two circles on which the elbow is, of the triangle of 3, 4 and 5."""
    sheet, r1, r2, c, l_u = _school()
    for center, other, color in ((r1, r2, UPPER), (c, r2, LOWER)):
        radius = float(np.linalg.norm(other - center))
        place = (float(center[1]), float(center[2]))
        sheet.axes.add_patch(Circle(place, radius, fill=False, ec=color, lw=0.9, ls=(0, (3, 2))))
        sheet.axes.update_datalim([(place[0] - radius, -radius), (place[0] + radius, radius)])
    along = (c - r1) / np.linalg.norm(c - r1)
    foot = r1 + (l_u @ along) * along
    other = 2.0 * foot - r2
    sheet.line([r1, other, c], MUTED, 1.4, **_THIN)
    _links(sheet, r1, r2, c)
    sheet.line([foot, r2], INK, 0.9)
    sheet.arrow(r1, c, "$u$", GIVEN, (0.0, -0.8), 0.7)
    sheet.name(r1 + 0.5 * l_u, r"$l_u$", UPPER, (-0.9, 0.5))
    sheet.name(0.5 * (r2 + c), r"$l_l$", LOWER, (0.8, 0.6))
    sheet.name(0.5 * (foot + r2), "0.24", INK, (1.2, -0.5))
    sheet.name(0.5 * (r1 + foot), "0.18", INK, (0.0, -0.8))
    sheet.name(r1, "R1", INK, (-0.9, -0.9))
    sheet.name(c, "R3", INK, (0.9, -0.9))
    sheet.name(r2, r"R2, $\sigma = +1$", INK, (-1.4, 1.3))
    sheet.name(other, r"$\sigma = -1$", MUTED, (0.3, -1.2))
    return sheet


def leg() -> Sheet:
    """Draw the round trip of a P-R-R-R leg: by the guide and the links, and by the platform."""
    made = PRRR((0.16, 0, 0.06), (0, 1, 0), (-0.08, 0, 0), 0.16, 0.17, 1.0, _BODY, _BODY)
    p = np.array([0.46, 0.13, 0.17])
    posed = Posed(made, p + made.platform_point)
    sheet = Sheet(-62.0, 20.0, (5.0, 3.5))
    r, d = np.array(made.guide_point), np.array([0.0, 1.0, 0.0])
    r1, r2 = posed.points[1:3]
    sheet.line([r - 0.08 * d, r + 0.26 * d], MUTED, 2.6)
    sheet.frame(np.zeros(3), np.eye(3), "x y z", INK)
    for point in (r1, r2, posed.c):
        sheet.axle(point, d, 0.06)
    sheet.arrow(r2, r2 + 0.08 * d, "$d$", GIVEN, (0.6, 0.3), 1.0)
    sheet.arrow(np.zeros(3), r, "$r$", GIVEN, (0.0, 0.9), **_THIN)
    sheet.arrow(r, r1, r"$\rho\,d$", INK, (-0.9, 0.6), 0.5)
    sheet.arrow(r1, r2, "$l_u$", UPPER, (-0.6, -0.8), linewidth=2.4)
    sheet.arrow(r2, posed.c, "$l_l$", LOWER, (-0.8, 0.3), linewidth=2.4)
    sheet.arrow(r1, posed.c, "$u$", GIVEN, (0.2, 0.8), 0.45)
    sheet.arrow(np.zeros(3), p, "$p$", PLATE, (0.2, -0.8), 0.6, **_THIN)
    sheet.arrow(p, posed.c, "$s$", PLATE, (0.1, 0.9))
    corners = [(-0.08, 0, 0), (0.05, -0.07, 0), (0.06, 0.06, 0), (-0.08, 0, 0)]
    sheet.line([p + np.array(corner) for corner in corners], PLATE, 1.2)
    for point, name, way in (
        (r1, "R1", (-0.4, 1.3)),
        (r2, "R2", (-0.2, -1.2)),
        (posed.c, "R3, $c$", (-1.7, 0.5)),
        (p, "P", (0.9, -0.7)),
    ):
        sheet.mark(point, INK)
        sheet.name(point, name, INK, way)
    return sheet


def platform() -> Sheet:
    """Draw the platform point's velocity, seen along k: P's, and that of turning."""
    sheet = Sheet(-90.0, 90.0, (4.4, 2.8))
    phi, rate = 0.6, 1.4
    k, p = np.array([0.0, 0.0, 1.0]), np.array([0.10, 0.02, 0.0])
    x, y = np.array([np.cos(phi), np.sin(phi), 0.0]), np.array([-np.sin(phi), np.cos(phi), 0.0])
    s = 0.2 * x
    moved, turned = np.array([0.12, -0.02, 0.0]), rate * 0.12 * np.cross(k, s / 0.2)
    corners = [p + 0.22 * x, p - 0.08 * x + 0.09 * y, p - 0.08 * x - 0.09 * y, p + 0.22 * x]
    sheet.line(corners, PLATE, 1.2)
    sheet.line([p, p + 0.24 * np.array([1.0, 0.0, 0.0])], MUTED, 1.0, **_THIN)
    sheet.arc(p, 0.12 * np.array([1.0, 0.0, 0.0]), 0.12 * x, r"$\varphi$", (0.8, 0.2))
    sheet.arrow(p, p + s, "$s$", PLATE, (-0.3, 0.8), 0.6)
    sheet.arrow(p, p + moved, r"$\dot p$", INK, (0.4, -0.8), 0.8)
    c = p + s
    sheet.arrow(c, c + moved, r"$\dot p$", INK, (0.2, -0.8), 0.7)
    sheet.arrow(c, c + turned, r"$\dot\varphi\,k\times s$", GIVEN, (-2.0, 0.2), 0.7)
    sheet.arrow(c, c + moved + turned, r"$\dot c$", LOWER, (1.0, 0.0), 0.8, linewidth=2.0)
    for point, name, way in ((p, "P", (-0.8, -0.8)), (c, "$c$", (0.9, -0.9))):
        sheet.mark(point, INK)
        sheet.name(point, name, INK, way)
    return sheet


def rates() -> Sheet:
    """Draw the rates of leg 1 of the school machine while P moves up, and what pairs with them."""
    sheet, r1, r2, c, l_u = _school()
    robot = pteron.load(SCHOOL)
    up = np.array([0.0, 0.0, 1.0])
    found = pteron.kinematics.joint_rates(robot, np.zeros(3), up)
    spin = np.array([1.0, 0.0, 0.0])
    elbow = float(found.upper_links[0]) * np.cross(spin, l_u)
    _links(sheet, r1, r2, c)
    sheet.arrow(c, c + 0.2 * up, r"$\dot u$", GIVEN, (0.8, 0.2), 0.8, linewidth=2.0)
    sheet.arrow(r2, r2 + 0.2 * elbow, r"$\dot\theta_u\,d\times l_u$", UPPER, (-2.4, 0.2), 0.7)
    sheet.arc(r1, np.array([0.0, 0.12, 0.0]), 0.4 * l_u, r"$\dot\theta_u$", (1.1, 0.2))
    back = r2 - c
    flat = -0.15 * np.array([0.0, 1.0, 0.0])
    sheet.arc(c, 0.375 * back, flat, r"$\dot\theta_l$", (-1.1, 0.4))
    for point, name, way in (
        (r1, "R1", (-1.0, -0.6)),
        (r2, "R2", (0.9, 0.8)),
        (c, "R3", (1, -0.6)),
    ):
        sheet.name(point, name, INK, way)
    sheet.name(0.5 * (r1 + r2), "$l_u$", UPPER, (-0.9, 0.4))
    sheet.name(0.5 * (r2 + c), "$l_l$", LOWER, (0.7, 0.7))
    return sheet


def body() -> Sheet:
    """Draw one body: its reference point, its centre of mass, and what acts on it."""
    sheet = Sheet(-90.0, 90.0, (4.4, 3.0))
    o, along = np.array([0.05, 0.03, 0.0]), np.array([np.cos(0.5), np.sin(0.5), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    g = 0.17 * along + 0.02 * across
    shape = [(-0.03, 0), (0, 0.04), (0.2, 0.06), (0.3, 0.01), (0.2, -0.03), (0, -0.035)]
    sheet.line([o + a * along + b * across for a, b in [*shape, shape[0]]], MUTED, 1.4)
    sheet.arrow(o, o + g, r"$\gamma = h/m$", GIVEN, (-0.6, 1.0), 0.5)
    sheet.arrow(o, o + np.array([-0.1, 0.06, 0.0]), "$a$", INK, (0.0, 0.8), 0.9)
    center, down = o + g, np.array([0.0, -1.0, 0.0])
    sheet.arrow(center, center + 0.11 * down, "$m g$", LOWER, (1.0, 0.0), 0.8)
    inward = -0.09 * g / np.linalg.norm(g)
    sheet.arrow(center, center + inward, r"$-\omega^2\gamma$", UPPER, (-0.4, -1.0), 0.9)
    turned = 0.09 * np.cross([0.0, 0.0, 1.0], g / np.linalg.norm(g))
    sheet.arrow(center, center + turned, r"$\alpha\,z\times\gamma$", UPPER, (1.8, 0.2), 0.9)
    sheet.arc(o, 0.06 * np.array([1.0, 0.0, 0.0]), 0.06 * along, r"$\omega,\alpha$", (1.3, 0.0))
    sheet.mark(o, INK)
    sheet.name(o, "reference point", INK, (-1.6, -1.2))
    sheet.mark(center, INK, 4.0)
    sheet.name(center, "centre of mass", INK, (2.6, -0.9))
    return sheet


def work() -> Sheet:
    """Draw leg 1 of the school machine in two neighbouring poses, with the weights of its links."""
    sheet, r1, r2, c, _ = _school()
    robot = pteron.load(SCHOOL)
    raised = np.array([0.0, 0.0, 0.05])
    upper = pteron.kinematics.link_vectors(robot, raised)[0][0]
    sheet.line([r1, r1 + upper, raised], MUTED, 2.0, **_THIN)
    _links(sheet, r1, r2, c)
    down = np.array([0.0, 0.0, -1.0])
    for start, end, weight, name in ((r1, r2, 10.0, "10 N"), (r2, c, 15.0, "15 N")):
        middle = 0.5 * (start + end)
        sheet.arrow(middle, middle + 0.009 * weight * down, name, LOWER, (1.2, 0.0), 0.8)
        sheet.mark(middle, INK, 3.5)
    sheet.arrow(c, raised, r"$\delta p$", GIVEN, (0.9, 0.0), 0.8, linewidth=2.0)
    for point, name, way in ((r1, "R1", (-0.9, -0.7)), (r2, "R2", (0, 1.2)), (c, "P", (0.9, -0.7))):
        sheet.name(point, name, INK, way)
    return sheet


def transfer() -> Sheet:
    """Draw the mass that two links may trade at the joint that both carry."""
    sheet, r1, r2, c, _ = _school()
    _links(sheet, r1, r2, c)
    sheet.mark(r2, LOWER, 17.0)
    sheet.mark(r2, UPPER, 10.0)
    sheet.name(r2, "mass goes over", INK, (0.0, 1.6))
    sheet.name(0.5 * (r1 + r2), r"$+\mu$", UPPER, (-1.2, 0.6))
    sheet.name(0.5 * (r2 + c), r"$-\mu$", LOWER, (1.2, 0.6))
    for point, name, way in ((r1, "R1", (-0.9, -0.7)), (c, "R3", (0.9, -0.7))):
        sheet.name(point, name, INK, way)
    return sheet


def rod() -> Sheet:
    """Draw an R-S-S leg: crank, rod, and the motion of the tip."""
    made = RSS((0.0, 0, 0.0), (0, 1, 0), (1, 0, 0), (-0.08, 0, 0), 0.17, 0.32, _BODY, _ROD, -1)
    c = np.array([0.19, 0.05, -0.26])
    posed = Posed(made, c)
    sheet = Sheet(-62.0, 18.0, (4.2, 3.6))
    r, d, tip = np.zeros(3), np.array([0.0, 1.0, 0.0]), posed.points[1]
    crank = posed.links[0]
    sheet.axle(r, d, 0.07)
    sheet.arrow(r, r + 0.09 * d, "$d$", GIVEN, (0.3, 0.8), 1.0)
    sheet.arrow(r, r + np.array([0.13, 0, 0]), "$a$", GIVEN, (0.8, 0.0), 1.0)
    sheet.arc(r, np.array([0.09, 0, 0]), 0.09 * crank / 0.17, "$q$", (0.9, 0.2))
    sheet.arrow(r, tip, "$l_u$", UPPER, (-0.6, 0.7), linewidth=2.8)
    sheet.arrow(tip, c, "$b$", LOWER, (1.0, 0.3), linewidth=2.4)
    sheet.arrow(r, c, "$w$", GIVEN, (-0.9, -0.2), **_THIN)
    sheet.arrow(tip, tip + 0.55 * np.cross(d, crank), "$t' = d\\times l_u$", INK, (2.2, 0.3), 0.9)
    for point, name, way in (
        (r, "$r$", (-0.9, 0.7)),
        (tip, "tip $t$", (0.2, 1.2)),
        (c, "$c$", (0.9, -0.8)),
    ):
        sheet.mark(point, INK)
        sheet.name(point, name, INK, way)
    return sheet


def singular() -> Sheet:
    """Draw a five-bar at both kinds of singular pose: a stretched leg, and rods in one line."""
    sheet = Sheet(-90.0, 90.0, (5.0, 2.7))
    a, b, crank, arm = np.array([-0.1, 0, 0]), np.array([0.1, 0, 0]), 0.2, 0.25
    for shift, kind in ((0.0, 1), (0.75, 2)):
        move = np.array([shift, 0.0, 0.0])
        if kind == 1:
            angle = 1.2
            away = np.array([np.cos(angle), np.sin(angle), 0.0])
            left, c = a + crank * away, a + (crank + arm) * away
        else:
            c = np.array([0.0, 0.12, 0.0])
            left = c - np.array([arm, 0.0, 0.0])
            a, b = left - np.array([-0.12, 0.16, 0]), c + np.array([arm - 0.12, -0.16, 0])
        gap = c - b
        reach = float(np.linalg.norm(gap))
        along = (crank**2 - arm**2 + reach**2) / (2.0 * reach)
        height = float(np.sqrt(crank**2 - along**2))
        across = np.array([gap[1], -gap[0], 0.0]) / reach
        right = b + along * gap / reach + height * across
        for base, elbow in ((a, left), (b, right)):
            points = [base + move, elbow + move, c + move]
            sheet.line(points[:2], UPPER, 4.0)
            sheet.line(points[1:], LOWER, 3.0)
            for point in points:
                sheet.mark(point, INK, 5.0)
        low = move + np.array([0.0, -0.09, 0.0])
        if kind == 1:
            free = 0.12 * np.array([-away[1], away[0], 0.0])
            sheet.arrow(left + move, left + move + free, r"$\dot q$", GIVEN, (-0.6, 0.8), 0.9)
            sheet.name(low, "type I: $b\\cdot t' = 0$", INK, (0, 0))
        else:
            free = np.array([0.0, 0.12, 0.0])
            sheet.arrow(c + move, c + move + free, "$\\dot c$", GIVEN, (0.8, 0.4), 0.9)
            sheet.name(low, "type II: $\\det A = 0$", INK, (0, 0))
    return sheet


DRAWINGS: dict[str, Callable[[], Sheet]] = {
    one.__name__: one
    for one in (triangle, leg, platform, rates, body, work, transfer, rod, singular)
}


DRAWINGS |= other_vectors.DRAWINGS


def draw(docs: Path, names: Sequence[str] = tuple(DRAWINGS)) -> None:
    """Write drawings, all by default."""
    folder = docs / "theory" / "vectors"
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        DRAWINGS[name]().save(folder / f"{name}.svg")
