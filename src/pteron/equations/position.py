"""The position problems: poses to slider coordinates and back, with every assembly mode."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.equations.circles import reach_margin, squared_reach
from pteron.equations.closure import closure, singularity
from pteron.equations.geometry import Expression, Geometry, along
from pteron.equations.legs import closing_vector, leg_position, slider_coordinate
from pteron.equations.platforms import PlatformMotion, platform_motion, resting_offset

_ROUNDING = 1e-14
"""What the closures' terms keep, relative to the largest of them."""


def platform_at(geometry: Geometry, pose: Expression) -> PlatformMotion:
    """Return the platform at rest in a pose."""
    rest = ca.SX.zeros(geometry.freedom)
    return platform_motion(geometry, pose, rest, rest)


def inverse_position(geometry: Geometry, pose: Expression) -> Expression:
    """Return the slider coordinates (n, 1), Eq. (4)."""
    points = platform_at(geometry, pose).points
    return ca.vertcat(
        *(
            slider_coordinate(leg, point.position)
            for leg, point in zip(geometry.legs, points, strict=True)
        )
    )


def links(geometry: Geometry, pose: Expression) -> tuple[Expression, Expression]:
    """Return l_u and l_l of every leg, each (n, 3): Eqs. (6) and (7)."""
    upper, lower = [], []
    for leg, point in zip(geometry.legs, platform_at(geometry, pose).points, strict=True):
        at = leg_position(leg, point.position)
        upper.append(ca.mtimes(leg.plane, at.l_u).T)
        lower.append(ca.mtimes(leg.plane, at.l_l).T)
    return ca.vertcat(*upper), ca.vertcat(*lower)


def reach(geometry: Geometry, pose: Expression) -> tuple[Expression, Expression, Expression]:
    """Return, for every leg (n, 1), n = |u|, its reach margin and the sine of its elbow's angle.

    n and the margin are in metres. The sine is sqrt(Delta) / (2 lu ll): 0 where the leg is
    stretched or folded (type I), NaN out of reach.
    """
    points = platform_at(geometry, pose).points
    distances, margins, sines = [], [], []
    for leg, point in zip(geometry.legs, points, strict=True):
        u = closing_vector(leg, point.position)
        distances.append(ca.sqrt(ca.dot(u, u)))
        margins.append(reach_margin(leg, u))
        sines.append(ca.sqrt(squared_reach(leg, u)) / (2 * leg.lu * leg.ll))
    return ca.vertcat(*distances), ca.vertcat(*margins), ca.vertcat(*sines)


def direct_position(geometry: Geometry, sliders: Expression, *, reached: bool = True) -> Expression:
    """Return every pose that the slider coordinates allow, as columns (m, k).

    The closures d_bar . (p + R(phi) s0 - r) = rho are linear in (p, cos phi, sin phi). For 3T they
    give one pose. For 3T1R their left null vector leaves A' cos(phi) + B' sin(phi) = C, with two
    angles: the first column has N . j > 0, the second N . j < 0 (see `closure`), so that each
    column is one assembly mode throughout. NaN where it is not real, C^2 > A'^2 + B'^2, or, with
    `reached`, where a leg does not reach it.
    """
    c = closure(geometry)
    known = ca.vertcat(
        *(
            rho + ca.dot(leg.d_bar, leg.r - _constant_offset(geometry, i))
            for i, (leg, rho) in enumerate(zip(geometry.legs, ca.vertsplit(sliders), strict=True))
        )
    )
    if c.null is None:
        p = ca.mtimes(c.right_inverse.T, known)
        return p + _nan_beyond_reach(geometry, p, 1, 0) if reached else p
    # The derivative of d_bar . s with respect to phi is j, so that d_bar . s itself is
    # cosines sin(phi) - sines cos(phi); hence A' = -B and B' = A of `singularity`.
    a, b = singularity(geometry)
    total = ca.dot(c.null, known)
    square = a * a + b * b
    # At a singular orientation both poses meet and the radicand is all rounding: what is barely
    # below zero counts as zero, an error of 1e-7 rad there. N . known cancels the sizes of guides
    # and sliders, but not their rounding.
    size = ca.dot(ca.fabs(c.null), _sizes(geometry, sliders))
    rest = square - total * total
    slack = _ROUNDING * (square + ca.sqrt(square) * size)
    radicand = ca.fmax(rest, ca.fmin(rest + slack, 0))
    root = ca.sqrt(radicand)
    poses = []
    for branch in (1, -1):
        cosine = (-b * total + branch * a * root) / square
        sine = (a * total + branch * b * root) / square
        offset = c.cosines * sine - c.sines * cosine
        p = ca.mtimes(c.right_inverse.T, known - offset)
        beyond = _nan_below_zero(radicand)
        if reached:
            beyond = beyond + _nan_beyond_reach(geometry, p, cosine, sine)
        poses.append(ca.vertcat(p, ca.atan2(sine, cosine)) + beyond)
    return ca.horzcat(*poses)


def beyond_reach(geometry: Geometry, points: Sequence[Expression]) -> Expression:
    """Return, for every leg (n, 1), NaN where its links do not reach its point, 0 where they do."""
    pairs = zip(geometry.legs, points, strict=True)
    return ca.vertcat(
        *(_nan_below_zero(squared_reach(leg, closing_vector(leg, point))) for leg, point in pairs)
    )


def _nan_beyond_reach(
    geometry: Geometry, p: Expression, cosine: Expression, sine: Expression
) -> Expression:
    """Return NaN where a leg does not reach the pose, given by cos(phi) and sin(phi); else 0."""
    points = []
    for i in range(geometry.freedom):
        a, b, constant = resting_offset(geometry, i)
        offset = along(a, cosine) + along(b, sine) if geometry.turns else a
        points.append(p + offset + constant)
    return ca.sum1(beyond_reach(geometry, points))


def _nan_below_zero(value: Expression) -> Expression:
    return ca.if_else(value < 0, ca.SX.nan(), 0)


def _sizes(geometry: Geometry, sliders: Expression) -> Expression:
    """Return the sizes (n, 1) of the terms that each closure's known side adds up."""
    bars, guides = (
        ca.horzcat(*(ca.fabs(vector) for vector in vectors))
        for vectors in zip(*((leg.d_bar, leg.r) for leg in geometry.legs), strict=True)
    )
    return ca.fabs(sliders) + ca.sum1(bars * guides).T


def _constant_offset(geometry: Geometry, i: int) -> Expression:
    a, _, constant = resting_offset(geometry, i)
    return constant if geometry.turns else a + constant
