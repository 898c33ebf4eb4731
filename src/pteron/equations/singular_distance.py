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
    """Return the distance, m, under translation alone, and the angle, rad, of the last angle alone.

    They are at most `FAR` and pi; a platform that does not turn has no angle.
    """
    state = machine.state(pose)
    measure = machine.closure.measure(state.platform, state.legs)
    slope = ca.gradient(measure, pose)
    lengths = machine.platform.directions.shape[1]
    found = {"metres": _first_order(measure, slope[:lengths], FAR)}
    if machine.closure.orientation is not None:
        a, b = machine.closure.orientation
        c, s = ca.cos(pose[-1]), ca.sin(pose[-1])
        found["radians"] = ca.atan2(ca.fabs(a * c + b * s), ca.fabs(b * c - a * s))
    elif lengths < machine.freedom:
        found["radians"] = _first_order(measure, slope[-1], math.pi)
    return found


def _first_order(measure: Expression, slope: Expression, most: float) -> Expression:
    """Return |mu| over its slope, with a least slope that makes the distance `most` at most."""
    least = measure / most
    return ca.fabs(measure) / ca.sqrt(ca.dot(slope, slope) + least * least + _TINY)
