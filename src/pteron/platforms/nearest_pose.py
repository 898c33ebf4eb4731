"""The pose nearest to a position of the reference point P and a rotation, of any kind of platform.

A rotation (..., 3, 3) takes vectors of the platform's frame to the base frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.platforms.platform import Platform

Array = NDArray[np.float64]

_TURN_STEPS = 30
"""Maximum number of Gauss-Newton steps."""

_TURN_APART = 1e-6
"""Step of the central differences, rad."""

_TURN_MOST = 0.5
"""Longest step of an angle, rad."""

_TURN_ROUNDING = 1e-9
"""Step at which the iteration ends, rad."""

_SINGULAR = 1e-12
"""Cosine of the middle angle below which the pose's angles count as singular."""


def nearest_pose(platform: Platform, position: Array, rotation: Array) -> Array:
    """Return the pose (..., m) nearest to a position of P (..., 3) and a rotation (..., 3, 3).

    If the platform can have both, the pose is exact. Roll, or rz, is 0 where the angles are
    singular.
    """
    named = dict(zip(platform.angles, _angles(platform, rotation), strict=True))
    lengths = np.moveaxis(position @ platform.directions.T, -1, 0)
    named |= dict(zip(platform.lengths, lengths, strict=True))
    parts = np.broadcast_arrays(*(named[name] for name in platform.coordinates))
    return np.stack(parts, axis=-1)


def pose_nearest_frame(platform: Platform, pose: Array, axes: Array) -> Array:
    """Return the pose (m,) near `pose` whose platform axes are nearest to `axes` (3, 3).

    `axes` (3, 3) are one a row, and need not be feasible for the platform; the sum of squared
    differences is minimised by the Gauss-Newton method; a single angle aligns the x axes.
    """
    nearest, turns = np.array(pose, dtype=float), np.flatnonzero(platform.angular)
    if platform.axis_angle is not None:
        x, y, _ = np.array(platform.frame) @ axes[0]
        difference = float(np.arctan2(y, x)) - nearest[turns]
        nearest[turns] += (difference + np.pi) % (2.0 * np.pi) - np.pi
        return nearest
    for _ in range(_TURN_STEPS):
        offsets = np.eye(len(nearest))[turns] * _TURN_APART
        ahead, behind = (
            platform.placement(nearest + side * offsets)[1].reshape(-1, 9) for side in (1.0, -1.0)
        )
        slopes = (ahead - behind).T / (2.0 * _TURN_APART)
        misfit = (axes - platform.placement(nearest)[1]).ravel()
        step = np.linalg.lstsq(slopes, misfit, rcond=None)[0]
        nearest[turns] += np.clip(step, -_TURN_MOST, _TURN_MOST)
        if np.abs(step).max(initial=0.0) < _TURN_ROUNDING:
            break
    return nearest


def _angles(platform: Platform, rotation: Array) -> tuple[Array, ...]:
    """Return the platform's angles (...) for a rotation, rad, in the pose's order."""
    if not platform.angles:
        return ()
    if platform.second_axis is not None:
        return _universal_angles(np.array(platform.axis), np.array(platform.second_axis), rotation)
    turned = np.array(platform.frame) @ rotation
    if not platform.tilts:
        return (np.arctan2(turned[..., 1, 0], turned[..., 0, 0]),)
    if platform.angle_order == "xyz":
        # Rx(rx) Ry(ry) Rz(rz) is the transpose of Rz(-rz) Ry(-ry) Rx(-rx).
        x, y, z = _roll_pitch_yaw(np.swapaxes(turned, -1, -2))
        return -x, -y, -z
    roll, pitch, yaw = _roll_pitch_yaw(turned)
    return (roll, pitch, yaw)[: len(platform.angles)]


def _roll_pitch_yaw(matrix: Array) -> tuple[Array, Array, Array]:
    """Return roll, pitch and yaw, rad, of matrices Rz(yaw) Ry(pitch) Rx(roll)."""
    cosine = np.hypot(matrix[..., 0, 0], matrix[..., 1, 0])
    pitch = np.arctan2(-matrix[..., 2, 0], cosine)
    is_singular = cosine < _SINGULAR
    roll = np.where(is_singular, 0.0, np.arctan2(matrix[..., 2, 1], matrix[..., 2, 2]))
    yaw = np.where(
        is_singular,
        np.arctan2(-matrix[..., 0, 1], matrix[..., 1, 1]),
        np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0]),
    )
    return roll, pitch, yaw


def _universal_angles(first: Array, second: Array, rotation: Array) -> tuple[Array, Array]:
    """Return the angles (alpha, beta), rad, of rotations Rot(first, alpha) Rot(second, beta)."""
    alpha = _angle_about(first, second, rotation @ second)
    # In the base frame the second axis is R b, and its normal turns about it by beta.
    second_now = rotation @ second
    normal = np.cross(first, second)
    normal_after_alpha = _rotate(first, alpha, normal)
    return alpha, _angle_about(second_now, normal_after_alpha, rotation @ normal)


def _angle_about(axis: Array, start: Array, end: Array) -> Array:
    """Return the angle (...), rad, about `axis` that takes `start` to `end`, both normal to it."""
    sine = (axis * np.cross(start, end)).sum(axis=-1)
    cosine = (start * end).sum(axis=-1) - (axis * start).sum(axis=-1) * (axis * end).sum(axis=-1)
    return np.asarray(np.arctan2(sine, cosine))


def _rotate(axis: Array, angle: Array, vector: Array) -> Array:
    """Return a vector (3,) normal to an axis (3,), rotated about it by angles (...), rad."""
    cosine, sine = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return np.asarray(cosine * vector + sine * np.cross(axis, vector))
