"""Ratios between a motor and its joint that the motor's limits allow, and its torque at a ratio.

A motor of rotor inertia J behind a ratio i, motor angle over the joint's coordinate q, has the
torque T = f / i + J i q''. What the joint needs without the motor, f, does not depend on the ratio,
for friction is the joint's. So every answer here is in closed form.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pteron.motion.sizing.drive_loads import Sizing, mean_squares
from pteron.renamed import former_attribute


class Span(NamedTuple):
    """Ratios from the least to the greatest, rad/m or rad/rad; none where least > greatest."""

    least: float
    greatest: float

    def __bool__(self) -> bool:
        """Return whether the span of gear ratios is not empty."""
        return self.least <= self.greatest

    def __contains__(self, ratio: object) -> bool:
        """Return whether a gear ratio lies in the span."""
        return isinstance(ratio, float) and self.least <= ratio <= self.greatest

    def intersect(self, other: Span) -> Span:
        """Return the intersection of two spans of gear ratios."""
        return Span(max(self.least, other.least), min(self.greatest, other.greatest))


Span.within = former_attribute("within", "intersect")  # type: ignore[attr-defined]


NONE = Span(math.inf, 0.0)
"""No ratio."""


def torques(sizing: Sizing, leg: int, ratio: float, rotor_inertia: float) -> tuple[float, float]:
    """Return root mean square and peak torque, N m, of a motor over the cycle at a gear ratio.

    The ratio is in rad/m or rad/rad, `rotor_inertia` in kg m^2.
    """
    rms = math.sqrt(float(mean_squares(sizing, leg, ratio, rotor_inertia).max()))
    loads, accelerations = sizing.loads[..., leg - 1], sizing.accelerations[..., leg - 1]
    peak = np.abs(loads / ratio + rotor_inertia * ratio * accelerations).max()
    return rms, float(peak)


def speed_span(sizing: Sizing, leg: int, max_speed: float) -> Span:
    """Return the span of gear ratios at which a motor is no faster than `max_speed`, rad/s."""
    fastest = float(sizing.peak_speeds[leg - 1])
    return Span(0.0, max_speed / fastest if fastest else math.inf)


def rated_span(sizing: Sizing, leg: int, rotor_inertia: float, rated_torque: float) -> Span:
    """Return the span of gear ratios at which the rms torque is at most `rated_torque`, N m."""
    force, mixed, acceleration = sizing.squares(leg)
    # C u^2 - B u + A <= 0 with u = i^2.
    a, b, c = force, rated_torque**2 - 2.0 * rotor_inertia * mixed, rotor_inertia**2 * acceleration
    inside = b * b - 4.0 * a * c
    if ((b < 0.0) | (inside < 0.0) | ((b == 0.0) & (a > 0.0))).any():
        return NONE
    root = b + np.sqrt(inside)
    least = np.sqrt(2.0 * a[a > 0.0] / root[a > 0.0])
    greatest = np.sqrt(root[c > 0.0] / (2.0 * c[c > 0.0]))
    return Span(float(least.max(initial=0.0)), float(greatest.min(initial=math.inf)))


def peak_span(sizing: Sizing, leg: int, rotor_inertia: float, peak_torque: float) -> Span:
    """Return the span of gear ratios at which the torque never exceeds `peak_torque`, N m.

    At each sample |f / i + J i q''| <= T holds for ratios i between the roots of two parabolas,
    which is an interval.
    """
    loads, accelerations = sizing.loads[..., leg - 1], sizing.accelerations[..., leg - 1]
    rotor_loads = rotor_inertia * accelerations
    inside = peak_torque**2 - 4.0 * loads * rotor_loads
    if (inside < 0.0).any():
        return NONE
    root = peak_torque + np.sqrt(inside)
    least = 2.0 * np.abs(loads) / root
    moving = np.abs(rotor_loads) > 0.0
    greatest = root[moving] / (2.0 * np.abs(rotor_loads[moving]))
    return Span(float(least.max()), float(greatest.min(initial=math.inf)))
