"""Curves of poses: self-motions, in which a platform moves while its actuated joints are held.

The homotopy paths of `pose_paths` that lead to such a machine end at points of the curve, in
general complex ones, where Newton's steps fail. From their real parts Levenberg-Marquardt steps
lead to real points, if the curve has any.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.equations.pose_paths import Closed
from pteron.kernels import Array
from pteron.kernels.path_programs import rows_kernel

ROUNDING = 2e-14
"""Greatest residual, over the bound of `second_slopes`, of a z that counts as a pose where no proof
is possible: next to a singularity, where two poses meet."""

_STEPS = 30
"""Number of steps of a descent."""

_FLAT = 1e-6
"""Singular value of the closures' derivatives, over the largest, that counts as zero."""

_PROBE_DISTANCE = 0.02
"""Distance, |z| = 1, from a pose to another on a curve. At an isolated pose of multiplicity m the
residuals there are about its m-th power, far above rounding."""


def lie_on_curves(closed: Closed, machines: Array, z: Array) -> NDArray[np.bool_]:
    """Return which states z (K, d) lie on a continuous curve of poses of their machine.

    `machines` (K, k, 7) holds seven numbers for each of the k closure equations, as in `Closed`.

    Where the Jacobian of the closure equations loses rank, other poses are sought at a distance in
    the null direction, to both sides.
    """
    if not len(z):
        return np.zeros(0, dtype=bool)
    tolerance = ROUNDING * second_slopes(closed, machines)
    identity = np.eye(closed.size)
    z, residuals = _levenberg_marquardt(closed, machines, z, identity)
    z = normalise_rows(z)
    rows, _ = rows_kernel(closed)(z, machines.reshape(len(z), 7 * closed.equations))
    _, sizes, axes = np.linalg.svd(np.concatenate([rows, z[:, None]], axis=1))
    is_on_curve = (residuals <= tolerance) & (sizes[:, -1] <= _FLAT * sizes[:, 0])
    fixed_directions = np.stack([z, axes[:, -1]], axis=1)
    projectors = identity - np.swapaxes(fixed_directions, -1, -2) @ fixed_directions
    for side in (_PROBE_DISTANCE, -_PROBE_DISTANCE):
        _, residuals = _levenberg_marquardt(closed, machines, z + side * axes[:, -1], projectors)
        is_on_curve &= residuals <= tolerance
    return np.asarray(is_on_curve)


def _levenberg_marquardt(
    closed: Closed, machines: Array, z: Array, projectors: Array
) -> tuple[Array, Array]:
    """Return z (K, d) after Levenberg-Marquardt steps, and the norms of their residuals (K,).

    Damped by the squared residual, the steps converge to a curve of poses as fast as Newton's
    method to a regular pose (Yamashita and Fukushima, On the rate of convergence of the
    Levenberg-Marquardt method, 2001). `projectors` (d, d) or (K, d, d) project onto the allowed
    steps.
    """
    numbers = machines.reshape(len(z), 7 * closed.equations)
    best, least = z, np.full(len(z), np.inf)
    for _ in range(_STEPS):
        rows, residuals = rows_kernel(closed)(z, numbers)
        size = np.linalg.norm(residuals, axis=-1)
        better = size < least
        best, least = np.where(better[:, None], z, best), np.where(better, size, least)
        u, s, v = np.linalg.svd(rows @ projectors, full_matrices=False)
        damping = np.maximum(size, ROUNDING)[:, None] ** 2
        step = (residuals[:, None] @ u) * (s / (s * s + damping))[:, None] @ v
        z = z - step[:, 0]
    return best, least


def second_slopes(closed: Closed, machines: Array) -> Array:
    """Return an upper bound (K,) of the second derivatives of the closure equations."""
    a, b, r = machines[..., :3], machines[..., 3:6], np.abs(machines[..., 6])
    length_a, length_b = (np.linalg.norm(v, axis=-1) for v in (a, b))
    bends = (length_a + length_b) ** 2 + 4.0 * closed.moves + r
    bends[:, closed.spheres :] = (2.0 * length_a * (2.0 + length_b) + 2.0 * r)[:, closed.spheres :]
    return np.asarray(np.sqrt((bends**2).sum(axis=-1) + closed.moves))


def normalise_rows(z: Array) -> Array:
    """Return rows z (..., d) scaled to unit length."""
    return np.asarray(z / np.linalg.norm(z, axis=-1, keepdims=True))
