"""A proved box about all positions in reach, from bounds on each leg's reach."""

from __future__ import annotations

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator

_WIDER = 1e-9
"""Share of its size by which the box is widened: far more than rounding."""

_SINGULAR = 1e-9
"""Share of the largest eigenvalue below which nothing bounds a direction: then there is no box."""


def enclosing_box(robot: Manipulator, low: Array, high: Array, *, limits: bool = True) -> Array:
    """Return a box (2, k) of positions P that holds all in reach between two orientations.

    Each leg keeps its platform point within R_j of a point, or of its guide's line: |A_j (P - p_j)|
    <= R_j. So sum |A_j (P - p_j)|^2 <= sum R_j^2, an ellipsoid, whose box is known in closed form.

    Of the two poses (m,) the angles count. Without `limits` no pose beyond a joint's limits is left
    out.
    """
    directions = robot.platform.directions
    size = len(directions)
    # The platform points at the middle of the interval, and how far they are from there at most.
    middle = 0.5 * (low + high)
    half = 0.5 * float((high - low)[robot.platform.angular].sum())
    if robot.platform.rotation_axes:  # a turned point is within twice its distance from the center
        half = min(half, 2.0)
    points = np.array([leg.platform_point for leg in robot.legs])
    arms = robot.platform.arms(points, middle)
    slacks = np.linalg.norm(points, axis=1) * half
    normal, right, constant, square = np.zeros((size, size)), np.zeros(size), 0.0, 0.0
    for leg, arm, slack in zip(robot.legs, arms, slacks, strict=True):
        bound = leg.held_bound if limits else leg.reach_bound
        if bound is None:
            continue
        offset = directions @ (np.array(bound.point) - np.array(leg.fixed_offset) - arm)
        projection = np.eye(size)
        if bound.line is not None:
            line = directions @ np.array(bound.line)
            if np.linalg.norm(line) > _SINGULAR:
                line = line / np.linalg.norm(line)
                projection = projection - np.outer(line, line)
        normal += projection
        right += projection @ offset
        constant += float(offset @ projection @ offset)
        square += (bound.radius + slack) ** 2
    eigenvalues = np.linalg.eigvalsh(normal)
    if size and eigenvalues[0] <= _SINGULAR * eigenvalues[-1]:
        raise ModelError(
            "the reach has no end that is known: the guides let the platform move along them for "
            "ever; give the legs limits, or say within which box",
            subject=robot.name,
        )
    center = np.linalg.solve(normal, right)
    remainder = square - (constant - float(center @ right))
    reach = np.sqrt(max(remainder, 0.0) * np.diag(np.linalg.inv(normal)))
    reach = reach * (1.0 + _WIDER) + _WIDER * (1.0 + np.abs(center))
    return np.array([center - reach, center + reach])
