"""The volume of the workspace by quadrature: lengths of lines inside it, added up.

It is an estimate at sampled poses; `paving` gives bounds that are proved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect, expect_to_fit
from pteron.kernels import Array
from pteron.kernels.bisection import bisect_condition
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.conditions import Condition, conditions, keeps
from pteron.workspace.volume import bounding_box

_SAMPLES = 129
"""Equally spaced positions on a line at which the conditions are tested."""

_HALVINGS = 24
"""Bisections that place an end between two samples."""

_CHUNK = 4096
"""Lines evaluated at a time."""


@dataclass(frozen=True, eq=False, repr=False)
class Quadrature(Result):
    """A volume by quadrature."""

    volume: float
    """m^3; of a planar machine an area, m^2."""
    error: float
    """Its difference from that of half as many lines each way: an estimate, no bound."""

    def __iter__(self) -> Iterator[float]:
        """Yield both, as ``volume, error = quadrature_volume(..)`` takes them."""
        return iter((self.volume, self.error))


def quadrature_volume(
    robot: RobotLike,
    pose: PoseLike,
    *,
    lines: int = 200,
    given: tuple[Condition, ...] | None = None,
) -> Quadrature:
    """Return an estimate of the volume where conditions hold, at the orientation of a pose.

    Lines along x fill the workspace's bounding box; where each one enters and leaves is found by
    halving, and the lengths inside are added up by the midpoint rule. Poses are evaluated in
    floating point, not in intervals: the bounds of `paving` are checked against it.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    pose : array, shape (m,)
        Gives the orientation, m and rad.
    lines : int
        Number of each way, an even number.
    given : tuple of Condition, optional
        The conditions on a pose; by default `conditions(robot)`: reach and limits.

    Returns
    -------
    Quadrature

    Raises
    ------
    ModelError
        If no position is in reach at this orientation.
    DataError
        If the number of lines is odd, or less than 2.

    Examples
    --------
    >>> from pteron.workspace import quadrature_volume
    >>> round(quadrature_volume("tripteron-router", [0.1, 0.1, 0.1], lines=20).volume, 6)
    0.008
    """
    robot = as_manipulator(robot)
    expect(lines >= 2 and not lines % 2, "lines", lines, "an even number of them")
    reference = finite_pose(robot, pose, "pose")
    box = bounding_box(robot, reference)
    line_axes = box.shape[1] - 1
    expect_to_fit("lines", lines, 3.0 * float(lines) ** line_axes * line_axes)
    required = conditions(robot) if given is None else given
    fine, coarse = (_integral(robot, required, reference, box, n) for n in (lines, lines // 2))
    return Quadrature(fine, abs(fine - coarse))


def _integral(
    robot: Manipulator, required: tuple[Condition, ...], reference: Array, box: Array, lines: int
) -> float:
    """Return the volume of the workspace in a box (2, d), by the midpoint rule over lines."""
    steps = (box[1] - box[0])[1:] / lines
    sides = [
        low + step * (np.arange(lines) + 0.5) for low, step in zip(box[0, 1:], steps, strict=True)
    ]
    places = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, len(steps))
    total = sum(
        _inner_lengths(robot, required, reference, box[:, 0], places[k : k + _CHUNK]).sum()
        for k in range(0, len(places), _CHUNK)
    )
    return float(total * np.prod(steps))


def _inner_lengths(
    robot: Manipulator,
    required: tuple[Condition, ...],
    reference: Array,
    ends: Array,
    places: Array,
) -> Array:
    """Return the lengths (L,) inside of lines along x between ends (2,), at places (L, k - 1)."""

    def contains(x: Array, row: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return whether positions x on lines `row` (indices) keep the conditions."""
        poses = np.broadcast_to(reference, (*x.shape, len(reference))).copy()
        poses[..., 0], poses[..., 1 : 1 + places.shape[1]] = x, places[row]
        return keeps(robot, required, poses)

    rows = np.arange(len(places))
    # Beyond the ends all is taken to lie outside, so that lines enter and leave in pairs.
    x = np.linspace(ends[0], ends[1], _SAMPLES)
    is_inside = np.zeros((len(places), _SAMPLES + 2), bool)
    is_inside[:, 1:-1] = contains(np.broadcast_to(x, (len(places), _SAMPLES)), rows[:, None])
    line, k = np.nonzero(is_inside[:, 1:] != is_inside[:, :-1])
    leaves = is_inside[line, k]
    low, high = x[np.maximum(k - 1, 0)], x[np.minimum(k, _SAMPLES - 1)]
    low, high = bisect_condition(lambda x: contains(x, line) == leaves, low, high, _HALVINGS)
    lengths = np.zeros(len(places))
    np.add.at(lengths, line, np.where(leaves, 1.0, -1.0) * 0.5 * (low + high))
    return lengths
