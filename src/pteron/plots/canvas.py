"""Empty figures and axes in the style of all pictures, their colours, and figures as SVG text.

The legs' four colours are Okabe and Ito's, which the colour-blind can tell apart. `svg` writes each
colour as a CSS variable with this value as its default, so that one picture serves a light and a
dark page.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Sequence
from html import escape
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.platforms.coordinates import SHOWN, coordinate
from pteron.plots.fonts import no_word_of_glyphs, take_fonts, warn_of_absent

Kind = TypeVar("Kind", bound=Hashable)

LEG_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6500", "#6a3fa0")
"""Colours of legs 1 to 6."""

_LEG_STYLES = (
    "-",
    (0, (6, 1.5)),
    (0, (2, 1.2)),
    (0, (6, 1.5, 1.5, 1.5)),
    (0, (3, 1.2, 1, 1.2)),
    (0, (1, 1)),
)
"""Line styles of legs 1 to 6, in every picture: colour alone does not survive every printer."""

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

_VARIABLES = {
    INK: "--ink",
    MUTED: "--muted",
    GRID: "--grid",
    PAPER: "--paper",
    REACH: "--reach",
    WARNING: "--warning",
    **{color: f"--leg{i + 1}" for i, color in enumerate(LEG_COLORS)},
}
"""CSS variables of the colours."""

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
        with no_word_of_glyphs():
            if saving and isinstance(engine, ConstrainedLayoutEngine) and self._is_flat:
                # Matplotlib draws all in vain to place the axes, then again with an idle engine.
                engine.execute(self)
            else:
                super().draw(renderer)

    @property
    def _is_flat(self) -> bool:
        return all(axes.name == "rectilinear" for axes in self.axes)

    def savefig(self, fname: Any, **options: Any) -> None:
        """Write the figure, with one warning of all letters that no font here has."""
        absent = take_fonts(self)
        with no_word_of_glyphs():
            super().savefig(fname, **options)
        # An .svg keeps text as text, for its reader's fonts.
        if str(options.get("format") or Path(str(fname)).suffix[1:]).lower() != "svg":
            warn_of_absent(absent)

    def _ipython_display_(self) -> None:
        # The way that goes before pyplot's, which notebooks know only once it is imported.
        from IPython.display import display

        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=_NOTEBOOK_DPI)
        width, height = (round(96.0 * inches) for inches in self.get_size_inches())
        size = {"width": width, "height": height}
        shown = {"image/png": buffer.getvalue(), "text/plain": repr(self)}
        display(shown, metadata={"image/png": size}, raw=True)


def blank(width: float, height: float) -> Figure:
    """Return a figure of so many inches, on white, with a canvas of its own."""
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
    axes = figure.add_subplot(place or 111)
    axes.patch.set_alpha(0.0)
    axes.set_xlabel(xlabel, fontsize=FONT_SIZE, color=INK)
    axes.set_ylabel(ylabel, fontsize=FONT_SIZE, color=INK)
    axes.tick_params(labelsize=FONT_SIZE, colors=INK, color=MUTED, length=3.0, width=0.7)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set(color=MUTED, linewidth=0.7)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def stack(
    figure: Figure, xlabel: str, ylabels: list[str], ratios: list[float] | None = None
) -> list[Axes]:
    """Return axes one above the other, which share the lowest one's scale along x."""
    return [row[0] for row in panels(figure, xlabel, [[label] for label in ylabels], ratios)]


def panels(
    figure: Figure, xlabel: str, ylabels: list[list[str]], ratios: list[float] | None = None
) -> list[list[Axes]]:
    """Return rows of axes beside each other, all over one scale along x, named below the last."""
    rows, columns = len(ylabels), len(ylabels[0])
    grid = GridSpec(rows, columns, figure=figure, height_ratios=ratios)
    found = [
        [plain_axes(figure, "", label, grid[i, j]) for j, label in enumerate(row)]
        for i, row in enumerate(ylabels)
    ]
    for row in found[:-1]:
        for axes, lowest in zip(row, found[-1], strict=True):
            axes.sharex(lowest)
            axes.tick_params(labelbottom=False)
    for axes in found[-1]:
        axes.set_xlabel(xlabel)
    return found


def leg_style(i: int, width: float) -> dict[str, Any]:
    """Return the colour and style of a leg's line, with its width in points."""
    k = i % len(LEG_COLORS)
    return {"color": LEG_COLORS[k], "linestyle": _LEG_STYLES[k], "linewidth": width}


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
    found = coordinate(name)
    return f"{found.symbol} ({shown_unit(found.unit)[1]})"


def leg_curves(
    axes: Axes,
    time: Array,
    values: Array,
    columns: Iterable[int],
    width: float,
    labels: Sequence[str] = (),
) -> None:
    """Draw columns of values (T, n), each in its leg's style, over all of the time (T,)."""
    for i in columns:
        label = labels[i] if labels else None
        axes.plot(time, values[:, i], label=label, **leg_style(i, width))
    axes.set_xlim(float(time[0]), float(time[-1]))


def leg_labels(count: int) -> list[str]:
    """Return the names of legs in a legend."""
    return [f"leg {i}" for i in range(1, count + 1)]


def zero_line(axes: Axes) -> None:
    """Draw a thin line at zero."""
    axes.axhline(0.0, color=MUTED, linewidth=0.8)


def groups_of(kinds: Sequence[Kind]) -> dict[Kind, list[int]]:
    """Return the columns of each kind, such as a unit, in the order of the kinds.

    Examples
    --------
    >>> groups_of(["m", "m", "rad"])
    {'m': [0, 1], 'rad': [2]}
    """
    return {kind: [i for i, own in enumerate(kinds) if own == kind] for kind in kinds}


def nice_step(least: float) -> float:
    """Return the least of 1, 2 and 5 times a power of ten that is no smaller than a step."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(power * min(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least))


def spot(axes: Axes, x: float, y: float, face: str, edge: str, size: float, **more: Any) -> None:
    """Draw one round mark."""
    style = {"marker": "o", "linestyle": "none", "markersize": size, **more}
    axes.plot([x], [y], markerfacecolor=face, markeredgecolor=edge, **style)


def remark(axes: Axes, text: str, x: float, y: float, color: str, rise: float = 0.0) -> None:
    """Write at a point, or so many points of type above it; y = inf is the top of the axes."""
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


def svg(figure: Figure, *, name: str, title: str) -> Markup:
    """Return a figure as one `<svg>` element for an HTML page, without a background.

    It holds no date, no random identifier and no address, and its colours are CSS variables with
    the printed colours as defaults. Text stays text, in the page's font. The name, of letters and
    digits, is put before every identifier, which must be unique in a page; the title says what the
    picture shows to those who cannot see it.
    """
    text = _drawn(figure, facecolor="none")
    text = text[text.index("<svg") :].rstrip()
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'\sid="', f' id="{name}-', text)
    text = re.sub(r'href="#', f'href="#{name}-', text)
    text = re.sub(r"url\(#", f"url(#{name}-", text)
    # The generic families that end matplotlib's list are the page's affair too.
    text = re.sub(r"font: ([^'\";]*?)'[^;\"]*", r"font: \1var(--font, sans-serif)", text)
    # A hundredth of a point is enough; only tags hold coordinates, the rest is text to read.
    text = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(?<=\.\d\d)\d+", "", tag[0]), text)
    for color, variable in _VARIABLES.items():
        text = text.replace(color, f"var({variable}, {color})")
    box = re.search(r'viewBox="([^"]+)"', text)
    assert box is not None  # matplotlib always writes it
    _, _, width, height = box[1].split()
    head = (
        f'<svg class="plot" role="img" aria-label="{escape(title)}" viewBox="{box[1]}" '
        f'style="--width: {width}px; aspect-ratio: {width} / {height}">'
        f"<title>{escape(title)}</title>"
    )
    return Markup(head + text[text.index(">") + 1 :])


def svg_file(figure: Figure) -> str:
    """Return a figure as the text of an SVG file that stands alone, on white, without a date."""
    return _drawn(figure)


def _drawn(figure: Figure, **look: Any) -> str:
    buffer = StringIO()
    with mpl.rc_context(TEXT):
        figure.savefig(buffer, format="svg", metadata=NO_METADATA, **look)
    return buffer.getvalue()
