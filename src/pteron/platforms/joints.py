"""A platform's motion as a chain of virtual joints, slides then turns, for exports."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.platforms.platform import Platform

Array = NDArray[np.float64]


class PlatformJoint(NamedTuple):
    """A virtual joint of the chain from the base to the platform."""

    name: str
    """Name of its coordinate: one of the pose's, or a dependent one."""
    is_prismatic: bool
    axis: Array
    """Unit vector (3,) where all coordinates are zero; joints before it move it."""
    values: Array
    """Its coordinate (...) at the poses, m or rad."""


def platform_joints(platform: Platform, poses: Array) -> list[PlatformJoint]:
    """Return the joints, with axis and values, that together move as the platform does.

    A tripod's joints include x, y and yaw, which depend on its pose.
    """
    kind = platform.kind
    x0, y0, k = (np.array(axis) for axis in platform.frame)
    axes = {"x": x0, "y": y0, "z": k} | platform.axes_by_angle
    names = kind.joints or platform.coordinates
    axes |= dict(zip(platform.lengths, platform.directions, strict=True))
    by_name = {name: poses[..., i] for i, name in enumerate(platform.coordinates)}
    if len(names) > len(by_name):
        p, axes_now = platform.placement(poses)
        x_direction = axes_now[..., 0, :] * np.sign(np.cos(by_name["pitch"]))[..., None]
        dependent = {
            "x": p @ x0,
            "y": p @ y0,
            "yaw": np.arctan2(x_direction @ y0, x_direction @ x0),
        }
        by_name = dependent | by_name
    return [
        PlatformJoint(name, name in ("x", "y", "z"), axes[name], by_name[name]) for name in names
    ]
