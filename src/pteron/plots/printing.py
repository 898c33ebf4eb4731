"""Figures for print and pages: as wide as a column, with text that stays text."""

from __future__ import annotations

import re
from html import escape
from io import BytesIO, StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import MultipleLocator

from pteron.atomic import write_bytes
from pteron.errors import DataError, OutputError, shorten
from pteron.plots.canvas import (
    FONT_SIZE,
    GRID,
    INK,
    MUTED,
    NO_METADATA,
    PAPER,
    REACH,
    TEXT,
    WARNING,
    legend,
)
from pteron.plots.fonts import silence_glyph_warnings, take_fonts
from pteron.plots.leg_curves import LEG_COLORS

Width = Literal["column", "page"]
"""Names of usual widths."""

WIDTHS: dict[str, float] = {"column": 3.5, "page": 7.16}
"""Inches of a journal's column, and of its page: two columns and the gap between them."""

_GAP = 3.0
"""Least distance between two numbers of a scale, in pixels of 1/100 inch."""

_PRINTED = 8.0
"""Size of letters in print, points."""

_VARIABLES = {
    INK: "--ink",
    MUTED: "--muted",
    GRID: "--grid",
    PAPER: "--paper",
    REACH: "--reach",
    WARNING: "--warning",
    **{color: f"--leg{i + 1}" for i, color in enumerate(LEG_COLORS)},
}
"""CSS variables of the colours, so that one picture serves a light and a dark page."""

_ON_PAGE = 3.8
"""Greatest width of a figure in a page, inches; more would make its letters smaller than text."""

_NARROWEST, _WIDEST = 1.5, 40.0
"""Least and greatest width, inches."""

_METADATA: dict[str, dict[str, Any]] = {
    ".svg": NO_METADATA,
    ".pdf": dict.fromkeys(("Creator", "Producer", "CreationDate")),
    ".png": {"Software": None},
}
"""Metadata by the ending of the file: without a date a figure makes the same file on every run."""


def resize(figure: Figure, width: Width | float) -> Figure:
    """Return the figure resized for print, with letters of 8 points.

    Maps and machines keep their shape; curves keep more of their height.

    Parameters
    ----------
    figure : Figure
        Any of this module's; it is changed.
    width : {"column", "page"} or float
        A journal's column (3.5 inches), its page (7.16), or inches.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If it is no width.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.plots import power_figure, resize
    >>> figure = power_figure(np.linspace(0.0, 1.0, 5), np.ones((5, 3)))
    >>> [float(side) for side in resize(figure, "column").get_size_inches().round(1)]
    [3.5, 2.7]
    """
    inches: Any = WIDTHS.get(width, 0.0) if isinstance(width, str) else width
    if not isinstance(inches, int | float) or not _NARROWEST <= inches <= _WIDEST:
        names = ", ".join(f'"{name}"' for name in WIDTHS)
        raise DataError(
            f"width: {shorten(width)} given; {names} or {_NARROWEST:g} to {_WIDEST:g} inches "
            "expected"
        )
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_fontsize(float(text.get_fontsize()) * _PRINTED / FONT_SIZE)
    for scale in (scale for axes in figure.axes for scale in (axes.xaxis, axes.yaxis)):
        for label in scale.get_ticklabels()[:1]:
            scale.set_tick_params(labelsize=label.get_fontsize())  # also of those to come
    return _set_width(figure, inches)


def _set_width(figure: Figure, inches: float) -> Figure:
    """Change a figure's width, and fit its legend and the tick labels along x."""
    wide, tall = (float(side) for side in figure.get_size_inches())
    shaped = any(axes.name == "3d" or axes.get_aspect() != "auto" for axes in figure.axes)
    ratio = inches / wide
    figure.set_size_inches(inches, tall * (ratio if shaped else ratio**0.5))
    take_fonts(figure)
    with silence_glyph_warnings():
        _fit_legend(figure, inches)
    figure.draw_without_rendering()
    for axes in figure.axes:
        _thin_ticks(axes)
    return figure


def _thin_ticks(axes: Axes) -> None:
    """Remove every second label of linear scales while those along x overlap."""
    while isinstance(axes.xaxis.get_major_locator(), MultipleLocator):
        numbers = [text.get_window_extent() for text in axes.get_xticklabels() if text.get_text()]
        places = sorted((box.x0, box.x1) for box in numbers)
        ticks = axes.get_xticks()
        if len(ticks) < 3 or all(
            span[1] + _GAP < next_span[0] for span, next_span in pairwise(places)
        ):
            return
        for scale in (axes.xaxis, axes.yaxis):
            scale.set_major_locator(MultipleLocator(2.0 * float(ticks[1] - ticks[0])))


def _fit_legend(figure: Figure, inches: float) -> None:
    """Break the legend into as many rows as it needs."""
    if not figure.legends:
        return
    columns = len(figure.legends[0].get_texts())
    while True:
        figure.legends[0].remove()
        legend(figure, columns)
        box = figure.legends[0].get_window_extent()
        if box.width <= inches * figure.dpi or columns == 1:
            return
        columns = -(-columns // 2)


def save_figure(
    figure: Figure, path: str | Path, *, width: Width | float | None = None, dpi: float = 300.0
) -> Path:
    """Write a figure to a file, atomically; text in it stays text.

    The same figure makes the same file on every run.

    Parameters
    ----------
    figure : Figure
        What to write.
    path : str or Path
        The file: .svg, .pdf or .png.
    width : {"column", "page"} or float, optional
        What `resized` makes of it first; by default it is written as it is.
    dpi : float
        Dots an inch of a .png.

    Returns
    -------
    Path

    Raises
    ------
    OutputError
        If the ending is another one, or the file cannot be written.
    DataError
        If it is no width.

    Examples
    --------
    >>> import pteron
    >>> figure = pteron.plots.draw(pteron.load("delta"))
    >>> pteron.plots.save_figure(figure, "delta.pdf", width="column")  # doctest: +SKIP
    PosixPath('delta.pdf')
    """
    target = Path(path)
    ending = target.suffix.lower()
    if ending not in _METADATA:
        raise OutputError(f"{path}: {ending or 'no'} ending, {', '.join(_METADATA)} expected")
    if width is not None:
        resize(figure, width)
    buffer = BytesIO()
    with mpl.rc_context(TEXT):
        figure.savefig(buffer, format=ending[1:], dpi=dpi, metadata=_METADATA[ending])
    return write_bytes(target, buffer.getvalue())


def svg(figure: Figure, *, name: str, title: str, widest: float = _ON_PAGE) -> Markup:
    """Return a figure as an `<svg>` element for an HTML page, without a background.

    It holds no date, no random identifier and no address, and its colours are CSS variables with
    the printed colours as defaults. Text stays text, in the page's font. The name, of letters and
    digits, is put before every identifier, which must be unique in a page; the title says what the
    picture shows to those who cannot see it. Of curves over time it tells a page's script where the
    time is. A wider figure is made as narrow as is said (inches), its letters as they are, so that
    they can be read in a column and on a phone.
    """
    if figure.get_size_inches()[0] > widest:
        _set_width(figure, widest)
    text = _render_svg(figure, facecolor="none")
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
        f"{_time_scale(figure, float(width), float(height))}"
        f'style="--width: {width}px; aspect-ratio: {width} / {height}">'
        f"<title>{escape(title)}</title>"
    )
    return Markup(head + text[text.index(">") + 1 :])


def _time_scale(figure: Figure, width: float, height: float) -> str:
    """Return the place of a time scale in a picture, for a page's cursor; "" without one.

    That is the time and x at its beginning and at its end, and y of its panels' top and bottom.
    """
    panels = figure.axes
    if not panels or panels[-1].get_xlabel() != "time (s)":
        return ""
    boxes = [axes.get_position() for axes in panels]
    (start, end), last = panels[-1].get_xlim(), boxes[-1]
    top, bottom = max(box.y1 for box in boxes), min(box.y0 for box in boxes)
    scale = (start, end, width * last.x0, width * last.x1)
    numbers = (*scale, height * (1.0 - top), height * (1.0 - bottom))
    return f'data-time="{" ".join(f"{number:.5g}" for number in numbers)}" '


def svg_file(figure: Figure) -> str:
    """Return a figure as the text of a standalone SVG file, on white, without a date."""
    return _render_svg(figure)


def _render_svg(figure: Figure, **look: Any) -> str:
    """Return a figure as SVG whose text is text, without metadata."""
    buffer = StringIO()
    with mpl.rc_context(TEXT):
        figure.savefig(buffer, format="svg", metadata=NO_METADATA, **look)
    return buffer.getvalue()
