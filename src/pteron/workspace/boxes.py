"""Boxes of poses cut in two, and poses of which some coordinates vary."""

from __future__ import annotations

from typing import Any

import numpy as np

from pteron.kernels import Array


def vary_coordinates(pose: Array, coordinates: Array, indices: Any = None) -> Array:
    """Return poses (..., m) with values (..., k) of some coordinates, the others from a pose (m,).

    `where` says for which, such as their indices (k,); by default they are the first.
    """
    poses = np.broadcast_to(pose, (*coordinates.shape[:-1], pose.shape[-1])).copy()
    poses[..., slice(coordinates.shape[-1]) if indices is None else indices] = coordinates
    return poses


def halve_boxes(boxes: Array, sizes: Array | float = 1.0) -> Array:
    """Return both halves of boxes (N, 2, k), one after the other, cut across their longest side.

    Sides are measured by sizes (k,), so that coordinates of different units are halved alike.
    """
    axis = ((boxes[:, 1] - boxes[:, 0]) / sizes).argmax(axis=1)
    rows, halves = np.arange(len(boxes)), np.repeat(boxes, 2, axis=0)
    middle = 0.5 * (boxes[rows, 0, axis] + boxes[rows, 1, axis])
    halves[2 * rows, 1, axis] = halves[2 * rows + 1, 0, axis] = middle
    return halves
