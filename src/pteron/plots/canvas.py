"""Empty figures and axes in the style of all pictures, with their colours and legends."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.platforms.coordinates import SHOWN, coordinate
from pteron.plots.fonts import silence_glyph_warnings, take_fonts, warn_of_absent
from pteron.plots.ticks import TickLabels, TickLocator

Kind = TypeVar("Kind", bound=Hashable)


INK = "#1c2630"
"""Text and main lines."""

MUTED = "#66727f"
"""Scales and secondary text."""

GRID = "#d3dae1"
"""Grid lines."""

PAPER = "#fdfefe"
"""Background."""

REACH = "#3d6b8f"
"""The reach of a machine."""

WARNING = "#b3261e"
"""Limits and faults."""

FONT_SIZE = 9.0
"""Points. Figures are about as wide as a phone's screen, so that text stays legible there."""

SMALL = 0.6
"""Width of lines in small pictures of a machine, over that in large ones."""

NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))
"""Metadata left out of an SVG file, so that the same figure gives the same file."""

TEXT: Any = {"svg.fonttype": "none", "svg.hashsalt": "pteron", "pdf.fonttype": 42}
"""Settings with which text stays text, and files are the same in each run."""


_NOTEBOOK_DPI = 144
"""Dots an inch of a picture in a notebook, which shows it at 96."""


class Picture(Figure):
    """A figure that notebooks show without pyplot, in fonts that have its letters."""

    def draw(self, renderer: Any) -> None:
        """Draw the figure."""
        saving, engine = self.canvas.is_saving(), self.get_layout_engine()
        if not saving:  # else `savefig` has done it
            take_fonts(self)
        with silence_glyph_warnings():
            if saving and isinstance(engine, ConstrainedLayoutEngine) and self._is_flat:
                # Matplotlib draws all in vain to place the axes, then again with an idle engine.
                engine.execute(self)
            else:
                super().draw(renderer)

    @property
    def _is_flat(self) -> bool:
        """Whether all axes are two-dimensional and Cartesian."""
        return all(axes.name == "rectilinear" for axes in self.axes)

    def savefig(self, fname: Any, **options: Any) -> None:
        """Write the figure, with a single warning of all letters that no font here has."""
        absent = take_fonts(self)
        with silence_glyph_warnings():
            super().savefig(fname, **options)
        # An .svg keeps text as text, for its reader's fonts.
        if str(options.get("format") or Path(str(fname)).suffix[1:]).lower() != "svg":
            warn_of_absent(absent)

    def _ipython_display_(self) -> None:
        """Show the figure in a notebook as a PNG at a fixed resolution."""
        # The way that goes before pyplot's, which notebooks know only once it is imported.
        from IPython.display import display

        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=_NOTEBOOK_DPI)
        width, height = (round(96.0 * inches) for inches in self.get_size_inches())
        size = {"width": width, "height": height}
        shown = {"image/png": buffer.getvalue(), "text/plain": repr(self)}
        display(shown, metadata={"image/png": size}, raw=True)


class AxesPlace:
    """A stand-in for a figure that draws a picture at the place of axes of another figure.

    A picture of one panel is drawn on these axes themselves; of several, a subfigure takes their
    place.
    """

    def __init__(self, ax: Axes | SubFigure) -> None:
        self._axes = ax if isinstance(ax, Axes) else None
        self._subfigure = ax if isinstance(ax, SubFigure) else None

    @property
    def figure(self) -> Any:
        """The figure, or subfigure, that holds the picture."""
        return self._subfigure or (self._axes and self._axes.figure)

    def add_subplot(self, place: Any = None, **options: Any) -> Axes:
        """Return the stand-in's axes for a picture with single axes, else axes of a subfigure."""
        if self._axes is not None and place is None:
            if (options.get("projection") == "3d") != (self._axes.name == "3d"):
                former, self._axes = self._axes, self._add_there("add_subplot", **options)
                former.remove()
            return self._axes
        places = () if place is None else (place,)
        return cast(Axes, self.subfigure().add_subplot(*places, **options))

    def add_gridspec(self, rows: int, columns: int, **options: Any) -> Any:
        """Return the grid of a subfigure; for a single panel, a grid whose place is None."""
        if rows == columns == 1:
            return dict.fromkeys((0, (0, 0)))
        return self.subfigure().add_gridspec(rows, columns, **options)

    def legend(self, **options: Any) -> Any:
        """Put a legend above the axes, or above those of the subfigure."""
        if self._axes is None:
            return self.subfigure().legend(**options)
        above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
        return self._axes.legend(**options | above)

    def get_size_inches(self) -> NDArray[np.float64]:
        """Return the place's width and height, inches."""
        place = self._axes or self.subfigure()
        box = place.get_window_extent() if self._axes is not None else place.bbox
        return np.array([box.width, box.height]) / float(self.figure.get_figure(root=True).dpi)

    def set_layout_engine(self, _: str) -> None:
        """Leave the layout of the other figure unchanged."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self.figure if self._axes is not None else self.subfigure(), name)

    def subfigure(self) -> Any:
        """Return the subfigure, which replaces the axes at the first call."""
        if self._subfigure is None:
            self._subfigure = self._add_there("add_subfigure")
            assert self._axes is not None
            self._axes.remove()
            self._axes = None
        return self._subfigure

    def _add_there(self, method: str, **options: Any) -> Any:
        """Return axes or a subfigure, added at the place of the axes in their figure's grid."""
        assert self._axes is not None
        place = self._axes.get_subplotspec()
        if place is None:
            raise DataError("ax: not in a grid; make it by subplots or add_subplot")
        return getattr(self._axes.figure, method)(place, **options)


def real_figure(figure: Figure | SubFigure) -> Figure:
    """Return the figure or subfigure that an `AxesPlace` stands for; another figure itself."""
    place: Any = figure
    return cast(Figure, place.figure if isinstance(place, AxesPlace) else place)


def whole_figure(figure: Figure) -> Figure:
    """Return the figure itself, or the subfigure that takes the place of axes."""
    place: Any = figure
    return cast(Figure, place.subfigure() if isinstance(place, AxesPlace) else place)


def blank(width: float, height: float, ax: Axes | SubFigure | None = None) -> Figure:
    """Return a figure of a size in inches, on white, with its own canvas; or the place of `ax`."""
    if ax is not None:
        return cast(Figure, AxesPlace(ax))
    figure = Picture(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """Return a figure as an array (height, width, 3) of red, green and blue."""
    canvas: Any = figure.canvas
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def plain_axes(figure: Figure, xlabel: str, ylabel: str, place: Any = None) -> Axes:
    """Return axes with a light grid and no frame but the two scales, at a place of a grid."""
    axes = figure.add_subplot() if place is None else figure.add_subplot(place)
    axes.patch.set_alpha(0.0)
    axes.set_xlabel(xlabel, fontsize=FONT_SIZE, color=INK)
    axes.set_ylabel(ylabel, fontsize=FONT_SIZE, color=INK)
    axes.tick_params(labelsize=FONT_SIZE, colors=INK, color=MUTED, length=3.0, width=0.7)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set(color=MUTED, linewidth=0.7)
    for scale in (axes.xaxis, axes.yaxis):
        scale.set_major_locator(TickLocator())
        scale.set_major_formatter(TickLabels())
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def stack(
    figure: Figure, xlabel: str, ylabels: list[str], ratios: list[float] | None = None
) -> list[Axes]:
    """Return axes one above the other, with a common scale along x."""
    return [row[0] for row in panels(figure, xlabel, [[label] for label in ylabels], ratios)]


def panels(
    figure: Figure, xlabel: str, ylabels: list[list[str]], ratios: list[float] | None = None
) -> list[list[Axes]]:
    """Return rows of axes with a common scale along x, labelled below the last row."""
    rows, columns = len(ylabels), len(ylabels[0])
    grid = figure.add_gridspec(rows, columns, height_ratios=ratios)
    axes_rows = [
        [plain_axes(figure, "", label, grid[i, j]) for j, label in enumerate(row)]
        for i, row in enumerate(ylabels)
    ]
    for row in axes_rows[:-1]:
        for axes, lowest in zip(row, axes_rows[-1], strict=True):
            axes.sharex(lowest)
            axes.tick_params(labelbottom=False)
    for axes in axes_rows[-1]:
        axes.set_xlabel(xlabel)
    return axes_rows


def legend(figure: Figure, columns: int) -> None:
    """Put a legend without a frame above the axes."""
    figure.legend(
        loc="outside upper center",
        ncols=columns,
        frameon=False,
        fontsize=FONT_SIZE - 1.0,
        labelcolor=INK,
        handlelength=2.2,
        columnspacing=1.2,
        handletextpad=0.5,
    )


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor to, and the name of, the unit of a picture for an SI unit."""
    name, factor = SHOWN.get(unit, (unit, 1.0))
    return factor, "degrees" if name == "\u00b0" else name


def axis_label(name: str) -> str:
    """Return a coordinate's symbol with its unit in a picture."""
    symbol_and_unit = coordinate(name)
    return f"{symbol_and_unit.symbol} ({shown_unit(symbol_and_unit.unit)[1]})"


def zero_line(axes: Axes) -> None:
    """Draw a thin line at zero."""
    axes.axhline(0.0, color=MUTED, linewidth=0.8)


def groups_of(kinds: Sequence[Kind]) -> dict[Kind, list[int]]:
    """Return the indices of equal elements, such as units, by element.

    Examples
    --------
    >>> groups_of(["m", "m", "rad"])
    {'m': [0, 1], 'rad': [2]}
    """
    return {kind: [i for i, k in enumerate(kinds) if k == kind] for kind in kinds}


def spot(axes: Axes, x: float, y: float, face: str, edge: str, size: float, **options: Any) -> None:
    """Draw a round mark on axes, filled and outlined in colours."""
    style = {"marker": "o", "linestyle": "none", "markersize": size, **options}
    axes.plot([x], [y], markerfacecolor=face, markeredgecolor=edge, **style)


def labelled_contours(
    axes: Axes, x: Array, y: Array, measure: np.ma.MaskedArray[Any, Any], levels: Iterable[float]
) -> None:
    """Draw those of the levels that a measure (B, A) over x (A,) and y (B,) takes, with labels."""
    if named := [level for level in levels if measure.min() < level < measure.max()]:
        lines = axes.contour(x, y, measure, levels=named, colors=[INK], linewidths=0.7)
        axes.clabel(lines, fmt="%.4g", fontsize=FONT_SIZE - 1.0, colors=[INK])


def remark(axes: Axes, text: str, x: float, y: float, color: str, rise: float = 0.0) -> None:
    """Write a text at a point, or points of type above it; y = inf is the top of the axes."""
    top = y == float("inf")
    axes.annotate(
        text,
        (x, 1.0 if top else y),
        xycoords=("data", "axes fraction") if top else "data",
        xytext=(0.0, rise),
        textcoords="offset points",
        ha="center",
        fontsize=FONT_SIZE,
        color=color,
    )
