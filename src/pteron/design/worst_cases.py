"""Worst values over all directions at poses: drives' forces and speeds, and errors of the tool.

Each is exact, or bounded from above, over every direction; over places it is that of the poses that
are given. A pose that the machine does not reach gives NaN.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import combinations, product
from math import sqrt

import numpy as np

from pteron.dynamics import drive_forces
from pteron.equations.drives import drives_of
from pteron.indices import Tolerances, pose_error
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.legs import Drive
from pteron.manipulator import Manipulator

_BISECTIONS = 60
"""Halvings for a multiplier: as exact as floats are."""

_CELLS = 16
"""Directions along each edge of a cube's face, over which an error of the tool is largest: they
overstate it by less than 0.4 % in space, and by less than 0.2 % in a plane."""


def worst_speeds(robot: Manipulator, poses: Array, speed: float) -> Array:
    """Return the greatest speed of each joint (N, n) as P moves at `speed` in any direction.

    The platform does not turn meanwhile; m/s or rad/s. The value is exact: the norm of a row of the
    Jacobian.
    """
    moving = len(robot.platform.lengths)
    rows = jacobian(robot, poses, on_failure="nan")[..., :moving]
    return np.asarray(speed * np.linalg.norm(rows, axis=-1))


def worst_forces(robot: Manipulator, poses: Array, speed: float, acceleration: float) -> Array:
    """Return the greatest size of each drive's force (N, n), N or N m, over all motions of P.

    Velocities are at most `speed`, m/s, and accelerations at most `acceleration`, m/s^2, in any
    direction, independently; the platform does not turn. A force is affine in the acceleration, so
    that its maximum is a row's norm, and quadratic in the velocity: its maximum in a ball equals
    that of the dual problem, without a gap (the S-lemma; I. Polik and T. Terlaky, SIAM Review
    49(3), 2007). Dry friction has the sign that increases the force, and includes all of the
    Stribeck force.
    """
    legs = (replace(leg, drive=_frictionless(leg.drive)) for leg in robot.legs)
    static, rows, squares = _force_expansion(replace(robot, legs=tuple(legs)), poses)
    known = np.isfinite(static).all(axis=-1)
    greatest = np.full(static.shape, np.nan)
    if not known.all():
        if known.any():
            greatest[known] = worst_forces(robot, poses[known], speed, acceleration)
        return greatest
    drives = drives_of(robot)
    lines = drives.viscous[:, None] * jacobian(robot, poses)[..., : squares.shape[-1]]
    eigenvalues, vectors = np.linalg.eigh(squares)
    parts = np.einsum("...ij,...i->...j", vectors, lines) ** 2
    independent = acceleration * np.linalg.norm(rows, axis=-1) + drives.coulomb + drives.stribeck
    static = static + drives.offset
    above = static + _greatest_over_directions(eigenvalues, parts, speed) + independent
    below = -static + _greatest_over_directions(-eigenvalues, parts, speed) + independent
    return np.asarray(np.maximum(above, below))


def _frictionless(drive: Drive | None) -> Drive | None:
    """Return a drive with its rotor inertia and ratio only, no friction; None without a drive."""
    return drive and Drive(rotor_inertia=drive.rotor_inertia, ratio=drive.ratio)


def _force_expansion(robot: Manipulator, poses: Array) -> tuple[Array, Array, Array]:
    """Return forces at rest (N, n), by acceleration (N, n, k), by velocities (N, n, k, k)."""
    k = len(robot.platform.lengths)
    axes = np.eye(robot.freedom)[:k]
    pairs = list(combinations(range(k), 2))
    zeros = np.zeros((1, robot.freedom))
    crossed = (axes[[i]] + axes[[j]] for i, j in pairs)
    velocities = np.concatenate([zeros, *([zeros] * k), axes, *crossed])
    accelerations = np.zeros_like(velocities)
    accelerations[1 : 1 + k] = axes
    forces = drive_forces(robot, poses[:, None], velocities, accelerations, on_failure="nan")
    static = forces[:, 0]
    rows, diagonal, mixed = np.split(forces[:, 1:] - static[:, None], [k, 2 * k], axis=1)
    squares = np.zeros((*static.shape, k, k))
    squares[..., range(k), range(k)] = diagonal.swapaxes(1, 2)
    for at, (i, j) in enumerate(pairs):
        half = 0.5 * (mixed[:, at] - diagonal[:, i] - diagonal[:, j])
        squares[..., i, j] = squares[..., j, i] = half
    return static, rows.swapaxes(1, 2), squares


def _greatest_over_directions(eigenvalues: Array, parts: Array, size: float) -> Array:
    """Return the maximum over |v| <= size of v^T C v + b^T v, by its dual.

    The eigenvalues are those of C (..., k), `parts` the squares of b along its axes. The dual is
    the least over mu >= max(0, lambda) of mu size^2 + sum(parts / (mu - lambda)) / 4.
    """
    floor = np.maximum(eigenvalues.max(axis=-1), 0.0)
    low, high = floor, floor + np.sqrt(parts.sum(axis=-1)) / (2.0 * size)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(_BISECTIONS if parts.any() else 0):
            mu = 0.5 * (low + high)
            terms = np.where(parts > 0.0, parts / (mu[..., None] - eigenvalues) ** 2, 0.0)
            falls = 0.25 * terms.sum(axis=-1) > size**2
            low, high = np.where(falls, mu, low), np.where(falls, high, mu)
        terms = np.where(parts > 0.0, parts / (high[..., None] - eigenvalues), 0.0)
    return np.asarray(high * size**2 + 0.25 * terms.sum(axis=-1))


def worst_position_errors(robot: Manipulator, poses: Array, tolerances: Tolerances) -> Array:
    """Return an upper bound of the tool's position error at each pose (N,), m.

    To first order in the errors, it is the maximum over unit vectors u of the sum of |u . error| of
    all sources. Directions are sampled so densely that dividing by the cosine of their spacing
    gives an upper bound.
    """
    lengths = len(robot.platform.lengths)
    parts = pose_error(robot, poses, tolerances, on_failure="nan").parts[:, :lengths]
    units, cosine = _directions(lengths)
    return np.array([float(np.abs(units @ part).sum(axis=1).max()) for part in parts]) / cosine


@lru_cache(maxsize=4)
def _directions(count: int) -> tuple[Array, float]:
    """Return unit vectors (D, count) over all directions, and the cosine of their covering angle.

    They point to the middles of cells on a cube's faces; opposite directions count once.
    """
    middles = (np.arange(_CELLS) + 0.5) * 2.0 / _CELLS - 1.0
    points = [
        np.insert(at, face, 1.0)
        for face in range(count)
        for at in product(middles, repeat=count - 1)
    ]
    vectors = np.array(points)
    # An angle from the cube's centre is no more than the distance on a face.
    farthest = sqrt(count - 1.0) / _CELLS
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True), float(np.cos(farthest))
