"""What the gallery shows of its scripts: every new figure or film among a block's names.

Pteron's figures are not made by pyplot, which the usual scraper asks.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


class FigureScraper:
    """Save each figure that a block of a script has made, and each film, a GIF file's path."""

    def __init__(self) -> None:
        self._shown: dict[str, list[Any]] = {}

    def __repr__(self) -> str:
        return "FigureScraper()"

    def __call__(self, block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
        """Return the lines that show the block's figures."""
        shown = self._shown.setdefault(block_vars["src_file"], [])
        paths = []
        for value in block_vars["example_globals"].values():
            film = isinstance(value, Path) and value.suffix == ".gif" and value.is_file()
            if not (film or isinstance(value, Figure)) or any(value is one for one in shown):
                continue
            shown.append(value)
            path = Path(next(block_vars["image_path_iterator"]))
            if film:
                path = path.with_suffix(".gif")
                shutil.copy(value, path)
            else:
                value.savefig(path, dpi=160, facecolor="white")
            paths.append(str(path))
        return str(figure_rst(paths, gallery_conf["src_dir"]))
