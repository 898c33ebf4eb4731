"""Axes in the plane of a planar machine, which is seen along the plane's normal."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from pteron.kernels import Array
from pteron.plots.canvas import PAPER, nice_step, plain_axes
from pteron.plots.machine_axes import MachineAxes

_RIM = 0.06
"""Share of what is drawn that the scales show around it."""


_APART = 0.4
"""Inches between two numbers of a scale, at least."""

_LEFT, _BELOW, _TOP = 0.62, 0.46, 0.1
"""Inches of a box that the scales and their names take, and that are free over the axes."""


class PlaneAxes(MachineAxes):
    """Axes with scales in mm, onto which points in space are put where the plane has them."""

    def __init__(
        self,
        figure: Figure,
        plane: Array,
        step: float,
        box: tuple[float, float, float, float] | None = None,
        *,
        small: bool = False,
    ) -> None:
        """Make the axes for x and y along the rows (2, 3) of `plane`, with squares of a side, m.

        They take a box of the figure (left, bottom, width, height, shares of it), or all of it;
        `small` ones have no scales.
        """
        super().__init__(small=small)
        axes = plain_axes(figure, "x (mm)", "y (mm)")
        axes.set_aspect("equal")
        if box is not None:
            figure.set_layout_engine("none")
            left, bottom, width, height = box
            if not small:
                wide, tall = figure.get_size_inches()
                left, width = left + _LEFT / wide, width - (_LEFT + _TOP) / wide
                bottom, height = bottom + _BELOW / tall, height - (_BELOW + _TOP) / tall
            axes.set_position((left, bottom, width, height))
        if small:
            axes.tick_params(length=0.0, labelbottom=False, labelleft=False)
            axes.set(xlabel="", ylabel="")
            for spine in axes.spines.values():
                spine.set_visible(False)
        self._small, self._step = small, step
        self.axes, self.plane = axes, plane

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
        look: dict[str, Any] = {
            "color": color,
            "linewidth": self._weight * width,
            "linestyle": style,
        }
        x, y = self._flat(points).T
        self.things += self.axes.plot(x, y, zorder=10.0 + raised, solid_capstyle="round", **look)

    def mark(self, point: Array, face: str, edge: str, size: float, raised: float = 0.03) -> None:
        """Draw a ring at a point."""
        x, y = self._flat(point)
        look: dict[str, Any] = {
            "marker": "o",
            "markersize": self._weight * size,
            "markeredgewidth": 1.4 * self._weight,
        }
        look |= {"markerfacecolor": face, "markeredgecolor": edge}
        self.things += self.axes.plot([x], [y], zorder=10.0 + raised, linestyle="none", **look)

    def faces(self, faces: list[Array], color: str, alpha: float, raised: float = 0.0) -> None:
        """Draw polygons."""
        flat = [self._flat(face) for face in faces]
        look: dict[str, Any] = {"facecolors": color, "edgecolors": PAPER, "linewidths": 0.6}
        polygons = PolyCollection(flat, alpha=alpha, zorder=10.0 + raised, **look)
        self.things.append(self.axes.add_collection(polygons))

    def text(self, point: Array, text: str, color: str, *, bold: bool = False) -> None:
        """Write beside a point, over everything."""
        x, y = self._flat(point)
        look: dict[str, Any] = {"fontsize": self._font, "fontweight": "bold" if bold else "normal"}
        look |= {"ha": "center", "va": "center", "zorder": 30.0}
        self.things.append(self.axes.text(x, y, text, color=color, **look))

    def fill(self) -> None:
        """Let the scales end a rim beyond what was drawn."""
        drawn = self.drawn
        low, high = drawn.min(axis=0), drawn.max(axis=0)
        rim = _RIM * float((high - low).max())
        low, high = low - rim, high + rim
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        if self._small:
            return
        # As many squares as their numbers have room for.
        figure, place = self.axes.get_figure(root=True), self.axes.get_position()
        assert figure is not None
        room = np.array([place.width, place.height]) * figure.get_size_inches()
        step = nice_step(max(1e3 * self._step, _APART * float(((high - low) / room).max())))
        for scale in (self.axes.xaxis, self.axes.yaxis):
            scale.set_major_locator(MultipleLocator(step))
