"""Check a built site in Chromium: `python docs/check_in_browser.py docs/_build/html`.

The search puts the right page first, and code fits its column. --list names the blocks that are cut
on a phone.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

QUERIES = {
    "delta calibration": "how-to/calibrate-a-printer",
    "singularity": "how-to/singularities",
    "singularities": "how-to/singularities",
    "export C": "pteron.export_c",
    "torque": "sizing",
    "hexapod": "how-to/platforms-that-tilt",
    "regressor": "pteron.regressor",
    "stewart": "catalog",
    "identify": "identification",
    "inverse kinematics": "pteron.inverse_kinematics",
    "motor sizing": "sizing",
    "units": "theory/conventions",
    "ROS": "identification",
    "friction": "identification",
    "install": "start/install",
    "stiffness": "theory/indices",
    "workspace": "how-to/prove-a-workspace",
    "klipper": "other-tools",
    "base parameters": "theory/base-parameters",
    "pick and place": "trajectories",
    "payload": "how-to/payloads-and-tools",
    "computed torque": "controllers",
    "matlab": "start/coming-from",
    "mass matrix": "pteron.mass_matrix",
}
"""What readers type, and the page, or the name in the reference, that answers it."""

FIRST, AMONG = 20, 3
"""For how many queries the right page has to be first; among how many results it is for all."""

CUT = {1440: 0.02, 390: 0.40}
"""Largest share of blocks of code that are cut, by the width of the window in pixels."""

_NO_CODE = ("_modules", "_static", "moving")
_FLAGS = ("--no-sandbox", "--disable-gpu")


class _Handler(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Print no line for a request."""


class _Server(ThreadingHTTPServer):
    def handle_error(self, *request: object) -> None:
        """Print nothing for a page that is left before it is loaded."""


@contextmanager
def served(site: Path) -> Iterator[str]:
    """Serve a site, and yield its address."""
    with _Server(("127.0.0.1", 0), partial(_Handler, directory=site)) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def results_of(page: Any, address: str, query: str) -> list[str]:
    """Return the links of the first results of a query."""
    page.goto(f"{address}/search.html?q={query.replace(' ', '+')}")
    page.wait_for_function(
        "n => document.querySelectorAll('.search a').length >= n"
        " || document.querySelector('.search-summary')?.innerText",
        arg=10,
    )
    links: list[str] = page.eval_on_selector_all(
        ".search a", "links => links.slice(0, 10).map((link) => link.getAttribute('href'))"
    )
    return links


def rank(links: list[str], target: str) -> int:
    """Return the place of a page, or of a name, among results, from 1; their number + 1 if none."""
    matches = [
        link.partition("#")[2] == target
        if target.startswith("pteron.")
        else link == f"{target}.html"
        for link in links
    ]
    return matches.index(True) + 1 if any(matches) else len(links) + 1


def search_faults(page: Any, address: str) -> list[str]:
    """Return what is wrong with the order of the results."""
    ranks = {query: rank(results_of(page, address, query), QUERIES[query]) for query in QUERIES}
    first = sum(place == 1 for place in ranks.values())
    late = ", ".join(f"'{query}' {place}" for query, place in ranks.items() if place > 1)
    print(
        f"Search: the right page is first for {first} of {len(ranks)} queries; other ranks: {late}."
    )
    faults = [
        f"search: {QUERIES[query]} is not among the first {AMONG} for '{query}'"
        for query, place in ranks.items()
        if place > AMONG
    ]
    if first < FIRST:
        faults.append(f"search: the right page is first for {first} queries; at least {FIRST}")
    return faults


def code_faults(page: Any, address: str, site: Path, name_them: bool) -> list[str]:
    """Return at which widths of the window too many blocks of code are cut."""
    cut, count = dict.fromkeys(CUT, 0), 0
    for path in sorted(site.rglob("*.html")):
        if {*path.relative_to(site).parts} & {*_NO_CODE} or "<pre" not in path.read_text("utf-8"):
            continue
        name = path.relative_to(site).as_posix()
        page.goto(f"{address}/{name}")
        for width in CUT:
            page.set_viewport_size({"width": width, "height": 900})
            page.evaluate("document.querySelectorAll('details').forEach((one) => one.open = true)")
            wide = page.eval_on_selector_all(
                "article pre",
                "blocks => blocks.map((block) => [block.scrollWidth > block.clientWidth + 1,"
                " Math.max(...block.innerText.split('\\n').map((line) => line.length)),"
                " block.innerText.slice(0, 50)])",
            )
            cut[width] += sum(row[0] for row in wide)
            for is_cut, columns, text in wide if name_them else ():
                if is_cut:
                    print(f"{width} {name}: {columns} columns: {text!r}")
        count += len(wide)
    shares = {width: cut[width] / max(count, 1) for width in CUT}
    listed = ", ".join(f"{100 * share:.1f} % at {width} px" for width, share in shares.items())
    print(f"Code: of {count} blocks are cut: {listed}.")
    return [
        f"code: {100 * shares[width]:.1f} % of the blocks are cut at {width} px; "
        f"at most {100 * limit:.0f} % may be"
        for width, limit in CUT.items()
        if shares[width] > limit
    ]


def _without_excerpts(route: Any) -> None:
    if route.request.resource_type == "fetch":
        route.abort()
    else:
        route.continue_()


def main() -> int:
    """Print what is wrong; return the exit code."""
    program = os.environ.get("PTERON_BROWSER") or shutil.which("chromium")
    if program is None:
        print("Search and code are not checked: no Chromium here; PTERON_BROWSER may name one.")
        return 0
    from playwright.sync_api import sync_playwright

    site = Path(sys.argv[1]).resolve()
    with served(site) as address, sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=list(_FLAGS))
        page = browser.new_page()
        # Excerpts do not change the order, nor pictures what is cut.
        page.route("**/*", _without_excerpts)
        faults = search_faults(page, address)
        # Without scripts, pages are laid out at once.
        page = browser.new_context(java_script_enabled=False).new_page()
        page.route("**/_images/*", lambda route: route.abort())
        faults += code_faults(page, address, site, "--list" in sys.argv)
        browser.close()
    print(*faults, sep="\n", end="\n" if faults else "")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
