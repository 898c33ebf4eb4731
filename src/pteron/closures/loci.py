"""Meeting points of planes and spheres in space, of circles and lines in a plane: closed forms."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import nan_below_zero
from pteron.closures.determinants import adjugate
from pteron.legs.circles import quarter_turn
from pteron.legs.leg import AngleLocus, CoordinateLocus, Locus, PlaneLocus, SphereLocus
from pteron.platforms.motion import PlatformEquations

_ROUNDING = 1e-14
"""Share of the sum of two squares up to which a difference below zero counts as rounding."""


def shift_locus(locus: Locus, offset: Expression) -> Locus:
    """Return the locus of P, given the locus of the point P + offset."""
    assert not isinstance(locus, AngleLocus | CoordinateLocus)
    if isinstance(locus, PlaneLocus):
        return locus._replace(offset=locus.offset - ca.dot(locus.normal, offset))
    return locus._replace(center=locus.center - offset)


def meeting_points(
    loci: Sequence[Locus], platform: PlatformEquations
) -> tuple[Expression, Expression]:
    """Return the points, as columns, in which loci meet, and the validity (0, else NaN).

    There are as many loci as the platform has lengths. There are two points, mirrored in a plane or
    a line, or one if all loci are planes. If the points are not real, they are NaN, and so is the
    validity.
    """
    if platform.directions.shape[1] == 2:
        return _meeting_in_plane(loci, platform)
    return _meeting_in_space(loci)


def _meeting_in_space(loci: Sequence[Locus]) -> tuple[Expression, Expression]:
    """Return the common points (3, 1 or 2) of three planes or spheres, and their validity."""
    spheres = [locus for locus in loci if isinstance(locus, SphereLocus)]
    planes = [(locus.normal, locus.offset) for locus in loci if isinstance(locus, PlaneLocus)]
    if not spheres:
        normals, offsets = (ca.horzcat(*parts) for parts in zip(*planes, strict=True))
        adj = adjugate(normals.T)
        point = ca.mtimes(adj, offsets.T) / ca.mtimes(normals[:, 0].T, adj[:, 0])
        return point, ca.SX(0)
    first, *others = spheres
    # Two planes n . (p - o) = h, o being the centre of the first sphere.
    planes = [(normal, offset - ca.dot(normal, first.center)) for normal, offset in planes]
    for sphere in others:
        displacement = sphere.center - first.center
        gap = first.radius * first.radius - sphere.radius * sphere.radius
        planes.append((displacement, 0.5 * (gap + ca.dot(displacement, displacement))))
    (n1, h1), (n2, h2) = planes
    line_direction = ca.cross(n1, n2)
    square = ca.dot(line_direction, line_direction)
    foot = (h1 * ca.cross(n2, line_direction) + h2 * ca.cross(line_direction, n1)) / square
    share, validity = _half_chord(first.radius * first.radius, ca.dot(foot, foot), square)
    return _mirrored_points(first.center + foot, share * line_direction, validity)


def _meeting_in_plane(
    loci: Sequence[Locus], platform: PlatformEquations
) -> tuple[Expression, Expression]:
    """Return the common points (2, 2) of two circles or lines in a plane, and their validity."""
    circles, lines = [], []
    for locus in loci:
        assert not isinstance(locus, AngleLocus | CoordinateLocus)
        if isinstance(locus, PlaneLocus):
            lines.append((ca.mtimes(platform.directions.T, locus.normal), locus.offset))
            continue
        square = locus.radius * locus.radius
        if isinstance(locus, SphereLocus):  # which the plane cuts in a circle
            square = square - ca.dot(platform.frame[2], locus.center) ** 2
        circles.append((ca.mtimes(platform.directions.T, locus.center), square))
    # A line n . (p - o) = h, o being the centre of the first circle.
    (first, square), *others = circles
    lines = [(normal, offset - ca.dot(normal, first)) for normal, offset in lines]
    for center, other in others:
        displacement = center - first
        lines.append((displacement, 0.5 * (square - other + ca.dot(displacement, displacement))))
    ((normal, height),) = lines
    n2 = ca.dot(normal, normal)
    foot = (height / n2) * normal
    share, validity = _half_chord(square, ca.dot(foot, foot), n2)
    return _mirrored_points(first + foot, share * quarter_turn(normal), validity)


def _mirrored_points(
    middle: Expression, step: Expression, validity: Expression
) -> tuple[Expression, Expression]:
    """Return middle -+ step as columns, NaN if invalid, and the validity (0 or NaN)."""
    return ca.horzcat(*(middle + side * step + validity for side in (-1, 1))), validity


def _half_chord(
    radius2: Expression, distance2: Expression, square: Expression
) -> tuple[Expression, Expression]:
    """Return half a chord over sqrt(square), and the validity (0, NaN if there is no chord)."""
    # Where both points meet the radicand is all rounding: barely below zero counts as zero.
    square_difference = radius2 - distance2
    radicand = ca.fmax(
        square_difference, ca.fmin(square_difference + _ROUNDING * (radius2 + distance2), 0)
    )
    return ca.sqrt(radicand / square), nan_below_zero(radicand)
