"""Regions of poses that are asked to lie in a workspace: boxes, cylinders and segments."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.arguments import expect
from pteron.errors import DataError, shorten
from pteron.kernels import Array

_FARTHEST = 1e70
"""Bound on the numbers of a region, whose fourth powers must not overflow; others are refused."""

_WIDER = 1e-12
"""Tolerance of comparisons, m and relative: far more than their rounding."""


@runtime_checkable
class Region(Protocol):
    """A set of poses."""

    @property
    def box(self) -> Array:
        """Least and greatest pose (2, m): the region lies between them."""

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return which poses (..., m) lie in the region."""

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which boxes with corners (B, m) are certain not to meet the region."""


@dataclass(frozen=True)
class Box:
    """All poses between two corner poses.

    Parameters
    ----------
    low, high : sequence of float
        Least and greatest value of each of the pose's coordinates, m and rad; where they are equal
        it does not vary.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]

    def __post_init__(self) -> None:
        low, high = (_checked_numbers(getattr(self, name), name) for name in ("low", "high"))
        if len(low) != len(high) or any(a > b for a, b in zip(low, high, strict=True)):
            raise DataError(
                f"box: low {list(low)} must have as many numbers as high {list(high)}, none greater"
            )
        if math.inf in (b - a for a, b in zip(low, high, strict=True)):
            raise DataError(f"box: from {list(low)} to {list(high)} is too far for a float")
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @classmethod
    def around(cls, poses: ArrayLike, margin: ArrayLike = 0.0) -> Box:
        """Return the smallest box that contains poses (..., m), such as those of a motion.

        With a margin (m,), or one for all coordinates, it is so much wider on each side.
        """
        array = np.asarray(poses, dtype=float)
        expect(array.ndim >= 1 and array.size, "poses", "none", "at least one")
        flat = array.reshape(-1, array.shape[-1])
        return cls(tuple(flat.min(axis=0) - margin), tuple(flat.max(axis=0) + margin))

    @property
    def box(self) -> Array:
        """Least and greatest pose (2, m)."""
        return np.array([self.low, self.high])

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return which poses (..., m) lie in the region."""
        return np.asarray(((self.low <= poses) & (poses <= self.high)).all(axis=-1))

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which boxes with corners (B, m) are certain not to meet the region."""
        return np.asarray(((high < self.low) | (low > self.high)).any(axis=-1))


@dataclass(frozen=True)
class Cylinder:
    """All positions of an upright or a tilted cylinder, at one orientation.

    Parameters
    ----------
    center : sequence of float
        The pose at its middle, m and rad; its angle, if it has one, holds throughout.
    radius : float
        m.
    height : float
        m.
    axis : (float, float, float)
        Its direction.
    """

    center: tuple[float, ...]
    radius: float
    height: float
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        center, axis = (_checked_numbers(getattr(self, name), name) for name in ("center", "axis"))
        if len(center) < 3 or len(axis) != 3 or not any(axis):
            raise DataError("cylinder: a pose with x, y and z is needed for center, and an axis")
        if not (0.0 <= self.radius < math.inf and 0.0 <= self.height < math.inf):
            raise DataError(
                f"cylinder: radius {self.radius!r} and height {self.height!r} must be finite, and "
                "not negative"
            )
        length = float(np.linalg.norm(axis))
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "axis", tuple(a / length for a in axis))

    @property
    def box(self) -> Array:
        """Least and greatest pose (2, m)."""
        direction = np.array(self.axis)
        half = 0.5 * self.height * np.abs(direction)
        half = half + self.radius * np.sqrt(np.maximum(1.0 - direction * direction, 0.0))
        half = half * (1.0 + _WIDER) + _WIDER
        box = np.array([self.center, self.center])
        box[:, :3] += np.array([-half, half])
        return box

    def _axial_parts(self, poses: Array) -> tuple[Array, Array]:
        """Return components of positions (..., 3) along and across the axis, from the middle."""
        offsets, axis = poses[..., :3] - self.center[:3], np.array(self.axis)
        heights = offsets @ axis
        return heights, offsets - heights[..., None] * axis

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return which poses (..., m) lie in the region."""
        heights, offsets = self._axial_parts(poses)
        inside = np.linalg.norm(offsets, axis=-1) <= self.radius
        return np.asarray(inside & (np.abs(heights) <= 0.5 * self.height))

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which boxes with corners (B, m) are certain not to meet the region."""
        heights, offsets = self._axial_parts(0.5 * (low + high))
        half, axis = 0.5 * (high - low)[:, :3], np.array(self.axis)
        slack = _WIDER * (1.0 + self.radius + self.height)
        far = np.abs(heights) - half @ np.abs(axis) > 0.5 * self.height + slack
        # Half the extent of a box across the axis, by components.
        shadow = half @ np.abs(np.eye(3) - np.outer(axis, axis))
        nearest = np.maximum(np.abs(offsets) - shadow, 0.0)
        return np.asarray(far | (np.linalg.norm(nearest, axis=-1) > self.radius + slack))


@dataclass(frozen=True)
class Segment:
    """All poses on the straight line between two poses, angles included.

    Parameters
    ----------
    start, end : sequence of float
        The two poses, m and rad.
    """

    start: tuple[float, ...]
    end: tuple[float, ...]

    def __post_init__(self) -> None:
        start, end = (_checked_numbers(getattr(self, name), name) for name in ("start", "end"))
        if len(start) != len(end):
            raise DataError(f"segment: start {list(start)} and end {list(end)} differ in length")
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)

    @property
    def box(self) -> Array:
        """Least and greatest pose (2, m)."""
        return np.sort([self.start, self.end], axis=0)

    def _shares_within(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the first and last share of the way (...,) within boxes with corners (..., m).

        The first is greater than the last where a box does not meet the line.
        """
        start, way = np.array(self.start), np.subtract(self.end, self.start)
        slack = _WIDER * (1.0 + np.abs(start) + np.abs(way))
        below, above = low - start - slack, high - start + slack
        moves = way != 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            bounds = np.sort([below / way, above / way], axis=0)
        is_beside = ((below > 0.0) | (above < 0.0)) & ~moves
        first = np.where(moves, bounds[0], np.where(is_beside, np.inf, 0.0)).max(axis=-1)
        last = np.where(moves, bounds[1], 1.0).min(axis=-1)
        return np.maximum(first, 0.0), np.minimum(last, 1.0)

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return which poses (..., m) lie in the region, to rounding."""
        return ~self.misses(poses, poses)

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which boxes with corners (B, m) are certain not to meet the region."""
        first, last = self._shares_within(low, high)
        return np.asarray(first > last)


def _checked_numbers(numbers: object, name: str) -> tuple[float, ...]:
    """Return numbers of a sensible size as a tuple of floats; others raise a `DataError`."""
    try:
        array = np.asarray(numbers, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    if array.ndim != 1 or not (np.abs(array) < _FARTHEST).all():
        raise DataError(
            f"{name}: {shorten(numbers)} given, a row of numbers of sensible size expected"
        )
    return tuple(array.tolist())
