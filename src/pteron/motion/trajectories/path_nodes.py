"""Places on a path between which its pose, tangent and curvature change little."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.motion.trajectories.path import Path, path_weights
from pteron.platforms import Platform

_EVEN = 0.3
"""Share of these intervals that is spaced evenly; the others are denser towards the rests."""

_BEND = 2e-3
"""Turn of the tangent, rad, by which an interval may differ from a curve of linear curvature."""

_TURN = 0.05
"""Greatest turn of the tangent in an interval, rad: a right angle of any size has some forty."""

_HALVINGS = 24
"""Rounds of halving: an interval of a metre becomes 1e-10 m."""


def path_nodes(
    path: Path, platform: Platform, begin: float, end: float, intervals: int = 400
) -> Array:
    """Return ascending arc lengths s (K,), m, from `begin` to `end`, dense where the path bends.

    `intervals` are those before any is halved.
    Intervals are halved until pose and tangent at their ends agree with the integrals of tangent
    and curvature over them, so that corners are found, however small, where no node is on them.
    """
    weights = path_weights(platform)

    def weighted(s: Array) -> tuple[Array, Array, Array]:
        """Return poses, tangents and curvatures (T, m) at arc lengths s (T,), angles as metres."""
        pose, first, second = path.at(s)
        return pose * weights, first * weights, second * weights

    even = np.linspace(0.0, 1.0, intervals + 1)
    s = begin + (end - begin) * (_EVEN * even + (1.0 - _EVEN) * (0.5 - 0.5 * np.cos(np.pi * even)))
    curve = weighted(s)
    low, high = np.arange(len(s) - 1), np.arange(1, len(s))
    for _ in range(_HALVINGS):
        middles = 0.5 * (s[low] + s[high])
        between = weighted(middles)
        span = (s[high] - s[low])[:, None]
        ends = [(part[low], part[high]) for part in curve]
        turns = np.linalg.norm(ends[1][1] - ends[1][0], axis=-1)
        bent = (_interval_errors(ends, between, span) > _BEND) | (turns > _TURN)
        if not bent.any():
            break
        new = len(s) + np.arange(int(bent.sum()))
        s = np.concatenate([s, middles[bent]])
        places, tangents, bends = (
            np.concatenate([part, more[bent]]) for part, more in zip(curve, between, strict=True)
        )
        curve = places, tangents, bends
        low, high = np.concatenate([low[bent], new]), np.concatenate([new, high[bent]])
    return np.sort(s)


def _interval_errors(
    ends: list[tuple[Array, Array]], between: tuple[Array, Array, Array], span: Array
) -> NDArray[np.float64]:
    """Return by how much, rad, each interval (K,) differs from a curve of linear curvature.

    `ends` are poses, tangents and curvatures (K, m) at both ends, `between` those in the middle.
    """
    (pose, next_pose), (first, next_first), (second, next_second) = ends
    _, middle_first, middle_second = between
    # Simpson's rule of the tangent and of the curvature.
    gaps = [
        (next_pose - pose) / span - (first + 4.0 * middle_first + next_first) / 6.0,
        next_first - first - span * (second + 4.0 * middle_second + next_second) / 6.0,
        span * (middle_second - 0.5 * (second + next_second)),
    ]
    return np.asarray(sum(np.linalg.norm(gap, axis=-1) for gap in gaps))
