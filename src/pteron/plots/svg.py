"""Figures as SVG text that stands inside an HTML page, the same on every run."""

from __future__ import annotations

import re
from html import escape
from io import StringIO

import matplotlib as mpl
from matplotlib.figure import Figure

from pteron.plots.colors import VARIABLES

__all__ = ["svg"]

_NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def svg(figure: Figure, *, name: str, title: str) -> str:
    """Return a figure as one `<svg>` element for an HTML page.

    It holds no date, no random identifier and no address, and its colours are CSS variables with
    the printed colours as defaults (see `pteron.plots.colors`). Text stays text, in the page's
    font.

    Parameters
    ----------
    figure : matplotlib Figure
        The picture.
    name : str
        Put before every identifier, which must be unique in a page: letters and digits.
    title : str
        What the picture shows, for those who cannot see it.

    Returns
    -------
    str
    """
    buffer = StringIO()
    with mpl.rc_context({"svg.hashsalt": "pteron", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata=_NO_METADATA)
    text = buffer.getvalue()
    text = text[text.index("<svg") :].rstrip()
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'\sid="', f' id="{name}-', text)
    text = re.sub(r'href="#', f'href="#{name}-', text)
    text = re.sub(r"url\(#", f"url(#{name}-", text)
    # The generic families that end matplotlib's list are the page's affair too.
    text = re.sub(r"font: ([^'\";]*?)'[^;\"]*", r"font: \1var(--font, sans-serif)", text)
    # A hundredth of a point is enough; only tags hold coordinates, the rest is text to read.
    text = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\.\d\d)\d+", r"\1", tag[0]), text)
    for color, variable in VARIABLES.items():
        text = text.replace(color, f"var({variable}, {color})")
    box = re.search(r'viewBox="([^"]+)"', text)
    assert box is not None  # matplotlib always writes it
    _, _, width, height = box[1].split()
    head = (
        f'<svg class="plot" role="img" aria-label="{escape(title)}" viewBox="{box[1]}" '
        f'style="--width: {width}px; aspect-ratio: {width} / {height}">'
        f"<title>{escape(title)}</title>"
    )
    return head + text[text.index(">") + 1 :]
