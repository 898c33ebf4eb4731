"""Motion of the tool's centre point from that of the platform, and the inverse."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array
from pteron.platforms import Platform

Curve = tuple[Array, Array, Array]
"""Poses (..., m), and their first and second derivatives by a parameter."""


def tool_motion(platform: Platform, pose: Array, first: Array, second: Array) -> Curve:
    """Return poses (..., m) whose lengths are the tool's place instead of P's, and two derivatives.

    If the platform turns about its axis alone, the constant part of the vector from P to the tool
    along that axis is left out. The pose is unchanged for a platform whose lengths cannot move the
    tool to any place, such as a tripod.
    """
    return _shift_curve(platform, (pose, first, second), 1.0)


def pose_motion(platform: Platform, place: Array, first: Array, second: Array) -> Curve:
    """Return poses of P from those of the tool, and two derivatives: inverse of `tool_motion`."""
    return _shift_curve(platform, (place, first, second), -1.0)


def tool_path(platform: Platform, pose: Array, first: Array, second: Array) -> Curve:
    """Return the tool's position (..., k) and two derivatives; k = 3 where the platform tilts.

    If the platform does not tilt, k is the number of the pose's lengths, and the columns are those
    of `tool_motion`.
    """
    if platform.tilts:
        return platform.tool_motion(pose, first, second)
    lengths = ~platform.angular
    place, velocity, acceleration = tool_motion(platform, pose, first, second)
    return place[..., lengths], velocity[..., lengths], acceleration[..., lengths]


def _shift_curve(platform: Platform, curve: Curve, side: float) -> Curve:
    """Return a curve shifted by the tool's arm: to the tool with `side` 1, back to P with -1."""
    turning = [
        part for axis, part in zip("xyz", platform.tool, strict=True) if axis in platform.arm_axes
    ]
    if not carries(platform) or not any(turning):
        return curve
    angular = platform.angular
    shifted = tuple(part.copy() for part in curve)
    angles = tuple(part[..., angular] for part in curve)
    for part, arm in zip(shifted, arm_motion(platform, *angles), strict=True):
        part[..., ~angular] += side * arm
    return shifted[0], shifted[1], shifted[2]


def carries(platform: Platform) -> bool:
    """Return whether the platform's lengths can move the tool to any place as its angles change."""
    return bool(platform.angles) and set(platform.arm_axes) <= set(platform.lengths)


def arm_motion(platform: Platform, angles: Array, rates: Array, growths: Array) -> Curve:
    """Return the part of the vector from P to the tool that turns (..., k), and two derivatives.

    The k components are along the pose's lengths; `angles`, `rates` and `growths` (second
    derivatives) are (..., j). The platform must be one that `carries` its tool.
    """
    if platform.axis_angle is None:
        state = (_pose_of_angles(platform, part) for part in (angles, rates, growths))
        return platform.tool_motion(*state)
    x, y = (platform.directions @ axis for axis in platform.frame[:2])
    a, b = (
        platform.tool[0] * x + platform.tool[1] * y,
        platform.tool[0] * y - platform.tool[1] * x,
    )
    cos, sin = np.cos(angles), np.sin(angles)
    arm, lever = cos * a + sin * b, cos * b - sin * a
    return arm, rates * lever, growths * lever - rates**2 * arm


def _pose_of_angles(platform: Platform, angles: Array) -> Array:
    """Return poses (..., m) with the platform's angles (..., a) and zeros for lengths."""
    pose = np.zeros((*angles.shape[:-1], len(platform.coordinates)))
    pose[..., platform.angular] = angles
    return pose
