"""Samples at any times as what their lowest harmonics are, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve  # type: ignore[import-untyped]

from pteron.kernels import Array

__all__ = ["Projection", "fourier_basis", "row_blocks"]

_BLOCK = 1 << 14


def row_blocks(rows: int) -> Iterator[slice]:
    """Yield so many rows in parts of a bounded size."""
    for start in range(0, rows, _BLOCK):
        yield slice(start, min(start + _BLOCK, rows))


def fourier_basis(time: Array, period: float, harmonics: int, derivative: int = 0) -> Array:
    """Return one, and sine and cosine of each harmonic (T, 2 H + 1), or their derivatives."""
    angle = 2.0 * np.pi / period
    columns = np.zeros((len(time), 2 * harmonics + 1))
    columns[:, 0] = float(derivative == 0)
    phase = np.remainder(time, period) * angle
    shift = derivative * np.pi / 2.0
    for h in range(1, harmonics + 1):
        scale = (h * angle) ** derivative
        columns[:, 2 * h - 1] = scale * np.sin(h * phase + shift)
        columns[:, 2 * h] = scale * np.cos(h * phase + shift)
    return columns


@dataclass(frozen=True)
class Projection:
    """Least squares onto the lowest harmonics of a period.

    Over a period and more the basis is nearly orthogonal, so that normal equations lose nothing.

    Attributes
    ----------
    time : array, shape (T,)
        Of the samples, s.
    period : float
        s.
    harmonics : int
        H.
    """

    time: Array
    period: float
    harmonics: int
    _normal: tuple[Array, bool]

    @classmethod
    def of(cls, time: Array, period: float, harmonics: int) -> Projection:
        """Return the projection of samples at some times."""
        bases = (fourier_basis(time[rows], period, harmonics) for rows in row_blocks(len(time)))
        size = 2 * harmonics + 1
        normal = sum((basis.T @ basis for basis in bases), np.zeros((size, size)))
        return cls(time, period, harmonics, cho_factor(normal))

    def basis(self, rows: slice) -> Array:
        """Return the basis functions at some of the samples."""
        return fourier_basis(self.time[rows], self.period, self.harmonics)

    def coefficients(self, signal: Callable[[slice], Array], size: int) -> Array:
        """Return the coefficients (2 H + 1, k) of a signal that comes as (rows, k)."""
        right = np.zeros((2 * self.harmonics + 1, size))
        for rows in row_blocks(len(self.time)):
            right += self.basis(rows).T @ signal(rows)
        return np.asarray(cho_solve(self._normal, right))

    def noise(self, used: Array, kept: Array) -> Array:
        """Return what is left at times `kept` of unit white noise on samples (T, n) that are 1."""
        at = cho_solve(self._normal, fourier_basis(kept, self.period, self.harmonics).T)
        variance = np.zeros((len(kept), used.shape[1]))
        for rows in row_blocks(len(self.time)):
            variance += ((self.basis(rows) @ at) ** 2).T @ used[rows]
        return np.asarray(np.sqrt(variance))
