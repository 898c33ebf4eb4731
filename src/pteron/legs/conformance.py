"""A test that a kind of leg keeps the protocol of `legs.leg`: run `faults` on a leg of your own.

It differentiates along one random motion of platform point and rotation: rates are the derivatives
of coordinates, bodies move with the joints that carry them, the forces that bodies need do the work
that their energy takes. No number is known beforehand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from pteron.bodies.agreement import TIME, mismatched_names, rate_of
from pteron.bodies.motion import (
    Expression,
    PointMotion,
    RotationMotion,
    Turn,
    mass_matrix,
    mass_moment,
    moments_of,
)
from pteron.bodies.vectors import Vector
from pteron.legs.ball_end import every_axis
from pteron.legs.kind import LegKind
from pteron.legs.leg import (
    CircleLocus,
    CoordinateLocus,
    LegEquations,
    LegMotion,
    PlaneLocus,
    SphereLocus,
)
from pteron.legs.protocol import breaches, point_in_reach


class _LegInMotion:
    """A leg whose platform point and rotation move at random in t, with random inertia."""

    def __init__(self, leg: LegKind, axes: Sequence[Vector], seed: int) -> None:
        rng = np.random.default_rng(seed)
        c, normal = point_in_reach(leg, seed), leg.plane_normal
        assert c is not None  # `breaches` has found one
        projector = np.eye(3) - (0.0 if normal is None else np.outer(normal, normal))
        size = leg.size or 1.0
        dc, ddc, self.gravity = (
            ca.SX(ca.DM(size * projector @ rng.normal(size=3))) for _ in range(3)
        )
        self.leg = leg
        t = TIME
        self.point = PointMotion(ca.SX(ca.DM(c)) + dc * t + ddc * t**2 / 2, dc + ddc * t, ddc)
        phi, rate, growth = rng.normal(size=3)
        moving = [(rate, growth), *rng.normal(size=(2, 2))]
        turns = tuple(
            Turn(ca.SX(ca.DM(list(axis))), first + second * t, ca.SX(second))
            for axis, (first, second) in zip(axes, moving, strict=False)
        )
        self.rotation = RotationMotion(turns, phi + rate * t + growth * t**2 / 2)
        if leg.platform_axes:
            self.rotation = _turn_about(leg.platform_axes, moving)
        omega = sum((turn.rate * turn.axis for turn in self.rotation.turns), ca.SX(3, 1))
        if leg.platform_center is not None:
            self.point = _point_about(ca.SX(list(leg.platform_center)), ca.SX(ca.DM(c)), omega)
        self.twist = ca.vertcat(self.point.velocity, omega)
        self.equations: LegEquations = leg.equations()
        self.motion: LegMotion = self.equations.motion(self.point, self.rotation)
        kinds = self.equations.kinds
        parameters = {b: ca.SX(ca.DM(rng.uniform(0.5, 1.5, len(kinds[b])))) for b in kinds}
        self.inertia = {b: moments_of(kinds[b], ca.vertsplit(v)) for b, v in parameters.items()}


def _turn_about(axes: Sequence[Vector], moving: Sequence[Sequence[float]]) -> RotationMotion:
    """Return the rotation about two axes, one after the other, of these rates and accelerations.

    Both angles are 0 at time 0.
    """
    (a, b), t = (ca.SX(list(axis)) for axis in axes), TIME
    (rate, growth), (second_rate, second_growth) = moving[:2]
    alpha = rate * t + growth * t**2 / 2
    turned = ca.cos(alpha) * b + ca.sin(alpha) * ca.cross(a, b)
    omega = (rate + growth * t) * a + (second_rate + second_growth * t) * turned
    turns = tuple(Turn(ca.SX.eye(3)[:, i], omega[i], rate_of(omega[i])) for i in range(3))
    return RotationMotion(turns, axes=ca.horzcat(a, turned))


def _point_about(center: Expression, c: Expression, omega: Expression) -> PointMotion:
    """Return the motion, to second order, of a point that turns about a center from c at time 0."""
    arm, growth, t = c - center, rate_of(omega), TIME
    now = ca.substitute(omega, t, 0)
    bend = ca.cross(growth, arm) + ca.cross(now, ca.cross(now, arm))
    place = arm + ca.cross(now, arm) * t + bend * t**2 / 2
    acceleration = ca.cross(growth, place) + ca.cross(omega, ca.cross(omega, place))
    return PointMotion(center + place, ca.cross(omega, place), acceleration)


def faults(
    leg: LegKind, axis: Vector | None = None, seed: int = 0, *, tilts: bool = False
) -> tuple[str, ...]:
    """Return the faults of a leg against the protocol of legs, one line each; () if none.

    Parameters
    ----------
    leg : LegKind
        A leg of the kind, in numbers.
    axis : unit vector, optional
        Axis of a platform that turns against the leg; None for one that does not.
    seed : int
        Seed of the random motion.
    tilts : bool
        Whether the platform turns about any axis.

    Examples
    --------
    >>> import pteron
    >>> from pteron.legs.conformance import faults
    >>> faults(pteron.load("delta").legs[0])
    ()
    """
    axes: Sequence[Vector] = every_axis() if tilts else [axis] if axis is not None else []
    if protocol_breaches := breaches(leg, axes):
        return protocol_breaches
    at = _LegInMotion(leg, axes, seed)
    return (*_joint_faults(at), *_body_faults(at), *_force_faults(at), *_locus_faults(at))


def _joint_faults(at: _LegInMotion) -> Iterator[str]:
    """Yield the faults of joint rates, accelerations and Jacobian rows against derivatives."""
    motion = at.motion
    row = motion.row / motion.divisor
    pairs = {
        "rate: not the derivative of coordinate": (motion.rate, rate_of(motion.coordinate)),
        "acceleration: not the derivative of rate": (motion.acceleration, rate_of(motion.rate)),
        "row / divisor: its product with (c', omega) is not rate": (
            ca.mtimes(row, at.twist),
            motion.rate,
        ),
    }
    twist = ca.SX(6, 1)
    for k, joint in enumerate(motion.chain, start=1):
        prefix = f"joint {k} of the chain: "
        pairs[f"{prefix}row times (c', omega) is not rate"] = (
            ca.mtimes(joint.row, at.twist),
            joint.rate,
        )
        pairs[f"{prefix}acceleration is not the derivative of rate"] = (
            joint.acceleration,
            rate_of(joint.rate),
        )
        twist += joint.rate * _screw(joint.kind, joint.axis, joint.point, at.point.position)
    carried = "chain: the joints' screws times their rates do not add up to (c', omega)"
    pairs[carried] = twist, at.twist
    yield from mismatched_names(pairs)


def _screw(kind: str, axis: Expression, point: Expression, c: Expression) -> Expression:
    """Return velocity at c and angular velocity (6, 1) for a joint rate of 1."""
    if kind == "P":
        return ca.vertcat(axis, ca.SX(3, 1))
    return ca.vertcat(ca.cross(axis, c - point), axis)


def _body_faults(at: _LegInMotion) -> Iterator[str]:
    """Yield the faults of bodies' rows, accelerations and axes against exact derivatives."""
    for letter, body in at.motion.bodies.items():
        velocity = ca.mtimes(body.velocity_row, at.twist)
        turning = ca.mtimes(body.turning_row, at.twist)
        pairs = {
            "velocity_row: not the derivative of position": (velocity, rate_of(body.position)),
            "acceleration: not the derivative of its velocity": (
                body.acceleration,
                rate_of(velocity),
            ),
        }
        for name, axis, second in (("x", body.x, body.ddx), ("y", body.y, body.ddy)):
            if axis is not None:
                first = rate_of(axis)
                pairs[f"{name}: does not turn as turning_row says"] = (
                    first,
                    ca.cross(turning, axis),
                )
                pairs[f"dd{name}: not the second derivative of {name}"] = second, rate_of(first)
        yield from (f'body "{letter}": {fault}' for fault in mismatched_names(pairs))


def _force_faults(at: _LegInMotion) -> Iterator[str]:
    """Yield the faults of the leg's forces against its bodies' and of power against energy."""
    state = at.point, at.rotation, at.gravity, at.inertia
    needs, body_needs = at.equations.needs(*state), at.equations.needs_of_bodies(*state)
    point_needs = (
        needs.point + at.equations.point_mass_needs(at.point, at.gravity, needs.mass).point
    )
    joint_needs = (
        needs.joint + at.equations.point_mass_needs(at.point, at.gravity, needs.mass).joint
    )
    row = at.motion.row / at.motion.divisor
    energy = ca.SX(0)
    for letter, body in at.motion.bodies.items():
        moments = at.inertia[letter]
        energy += 0.5 * ca.bilin(mass_matrix(body, moments), at.twist, at.twist)
        energy -= ca.dot(at.gravity, mass_moment(body, moments))
    power = ca.dot(body_needs.point, at.twist)
    yield from mismatched_names(
        {
            "needs: not what its bodies need, body by body": (
                point_needs + ca.mtimes(row.T, joint_needs),
                body_needs.point,
            ),
            "bodies: the power of what they need is not the rate of their energy": (
                power,
                rate_of(energy),
            ),
        }
    )


def _locus_faults(at: _LegInMotion) -> Iterator[str]:
    """Yield a fault if the platform point c is not on the leg's locus at the joint coordinate."""
    locus, c = at.equations.locus(at.motion.coordinate), at.point.position
    if isinstance(locus, PlaneLocus):
        pair = ca.dot(locus.normal, c), locus.offset
    elif isinstance(locus, SphereLocus):
        pair = ca.norm_2(c - locus.center), locus.radius
    elif isinstance(locus, CoordinateLocus):
        pair = at.motion.coordinate, locus.joint
    elif isinstance(locus, CircleLocus):
        normal = ca.SX(list(at.leg.plane_normal or ()))
        pair = ca.norm_2(ca.cross(normal, c - locus.center)), locus.radius
    else:
        pair = at.rotation.angle, locus.angle
    yield from mismatched_names({"locus: c is not on it at the joint's coordinate": pair})
