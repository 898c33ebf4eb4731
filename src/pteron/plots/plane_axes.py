"""Axes of pictures of a planar machine, in its plane, seen along the normal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from pteron.kernels import Array
from pteron.plots.canvas import Picture, plain_axes
from pteron.plots.machine_axes import MachineAxes
from pteron.plots.ticks import nice_step

_RIM = 0.06
"""Margin around the drawing, as a share of its size."""


_APART = 0.4
"""Least distance between two numbers of a scale, inches."""

_LEFT, _BELOW, _TOP = 0.62, 0.46, 0.1
"""Inches for the scales and their names, left of and below the axes, and free above the axes."""


class PlaneAxes(MachineAxes):
    """Axes with scales in mm, onto which points in space are projected."""

    def __init__(
        self,
        figure: Figure,
        plane: Array,
        step: float,
        box: tuple[float, float, float, float] | None = None,
        *,
        small: bool = False,
    ) -> None:
        """Make the axes for x and y along the two rows of `plane`, shape (2, 3).

        The grid's squares have sides of `step`, m.

        They take a box of the figure (left, bottom, width, height, shares of it), or all of it;
        `small` ones have no scales.
        """
        axes = plain_axes(figure, "x (mm)", "y (mm)")
        super().__init__(axes, small=small)
        axes.set_aspect("equal")
        if box is not None:
            if isinstance(figure, Picture):
                figure.set_layout_engine("none")
            x_start, bottom, width, height = box
            if not small:
                wide, tall = figure.get_size_inches()
                x_start, width = x_start + _LEFT / wide, width - (_LEFT + _TOP) / wide
                bottom, height = bottom + _BELOW / tall, height - (_BELOW + _TOP) / tall
            axes.set_position((x_start, bottom, width, height))
        if small:
            axes.tick_params(length=0.0, labelbottom=False, labelleft=False)
            axes.set(xlabel="", ylabel="")
            for spine in axes.spines.values():
                spine.set_visible(False)
        self._small, self._step, self.plane = small, step, plane

    def _to_axes(self, points: Array, *, extends: bool = True) -> Array:
        """Return points (..., 3) projected on the plane (..., 2), mm; `fill` includes them."""
        flat = np.asarray(1e3 * points @ self.plane.T)
        self._drawn.append(flat)
        return flat

    def _order(self, points: Array) -> float:
        """Return a constant drawing order: things in a plane have no depth."""
        return 10.0

    def _polygons(self, faces: list[Array], **look: Any) -> Artist:
        """Add filled polygons to the axes."""
        polygons: Artist = self.axes.add_collection(PolyCollection(faces, **look))
        return polygons

    def side_direction(self, away: Array, line_direction: Array) -> Array:
        """Return the unit vector in the plane, across a line, nearest to `away`."""
        x, y = self.plane @ line_direction
        normal = np.array([-y, x]) / max(float(np.hypot(x, y)), 1e-12)
        return np.asarray(np.copysign(1.0, normal @ self.plane @ away) * normal @ self.plane)

    def fill(self, angles: Sequence[float] = (0.0,)) -> None:
        """Set the scales to end a margin beyond everything drawn."""
        drawn = self.drawn_points
        low, high = drawn.min(axis=0), drawn.max(axis=0)
        rim = _RIM * float((high - low).max())
        low, high = low - rim, high + rim
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        if self._small:
            return
        # As many squares as their numbers leave space for.
        figure, place = self.axes.get_figure(root=True), self.axes.get_position()
        assert figure is not None
        room = np.array([place.width, place.height]) * figure.get_size_inches()
        step = nice_step(max(1e3 * self._step, _APART * float(((high - low) / room).max())))
        for scale in (self.axes.xaxis, self.axes.yaxis):
            scale.set_major_locator(MultipleLocator(step))
