"""Draw the vectors of the theory, for docs/theory: vectors/NAME.svg.

Points and vectors are those that the library computes, of the machine docs/theory/school.toml
where they fit it; only the names are put by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import machines
import numpy as np
import other_vectors
from legs import GIVEN, INK, LOWER, MUTED, PLATE, UPPER, Posed, Sheet
from matplotlib.patches import Circle

import pteron
from pteron.bodies import PlanarInertia, RodInertia
from pteron.kernels import Array
from pteron.legs import PRRR, RSS, Drive, Stribeck

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
    sheet.name(0.5 * (foot + r2), "0.24", INK, (1.05, -0.9))
    sheet.name(0.5 * (r1 + foot), "0.18", INK, (0.0, -0.8))
    sheet.name(r1, "R1", INK, (-0.9, -0.9))
    sheet.name(c, "R3", INK, (0.9, -0.9))
    sheet.name(r2, r"R2, $\sigma = +1$", INK, (-1.4, 1.3))
    sheet.name(other, r"$\sigma = -1$", MUTED, (2.0, -0.3))
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
    sheet.arrow(p, p + s, "$s$", PLATE, (-0.4, 0.7), 0.25)
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
    first, second = 0.3 * elbow, 0.3 * float(found.lower_links[0]) * np.cross(spin, c - r2)
    assert np.allclose(first + second, 0.3 * up)
    sheet.arrow(c, c + 0.3 * up, r"$\dot u$", GIVEN, (-0.8, 0.0), 0.7, linewidth=2.0)
    sheet.arrow(c, c + second, r"$\dot\theta_l\,d\times l_l$", LOWER, (2.5, -0.2), 0.6)
    sheet.arrow(c + second, c + 0.3 * up, r"$\dot\theta_u\,d\times l_u$", UPPER, (2.2, 0.8), 0.4)
    sheet.arrow(r2, r2 + first, r"$\dot\theta_u\,d\times l_u$", UPPER, (-2.6, 0.2), 0.7)
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
    sheet = Sheet(-90.0, 90.0, (5.0, 3.0))
    o, along = np.array([0.05, 0.03, 0.0]), np.array([np.cos(0.5), np.sin(0.5), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    g = 0.17 * along + 0.02 * across
    shape = [(-0.03, 0), (0, 0.04), (0.2, 0.06), (0.33, 0.04), (0.35, -0.05), (0.3, -0.11)]
    shape += [(0.18, -0.05), (0, -0.035)]
    sheet.line([o + a * along + b * across for a, b in [*shape, shape[0]]], MUTED, 1.4)
    sheet.arrow(o, o + g, r"$\gamma = h/m$", GIVEN, (-0.9, 0.9), 0.4)
    sheet.arrow(o, o + np.array([-0.1, 0.06, 0.0]), r"$\ddot o$", INK, (0.0, 0.8), 0.9)
    center, down = o + g, np.array([0.0, -1.0, 0.0])
    sheet.arrow(center, center + 0.11 * down, "$m g$", LOWER, (1.0, 0.0), 0.8)
    inward = -0.09 * g / np.linalg.norm(g)
    sheet.arrow(center, center + inward, r"$-\omega^2\gamma$", UPPER, (1.3, -0.7), 0.8)
    turned = 0.09 * np.cross([0.0, 0.0, 1.0], g / np.linalg.norm(g))
    sheet.arrow(center, center + turned, r"$\dot\omega\,z\times\gamma$", UPPER, (1.8, 0.2), 0.9)
    sheet.arc(o, 0.05 * np.array([1.0, 0.0, 0.0]), 0.05 * along, r"$\omega,\dot\omega$", (1.3, 0.0))
    sheet.mark(o, INK)
    sheet.name(o, "reference point", INK, (-4.4, -1.1))
    sheet.mark(center, INK, 4.0)
    sheet.name(center, "centre of mass", INK, (4.0, -0.1))
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
    sheet.name(0.5 * (r1 + r2), "$+m_t$", UPPER, (-1.2, 0.6))
    sheet.name(0.5 * (r2 + c), "$-m_t$", LOWER, (1.2, 0.6))
    for point, name, way in ((r1, "R1", (-0.9, -0.7)), (c, "R3", (0.9, -0.7))):
        sheet.name(point, name, INK, way)
    return sheet


def rod() -> Sheet:
    """Draw an R-S-S leg at a positive q: crank, rod, and the motion of the tip."""
    made = RSS((0.0, 0, 0.0), (0, 1, 0), (1, 0, 0), (-0.08, 0, 0), 0.17, 0.32, _BODY, _ROD, -1)
    c = np.array([0.12, 0.05, -0.41])
    posed = Posed(made, c)
    assert posed.coordinate > 0.5
    sheet = Sheet(-62.0, 18.0, (4.2, 3.6))
    r, d, tip = np.zeros(3), np.array([0.0, 1.0, 0.0]), posed.points[1]
    crank = posed.links[0]
    sheet.axle(r, d, 0.07)
    sheet.arrow(r, r + 0.09 * d, "$d$", GIVEN, (0.3, 0.8), 1.0)
    sheet.arrow(r, r + np.array([0.13, 0, 0]), "$a$", GIVEN, (0.8, 0.0), 1.0)
    sheet.arc(r, np.array([0.09, 0, 0]), 0.09 * crank / 0.17, "$q$", (0.9, 0.2))
    sheet.arrow(r, tip, "$l_u$", UPPER, (-0.5, -0.9), linewidth=2.8)
    sheet.arrow(tip, c, "$b$", LOWER, (1.0, 0.3), linewidth=2.4)
    sheet.arrow(r, c, "$w$", GIVEN, (-0.9, -0.2), **_THIN)
    sheet.arrow(tip, tip + 0.55 * np.cross(d, crank), "$t'$", INK, (-0.7, 0.5), 0.8)
    for point, name, way in (
        (r, "$r$", (-0.9, 0.7)),
        (tip, "tip $t$", (1.6, 0.4)),
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


def friction() -> Sheet:
    """Draw a drive's friction over the joint's rate."""
    coulomb, more, rate, viscous = 3.0, 2.0, 0.05, 12.0
    drive = Drive(coulomb=coulomb, stribeck=Stribeck(more, rate), viscous=viscous)
    robot = pteron.load(SCHOOL)
    robot = replace(robot, legs=(replace(robot.legs[0], drive=drive), *robot.legs[1:]))
    rates = np.concatenate([np.linspace(1e-6, 0.1, 81), np.linspace(0.1, 0.3, 21)])
    rest = np.zeros(3)

    def force(rate: float) -> float:
        state = rest, rate * np.array([1.0, 0.0, 0.0]), rest
        return float(
            (pteron.drive_forces(robot, *state) - pteron.inverse_dynamics(robot, *state))[0]
        )

    sheet = Sheet(-90.0, 90.0, (5.4, 3.4))

    def at(rate: float, force: float) -> Array:
        return np.array([10.0 * rate, 0.3 * force, 0.0])

    sheet.arrow(at(-0.32, 0), at(0.36, 0), r"$\dot q$", INK, (0.2, -0.9), 1.0, linewidth=1.0)
    sheet.arrow(at(0, -8.0), at(0, 8.4), "force", INK, (1.5, 0.0), 1.0, linewidth=1.0)
    for sign in (1.0, -1.0):
        sheet.line([at(v, force(v)) for v in sign * rates], UPPER, 2.4)
    sheet.line([at(0, coulomb), at(0.3, coulomb + 0.3 * viscous)], MUTED, 1.4, **_THIN)
    sheet.line([at(rate, 0), at(rate, force(rate))], MUTED, 1.0, **_THIN)
    sheet.name(at(rate, 0), "$v_s$", INK, (0.0, -0.9))
    sheet.arrow(at(-0.02, 0), at(-0.02, coulomb), "$F_c$", GIVEN, (-0.9, 0.0), 0.5)
    sheet.arrow(at(-0.02, coulomb), at(-0.02, coulomb + more), "$F_s$", LOWER, (-0.9, 0.0), 0.5)
    for level in (coulomb, coulomb + more):
        sheet.line([at(-0.03, level), at(0.0, level)], MUTED, 0.8)
    left = coulomb + rate * viscous
    sheet.line([at(rate, left), at(rate, force(rate))], LOWER, 2.4)
    sheet.name(at(rate, force(rate)), "$0.37\\,F_s$", LOWER, (2.3, 1.0))
    sheet.name(at(0.24, coulomb + 0.24 * viscous), r"$F_c + F_v\,\dot q$", MUTED, (1.4, -1.3))
    return sheet


def fit() -> Sheet:
    """Draw the four samples of the worked regression, and the two lines that fit them."""
    sheet = Sheet(-90.0, 90.0, (5.0, 3.4))

    def at(acceleration: float, force: float) -> Array:
        return np.array([acceleration, 0.25 * force, 0.0])

    sheet.arrow(at(-3, 0), at(3.2, 0), r"$\ddot\rho$", INK, (0.2, -0.9), 1.0, linewidth=1.0)
    sheet.arrow(at(0, -8.4), at(0, 8.8), "$F$", INK, (0.8, 0.0), 1.0, linewidth=1.0)
    for sign, color, name in ((1.0, UPPER, r"$\dot\rho > 0$"), (-1.0, LOWER, r"$\dot\rho < 0$")):
        ends = [at(a, 2.0 * a + 3.1 * sign) for a in (-2.6, 2.6)]
        sheet.line(ends, color, 1.6)
        sheet.name(ends[int(sign > 0)], name, color, (-1.6 * sign, 0.4 * sign))
        for a, force in SAMPLES[sign]:
            sheet.mark(at(a, force), color)
    both: dict[str, Any] = {"arrowstyle": "<|-|>", "linewidth": 1.0}
    sheet.arrow(at(0, -3.1), at(0, 3.1), r"$2\,\hat F_c$", GIVEN, (1.4, -0.6), 0.75, **both)
    corner = at(1.6, 2.0 * 0.6 - 3.1)
    sheet.line([at(0.6, 2.0 * 0.6 - 3.1), corner, at(1.6, 0.1)], MUTED, 1.0)
    sheet.name(at(1.1, -1.9), "1", MUTED, (0.0, -0.6))
    sheet.name(at(1.6, -0.9), r"$\hat m$", MUTED, (0.8, 0.0))
    return sheet


SAMPLES = {1.0: ((2.0, 7.1), (-2.0, -0.9)), -1.0: ((2.0, 0.9), (-2.0, -7.1))}
"""Accelerations and forces of docs/theory/identification.md, by the sign of the rate."""


DRAWINGS: dict[str, Callable[[], Sheet]] = {
    one.__name__: one
    for one in (
        *(triangle, leg, platform, rates, body, work, transfer, rod, singular),
        *(friction, fit),
    )
}


DRAWINGS |= machines.DRAWINGS | other_vectors.DRAWINGS


def draw(docs: Path, names: Sequence[str] = tuple(DRAWINGS)) -> None:
    """Write drawings, all by default."""
    folder = docs / "theory" / "vectors"
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        DRAWINGS[name]().save(folder / f"{name}.svg")
