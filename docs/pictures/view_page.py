"""Draw view.png and view-planar.png for docs/view.md: the page of `pteron view` in Chromium."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np

import pteron
from pteron.viewer import Viewer, view

_FLAGS = ("--no-sandbox", "--disable-gpu")
_SIZE = {"width": 1180, "height": 760}
_STILL = 1500
"""ms in which a page that is drawn does not change."""


def draw(docs: Path) -> None:
    """Write view.png, the Quadrupteron with a slice, and view-planar.png, a 3-RRR at its end."""
    program = os.environ.get("PTERON_BROWSER") or shutil.which("chromium")
    if program is None:
        print("view.png is left as it is: no Chromium here; PTERON_BROWSER may name one")
        return
    with view(pteron.load("quadrupteron"), port=0) as viewer:
        viewer.move_to([0.03, 0.05, 0.06, np.radians(25.0)])
        _shoot(program, viewer, docs / "view.png", "xz")
    with view(pteron.load("3-rrr"), port=0) as viewer:
        viewer.move_to([0.0, 0.3, 0.0])
        _shoot(program, viewer, docs / "view-planar.png", None)


def _shoot(program: str, viewer: Viewer, path: Path, plane: str | None) -> None:
    """Write a picture of the page, with a slice of the workspace."""
    from playwright.sync_api import sync_playwright

    viewer.wait()
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=list(_FLAGS))
        page = browser.new_page(viewport=_SIZE)  # type: ignore[arg-type]
        page.goto(viewer.url)
        page.wait_for_selector("table.legs")
        if plane is not None:
            page.evaluate("document.getElementById('looks').open = true")
            page.select_option("#plane", plane)
        before = b""
        while before != (now := page.screenshot()):
            before = now
            page.wait_for_timeout(_STILL)
        path.write_bytes(now)
        browser.close()
