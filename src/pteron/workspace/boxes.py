"""Boxes of poses cut in two, for searches and proofs by branch and bound."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array


def halved(boxes: Array, sizes: Array | float = 1.0) -> Array:
    """Return both halves of boxes (N, 2, k), one after the other, cut across their longest side.

    Sides are measured by sizes (k,), so that coordinates of different units are halved alike.
    """
    axis = ((boxes[:, 1] - boxes[:, 0]) / sizes).argmax(axis=1)
    rows, halves = np.arange(len(boxes)), np.repeat(boxes, 2, axis=0)
    middle = 0.5 * (boxes[rows, 0, axis] + boxes[rows, 1, axis])
    halves[2 * rows, 1, axis] = halves[2 * rows + 1, 0, axis] = middle
    return halves
