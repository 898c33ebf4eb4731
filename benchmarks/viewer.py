"""The viewer: delay from a slider to text and picture, and a thousand random drags on ten machines.

A key moves a slider of the page in headless Chromium, whose picture the processor draws. The clock
runs from the key's event until the number has changed in the page, and until the picture with the
new pose has been drawn; it also runs on the server alone, from an action to its last message, and
for the time from one picture to the next of a machine that a spring pulls, with rigid drives and
with drives as they are.
`--drags` makes the drags with the mouse: each leads somewhere in the window, and after it the
platform must be where it may be, and must move again when it is dragged home.
"""

from __future__ import annotations

import os
import random
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np
from measuring import quick
from measuring.as_they_are import as_they_are

import pteron
from pteron.viewer import Viewer, view
from pteron.viewer.boundary import is_allowed
from pteron.viewer.pushing import DRIVES, Push
from pteron.workspace import home_pose

_FLAGS = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")

DRAGGED = (
    *("quadrupteron", "delta", "five-bar", "3-rrr", "3-rpr", "par4", "stewart", "ball-table"),
    *("orthoglide", "wrist"),
)
"""Machines of all kinds of platforms and legs that are common."""

_SPAN = 1.0 / 30.0
"""From one picture to the next, s."""

_CLOCK = """() => {
    window.marks = {start: null, text: [], picture: []};
    addEventListener('keydown', event => { marks.start = event.timeStamp; }, true);
    const seen = new MutationObserver(() => {
        if (marks.start === null) return;
        const start = marks.start;
        marks.start = null;
        marks.text.push(performance.now() - start);
        // The picture is drawn in the next frame, and handed over before the one after it.
        requestAnimationFrame(() => requestAnimationFrame(() => {
            document.getElementById('view').getContext('2d').getImageData(0, 0, 1, 1);
            marks.picture.push(performance.now() - start);
        }));
    });
    addEventListener('DOMContentLoaded', () => {
        seen.observe(document.getElementById('readout'), {childList: true});
    });
}"""


def main() -> None:
    """Print the times of each machine, then what dragging finds."""
    if "--drags" in sys.argv:
        _drags(10 if quick() else 100)
        return
    machines = (
        ("five-bar",) if quick() else ("quadrupteron", "delta", "five-bar", "par4", "stewart")
    )
    print("from a slider, ms: median, 95 %")
    for name in machines:
        with view(pteron.load(name), port=0) as viewer:
            print(f"  {name:<14} server {_told(_on_the_server(viewer))}", end="")
            with _page(viewer) as page:
                if page:
                    text, picture = _in_the_browser(page)
                    print(f"   text {_told(text)}   picture {_told(picture)}")
                else:
                    print("   (no Chromium)")
    _pushes(machines)
    _drags(2 if quick() else 20)


def _pushes(machines: tuple[str, ...]) -> None:
    """Print how long a picture's span of a pushed machine takes, with rigid drives and others."""
    print(f"a span of {1e3 * _SPAN:.0f} ms of a push, ms: median, 95 %")
    for name in machines:
        robot = pteron.load(name)
        print(f"  {name:<14}", end="")
        for kind, machine in (("rigid", robot), ("as they are", as_they_are(robot))):
            times, moved = _pushed(machine)
            print(f" drives {kind} {_told(times)}, pulled {1e3 * moved:.1f} mm  ", end="")
        print(flush=True)


def _pushed(robot: pteron.Manipulator) -> tuple[list[float], float]:
    """Return times, ms, of spans under a spring that pulls sideways, and how far it pulled, m."""
    home = home_pose(robot)
    push, times = Push(robot, home, next(iter(DRIVES))), []
    at = robot.platform.placement(home)[0]
    push.pull(at, at + 0.1 * robot.platform.directions[0])
    for _ in range(6 if quick() else 90):
        begin = perf_counter()
        push.go(_SPAN)
        times.append(1e3 * (perf_counter() - begin))
        assert np.isfinite(push.pose).all()
    return times[3:], float(np.linalg.norm(robot.platform.placement(push.pose)[0] - at))


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
        browser = play.chromium.launch(executable_path=program, args=list(_FLAGS))
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.add_init_script(f"({_CLOCK})()")
        page.goto(viewer.url)
        page.wait_for_selector("table.legs", state="attached")
        page.wait_for_timeout(1000)
        yield page
        browser.close()


def _in_the_browser(page: Any) -> tuple[list[float], list[float]]:
    """Return times, ms, from a key on a slider to the numbers, and to the picture."""
    page.focus("#pose0")
    count = 5 if quick() else 60
    for k in range(count):
        page.keyboard.press("ArrowRight" if k % 20 < 10 else "ArrowLeft")
        page.wait_for_function(f"() => marks.picture.length > {k}")
        page.wait_for_timeout(120)
    marks = page.evaluate("() => marks")
    return marks["text"][2:], marks["picture"][2:]


def _drags(count: int) -> None:
    """Print what so many random drags on each machine come to."""
    rng = random.Random(0)
    print(f"{count} random drags on each of {len(DRAGGED)} machines:")
    for name in DRAGGED[: 2 if quick() else None]:
        with view(pteron.load(name), port=0) as viewer, _page(viewer) as page:
            if page is None:
                return
            outside, stuck, stopped, moved = 0, 0, 0, 0
            for _ in range(count):
                before = viewer.state.pose
                _drag(page, viewer, (rng.uniform(10, 900), rng.uniform(60, 790)))
                after = viewer.state
                moved += not np.array_equal(before, after.pose)
                outside += not bool(is_allowed(after.robot, after.pose))
                if after.message:
                    stopped += 1
                    home = viewer.home
                    viewer.move_to(after.pose + 0.3 * (home - after.pose))
                    viewer.wait()
                    stuck += np.array_equal(viewer.state.pose, after.pose)
                    page.wait_for_timeout(30)
            faults = len(viewer.faults)
            print(
                f"  {name:<14} moved {moved}, stopped by the boundary {stopped}; not allowed "
                f"{outside}, stuck {stuck}, failures {faults}",
                flush=True,
            )


def _drag(page: Any, viewer: Viewer, to: tuple[float, float]) -> None:
    """Drag the platform's middle, or the end of its x axis where it only turns; go home if away."""
    x, y = page.evaluate("document.getElementById('view').platform()")
    if page.evaluate("([x, y]) => document.elementFromPoint(x, y)?.id", [x, y]) != "view":
        viewer.move_to(viewer.home)
        viewer.wait()
        page.wait_for_timeout(100)
        x, y = page.evaluate("document.getElementById('view').platform()")
    page.mouse.move(x, y)
    page.mouse.down()
    for share in (0.3, 0.6, 1.0):
        page.mouse.move(x + share * (to[0] - x), y + share * (to[1] - y))
        page.wait_for_timeout(15)
    page.mouse.up()
    page.wait_for_timeout(30)
    viewer.wait()


if __name__ == "__main__":
    main()
