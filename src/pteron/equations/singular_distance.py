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
    """Return the distance, m, under translation alone, and the angle, rad, of a turn alone.

    They are at most `FAR` and pi; a platform that does not turn has no angle. One that tilts turns
    about whichever axis brings it there soonest, of those about which its angles turn it.
    """
    state = machine.state(pose)
    measure = machine.closure.measure(state.platform, state.legs)
    slope = ca.gradient(measure, pose)
    lengths = machine.platform.directions.shape[1]
    along, about = slope[:lengths], slope[lengths:]
    found = {"metres": _first_order(measure, ca.dot(along, along), FAR)}
    if machine.closure.orientation is not None:
        a, b = machine.closure.orientation
        c, s = ca.cos(pose[-1]), ca.sin(pose[-1])
        found["radians"] = ca.atan2(ca.fabs(a * c + b * s), ca.fabs(b * c - a * s))
    elif about.numel():
        square = ca.dot(about, about)
        if about.numel() > 1:  # |omega|^2 is a form of the angles' rates
            turning = state.platform.twist_rows[3:, lengths:]
            form = ca.mtimes(turning.T, turning)
            square = ca.dot(about, ca.mtimes(ca.inv_minor(form), about))
        found["radians"] = _first_order(measure, square, math.pi)
    return found


def _first_order(measure: Expression, square: Expression, most: float) -> Expression:
    """Return |mu| over its slope, whose square is given: at most `most`."""
    size = ca.fabs(measure)
    # `fmin` of the quotient would take `most` for a quotient that is not a number.
    return size / ca.fmax(ca.sqrt(square + _TINY), size / most)
