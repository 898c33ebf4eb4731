"""Closures with the joints held, and Newton's step to a pose that meets them.

A held leg keeps its platform point c on a plane, a sphere or, in a planar machine, a circle, or it
keeps the platform's angle: its locus, see `legs.leg`.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression, point_rows
from pteron.closures.closure import nan_below_zero, plain_rows, rows_in_quasi_velocities
from pteron.closures.determinants import determinant, solve
from pteron.equations.kinematics import reach
from pteron.equations.machine import Machine
from pteron.legs.leg import (
    AngleLocus,
    CircleLocus,
    CoordinateLocus,
    LegEquations,
    Locus,
    PlaneLocus,
    SphereLocus,
)
from pteron.platforms.motion import PlatformMotion
from pteron.tolerances import ROUNDING

_STEPS = 4
"""Newton's steps of a controller: from some hundredths of a machine's size they reach rounding."""

_CLOSED = 1e-6
"""Tolerance of the relative residual before the last step, which squares it: single precision."""

_STEADY = 0.01
"""Greatest relative difference of the determinants of the last two steps.

Near a solution they agree. Where no pose exists, next to a singularity, the residual may be within
its tolerance, but each step halves the determinant or more.
"""


_AGREEMENT = 1e-2
"""Difference, relative to the legs' sizes, up to which more readings than coordinates belong to one
pose."""

_NO_CHANGE = 1e-300
"""Factor of a term that is added to propagate NaN: it changes no finite number."""


class Rows(NamedTuple):
    """The closures of legs whose joints are held, for v = (p - origin) / size.

    (zeroth + first f_1 + second f_2) (v.v, v, 1) = 0, a row (w, m, h) for each leg, where f_1 and
    f_2 are cos(phi) and sin(phi) or, where the platform slides, phi and its square.
    """

    zeroth: Expression
    """(n, d + 2), where p has d coordinates."""
    first: Expression
    second: Expression
    origin: Expression
    """(d, 1), m."""
    size: Expression
    """m."""


def closure_rows(machine: Machine, joints: Expression) -> Rows:
    """Return closure equations, linear in lifted coordinates, for joints (n, 1) held fixed.

    m.m' - 2 (w h' + w' h) of two rows is the cosine of the angle at which their spheres, circles or
    planes meet, and 1 for a row with itself.
    """
    directions, offsets = machine.platform.directions, machine.platform.offsets
    loci = [leg.locus(q) for leg, q in zip(machine.legs, ca.vertsplit(joints), strict=True)]
    origin, size = ca.SX(directions.shape[1], 1), ca.SX(1)
    for locus, offset in reversed(list(zip(loci, offsets, strict=True))):
        if isinstance(locus, SphereLocus | CircleLocus):
            origin, size = ca.mtimes(directions.T, locus.center - offset.constant), locus.radius
    leg_rows = []
    for leg, locus, (a, b, constant) in zip(machine.legs, loci, offsets, strict=True):
        s = ca.mtimes(directions, origin) + constant  # c = s + size v + a f_1 + b f_2
        w, m, h = ca.SX(1, 3), ca.SX(directions.shape[1], 3), ca.SX(1, 3)
        scale = ca.SX(1)
        if isinstance(locus, AngleLocus):  # sin(phi - angle) = 0
            h[1], h[2] = -ca.sin(locus.angle), ca.cos(locus.angle)
        elif isinstance(locus, PlaneLocus):
            m[:, 0] = size * ca.mtimes(directions.T, locus.normal)
            h = ca.mtimes(locus.normal.T, ca.horzcat(s, a, b))
            h[0] -= locus.offset
            scale = ca.norm_2(m[:, 0])
        else:
            assert isinstance(locus, SphereLocus | CircleLocus)
            arm = _component_in_plane(machine, leg, locus, s - locus.center)
            w[0] = size**2
            m = 2 * size * ca.mtimes(directions.T, ca.horzcat(arm, a, b))
            h = ca.mtimes(arm.T, ca.horzcat(arm, 2 * a, 2 * b))
            h[0] -= locus.radius**2
            h[2 if machine.platform.slides else 0] += ca.dot(a, a)  # |a f_1 + b f_2|^2
            scale = 2 * locus.radius * size
        leg_rows.append(ca.vertcat(w, m, h) / scale)
    zeroth, first, second = (ca.horzcat(*(rows[:, k] for rows in leg_rows)).T for k in range(3))
    return Rows(zeroth, first, second, origin, size)


def _component_in_plane(
    machine: Machine, leg: LegEquations, locus: SphereLocus | CircleLocus, v: Expression
) -> Expression:
    """Return a vector from a locus's centre, for a circle projected onto the circle's plane."""
    if isinstance(locus, SphereLocus):
        return v
    if leg.holds is not None:
        return v - ca.mtimes(leg.holds.normal, ca.dot(leg.holds.normal, v))
    directions = machine.platform.directions
    return ca.mtimes(directions, ca.mtimes(directions.T, v))


def holds_spheres(machine: Machine) -> bool:
    """Return whether every leg whose joint is held keeps its platform point on a sphere or circle.

    A circle is the sphere's part in the plane in which the leg keeps that point.
    """
    loci = (leg.locus(ca.SX(0)) for leg in machine.legs)
    return all(isinstance(locus, SphereLocus | CircleLocus) for locus in loci)


def plane_of_locus(locus: Locus) -> PlaneLocus | None:
    """Return the plane that a locus is, or lies in whichever the leg's branch; None without one."""
    if isinstance(locus, CoordinateLocus):
        return locus.plane
    return locus if isinstance(locus, PlaneLocus) else None


def holds_planes(machine: Machine) -> bool:
    """Return whether every leg whose joint is held keeps its platform point in a plane."""
    return all(plane_of_locus(leg.locus(ca.SX(0))) is not None for leg in machine.legs)


def held_planes(machine: Machine, joints: Expression) -> tuple[Expression, Expression]:
    """Return the planes of held joints: normals, one after the other (3 n, 1), offsets (n, 1)."""
    planes = [
        plane_of_locus(leg.locus(q))
        for leg, q in zip(machine.legs, ca.vertsplit(joints), strict=True)
    ]
    zero = 0 * joints[0]  # what is constant has a column for each of a batch of joints too
    known = [plane for plane in planes if plane is not None]  # all, see `holds_planes`
    normals = ca.vertcat(*(plane.normal for plane in known))
    return ca.densify(normals) + zero, ca.vertcat(*(plane.offset for plane in known)) + zero


def held_spheres(machine: Machine, joints: Expression) -> tuple[Expression, Expression]:
    """Return centres (n, 3) and squared radii (n, 1) of the spheres that hold platform points.

    If the leg keeps its point in a plane, the centre is projected into that plane.
    """
    centers, squares = [], []
    for leg, q in zip(machine.legs, ca.vertsplit(joints), strict=True):
        locus = leg.locus(q)
        assert isinstance(locus, SphereLocus | CircleLocus)  # see `holds_spheres`
        center = locus.center
        if leg.holds is not None:
            away = ca.dot(leg.holds.normal, center - leg.holds.point)
            center = center - away * leg.holds.normal
        centers.append(center.T)
        squares.append(locus.radius * locus.radius)
    return ca.vertcat(*centers), ca.vertcat(*squares)


class ClosureResiduals(NamedTuple):
    """Residuals of the closures of held joints at a pose, with their Jacobian."""

    lengths: Expression
    """(n, 1): m, or rad."""
    rows: Expression
    """(n, m): their Jacobian in the platform's quasi-velocities."""
    relative: Expression
    """The largest residual, relative to the size of all legs' terms."""
    arms: list[Expression | None]
    """Vectors from the centers of spheres and circles to the platform points, (3, 1) each."""
    platform: PlatformMotion
    leg_rows: list[Expression]
    """(1, 6) each: the legs' part of `rows`, against (c', omega)."""
    contradiction: Expression = 0
    """The largest residual of a redundant machine: by how much its joints contradict each other.
    `relative` is then the part of it that a step of least squares still changes."""

    @property
    def step(self) -> tuple[Expression, Expression]:
        """Newton's step (m, 1) times the Jacobian's determinant, and that determinant."""
        step, determinant = solve(self.rows, -self.lengths)
        return self.platform.pose_rates(step), determinant


def closure_residuals(machine: Machine, joints: Expression, pose: Expression) -> ClosureResiduals:
    """Return the closure errors and their Jacobian for joints (n, 1) at a pose (m, 1)."""
    zero_rates = ca.SX.zeros(machine.freedom)
    platform = machine.platform.motion(pose, zero_rates, zero_rates)
    lengths, rows, angles, sizes = [], [], [ca.SX(0)], [ca.SX(ROUNDING)]
    arms: list[Expression | None] = []
    for leg, q, point in zip(machine.legs, ca.vertsplit(joints), platform.points, strict=True):
        locus, c = leg.locus(q), point.position
        arms.append(None)
        if isinstance(locus, AngleLocus):
            length = platform.rotation.angle - locus.angle
            row = platform.rotation.turns[0].row
            angles.append(ca.fabs(length) / (1 + ca.fabs(locus.angle)))
        elif isinstance(locus, PlaneLocus):
            length, row = ca.dot(locus.normal, c) - locus.offset, point_rows(locus.normal.T)
            sizes.append(locus.size + ca.dot(ca.fabs(locus.normal), ca.fabs(c)))
        elif isinstance(locus, CoordinateLocus):
            motion = leg.motion(point, platform.rotation)
            length, row = motion.coordinate - q, motion.row / motion.divisor
            size = ca.norm_2(row[:3])  # of the force: the row of a unit force
            length, row = length / size, row / size
            sizes.append(ca.fabs(q) + ca.norm_1(c))
        else:
            b = _component_in_plane(machine, leg, locus, c - locus.center)
            length = 0.5 * (ca.dot(b, b) / locus.radius - locus.radius)
            row = point_rows(b.T / locus.radius)
            sizes.append(locus.radius + ca.norm_1(c) + ca.norm_1(locus.center))
            arms[-1] = b
        lengths.append(length)
        rows.append(row)
    # Relative to the terms of all legs: those of a plane through the origin may all be zero.
    length_residuals = [
        ca.fabs(length)
        for leg, q, length in zip(machine.legs, ca.vertsplit(joints), lengths, strict=True)
        if not isinstance(leg.locus(q), AngleLocus)
    ]
    share = ca.mmax(ca.vertcat(*length_residuals)) / ca.sum1(ca.vertcat(*sizes))
    largest = ca.mmax(ca.vertcat(share, *angles))
    errors, quasi_rows = ca.vertcat(*lengths), rows_in_quasi_velocities(platform, rows)
    parts = errors, quasi_rows, largest, arms, platform, rows
    if not machine.closure.is_redundant:
        return ClosureResiduals(*parts)
    # More joints than coordinates contradict each other: what a step still changes is to vanish.
    change = ca.mtimes(quasi_rows, solve(quasi_rows, errors)[0])
    relative = ca.mmax(ca.fabs(change)) / ca.sum1(ca.vertcat(*sizes))
    return ClosureResiduals(*parts, largest)._replace(relative=relative)


def closure_errors(
    machine: Machine, joints: Expression, pose: Expression
) -> tuple[Expression, Expression]:
    """Return two forms (n, 1) of what vanishes where joints (n, 1) have a pose (m, 1).

    The first one vanishes whatever the elbows are, but has the sign of the inner one of two roots;
    the second one vanishes in every branch. Both are smooth where an elbow is stretched.
    """
    residuals = closure_residuals(machine, joints, pose)
    legs, platform = machine.legs_at(residuals.platform), residuals.platform
    lengths = ca.vertsplit(residuals.lengths)
    forms = list(lengths), list(lengths)
    for i, (leg, q, point) in enumerate(
        zip(legs, ca.vertsplit(joints), platform.points, strict=True)
    ):
        locus = leg.locus(q)
        if not isinstance(locus, CoordinateLocus):
            continue
        for form, any_branch in zip(forms, (False, True), strict=True):
            if locus.closure is not None:
                form[i] = locus.closure(point.position, any_branch)
            elif locus.plane is not None:
                form[i] = ca.dot(locus.plane.normal, point.position) - locus.plane.offset
    return ca.vertcat(*forms[0]), ca.vertcat(*forms[1])


def newton_step(
    machine: Machine, joints: Expression, pose: Expression
) -> tuple[Expression, Expression]:
    """Return the pose (m, 1) after one Newton step, and the relative closure error before it."""
    residuals = closure_residuals(machine, joints, pose)
    step, determinant = residuals.step
    # The maximum drops NaN, which a sum propagates.
    return pose + step / determinant, residuals.relative + _NO_CHANGE * ca.norm_1(residuals.lengths)


def any_branch_step(
    machine: Machine, joints: Expression, pose: Expression
) -> tuple[Expression, Expression]:
    """Return the pose (m, 1) after a Newton step in whatever branch, and the step's largest part.

    `pose` is a symbol.
    """
    errors = closure_errors(machine, joints, pose)[1]
    step, determinant = solve(ca.jacobian(errors, pose), -errors)
    change = step / determinant
    return pose + change, ca.mmax(ca.fabs(change)) + _NO_CHANGE * ca.norm_1(errors)


class NewtonEnd(NamedTuple):
    """The pose after Newton's steps, and how far they converged."""

    pose: Expression
    """NaN where they do not converge, or a leg does not reach; not finite where the type-II
    measure does not exceed the threshold."""
    measure: Expression
    """The type-II measure."""
    determinant: Expression
    """The determinant of the closures' slopes, which has the measure's zeros and their signs."""
    residuals: ClosureResiduals
    """Before the last step."""


def converged_step(
    machine: Machine, joints: Expression, pose: Expression, least: float
) -> NewtonEnd:
    """Return the pose of joints (n, 1) by Newton's method from a start pose (m, 1)."""
    residuals = closure_residuals(machine, joints, pose)
    step, divisor = residuals.step
    for _ in range(_STEPS - 1):
        previous_divisor, pose = divisor, pose + step / divisor
        residuals = closure_residuals(machine, joints, pose)
        step, divisor = residuals.step
    measure = machine.closure.measure_of(residuals.platform, residuals.leg_rows)
    validity = nan_below_zero(_CLOSED - residuals.relative)
    if machine.closure.is_redundant:
        validity += nan_below_zero(_AGREEMENT - residuals.contradiction)
    validity += nan_below_zero(_STEADY - ca.fabs(divisor / previous_divisor - 1))
    # The last step's divisor vanishes where the measure is too small.
    enough = ca.fmax(measure * measure - least * least, 0) / (measure * measure)
    last_pose = pose + step / (divisor * enough)
    for leg, q, at in zip(
        machine.legs, ca.vertsplit(joints), reach(machine, last_pose), strict=True
    ):
        if isinstance(leg.locus(q), PlaneLocus):  # it goes on where the leg does not reach
            validity += nan_below_zero(at.discriminant)
    return NewtonEnd(last_pose + validity, measure, divisor, residuals)


def direct_step(
    machine: Machine, joints: Expression, pose: Expression, least: float
) -> tuple[Expression, Expression, Expression]:
    """Return the pose of joints near a start pose, its type-II measure, leg that changed branch.

    The pose is NaN where that of `converged_step` is, where a leg does not reach the start pose,
    and beyond a singularity of the robot's working mode: the type-II measure changes its sign, or a
    leg bends the other way. The last result is that leg's number, from 1; 0 if there is none, or if
    Newton's method does not converge.
    """
    end = converged_step(machine, joints, pose, least)
    # At the start pose the loci are those of the joints there, not of the given joints.
    start, rows = machine.state(pose), ca.vertsplit(closure_residuals(machine, joints, pose).rows)
    closed_rows = ca.vertsplit(plain_rows(start.platform, start.legs))
    validity, bent = ca.SX(0), ca.SX(0)
    legs = zip(machine.legs, ca.vertsplit(joints), start.legs, reach(machine, pose), strict=True)
    for i, (leg, q, motion, at) in enumerate(legs):
        arm, joint = end.residuals.arms[i], ca.SX.sym("joint")
        locus = leg.locus(joint)
        if arm is None or not isinstance(locus, SphereLocus | CircleLocus):
            continue
        rows[i] = closed_rows[i]
        validity += nan_below_zero(at.discriminant)
        center_rate = ca.substitute(ca.jacobian(locus.center, joint), joint, q)
        arm_rate = ca.dot(arm, center_rate) * motion.divisor
        # Below zero, as 1 would be a truth value.
        bent = ca.fmin(bent, ca.if_else(arm_rate < 0, -(i + 1), 0))
    bent = ca.if_else(end.residuals.relative < _CLOSED, -bent, 0)
    side = determinant(ca.vertcat(*rows)) * end.determinant
    validity += nan_below_zero(side) + nan_below_zero(-bent)
    return end.pose + validity, end.measure, bent
