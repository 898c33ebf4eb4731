"""Vectors in space as three floats, and checks of a manipulator's numbers and vectors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import ModelError, shorten
from pteron.tolerances import ROUNDING

Vector = tuple[float, float, float]

UNIT_TOLERANCE = 1e-6
"""Tolerance of a unit vector's length: within it a vector is normalised, beyond it an error."""

PARALLEL_TOLERANCE = 1e-9
"""Sine of the angle under which two unit vectors count as parallel."""

_ROUNDING = 4 * math.ulp(1.0)
"""Tolerance of the length of a vector that stays bit for bit: rounding."""

_SMALL_ANGLE = 1e-3
"""Angle, rad, up to which sin(a/2)/a is a series: its next term is below 2e-24."""

_UPRIGHT = 1e-15
"""Tolerance of the cosine of two perpendicular unit vectors: rounding."""


def number(value: object, key: str) -> float:
    """Return `value` as a finite float, or raise an error that names its `key`."""
    try:
        converted = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ModelError(f"{key}: {value!r} is not a number") from None
    except OverflowError:
        raise ModelError(f"{key}: {shorten(value)} is too large a number") from None
    if not math.isfinite(converted):
        raise ModelError(f"{key}: {converted} is not a finite number")
    return converted


def positive(value: object, key: str, unit: str) -> float:
    """Return `value` as a float; raise an error that names its `key` unless it is above zero."""
    converted = number(value, key)
    if converted <= 0.0:
        raise ModelError(
            f"{key}: {converted:g} {unit} is not positive; give a value above 0 {unit}"
        )
    return converted


def not_negative(value: object, key: str, unit: str) -> float:
    """Return `value` as a float; raise an error that names its `key` if it is negative."""
    converted = number(value, key)
    if converted < 0.0:
        raise ModelError(f"{key}: {converted:g} {unit} is negative; give 0 or more")
    return converted


def numbers(values: Sequence[object], key: str, count: int) -> tuple[float, ...]:
    """Return `values` as `count` finite floats; raise an error that names their `key`."""
    try:
        components = list(values)
    except TypeError:
        raise ModelError(f"{key}: {values!r} is not a list of {count} numbers") from None
    if len(components) != count:
        raise ModelError(f"{key}: {len(components)} numbers given, {count} expected")
    return tuple(number(component, f"{key}[{i}]") for i, component in enumerate(components))


def interval(values: Sequence[object], key: str) -> tuple[float, float]:
    """Return `values` as (least, most) floats; raise an error unless least is below most."""
    low, high = numbers(values, key, 2)
    if low >= high:
        raise ModelError(f"{key}: {low:g} is not below {high:g}; give [least, most]")
    return low, high


def vector(values: Sequence[object], key: str) -> Vector:
    """Return `values` as a vector of three finite floats; raise an error that names its `key`."""
    x, y, z = numbers(values, key, 3)
    return (x, y, z)


def unit_vector(values: Sequence[object], key: str) -> Vector:
    """Return `values` normalised; raise where the length differs from 1 by over `UNIT_TOLERANCE`.

    A vector of unit length up to rounding is returned bit for bit, so that a file does not drift
    when it is read and written repeatedly.
    """
    raw = vector(values, key)
    length = norm(raw)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        mend = (
            "a zero vector has no direction"
            if length == 0.0
            else "write " + str([float(f"{c / length:.12g}") for c in raw])
        )
        raise ModelError(f"{key}: {list(raw)} has length {length:.6g}, not 1; {mend}")
    if abs(length - 1.0) <= _ROUNDING:
        return raw
    return scale_vector(raw, 1.0 / length)


def perpendicular(values: Sequence[object], axis: Vector, key: str, other: str) -> Vector:
    """Return `values` as a unit vector perpendicular to `axis`; raise if they are far from it.

    Perpendicularity is checked before the length, so that the message can propose a vector that
    satisfies both.
    """
    raw = vector(values, key)
    lean, size = dot(raw, axis), norm(raw)
    if abs(lean) > UNIT_TOLERANCE * size:
        upright = _perpendicular_part(raw, axis)
        if norm(upright) < UNIT_TOLERANCE * size:
            raise ModelError(
                f"{key}: {list(raw)} is along {other} {list(axis)}; give one at right angles to it"
            )
        suggestion = [float(f"{c / norm(upright):.12g}") + 0.0 for c in upright]
        raise ModelError(
            f"{key}: {list(raw)} is not perpendicular to {other} {list(axis)}; {suggestion} is"
        )
    unit = unit_vector(raw, key)
    if abs(dot(unit, axis)) <= _UPRIGHT:
        return unit
    upright = _perpendicular_part(unit, axis)
    return scale_vector(upright, 1.0 / norm(upright))


def _perpendicular_part(v: Vector, axis: Vector) -> Vector:
    """Return the component of a vector perpendicular to a unit vector."""
    lean = dot(v, axis)
    return (v[0] - lean * axis[0], v[1] - lean * axis[1], v[2] - lean * axis[2])


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence[Any], b: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return the vector product of two vectors (3)."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vector) -> float:
    """Return the Euclidean length of a vector."""
    return math.hypot(*a)


def scale_vector(a: Vector, factor: float) -> Vector:
    """Return a vector multiplied by `factor`."""
    return (factor * a[0], factor * a[1], factor * a[2])


def shift_point(point: Vector, direction: Vector, way: float) -> Vector:
    """Return a point shifted by `way`, m, along a unit vector."""
    return (
        point[0] + way * direction[0],
        point[1] + way * direction[1],
        point[2] + way * direction[2],
    )


def parallel(a: Vector, b: Vector) -> bool:
    """Return whether two unit vectors are parallel, in the same or in opposite sense."""
    return norm(cross(a, b)) < PARALLEL_TOLERANCE


def vertical(d: Vector, gravity: Vector) -> bool:
    """Return whether a unit vector is vertical: gravity is along it, or zero."""
    size = norm(gravity)
    return size == 0.0 or parallel(d, scale_vector(gravity, 1.0 / size))


def complement(axes: ArrayLike) -> NDArray[np.float64]:
    """Return orthonormal rows (k, 3) perpendicular to all vectors (n, 3)."""
    matrix = np.asarray(axes, dtype=float).reshape(-1, 3)
    _, sizes, rows = np.linalg.svd(matrix) if len(matrix) else (None, np.zeros(0), np.eye(3))
    spanning: NDArray[np.float64] = rows[int((sizes > ROUNDING).sum()) :]
    return spanning


def rotation_matrices(vectors: ArrayLike) -> NDArray[np.float64]:
    """Return rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad.

    They are computed by quaternions (x, y, z, w), equal to the bit to SciPy's `Rotation`, which is
    slow to import.
    """
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    angle = np.sqrt(x * x + y * y + z * z)
    square = angle * angle
    small = angle <= _SMALL_ANGLE
    series = 0.5 - square / 48.0 + square * square / 3840.0
    share = np.where(small, series, np.sin(0.5 * angle) / np.where(small, 1.0, angle))
    x, y, z, w = share * x, share * y, share * z, np.cos(0.5 * angle)
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    rows = [
        [xx - yy - zz + ww, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), -xx + yy - zz + ww, 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), -xx - yy + zz + ww],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
