"""Inertia and mobility at the joints: of Jacobians J (..., n, m), mass matrices M (..., m, m)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array = NDArray[np.float64]


def mass_with_rotors(rows: _Array, mass: _Array, rotors: _Array) -> _Array:
    """Return mass matrices with rotor inertias, M + J^T D J (..., m, m)."""
    return np.asarray(mass + (rows.mT * rotors[..., None, :]) @ rows)


def joint_mobilities(rows: _Array, mass: _Array) -> _Array:
    """Return the diagonal (..., n) of J M^-1 J^T, 1/kg or 1/(kg m^2).

    It is the acceleration of each joint per unit of its force, the other joints being free.
    """
    return np.asarray(np.einsum("...ij,...ji->...i", rows, np.linalg.solve(mass, rows.mT)))


def moved_inertias(rows: _Array, mass: _Array) -> _Array:
    """Return the inertia (..., n) at each joint, kg or kg m^2, with the other joints locked.

    With more joints than coordinates, where none can then move, the others are free.
    """
    if rows.shape[-2] > rows.shape[-1]:
        return np.asarray(1.0 / joint_mobilities(rows, mass))
    inverse = np.linalg.inv(rows)
    return np.asarray(np.einsum("...ai,...ab,...bi->...i", inverse, mass, inverse))


def rate_matrix(rows: _Array, strengths: ArrayLike = 1.0) -> _Array:
    """Return the matrices (..., m, n) that map joint rates to pose rates, J^-1.

    With more joints than coordinates the rates are those of least squares, weighted by the drives'
    strengths.
    """
    if rows.shape[-2] == rows.shape[-1]:
        return np.asarray(np.linalg.inv(rows))
    weights = np.asarray(strengths)
    return np.asarray(np.linalg.pinv(rows * weights[..., None]) * weights)


def solve_rates(rows: _Array, rates: _Array, strengths: ArrayLike = 1.0) -> _Array:
    """Return the pose rates (..., m, K) of joint rates (..., n, K), as `rate_matrix` maps them."""
    if rows.shape[-2] == rows.shape[-1]:
        return np.asarray(np.linalg.solve(rows, rates))
    return np.asarray(rate_matrix(rows, strengths) @ rates)


def share_loads(rows: _Array, loads: _Array, strengths: ArrayLike = 1.0) -> _Array:
    """Return the drive forces F (..., n, K) with J^T F = loads (..., m, K), of least norm."""
    if rows.shape[-2] == rows.shape[-1]:
        return np.asarray(np.linalg.solve(rows.mT, loads))
    return np.asarray(rate_matrix(rows, strengths).mT @ loads)
