"""A machine's joint points with their difference from another machine's enlarged, for drawings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pteron.kernels import Array
from pteron.motion.joint_points import Guide, JointPoints, Part


def enlarged_points(points: JointPoints, other: JointPoints, times: float) -> JointPoints:
    """Return joint points moved by `times` their difference from another machine's points.

    With `times` = 1 they are the other machine's points.
    """
    other_corners = np.vstack([part.corners for part in other.parts])
    return replace(
        points,
        links=tuple(
            _shift_points(line, there, times)
            for line, there in zip(points.links, other.links, strict=True)
        ),
        parts=tuple(
            Part(
                part.hub,
                _shift_points(part.corners, other_corners, times)
                if len(other_corners)
                else part.corners,
            )
            for part in points.parts
        ),
        tool=points.tool + times * (other.tool - points.tool),
    )


def enlarged_guides(
    guides: Sequence[Guide], others: Sequence[Guide], times: float
) -> tuple[Guide, ...]:
    """Return guides moved by `times` their difference from another machine's guides."""
    return tuple(
        replace(guide, path=guide.path + times * (other.path - guide.path))
        for guide, other in zip(guides, others, strict=True)
    )


def greatest_difference(points: JointPoints, other: JointPoints) -> float:
    """Return the greatest distance, m, between corresponding joints of two machines at a pose."""
    moved = enlarged_points(points, other, 1.0)
    return max(
        float(np.linalg.norm(there - line, axis=-1).max())
        for line, there in zip(points.links, moved.links, strict=True)
    )


def _shift_points(points: Array, others: Array, times: float) -> Array:
    """Return points (K, 3) moved by `times` the way to the nearest or same of `others`."""
    # Joints that coincide in one machine may be two in the other: the nearest is the same one.
    if len(points) == len(others):
        nearest = others
    else:
        nearest = others[np.linalg.norm(points[:, None] - others, axis=-1).argmin(axis=1)]
    return np.asarray(points + times * (nearest - points))
