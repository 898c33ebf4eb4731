"""Pictures of slices through the reach: its margin and the leg that ends it, or another measure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy  # type: ignore[import-untyped]
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.path import Path
from matplotlib.ticker import MultipleLocator

from pteron.kernels import Array
from pteron.platforms.coordinates import coordinate
from pteron.plots.canvas import (
    INK,
    MUTED,
    PAPER,
    REACH,
    blank,
    labelled_contours,
    plain_axes,
    real_figure,
    spot,
)
from pteron.plots.leg_curves import LEG_COLORS
from pteron.plots.ticks import nice_step
from pteron.tolerances import ROUNDING
from pteron.workspace import BEYOND_LIMITS, REACHABLE, ReachSlice

_BANDS = 4
"""Shades of the margin inside the reach."""

_TENTHS = [tenth / 10.0 for tenth in range(10)]
"""Levels of a measure's lines."""

_SPECK = 2.0
"""Size, in cells of the grid, below which an outline is not drawn."""

_DASHES = ("-", "-", (0, (3, 2)), (0, (3, 2)), (0, (1, 1)), (0, (1, 1)))
"""Styles of lines of legs 1 to 6: lines which coincide, as those of mirrored legs do, both show."""


def reach_figure(
    cut: ReachSlice, *, path: Array | None = None, ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of a slice through the reach, with a motion's poses (T, m) on it.

    In reach, the shade deepens with the margin. Outside, the colour is that of the leg that misses
    the pose by most; a line in a leg's colour is the end of its reach (type I).
    """
    figure, axes, first, second = _sheet(cut, ax)

    def fill(field: Array, color: str, alpha: float, level: float = 0.0) -> None:
        """Fill where a field (rows, columns) exceeds a level, with a color."""
        if field.max() > level:
            axes.contourf(first, second, field, levels=[level, np.inf], colors=[color], alpha=alpha)

    legs = np.moveaxis(cut.leg_margins, -1, 0)
    # What is painted over begins and ends elsewhere by less than a cell of the grid: so no gaps.
    for field, color in _territories(legs):
        fill(field, PAPER, 1.0)
        fill(field, color, 0.16)
    if (cut.status == BEYOND_LIMITS).any():
        fill(legs.min(axis=0), MUTED, 0.4)
        fill(cut.margin, PAPER, 1.0)
    for level in np.linspace(0.0, max(float(cut.margin.max()), 0.0), _BANDS, endpoint=False):
        fill(cut.margin, REACH, 0.24, float(level))
    for i, margin in enumerate(legs):
        if margin.min() < 0.0 < margin.max():
            edge = axes.contour(first, second, margin, levels=[0.0], colors=[LEG_COLORS[i]])
            edge.set(linestyles=[_DASHES[i]], linewidths=1.6)
    _finish(axes, cut, path)
    return real_figure(figure)


def measure_figure(
    cut: ReachSlice,
    measure: Array,
    *,
    path: Array | None = None,
    levels: Sequence[float] = _TENTHS,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of a measure (B, A) on a slice, where it is in reach.

    The shade deepens with the measure from level to level, by default tenths; every second line is
    named.
    """
    figure, axes, first, second = _sheet(cut, ax, lowest=0.0)
    # Drawn beyond the edge of the reach and cut off there, so that the edge is smooth.
    nearest = scipy.ndimage.distance_transform_edt(np.isnan(measure), return_indices=True)[1]
    extended = measure[tuple(nearest)]
    inside = np.ma.masked_where(cut.status != REACHABLE, extended)
    drawn = [
        axes.contourf(first, second, extended, levels=[level, np.inf], colors=[REACH], alpha=0.11)
        for level in levels
        if level < extended.max()
    ]
    labelled_contours(axes, first, second, inside, levels[::2])
    edge = axes.contour(first, second, cut.margin, levels=[0.0], colors=[MUTED], linewidths=1.0)
    # Where the reach ends in a thread thinner than the grid, single cells of it are no picture.
    cell = np.array([np.ptp(first), np.ptp(second)]) / np.subtract(inside.shape, 1)
    rims = [
        rim
        for rim in edge.get_paths()[0].to_polygons(closed_only=False)
        if (np.ptp(rim, axis=0) > _SPECK * cell).any()
    ]
    outline = Path.make_compound_path(*map(Path, rims))
    edge.set_paths([outline])
    for region in drawn:
        region.set_clip_path(outline, axes.transData)
    _finish(axes, cut, path)
    return real_figure(figure)


def _sheet(
    cut: ReachSlice, ax: Axes | SubFigure | None, lowest: float = 1.8
) -> tuple[Figure, Axes, Array, Array]:
    """Return a figure, its axes with their scales, and both coordinates in display units."""
    names = [coordinate(name) for name in cut.plane]
    first, second = names[0].shown_factor * cut.first, names[1].shown_factor * cut.second
    spans, same = np.array([np.ptp(first), np.ptp(second)]), names[0].unit == names[1].unit
    shape = float(spans[1] / spans[0]) if same else 1.0
    height = 0.6 + 3.3 * shape
    figure = blank(3.9, min(max(height, lowest), 5.6) if lowest else height, ax)
    axes = plain_axes(figure, *(f"{name.symbol} ({name.shown_unit})" for name in names))
    axes.grid(visible=False)
    axes.set_aspect("equal" if same else "auto")
    axes.set(xlim=(first[0], first[-1]), ylim=(second[0], second[-1]))
    wide = [spans.max()] * 2 if same else spans
    for scale, span in zip((axes.xaxis, axes.yaxis), wide, strict=True):
        scale.set_major_locator(MultipleLocator(nice_step(float(span) / 6.0)))
    return figure, axes, first, second


def _finish(axes: Axes, cut: ReachSlice, path: Array | None) -> None:
    """Draw a motion's path and the slice's centre over a map."""
    (i, j), (a, b) = cut.places, (coordinate(name).shown_factor for name in cut.plane)
    if path is not None:
        for color, width in ((PAPER, 3.2), (INK, 1.4)):
            (line,) = axes.plot(a * path[:, i], b * path[:, j], color=color, linewidth=width)
            line.set_solid_capstyle("round")
    spot(axes, a * cut.center[i], b * cut.center[j], INK, PAPER, 6.0, zorder=5)


def _territories(legs: Array) -> Iterator[tuple[Array, str]]:
    """Yield fields (B, A), positive where poses are infeasible, with their colours, to be painted.

    In the end a pose has the colour of the leg that misses it by most: the last leg's is painted
    wherever one does, then the others' over it where none after them does worse. Of legs that miss
    alike in the whole slice, as mirrored ones do, the first counts.
    """
    far = np.abs(legs[:, None] - legs).max(axis=(-2, -1))
    first = [i for i in range(len(legs)) if not (far[i, :i] <= ROUNDING).any()]
    ranked, missed = legs[first], -legs.min(axis=0)
    for count in range(len(first), 0, -1):
        others = ranked[count:].min(axis=0, initial=np.inf)
        yield np.minimum(missed, others - ranked[:count].min(axis=0)), LEG_COLORS[first[count - 1]]
