"""Least squares through a QR factor that is built block by block, so that memory stays small."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.identification.errors import LogSourceMixin
from pteron.identification.observation import Observations, triangle
from pteron.kernels import Array

BLOCK = 1 << 14
"""Rows that are factorised at a time."""

_UNSEEN = 1e-10
"""Singular value, relative to the largest, below which a combination of values is not excited."""

_TAKES_PART = 0.05
"""Share of a value in a combination that is not excited, from which messages name the value."""

_PLAIN = 1e5
"""Condition number of W up to which W R^-1 is orthonormal to some ten digits."""


@dataclass(frozen=True)
class QrFactor(LogSourceMixin):
    """The triangular factor R of [W F], regressor and forces, W's columns scaled to length 1."""

    factor: Array
    """R of the scaled W (p, p)."""
    image: Array
    """Q^T F (p,)."""
    rest: float
    """Sum of squares of the least-squares residuals."""
    scale: Array
    """Lengths (p,) of W's columns: values = solution / scale."""
    rows: int
    """Number of equations."""
    names: tuple[str, ...]
    source: str
    """The log's name in messages."""

    @property
    def condition(self) -> float:
        """Condition number of W with its columns scaled to unit length."""
        return float(np.linalg.cond(self.factor))

    @property
    def degrees(self) -> int:
        """Degrees of freedom: the number of equations less that of values."""
        return self.rows - len(self.names)

    def values(self) -> Array:
        """Return the least-squares values (p,)."""
        return np.asarray(scipy.linalg.solve_triangular(self.factor, self.image) / self.scale)

    def inverse(self) -> Array:
        """Return (W^T W)^-1, (p, p): their covariance for noise of unit variance."""
        inverse = scipy.linalg.solve_triangular(self.factor, np.eye(len(self.names)))
        return np.asarray((inverse @ inverse.T) / np.outer(self.scale, self.scale))

    def inverse_triangle(self) -> Array | None:
        """Return the inverse (p, p) that orthonormalises W's columns; None if ill-conditioned."""
        if not self.condition < _PLAIN:
            return None
        inverse = scipy.linalg.solve_triangular(self.factor, np.eye(len(self.names)))
        return np.asarray(inverse / self.scale[:, None])

    def check_seen(self) -> QrFactor:
        """Return the factor itself; raise LogError, naming them, if values are undetermined."""
        if self.degrees <= 0:
            raise self.fault(
                "too short",
                f"{self.rows} equations are left after filters and edges, more than "
                f"{len(self.names)} are needed; record longer, or choose a higher band",
            )
        _, sizes, directions = np.linalg.svd(self.factor)
        unseen = directions[sizes <= _UNSEEN * sizes[0]]
        concerned = (np.abs(unseen) > _TAKES_PART).any(axis=0) | (self.scale == 0.0)
        if concerned.any():
            names = [name for name, flag in zip(self.names, concerned, strict=True) if flag]
            raise self.fault(
                "too little motion",
                f"too little motion: {len(names)} of {len(self.names)} values cannot be seen "
                f"({', '.join(names)}); move all coordinates at once, such as along a trajectory "
                "of pteron excite",
            )
        return self


def actuator_factors(observations: Observations) -> Observations:
    """Return equivalent observations with fewer rows: the triangle of each actuator's [W F].

    Whatever weights (n,) actuators have, they have the same `qr_factor`, from p + 1 rows each.
    """
    p = len(observations.names)
    triangles = np.empty((p + 1, observations.actuators, p + 1))
    for i in range(observations.actuators):
        rows = observations.matrix[:, i], observations.forces[:, i]
        starts = range(0, len(rows[1]), BLOCK)
        pieces = (np.column_stack([part[k : k + BLOCK] for part in rows]) for k in starts)
        triangles[:, i] = triangle(pieces, p + 1)
    return replace(observations, matrix=triangles[..., :p], forces=triangles[..., p])


def qr_factor(
    observations: Observations, weights: Array | None = None, *, block: int = BLOCK
) -> QrFactor:
    """Return the QR factor of observations, `block` rows at a time.

    The rows are multiplied by `weights`, (R, n) or (n,), where they are given.
    """
    p = len(observations.names)
    squares = np.zeros(p)
    # Two passes: lengths first, so that the factor is one of columns of like size.
    for matrix, _ in _blocks(observations, weights, block):
        squares += (matrix**2).sum(axis=0)
    scale = np.sqrt(squares)
    divisor = np.where(scale > 0.0, scale, 1.0)
    blocks = _blocks(observations, weights, block)
    full = triangle((np.column_stack([rows / divisor, f]) for rows, f in blocks), p + 1)
    labels = observations.rows, observations.names, observations.source
    return QrFactor(full[:p, :p], full[:p, p], float(full[p, p] ** 2), scale, *labels)


def _blocks(
    observations: Observations, weights: Array | None, block: int
) -> Iterator[tuple[Array, Array]]:
    """Yield weighted rows of the regressor and of the forces, flattened, in blocks of samples."""
    for start in range(0, len(observations.forces), block):
        rows = slice(start, start + block)
        matrix, forces = observations.matrix[rows], observations.forces[rows]
        if weights is not None:
            factors = weights if weights.ndim == 1 else weights[rows]
            matrix, forces = factors[..., None] * matrix, factors * forces
        yield matrix.reshape(-1, matrix.shape[-1]), forces.reshape(-1)
