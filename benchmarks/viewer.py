"""The viewer: delay from a slider to the picture, and memory after minutes of random dragging.

A key moves a slider of the page in headless Chromium, whose WebGL the processor draws. The clock
runs from the key's event until the picture with the new pose has been drawn; it also runs on the
server alone, from an action to its last message. Then a mouse drags random sliders to random
places; `--minutes 10` does only that, for so long.
"""

from __future__ import annotations

import os
import random
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from measuring import quick

import pteron
from pteron.viewer import Viewer, view

_FLAGS = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
_SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader")

_CLOCK = """() => {
    const marks = window.marks = {start: null, found: []};
    addEventListener('keydown', event => { marks.start = event.timeStamp; }, true);
    const drawn = WebGL2RenderingContext.prototype;
    // The places of all bars are in a texture; a new pose is a new texture.
    for (const name of ['texSubImage2D', 'texImage2D']) {
        const usual = drawn[name];
        drawn[name] = function (...given) {
            usual.apply(this, given);
            if (marks.start === null) return;
            const start = marks.start;
            marks.start = null;
            // When the next frame begins this one is handed over; reading waits for its drawing.
            requestAnimationFrame(() => {
                this.readPixels(0, 0, 1, 1, this.RGBA, this.UNSIGNED_BYTE, new Uint8Array(4));
                marks.found.push(performance.now() - start);
            });
        };
    }
}"""


def main() -> None:
    """Print the times of each machine, then what dragging leaves behind."""
    if "--minutes" in sys.argv:
        _leave_behind(float(sys.argv[sys.argv.index("--minutes") + 1]))
        return
    machines = ("five-bar",) if quick() else ("quadrupteron", "delta", "five-bar", "par4")
    print("from a slider to the picture, ms: median, 95 %")
    for name in machines:
        with view(pteron.load(name), port=0) as viewer:
            print(f"  {name:<14} server {_told(_on_the_server(viewer))}", end="")
            with _page(viewer) as page:
                print(f"   page {_told(_in_the_browser(page))}" if page else "   (no Chromium)")
    _leave_behind(0.05 if quick() else 1.0)


def _leave_behind(minutes: float) -> None:
    """Print what so many minutes of random dragging leave behind."""
    with view(pteron.load("quadrupteron"), port=0) as viewer, _page(viewer) as page:
        if page:
            _drag(viewer, page, 60.0 * minutes)


def _told(times: list[float]) -> str:
    return f"{np.median(times):6.1f} {np.percentile(times, 95):6.1f}"


def _on_the_server(viewer: Viewer) -> list[float]:
    """Return times, ms, from an action to its last message, for small moves about home."""
    home, rng = viewer.state.pose, np.random.default_rng(0)
    times = []
    for _ in range(20 if quick() else 300):
        target = home + 0.01 * rng.normal(size=len(home))
        begin = perf_counter()
        viewer.move_to(target)
        viewer.wait()
        times.append(1e3 * (perf_counter() - begin))
    viewer.move_to(home)
    return times[5:]


@contextmanager
def _page(viewer: Viewer) -> Iterator[Any]:
    """Open a tab with the page; yield None where there is no Chromium."""
    program = os.environ.get("PTERON_BROWSER") or shutil.which("chromium")
    if program is None:
        yield None
        return
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=[*_FLAGS, *_SOFTWARE])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.add_init_script(f"({_CLOCK})()")
        page.goto(viewer.url)
        page.wait_for_selector("table.legs")
        page.wait_for_timeout(3000)
        yield page
        browser.close()


def _in_the_browser(page: Any) -> list[float]:
    """Return times, ms, from a key on a slider to the picture."""
    page.locator("[role=slider]").first.focus()
    count = 5 if quick() else 60
    for k in range(count):
        page.keyboard.press("ArrowRight" if k % 20 < 10 else "ArrowLeft")
        page.wait_for_function(f"() => marks.found.length > {k}")
        page.wait_for_timeout(120)
    found: list[float] = page.evaluate("() => marks.found")
    return found[2:]


def _drag(viewer: Viewer, page: Any, duration: float) -> None:
    """Drag random sliders to random places, and print what came of it."""
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    devtools = page.context.new_cdp_session(page)
    rng = random.Random(0)
    sliders = page.locator("[role=slider]")
    boxes = [sliders.nth(k).locator("xpath=..").bounding_box() for k in range(sliders.count())]
    boxes = [box for box in boxes if box]

    def dragged(until: float) -> int:
        """Drag until a time; return how often the machine was found in another pose."""
        count, before = 0, viewer.state.pose
        while perf_counter() < until:
            box = rng.choice(boxes)
            height = box["y"] + 0.5 * box["height"]
            page.mouse.move(box["x"] + box["width"] * rng.random(), height)
            page.mouse.down()
            for _ in range(rng.randint(1, 15)):
                page.mouse.move(box["x"] + box["width"] * rng.uniform(-0.1, 1.1), height)
                count += viewer.state.pose is not before
                before = viewer.state.pose
            page.mouse.up()
        return count

    warm = min(60.0, 0.2 * duration)
    begin = perf_counter()
    dragged(begin + warm)
    before = _memory(), _heap(devtools)
    count = dragged(begin + duration)
    after = _memory(), _heap(devtools)
    print(f"{duration / 60.0:.2g} min of random dragging, {count} poses seen:")
    print(f"  exceptions: {len(viewer.faults)} on the server, {len(errors)} on the page")
    for where, one, other in zip(("server", "page"), before, after, strict=True):
        print(f"  memory of the {where}: {one:.1f} MB, then {other:.1f} MB: {other - one:+.1f} MB")
    for text in (*viewer.faults, *errors):
        print(text)


def _memory() -> float:
    """Return the memory of this process, MB."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return float(status.split("VmRSS:")[1].split()[0]) / 1024.0


def _heap(devtools: Any) -> float:
    """Return what the page holds in memory once it has tidied up, MB."""
    devtools.send("HeapProfiler.collectGarbage")
    devtools.send("Performance.enable")
    found = devtools.send("Performance.getMetrics")["metrics"]
    return float(next(one["value"] for one in found if one["name"] == "JSHeapUsedSize")) / 2**20


if __name__ == "__main__":
    main()
