"""Derivatives by central differences of eighth order, for functions that accept batches."""

import numpy as np

OFFSETS = np.array([-4, -3, -2, -1, 1, 2, 3, 4])
WEIGHTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280])

STEP = 5e-5
"""In metres or radians: the legs of a pose with bend 0.5 are then over 100 steps from stretched, so
that the truncation error (step / distance)^8 is below rounding, 1e-16 / STEP."""


def along(function, step):
    """Return d/dt of function(t) at t = 0; t is an array (8,), the leading axis of the result."""
    values = function(OFFSETS * step)
    return np.tensordot(WEIGHTS, values, axes=(0, 0)) / step


def gradient(function, poses, step=STEP):
    """Return the derivative of function(poses (..., m)) -> (..., *shape): (..., *shape, m)."""
    columns = [
        along(
            lambda t, axis=axis: function(poses + np.multiply.outer(t, axis * np.ones_like(poses))),
            step,
        )
        for axis in np.eye(poses.shape[-1])
    ]
    return np.stack(columns, axis=-1)
