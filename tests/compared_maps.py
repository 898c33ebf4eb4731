"""Comparison of two maps."""

from __future__ import annotations

import numpy as np


def alike(one, other):
    """Say whether two maps are the same to the last bit."""
    return (
        one.grid == other.grid
        and (one.status == other.status).all()
        and one.values.keys() == other.values.keys()
        and all(np.array_equal(v, other.values[k], equal_nan=True) for k, v in one.values.items())
    )
