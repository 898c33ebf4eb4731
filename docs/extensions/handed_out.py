"""What pages hand out beside themselves: a moving machine, a report, the notebooks as one file."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from sphinx.application import Sphinx

import pteron
from pteron.motion import pick_and_place
from pteron.report import write_motion_page, write_report
from pteron.workspace import home_pose


def hand_out(app: Sphinx) -> None:
    """Write moving/delta.html, moving/report.html and notebooks.zip into the folder of the site."""
    if app.builder.format != "html":
        return
    out = Path(app.outdir)
    out.mkdir(parents=True, exist_ok=True)
    with ZipFile(out / "notebooks.zip", "w", ZIP_DEFLATED) as bundle:
        for path in sorted((Path(app.srcdir) / "notebooks").glob("*.ipynb")):
            # One date: the same notebooks make the same file.
            entry = ZipInfo(f"pteron-notebooks/{path.name}", (1980, 1, 1, 0, 0, 0))
            bundle.writestr(entry, path.read_bytes(), ZIP_DEFLATED)
    page = out / "moving" / "delta.html"
    if not page.is_file():
        page.parent.mkdir(exist_ok=True)
        delta = pteron.load("delta")
        write_motion_page(delta, pick_and_place(delta, home_pose(delta)), page)
        write_report(delta, page.parent)


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("builder-inited", hand_out)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
