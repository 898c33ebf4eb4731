"""Clearances between a machine's bodies: least distances of their centre lines.

A body is one or more straight segments: a leg's links and rods, a slider's guide within its limits,
the platform as arms from P to its points. Pairs of bodies that share a joint, and pairs of guides,
which do not move, are excluded.

The squared distance of two segments is a convex quadratic over the unit square of the places s and
t on them. Its least value is at its stationary point, where that is inside, else on one of the four
edges, where one segment's end is nearest to the other. All five are points of the segments, so that
the least of their distances is exact and no branch is needed; for parallel segments the stationary
point is arbitrary, and an edge is as near.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import combinations
from typing import Literal, get_args

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine, State
from pteron.legs import LegKind
from pteron.legs.leg import LegMotion
from pteron.manipulator import Manipulator
from pteron.tolerances import ROUNDING

Segment = tuple[Expression, Expression]
"""Both ends, (3, 1)."""

Kind = Literal["guide", "upper", "lower", "leg", "platform"]
"""Kinds of bodies: a slider's guide, an upper link or crank, a last link or rods, a leg whose two
parts slide on one line (a ram or a shaft), the platform."""

_TINY = 1e-24
"""Least value of a square (m^2, or a squared sine) in a denominator."""


@dataclass(frozen=True)
class Body:
    """A body that may collide with others: its kind, and its leg, from 1; 0 for the platform."""

    kind: Kind
    leg: int
    name: str


def bodies(robot: Manipulator) -> list[Body]:
    """Return the bodies of a machine: each leg's guide, upper and lower link, then the platform.

    A guide without limits has no ends and is left out.
    """
    machine = Machine.numeric(robot)
    state = machine.state(ca.SX.sym("pose", machine.freedom))
    return [body for body, _ in _segments(machine, state)]


def pairs(robot: Manipulator) -> list[tuple[Body, Body]]:
    """Return the pairs of bodies whose distance is computed, in the order of `clearances`."""
    return [pair for pair in combinations(bodies(robot), 2) if not _share_a_joint(robot, *pair)]


def clearances(machine: Machine, pose: Expression) -> Expression:
    """Return the distance between the centre lines of each pair of `pairs`, (K, 1), m."""
    squares = [square for _, square in _squares(machine, pose)]
    return ca.sqrt(ca.vertcat(*squares)) if squares else ca.SX(0, 1)


def meetings(robot: Manipulator) -> list[tuple[Kind, Kind]]:
    """Return the pairs of kinds of bodies that may collide, in the order of `least_clearances`."""
    return list(dict.fromkeys(_kinds(*pair) for pair in pairs(robot)))


def least_clearances(machine: Machine, pose: Expression) -> Expression:
    """Return the least centre-line distance over all pairs of the same kinds, (k, 1), m."""
    squares: dict[tuple[Kind, Kind], Expression] = {}
    for pair, square in _squares(machine, pose):
        kinds = _kinds(*pair)
        squares[kinds] = ca.fmin(squares[kinds], square) if kinds in squares else square
    return ca.sqrt(ca.vertcat(*squares.values())) if squares else ca.SX(0, 1)


def _kinds(a: Body, b: Body) -> tuple[Kind, Kind]:
    """Return the kinds of two bodies, sorted in the order of `Kind`."""
    first, second = sorted((a.kind, b.kind), key=get_args(Kind).index)
    return first, second


def _squares(machine: Machine, pose: Expression) -> Iterator[tuple[tuple[Body, Body], Expression]]:
    """Yield each pair of bodies and the squared distance of their centre lines, m^2."""
    bodies = list(_segments(machine, machine.state(pose)))
    for (body, first), (other_body, second) in combinations(bodies, 2):
        if not _share_a_joint(machine.robot, body, other_body):
            squares = [squared_distance(a, b) for a in first for b in second]
            yield (body, other_body), reduce(ca.fmin, squares)


def squared_distance(first: Segment, second: Segment) -> Expression:
    """Return the least squared distance of two segments, which may be points, m^2."""
    (p, p_end), (q, q_end) = first, second
    u, v, w = p_end - p, q_end - q, p - q
    uu, vv, uv = ca.dot(u, u), ca.dot(v, v), ca.dot(u, v)
    uw, vw = ca.dot(u, w), ca.dot(v, w)
    u_square, v_square = ca.fmax(uu, _TINY), ca.fmax(vv, _TINY)

    def square(s: Expression, t: Expression) -> Expression:
        """Return the squared distance, m^2, of two points at line parameters s and t (0 to 1)."""
        separation = w + s * u - t * v
        return ca.dot(separation, separation)

    denominator = ca.fmax(uu * vv - uv * uv, _TINY * u_square * v_square)
    s = _clip_to_unit((uv * vw - vv * uw) / denominator)
    least = square(s, _clip_to_unit((s * uv + vw) / v_square))
    for end in (0.0, 1.0):
        t = _clip_to_unit((end * uv + vw) / v_square)
        s = _clip_to_unit((end * uv - uw) / u_square)
        least = ca.fmin(least, ca.fmin(square(ca.SX(end), t), square(s, ca.SX(end))))
    return least


def _clip_to_unit(share: Expression) -> Expression:
    """Return a number clipped to the range from 0 to 1."""
    return ca.fmin(ca.fmax(share, 0), 1)


def _segments(machine: Machine, state: State) -> Iterator[tuple[Body, list[Segment]]]:
    """Yield the bodies of legs and platform with the segments of their centre lines."""
    robot = machine.robot
    for i, (leg, motion) in enumerate(zip(robot.legs, state.legs, strict=True), start=1):
        yield from _leg_segments(i, leg, motion, state.platform.points[i - 1].position)
    arms = list(_arms(machine, state))
    if arms:
        yield Body("platform", 0, "platform"), arms


def _leg_segments(
    i: int, leg: LegKind, motion: LegMotion, c: Expression
) -> Iterator[tuple[Body, list[Segment]]]:
    """Yield the guide and the links of leg i, from 1, with the segments of their centre lines."""
    if "p" in motion.bodies and leg.limits is not None and leg.joint_axis is not None:
        r, e = ca.SX(list(leg.guide_point)), ca.SX(list(leg.joint_axis))
        low, high = leg.limits
        yield Body("guide", i, f"leg {i} guide"), [(r + low * e, r + high * e)]
    upper, lower = motion.links
    if upper is not None:
        start = next(joint.point for joint in motion.chain if joint.body == "u")
        yield Body("upper", i, f"leg {i} {leg.names['u']}"), [(start, start + upper)]
    if lower is not None:
        half = _half_bar(leg)
        sides = [half, -half] if half is not None else [ca.SX(3, 1)]
        lines = [(c - lower + h, c + h) for h in sides]
        if upper is None and _has_upper(leg):
            yield Body("leg", i, f"leg {i}"), lines
        else:
            name = leg.names["l"] + ("s" if half is not None else "")
            yield Body("lower", i, f"leg {i} {name}"), lines


def _half_bar(leg: LegKind) -> Expression | None:
    """Return the vector (3, 1) of half the bar between parallel rods, m; None without a bar."""
    if leg.bar is None or leg.bar_length is None:
        return None
    return ca.SX([0.5 * leg.bar_length * v for v in leg.bar])


def _arms(machine: Machine, state: State) -> Iterator[Segment]:
    """Yield the segments of the platform's arms from P to its points."""
    robot, p = machine.robot, state.platform.body.position
    seen = set()
    for leg, point in zip(robot.legs, state.platform.points, strict=True):
        hinge = point.position - ca.SX(list(leg.fixed_offset))
        ends = [p, hinge, point.position]
        offsets = [leg.platform_point, leg.fixed_offset]
        if not robot.platform.angles:
            total = tuple(a + b for a, b in zip(*offsets, strict=True))
            ends, offsets = [p, point.position], [total]
        for k, offset in enumerate(offsets):
            key = tuple(offsets[: k + 1])
            if max(map(abs, offset)) > ROUNDING and key not in seen:
                seen.add(key)
                yield ends[k], ends[k + 1]


def _share_a_joint(robot: Manipulator, a: Body, b: Body) -> bool:
    """Return whether two bodies share a joint or a guide, or are both fixed."""
    if a.kind == b.kind == "guide":
        return True
    last = [body.kind in ("lower", "leg") for body in (a, b)]
    if "platform" in (a.kind, b.kind):
        return any(last)
    if a.leg == b.leg:
        return {a.kind, b.kind} != {"guide", "lower"} or not _has_upper(robot.legs[a.leg - 1])
    if all(last):
        return _share_platform_point(robot, a.leg, b.leg)
    guide, other = (a, b) if a.kind == "guide" else (b, a)
    return (
        guide.kind == "guide" and _first(robot, other) and _share_line(robot, guide.leg, other.leg)
    )


def _has_upper(leg: LegKind) -> bool:
    """Return whether a leg has an upper link, crank or cylinder."""
    return "u" in leg.names


def _first(robot: Manipulator, body: Body) -> bool:
    """Return whether a link is the first one of its leg."""
    return body.kind == "upper" or not _has_upper(robot.legs[body.leg - 1])


def _share_platform_point(robot: Manipulator, i: int, j: int) -> bool:
    """Return whether legs i and j, from 1, meet the platform in the same point."""
    first, second = (
        np.array([*leg.platform_point, *leg.fixed_offset])
        for leg in (robot.legs[i - 1], robot.legs[j - 1])
    )
    return bool(np.abs(first - second).max() <= ROUNDING)


def _share_line(robot: Manipulator, i: int, j: int) -> bool:
    """Return whether the guides of legs i and j, from 1, lie on one line."""
    first, second = robot.legs[i - 1], robot.legs[j - 1]
    if first.joint_axis is None or second.joint_axis is None:
        return False
    axis = np.array(first.joint_axis)
    separation = np.array(second.guide_point) - np.array(first.guide_point)
    if "p" not in first.bodies or "p" not in second.bodies:
        return False
    cross_products = np.cross(axis, separation), np.cross(axis, second.joint_axis)
    return bool(max(np.abs(v).max() for v in cross_products) <= ROUNDING)
