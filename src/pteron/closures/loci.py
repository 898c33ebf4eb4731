"""Meeting points of planes and spheres in space, of circles and lines in a plane: closed forms."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import nan_below_zero
from pteron.closures.determinants import adjugate
from pteron.legs.circles import quarter_turn
from pteron.legs.leg import Locus, Plane, Sphere, Turned
from pteron.platforms.motion import PlatformEquations

_ROUNDING = 1e-14
"""Share of the sum of two squares up to which a difference below zero counts as rounding."""


def moved(locus: Locus, offset: Expression) -> Locus:
    """Return the locus of the platform's point P from that of P + offset."""
    assert not isinstance(locus, Turned)
    if isinstance(locus, Plane):
        return locus._replace(offset=locus.offset - ca.dot(locus.normal, offset))
    return locus._replace(center=locus.center - offset)


def meeting_points(
    loci: Sequence[Locus], platform: PlatformEquations
) -> tuple[Expression, Expression]:
    """Return the points, as columns, in which as many loci meet as the platform has lengths.

    They are two, mirrored in a plane or a line; planes alone meet in one. Where they are not real
    they are NaN, and so is the number returned beside them, which else is 0.
    """
    if platform.directions.shape[1] == 2:
        return _meeting_in_plane(loci, platform)
    return _meeting_in_space(loci)


def _meeting_in_space(loci: Sequence[Locus]) -> tuple[Expression, Expression]:
    spheres = [locus for locus in loci if isinstance(locus, Sphere)]
    planes = [(locus.normal, locus.offset) for locus in loci if isinstance(locus, Plane)]
    if not spheres:
        normals, offsets = (ca.horzcat(*parts) for parts in zip(*planes, strict=True))
        across = adjugate(normals.T)
        point = ca.mtimes(across, offsets.T) / ca.mtimes(normals[:, 0].T, across[:, 0])
        return point, ca.SX(0)
    first, *others = spheres
    # Two planes n . (p - o) = h, o being the centre of the first sphere.
    planes = [(normal, offset - ca.dot(normal, first.center)) for normal, offset in planes]
    for sphere in others:
        apart = sphere.center - first.center
        gap = first.radius * first.radius - sphere.radius * sphere.radius
        planes.append((apart, 0.5 * (gap + ca.dot(apart, apart))))
    (n1, h1), (n2, h2) = planes
    along = ca.cross(n1, n2)
    square = ca.dot(along, along)
    foot = (h1 * ca.cross(n2, along) + h2 * ca.cross(along, n1)) / square
    share, beyond = _half_chord(first.radius * first.radius, ca.dot(foot, foot), square)
    return _both_sides(first.center + foot, share * along, beyond)


def _meeting_in_plane(
    loci: Sequence[Locus], platform: PlatformEquations
) -> tuple[Expression, Expression]:
    circles, lines = [], []
    for locus in loci:
        assert not isinstance(locus, Turned)
        if isinstance(locus, Plane):
            lines.append((ca.mtimes(platform.directions.T, locus.normal), locus.offset))
            continue
        square = locus.radius * locus.radius
        if isinstance(locus, Sphere):  # which the plane cuts in a circle
            square = square - ca.dot(platform.frame[2], locus.center) ** 2
        circles.append((ca.mtimes(platform.directions.T, locus.center), square))
    # A line n . (p - o) = h, o being the centre of the first circle.
    (first, square), *others = circles
    lines = [(normal, offset - ca.dot(normal, first)) for normal, offset in lines]
    for center, other in others:
        apart = center - first
        lines.append((apart, 0.5 * (square - other + ca.dot(apart, apart))))
    ((normal, height),) = lines
    n2 = ca.dot(normal, normal)
    foot = (height / n2) * normal
    share, beyond = _half_chord(square, ca.dot(foot, foot), n2)
    return _both_sides(first + foot, share * quarter_turn(normal), beyond)


def _both_sides(
    middle: Expression, step: Expression, beyond: Expression
) -> tuple[Expression, Expression]:
    return ca.horzcat(*(middle + side * step + beyond for side in (-1, 1))), beyond


def _half_chord(
    radius2: Expression, distance2: Expression, square: Expression
) -> tuple[Expression, Expression]:
    """Return half a chord over the length of a vector of this square; and NaN if it is not real."""
    # Where both points meet the radicand is all rounding: barely below zero counts as zero.
    rest = radius2 - distance2
    radicand = ca.fmax(rest, ca.fmin(rest + _ROUNDING * (radius2 + distance2), 0))
    return ca.sqrt(radicand / square), nan_below_zero(radicand)
