"""Matrices of many more rows than columns: columns scaled to length one, and triangular factors."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pteron.kernels import Array


def scaled(columns: Array) -> tuple[Array, Array]:
    """Return columns (R, k) divided by their lengths, and these (k,); 1 for a column of zeros."""
    lengths = np.linalg.norm(columns, axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return columns / lengths, lengths


def triangle(pieces: Iterable[Array], size: int) -> Array:
    """Return the QR decomposition's R (k, k) of rows (R, k) in pieces, k being `size`."""
    factor: Array = np.zeros((size, size))
    for piece in pieces:
        factor = np.asarray(np.linalg.qr(np.vstack([factor, piece]), mode="r"))
    return factor
