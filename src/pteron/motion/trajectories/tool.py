"""Motion of the tool's centre point from that of the platform, and the other way round."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array
from pteron.platforms import Platform

Curve = tuple[Array, Array, Array]
"""Poses (..., m), and their first and second derivatives by a parameter."""


def tool_motion(platform: Platform, pose: Array, first: Array, second: Array) -> Curve:
    """Return the tool's place along the pose's lengths, with its angles, and two derivatives.

    The part from P to the tool along the platform's axis, which is constant, is left out.
    """
    return _moved(platform, (pose, first, second), 1.0)


def pose_motion(platform: Platform, place: Array, first: Array, second: Array) -> Curve:
    """Return the poses from the motion of the tool: the inverse of `tool_motion`."""
    return _moved(platform, (place, first, second), -1.0)


def _moved(platform: Platform, curve: Curve, side: float) -> Curve:
    if not platform.angles or not any(platform.tool[:2]):
        return curve
    place, velocity, acceleration = (part.copy() for part in curve)
    angular = platform.angular
    rate, growth = velocity[..., angular], acceleration[..., angular]
    # The arm from P to the tool turns in part with the platform.
    arm, lever = turning_arm(platform, place[..., angular])
    place[..., ~angular] += side * arm
    velocity[..., ~angular] += side * rate * lever
    acceleration[..., ~angular] += side * (growth * lever - rate**2 * arm)
    return place, velocity, acceleration


def turning_arm(platform: Platform, angle: Array) -> tuple[Array, Array]:
    """Return the arm from P to the tool that turns, at angles (..., 1), and its derivative."""
    x, y = (platform.directions @ axis for axis in platform.frame[:2])
    a, b = (
        platform.tool[0] * x + platform.tool[1] * y,
        platform.tool[0] * y - platform.tool[1] * x,
    )
    cos, sin = np.cos(angle), np.sin(angle)
    return cos * a + sin * b, cos * b - sin * a
