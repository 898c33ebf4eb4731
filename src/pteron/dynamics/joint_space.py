"""Inertia and mobility at the joints: of Jacobians J (..., n, m), mass matrices M (..., m, m)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    """Return the inertia (..., n) at each joint, kg or kg m^2, with the other joints locked."""
    inverse = np.linalg.inv(rows)
    return np.asarray(np.einsum("...ai,...ab,...bi->...i", inverse, mass, inverse))
