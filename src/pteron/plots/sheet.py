"""Axes in the plane of a planar machine, which is seen along the plane's normal."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, PAPER, plain_axes

_RIM = 0.06
"""Share of what is drawn that the scales show around it."""


class Sheet:
    """Axes with scales in mm, onto which points in space are put where the plane has them."""

    def __init__(self, figure: Figure, plane: Array, step: float) -> None:
        """Make the axes for x and y along the rows (2, 3) of `plane`, with squares of a side, m."""
        axes = plain_axes(figure, "x (mm)", "y (mm)")
        axes.set_aspect("equal")
        for scale in (axes.xaxis, axes.yaxis):
            scale.set_major_locator(MultipleLocator(1e3 * step))
        self.axes, self.plane = axes, plane
        self._drawn: list[Array] = []

    def _flat(self, points: Array) -> Array:
        flat = 1e3 * points @ self.plane.T
        self._drawn.append(flat.reshape(-1, 2))
        return np.asarray(flat)

    def beside(self, away: Array, along: Array) -> Array:
        """Return the unit vector in the plane, across a line, nearest to `away`."""
        x, y = self.plane @ along
        across = np.array([-y, x]) / max(float(np.hypot(x, y)), 1e-12)
        return np.asarray(np.copysign(1.0, across @ self.plane @ away) * across @ self.plane)

    def line(
        self,
        points: Array,
        color: str,
        width: float,
        *,
        raised: float = 0.0,
        style: str | tuple[float, tuple[float, ...]] = "-",
    ) -> None:
        """Draw a line through points (K, 3)."""
        look: dict[str, Any] = {"color": color, "linewidth": width, "linestyle": style}
        x, y = self._flat(points).T
        self.axes.plot(x, y, zorder=10.0 + raised, solid_capstyle="round", **look)

    def mark(self, point: Array, face: str, edge: str, size: float, raised: float = 0.03) -> None:
        """Draw a ring at a point."""
        x, y = self._flat(point)
        look: dict[str, Any] = {"marker": "o", "markersize": size, "markeredgewidth": 1.4}
        look |= {"markerfacecolor": face, "markeredgecolor": edge}
        self.axes.plot([x], [y], zorder=10.0 + raised, linestyle="none", **look)

    def faces(self, faces: list[Array], color: str, alpha: float, raised: float = 0.0) -> None:
        """Draw polygons."""
        flat = [self._flat(face) for face in faces]
        look: dict[str, Any] = {"facecolors": color, "edgecolors": PAPER, "linewidths": 0.6}
        self.axes.add_collection(PolyCollection(flat, alpha=alpha, zorder=10.0 + raised, **look))

    def text(self, point: Array, text: str, color: str, *, bold: bool = False) -> None:
        """Write beside a point, over everything."""
        x, y = self._flat(point)
        look: dict[str, Any] = {"fontsize": FONT_SIZE, "fontweight": "bold" if bold else "normal"}
        self.axes.text(x, y, text, color=color, ha="center", va="center", zorder=30.0, **look)

    def fill(self) -> None:
        """Let the scales end a rim beyond what was drawn."""
        drawn = np.vstack(self._drawn)
        low, high = drawn.min(axis=0), drawn.max(axis=0)
        rim = _RIM * float((high - low).max())
        self.axes.set(xlim=(low[0] - rim, high[0] + rim), ylim=(low[1] - rim, high[1] + rim))
