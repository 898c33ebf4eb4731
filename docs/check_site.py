"""Check a built site: `python docs/check_site.py docs/_build/html`.

Every link and picture leads somewhere, every page can be reached from the first one, nothing is
loaded from the network, and the search knows the pages.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"script": "src", "img": "src", "source": "src", "video": "src", "iframe": "src"}
"""Tags that load something, and where from; `link` does in its own way."""

WITHOUT_LINKS = ("genindex.html", "search.html", "py-modindex.html", "404.html")
"""Pages that Sphinx makes and that need no way to them."""


class Page(HTMLParser):
    """The anchors, links and loaded files of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag is and points to."""
        given = {key: value for key, value in attrs if value}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag == "link" and "stylesheet" in given.get("rel", ""):
            self.loaded.append(given["href"])
        elif tag in LOADED and LOADED[tag] in given:
            self.loaded.append(given[LOADED[tag]])


def target_of(page: Path, link: str) -> tuple[Path, str] | None:
    """Return the file and the anchor that a local link names; None for one that leads elsewhere."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return None
    path = page.parent / unquote(parts.path) if parts.path else page
    return path.resolve(), unquote(parts.fragment)


def faults(site: Path) -> list[str]:
    """Return what is wrong with a site, a line each."""
    site = site.resolve()
    pages = {
        path: Page(path.read_text(encoding="utf-8"))
        for path in site.rglob("*.html")
        if "_static" not in path.parts
    }
    found, reached, waiting = [], set(), [site / "index.html"]
    for path, page in pages.items():
        where = path.relative_to(site)
        for link in (*page.links, *page.loaded):
            target = target_of(path, link)
            if target is None:
                continue
            if not target[0].exists():
                found.append(f"{where}: {link} leads nowhere")
            elif target[1] and target[0] in pages and target[1] not in pages[target[0]].anchors:
                found.append(f"{where}: {link} names no place of its page")
        found += [
            f"{where}: {link} is loaded from the network"
            for link in page.loaded
            if urlsplit(link).netloc
        ]
    while waiting:
        path = waiting.pop()
        if path in reached or path not in pages:
            continue
        reached.add(path)
        targets = (target_of(path, link) for link in pages[path].links)
        waiting += [target[0] for target in targets if target]
    lost = (path for path in set(pages) - reached if path.name not in WITHOUT_LINKS)
    found += [f"{path.relative_to(site)}: no way leads there" for path in sorted(lost)]
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    found += [f"search does not know {word}" for word in ("jacobian", "delta") if word not in index]
    return found


if __name__ == "__main__":
    told = faults(Path(sys.argv[1]))
    print(*told, sep="\n", end="\n" if told else "")
    sys.exit(1 if told else 0)
