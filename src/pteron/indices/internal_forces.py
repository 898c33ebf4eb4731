"""Forces and moments of the legs on the platform that balance given loads, for many states.

`joint_reactions` and `compliance` use them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pteron.kernels import Array
from pteron.manipulator import Manipulator

_RANK = 1e-10
"""Share of the largest singular value below which one counts as zero."""


class Equations(NamedTuple):
    """Outputs of the kernel "reactions" for B states, in its order; see `equations.reactions`."""

    rows: Array
    right: Array
    presumed_rows: Array
    presumed_right: Array
    loads: Array
    driven_rows: Array
    driven: Array
    ends: Array
    points: Array
    passed: Array


class BalancedLoads(NamedTuple):
    """The legs' forces and moments that balance K loads, as far as statics determines them."""

    forces: Array
    """(B, 6 n, K): a force and a moment of each leg on the platform."""
    stresses: Array
    """(B, 6 n, r): self-stresses, orthogonal with moments divided by `size_of`; zero where a state
    has fewer than others."""
    missed: Array
    """(B, S, K): the part of the loads that the legs cannot hold, moments divided by `size_of`."""


_BLOCK = 1024
"""States whose matrices are in memory at once: some 40 kB each."""


def blocks(parts: Sequence[Array]) -> Iterator[list[Array]]:
    """Yield all arrays cut into blocks of at most `_BLOCK` rows; one block even if empty."""
    for start in range(0, max(len(parts[0]), 1), _BLOCK):
        yield [part[start : start + _BLOCK] for part in parts]


def size_of(robot: Manipulator) -> float:
    """Return the mean leg size, m, by which moments are made comparable with forces."""
    return float(np.mean([leg.size for leg in robot.legs]))


def force_units(robot: Manipulator) -> Array:
    """Return scale factors (6 n,) of leg forces (1) and moments (mean leg size, m)."""
    return np.tile(np.repeat([1.0, size_of(robot)], 3), robot.joint_count)


def balance_loads(
    robot: Manipulator, equations: Equations, right: Array, presumed: Array
) -> BalancedLoads:
    """Return the leg forces, self-stresses and residuals that balance loads (B, R, K).

    The necessary equations hold exactly; of their solutions the one nearest to the presumed
    equations is taken. Moments are divided by the machine's size, so that no rank depends on a
    unit.
    """
    count, length = equations.rows.shape[-1], size_of(robot)
    unit_sizes = force_units(robot)
    rows, presumed_rows = equations.rows * unit_sizes, equations.presumed_rows * unit_sizes
    parts = equations.rows.reshape(*equations.rows.shape[:-1], -1, 6)
    moments = (parts[..., 3:] != 0.0).any(axis=(0, -1, -2))
    moments[: robot.freedom] |= robot.platform.angular
    row_scale = np.where(moments, 1.0 / length, 1.0)[:, None]
    rows, right = row_scale * rows, row_scale * right
    presumed_scale = np.ones(presumed_rows.shape[-2])
    presumed_scale[3:] = 1.0 / length
    presumed_rows, presumed = (
        presumed_scale[:, None] * presumed_rows,
        presumed_scale[:, None] * presumed,
    )
    pseudo_inverse = inverse(rows)
    forces, null_space = pseudo_inverse @ right, _range(np.eye(count) - pseudo_inverse @ rows)
    free_rows = presumed_rows @ null_space
    pseudo_inverse = inverse(free_rows)
    forces = forces + null_space @ pseudo_inverse @ (presumed - presumed_rows @ forces)
    stresses = _range(null_space @ (np.eye(null_space.shape[-1]) - pseudo_inverse @ free_rows))
    return BalancedLoads(
        unit_sizes[:, None] * forces,
        unit_sizes[:, None] * stresses,
        presumed_rows @ forces - presumed,
    )


def _range(projectors: Array) -> Array:
    """Return orthonormal columns (B, n, r) that span the range of projectors (B, n, n)."""
    columns, sizes, _ = np.linalg.svd(projectors)
    counts = sizes > 0.5  # each is 0 or 1, but for rounding
    return np.asarray(
        (columns[..., : sizes.shape[-1]] * counts[:, None])[..., : counts.sum(-1).max()]
    )


def platform_wrench(robot: Manipulator, wrench: Array, moment: Array) -> Array:
    """Return force and moment at P (..., 6) of a wrench (..., m) plus a moment (..., 3)."""
    force, moment_of_wrench = robot.platform.force_and_moment(wrench)
    return np.concatenate(np.broadcast_arrays(force, moment_of_wrench + moment), axis=-1)


def wrench_shift(arms: Array) -> Array:
    """Return matrices (..., 6, 6) that move a wrench from c to points with vectors `arms` to c."""
    shifts = np.zeros((*arms.shape[:-1], 6, 6))
    shifts[...] = np.eye(6)
    x, y, z = np.moveaxis(arms, -1, 0)
    shifts[..., 3, 1], shifts[..., 3, 2] = -z, y
    shifts[..., 4, 0], shifts[..., 4, 2] = z, -x
    shifts[..., 5, 0], shifts[..., 5, 1] = -y, x
    return shifts


def inverse(matrices: Array) -> Array:
    """Return the pseudo-inverses of matrices, small singular values truncated."""
    return np.asarray(np.linalg.pinv(matrices, rcond=_RANK))


def apply_matrices(matrices: Array, vectors: Array) -> Array:
    """Return the products (..., n) of matrices (..., n, m) and vectors (..., m)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
