"""Distances from a pose to type-II singularities, to first order, or in closed form for an angle.

The nearest zero of the type-II measure mu is |mu| / |d mu / dx| away, to first order: the nearer,
the more exactly. Where det J is a multiple of A cos(phi) + B sin(phi) the angle is exact.
"""

from __future__ import annotations

import math

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.kinematics import FAR
from pteron.equations.machine import Machine

_TINY = 1e-30
"""Added to a squared slope, against 0/0 where measure and slope are both zero."""


def type_ii_distances(machine: Machine, pose: Expression) -> dict[str, Expression]:
    """Return first-order distance to type II: by translation alone, m; by rotation alone, rad.

    The values are at most `FAR` and pi; there is no angle for a platform that does not turn. If the
    platform tilts, the angle is the least over all rotation axes that its angles span.
    """
    state = machine.state(pose)
    measure = machine.closure.measure(state.platform, state.legs)
    slope = ca.gradient(measure, pose)
    lengths = machine.platform.directions.shape[1]
    translation_slope, rotation_slope = slope[:lengths], slope[lengths:]
    distances = {"metres": _first_order(measure, ca.dot(translation_slope, translation_slope), FAR)}
    if machine.closure.orientation is not None:
        a, b = machine.closure.orientation
        c, s = ca.cos(pose[-1]), ca.sin(pose[-1])
        distances["radians"] = ca.atan2(ca.fabs(a * c + b * s), ca.fabs(b * c - a * s))
    elif rotation_slope.numel():
        square = ca.dot(rotation_slope, rotation_slope)
        if rotation_slope.numel() > 1:  # |omega|^2 is a form of the angles' rates
            turning = state.platform.twist_rows[3:, lengths:]
            form = ca.mtimes(turning.T, turning)
            square = ca.dot(rotation_slope, ca.mtimes(ca.inv_minor(form), rotation_slope))
        distances["radians"] = _first_order(measure, square, math.pi)
    return distances


def _first_order(measure: Expression, square: Expression, most: float) -> Expression:
    """Return min(|measure| / slope, most), given the slope's square."""
    size = ca.fabs(measure)
    # `fmin` of the quotient would return `most` for a quotient that is NaN.
    return size / ca.fmax(ca.sqrt(square + _TINY), size / most)
