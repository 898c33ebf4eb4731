"""Scraper of the gallery: every new matplotlib figure among a block's names.

Pteron's figures are not made by pyplot, which the usual scraper asks. A film shows itself, where a
block ends with it.
"""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


class FigureScraper:
    """Save each figure that a block of a script has made."""

    def __init__(self) -> None:
        self._shown: dict[str, list[Figure]] = {}

    def __repr__(self) -> str:
        return "FigureScraper()"

    def __call__(self, block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
        """Return the lines that show the block's figures."""
        shown = self._shown.setdefault(block_vars["src_file"], [])
        paths = []
        for value in block_vars["example_globals"].values():
            if not isinstance(value, Figure) or any(value is one for one in shown):
                continue
            shown.append(value)
            path = next(block_vars["image_path_iterator"])
            value.savefig(path, dpi=160, facecolor="white")
            paths.append(path)
        return str(figure_rst(paths, gallery_conf["src_dir"]))
