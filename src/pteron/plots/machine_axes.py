"""What was drawn on axes: all of it to be held by their scales, the last of it to be taken away."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, SMALL


class MachineAxes:
    """Axes and what was put on them: `things`, in that order."""

    def __init__(self, *, small: bool) -> None:
        """Begin with nothing; `small` axes have thinner lines and smaller letters."""
        self._weight = SMALL if small else 1.0
        self._font = FONT_SIZE - 2.0 if small else FONT_SIZE
        self.things: list[Artist] = []
        self._drawn: list[Array] = []

    def clear(self, kept: int) -> None:
        """Take away what was drawn last, all but so many things."""
        for thing in self.things[kept:]:
            thing.remove()
        del self.things[kept:]
        self._drawn.clear()

    @property
    def drawn(self) -> Array:
        """Return the points (K, 2) or (K, 3) of what was drawn, as the axes have them."""
        return np.vstack(self._drawn)

    def hold(self, drawn: Array) -> None:
        """Let `fill` leave room for points, (K, 2) or (K, 3), that other axes hold."""
        self._drawn.append(drawn)
