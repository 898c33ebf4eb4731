"""Methods `svd` and `qr` of `base_parameters`: a regressor's null space, in floating point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pteron.dynamics import regressor
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import random_poses
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.measure_floors import median_floors
from pteron.manipulator import Manipulator, parameter_data
from pteron.reduction.certificate import NumericalCertificate, NumericalRank
from pteron.reduction.grouping import Grouping, Shares

_TOLERANCE = 1e-10
"""Singular values up to this share of the largest count as zero, with rows and columns of unit
length: rounding leaves 1e-14, what is identifiable at all 1e-6 and more. The certificate reports
the gap."""

_STATES_PER_COLUMN = 4
"""Random states at which the regressor is evaluated, for each of its columns."""

_ACCELERATION = 9.81
"""m/s^2: that of the random motions, so that inertia weighs about as much as gravity."""


_Gap = tuple[float, float]
"""The smallest value kept, and the largest one dropped."""


class _Scaled(NamedTuple):
    """Regressors at random states, stacked (R, columns), with columns of length 1."""

    matrix: Array
    lengths: Array
    """Lengths of the columns before that, in their units; infinite of rounding alone."""
    states: int
    dropped: float
    """Greatest length of a column that counts as rounding, over the longest."""


def svd_grouping(robot: Manipulator, order: Sequence[int], sharing: Array, seed: int) -> Grouping:
    """Return the grouping from the singular value decomposition (Gautier's, the paper's method).

    The null vectors are the right singular vectors of vanishing values. Columns are dropped, those
    least preferred first, as long as the null vectors' entries at them stay independent.
    """
    scaled = _scaled_regressor(robot, sharing, seed)
    _, singular, vectors = np.linalg.svd(scaled.matrix, full_matrices=True)  # Section 5 (a)
    singular = np.pad(singular, (0, scaled.matrix.shape[1] - len(singular)))
    rank = int((singular > _TOLERANCE * singular[0]).sum())
    null = vectors[rank:].T
    dropped = independent(null.T, list(reversed(order)), len(order) - rank)[0]
    base_columns = sorted(set(order) - set(dropped))
    shares = (
        -np.linalg.solve(null[dropped].T, null[base_columns].T).T
        if dropped
        else np.empty((rank, 0))
    )
    gap = singular[rank - 1] / singular[0], np.max(singular[rank:], initial=0.0) / singular[0]
    return _grouping("svd", base_columns, dropped, shares, scaled, gap)


def qr_grouping(robot: Manipulator, order: Sequence[int], sharing: Array, seed: int) -> Grouping:
    """Return the grouping from a QR decomposition with the columns in the order of preference."""
    scaled = _scaled_regressor(robot, sharing, seed)
    base_columns, norms = independent(scaled.matrix, order)
    base_columns = sorted(base_columns)
    dropped = [column for column in order if column not in base_columns]
    shares = _least_squares(scaled, base_columns, dropped)
    gap = min(norms[k] for k in base_columns), max((norms[k] for k in dropped), default=0.0)
    return _grouping("qr", base_columns, dropped, shares, scaled, gap)


def numerical_rank(robot: Manipulator, sharing: Array, seed: int) -> NumericalRank:
    """Return the rank that the singular values of the scaled regressor show."""
    scaled = _scaled_regressor(robot, sharing, seed)
    singular = np.linalg.svd(scaled.matrix, compute_uv=False)
    relative = singular / singular[0]
    is_significant = relative > _TOLERANCE
    dropped = float(relative[~is_significant].max(initial=scaled.dropped))
    return NumericalRank(int(is_significant.sum()), float(relative[is_significant][-1]), dropped)


def fitted_shares(
    robot: Manipulator, sharing: Array, base_columns: list[int], dropped: list[int], seed: int
) -> Shares:
    """Return the shares of columns known to depend on the kept ones, by least squares."""
    scaled = _scaled_regressor(robot, sharing, seed)
    return _unscaled_shares(
        base_columns, dropped, _least_squares(scaled, base_columns, dropped), scaled
    )


def _least_squares(scaled: _Scaled, base_columns: list[int], dropped: list[int]) -> Array:
    """Return the shares (b, d) of dropped columns in the base columns, by least squares."""
    shares = np.linalg.lstsq(scaled.matrix[:, base_columns], scaled.matrix[:, dropped], rcond=None)[
        0
    ]
    return np.asarray(shares, dtype=float)


def _scaled_regressor(robot: Manipulator, sharing: Array, seed: int) -> _Scaled:
    """Return the regressors at random states, without units: rows and columns of length 1.

    Positive factors of rows and columns leave the rank as it is. Those of rows make forces and
    moments, and poses near to and far from singularities, count alike.
    """
    rng = np.random.default_rng(seed)
    poses = _poses(robot, _STATES_PER_COLUMN * sharing.shape[1], rng)
    # In the machine's own units of length and time, so that its size does not matter.
    size = max(leg.size for leg in robot.legs)
    second = np.sqrt(size / _ACCELERATION)
    units = np.where(np.arange(robot.freedom) < len(robot.platform.directions), size, 1.0)
    velocity = units / second * rng.normal(size=poses.shape)
    acceleration = units / second**2 * rng.normal(size=poses.shape)
    # Columns of kg, kg m and kg m^2 are compared by what a body of the machine's size would have.
    powers = np.array([p.length_power for p in parameter_data(robot)])
    extents = size ** (powers @ sharing / sharing.sum(axis=0))
    rows = (regressor(robot, poses, velocity, acceleration) @ sharing) * extents
    levers = np.array([size if leg.joint.unit == "rad" else 1.0 for leg in robot.legs])
    stacked = (rows / levers[:, None]).reshape(-1, sharing.shape[1])
    stacked = stacked / _lengths(stacked, axis=1)[0][:, None]
    # A column that does nothing stays zero instead of being blown up to noise.
    lengths, dropped = _lengths(stacked, axis=0)
    return _Scaled(stacked / lengths, lengths / extents, len(poses), dropped)


def _lengths(matrix: Array, axis: int) -> tuple[Array, float]:
    """Return the norms along an axis, infinite where they vanish beside the longest one.

    Second is the greatest of the vanishing norms, over the longest.
    """
    lengths = np.linalg.norm(matrix, axis=axis)
    shares = lengths / max(float(lengths.max(initial=0.0)), np.finfo(float).tiny)
    vanish = shares <= _TOLERANCE
    return np.where(vanish, np.inf, lengths), float(shares[vanish].max(initial=0.0))


def _poses(robot: Manipulator, count: int, rng: np.random.Generator) -> Array:
    """Return random poses (count, m) whose type-I and type-II measures exceed the medians.

    They keep the limits where enough poses do; the rank is the same beyond them.
    """
    expect_regular(robot)
    try:
        return random_poses(robot, count, seed=rng, **median_floors(robot)._asdict())
    except ModelError:
        least = median_floors(robot, limits=False)
        return random_poses(robot, count, seed=rng, limits=False, **least._asdict())


def independent(
    matrix: Array, order: Sequence[int], most: int | None = None, least: float = _TOLERANCE
) -> tuple[list[int], dict[int, float]]:
    """Return the first independent columns, `most` at most, and each column's remainder.

    Gram and Schmidt, twice over, which is as good as Householder: a remainder of more than `least`
    is a column's own.
    """
    basis = np.empty((matrix.shape[0], 0))
    taken: list[int] = []
    norms: dict[int, float] = {}
    for column in order:
        remainder = matrix[:, column]
        for _ in range(2):
            remainder = remainder - basis @ (basis.T @ remainder)
        norms[column] = float(np.linalg.norm(remainder))
        if norms[column] > least and len(taken) != most:
            taken.append(column)
            basis = np.column_stack([basis, remainder / norms[column]])
    return taken, norms


def _grouping(
    method: str,
    base_columns: list[int],
    dropped: list[int],
    shares: Array,
    scaled: _Scaled,
    gap: _Gap,
) -> Grouping:
    """Return the grouping of kept and dropped columns by their shares, with its certificate."""
    misfit = scaled.matrix[:, dropped] - scaled.matrix[:, base_columns] @ shares
    certificate = NumericalCertificate(
        method=method,
        rank=len(base_columns),
        columns=scaled.matrix.shape[1],
        states=scaled.states,
        tolerance=_TOLERANCE,
        smallest_kept=float(gap[0]),
        largest_dropped=max(float(gap[1]), scaled.dropped),
        residual=float(np.abs(misfit).max(initial=0.0)),
    )
    return Grouping(
        tuple(base_columns), _unscaled_shares(base_columns, dropped, shares, scaled), certificate
    )


def _unscaled_shares(
    base_columns: list[int], dropped: list[int], shares: Array, scaled: _Scaled
) -> Shares:
    """Return the shares of the unscaled columns, without those that are only rounding."""
    scale = scaled.lengths
    return {
        column: {
            k: float(shares[i, j] * scale[column] / scale[k])
            for i, k in enumerate(base_columns)
            if abs(shares[i, j]) > _TOLERANCE and np.isfinite(scale[column])
        }
        for j, column in enumerate(dropped)
    }
