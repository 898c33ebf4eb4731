"""`MachineAxes`, base class of axes that a machine is drawn on: lines, marks, faces and texts.

`space_axes` and `plane_axes` have those of pictures in space and in a plane.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, PAPER, SMALL

Style = str | tuple[float, tuple[float, ...]]
"""A line's style, as matplotlib has it."""


class MachineAxes(ABC):
    """Axes of a figure, and the `things` drawn on them, in their order.

    While it `measures` nothing is drawn, but `fill` leaves space for it.
    """

    _line: ClassVar[Any] = Line2D

    def __init__(self, axes: Any, *, small: bool) -> None:
        """Begin with nothing; `small` axes have thinner lines and smaller letters."""
        axes.patch.set_alpha(0.0)
        self.axes = axes
        self.figure: Figure = axes.figure
        self._weight = SMALL if small else 1.0
        self._font = FONT_SIZE - 2.0 if small else FONT_SIZE
        self.things: list[Artist] = []
        self.measures = False
        self._drawn: list[Array] = []

    @abstractmethod
    def _to_axes(self, points: Array, *, extends: bool = True) -> Array:
        """Return points (..., 3) of the base frame in axes coordinates; `fill` includes them."""

    @abstractmethod
    def _order(self, points: Array) -> float:
        """Return the drawing order of points (K, d) of the axes."""

    @abstractmethod
    def _polygons(self, faces: list[Array], **look: Any) -> Artist:
        """Add polygons with corners in the axes' coordinates."""

    @abstractmethod
    def side_direction(self, away: Array, line_direction: Array) -> Array:
        """Return the unit vector in the picture's plane, across a line, nearest to `away`."""

    @abstractmethod
    def fill(self, angles: Sequence[float] = (0.0,)) -> None:
        """Place the axes so that all things fit into them, seen from any of the angles, rad."""

    def clear(self, count: int) -> None:
        """Remove all but the first `count` things."""
        for thing in self.things[count:]:
            thing.remove()
        del self.things[count:]
        self._drawn.clear()

    @property
    def drawn_points(self) -> Array:
        """The points (K, 2) or (K, 3) of all things, in the axes' coordinates."""
        return np.vstack(self._drawn)

    def reserve_space(self, drawn: Array) -> None:
        """Let `fill` leave space for points, (K, 2) or (K, 3), of other axes."""
        self._drawn.append(drawn)

    def line(
        self, points: Array, color: str, width: float, *, raised: float = 0.0, style: Style = "-"
    ) -> None:
        """Draw a line through points (K, 3)."""
        p = self._to_axes(points)
        if self.measures:
            return
        look: dict[str, Any] = {"color": color, "linewidth": self._weight * width}
        look |= {"linestyle": style, "solid_capstyle": "round"}
        self._add_line(p, zorder=self._order(p) + raised, **look)

    def mark(self, point: Array, face: str, edge: str, size: float, raised: float = 0.03) -> None:
        """Draw a ring at a point."""
        p = self._to_axes(point[None], extends=False)
        if self.measures:
            return
        look: dict[str, Any] = {"marker": "o", "markersize": self._weight * size}
        look |= {"markeredgewidth": 1.4 * self._weight, "linestyle": "none"}
        look |= {"markerfacecolor": face, "markeredgecolor": edge}
        self._add_line(p, zorder=self._order(p) + raised, **look)

    def _add_line(self, p: Array, **look: Any) -> None:
        """Draw a polyline through points (K, d), without a rescaling of the axes."""
        # `plot` would scale the axes, each time, which `fill` does once.
        self.things.append(self.axes.add_artist(self._line(*p.T, **look)))

    def faces(self, faces: list[Array], color: str, alpha: float, raised: float = 0.0) -> None:
        """Draw polygons with a common drawing order."""
        placed = [self._to_axes(face, extends=False) for face in faces]
        if self.measures:
            return
        look: dict[str, Any] = {"facecolors": color, "edgecolors": PAPER, "linewidths": 0.6}
        order = self._order(np.vstack(placed)) + raised
        self.things.append(self._polygons(placed, alpha=alpha, zorder=order, **look))

    def text(self, point: Array, text: str, color: str, *, bold: bool = False) -> None:
        """Write a text beside a point, above everything."""
        look: dict[str, Any] = {"fontsize": self._font, "fontweight": "bold" if bold else "normal"}
        look |= {"ha": "center", "va": "center", "zorder": 30.0}
        p = self._to_axes(point[None])[0]
        if self.measures:
            return
        self.things.append(self.axes.text(*p, text, color=color, **look))
