"""How large a shape can be about a centre, and where it can be larger."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import linprog  # type: ignore[import-untyped]

from pteron.kernels import Array

_STEPS = 40
_SIZES = 33
_STEP = 1e-6
"""m, of differences."""


class Growth:
    """A search for the centre at which a shape can be largest.

    Where the shape's points keep all conditions, linear programs say which way the centre should
    move so that it can grow; a step that does not help is halved.

    Parameters
    ----------
    rooms : callable
        Of positions (..., k): what is not negative inside, (..., C).
    template : array, shape (T, k)
        Points of the shape of size 1.
    gauge : callable
        Of ways from the centre (..., k): the size of the shape that they end at, (...).
    """

    def __init__(
        self,
        rooms: Callable[[Array], Array],
        template: Array,
        gauge: Callable[[Array], Array],
    ) -> None:
        self.rooms, self.template, self.gauge = rooms, template, gauge
        self.outside = np.empty((0, template.shape[1]))
        """Positions that are known not to be inside."""

    def learn(self, position: Array, center: Array) -> None:
        """Take note of a position that is not inside, found in a shape about a centre."""
        way = position - center
        self.outside = np.vstack([self.outside, position])
        self.template = np.vstack([self.template, way / self.gauge(way)])

    def size_at(self, center: Array, most: float) -> float:
        """Return the largest size up to `most` up to which all of the shape's points are inside."""
        low, high = 0.0, float(self.gauge(self.outside - center).min(initial=most))
        for _ in range(4):
            sizes = np.linspace(low, high, _SIZES)
            points = center + sizes[:, None, None] * self.template
            good = (self.rooms(points) >= 0.0).all(axis=(1, 2))
            first = _SIZES if good.all() else int((~good).argmax())
            if first in (0, _SIZES):
                return high if first else 0.0
            low, high = sizes[first - 1], sizes[first]
        return float(low)

    def improved(self, center: Array, size: float) -> tuple[Array, float]:
        """Return a centre, from one on, at which the shape is largest, and its size there."""
        size = self.size_at(center, 2.0 * size)
        trust = max(size, _STEP)
        for _ in range(_STEPS):
            moved, grown = self._step(center, size, trust)
            reached = self.size_at(moved, max(grown, 2.0 * size))
            if reached > size:
                gain, center, size = reached - size, moved, reached
                if gain < 1e-7 * size:
                    break
            else:
                trust *= 0.35
                if trust < 1e-6 * max(size, _STEP):
                    break
        return center, size

    def _step(self, center: Array, size: float, trust: float) -> tuple[Array, float]:
        """Return where a linear program would move the centre, and what size it hopes for."""
        k = len(center)
        points = center + size * self.template
        values = self.rooms(points)
        ways = _STEP * np.eye(k)
        slopes = np.stack(
            [(self.rooms(points + w) - self.rooms(points - w)) / (2.0 * _STEP) for w in ways], -1
        )
        lengths = np.linalg.norm(slopes, axis=-1)
        near = np.isfinite(values) & np.isfinite(lengths) & (lengths > 0.0)
        near &= values < 4.0 * trust * np.where(near, lengths, 1.0)
        rows, columns = np.nonzero(near)
        normals = slopes[rows, columns] / lengths[rows, columns][:, None]
        grows = np.einsum("nk,nk->n", normals, self.template[rows])
        found = linprog(
            np.append(np.zeros(k), -1.0),
            A_ub=-np.column_stack([normals, grows]),
            b_ub=np.maximum(values[rows, columns] / lengths[rows, columns], 0.0),
            bounds=[(-trust, trust)] * (k + 1),
        )
        if found.x is None:
            return center, size
        return center + found.x[:k], size + float(found.x[k])
