"""Check a built site: `python docs/check_site.py docs/_build/html`.

Every link and picture leads somewhere, every page can be reached from the first one, nothing is
loaded from the network, and the search knows the pages. No table has lost its head, no frame keeps
the wheel to itself, each picture has a name, an arrow key leaves no page, and paper is white.
"""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"script": "src", "img": "src", "source": "src", "video": "src", "iframe": "src"}
"""Tags that load something, and where from; `link` does in its own way."""

WITHOUT_LINKS = ("genindex.html", "search.html", "py-modindex.html", "404.html")
"""Pages that Sphinx makes and that need no way to them."""


_HIDES_HEADS = re.compile(r"([^{}]*)thead:not\(:has\(th p:not\(:empty\)\)\)\s*\{\s*display: none")
"""The rule of the style that hides heads without words in paragraphs, and of which tables."""

_FILE_NAME = re.compile(r"(?:[\w.-]+/)*[0-9a-f]{32,}(?:\.\w+)?")
"""A picture's name that is its file's, made of its contents."""


class Page(HTMLParser):
    """The anchors, links, loaded files, frames, pictures and tables' heads of a page.

    `heads` has of each head with words the classes of its table, and whether a paragraph in it has
    some; `nameless` the pictures that a reader of the screen does not name, `frames` the frames
    that scroll.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.frames: list[str] = []
        self.nameless: list[str] = []
        self.heads: list[tuple[str, bool]] = []
        self._tables: list[str] = []
        self._open: set[str] = set()
        self._words = [False, False]
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
        if tag == "iframe" and given.get("scrolling") != "no":
            self.frames.append(given.get("src", ""))
        if tag == "img" and (
            "alt" not in dict(attrs) or _FILE_NAME.fullmatch(given.get("alt", ""))
        ):
            self.nameless.append(given.get("src", ""))
        if tag == "table":
            self._tables.append(given.get("class", ""))
        if tag in ("thead", "p"):
            self._open.add(tag)
        if tag == "thead":
            self._words = [False, False]

    def handle_data(self, data: str) -> None:
        """Note whether a table's head has words, and in a paragraph."""
        if data.strip() and "thead" in self._open:
            self._words[0] = True
            self._words[1] |= "p" in self._open

    def handle_endtag(self, tag: str) -> None:
        """Note a table's head that ends."""
        if tag == "thead" and self._words[0]:
            self.heads.append((self._tables[-1] if self._tables else "", self._words[1]))
        if tag == "table" and self._tables:
            self._tables.pop()
        self._open.discard(tag)


def target_of(page: Path, link: str) -> tuple[Path, str] | None:
    """Return the file and the anchor that a local link names; None for one that leads elsewhere."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return None
    path = page.parent / unquote(parts.path) if parts.path else page
    return path.resolve(), unquote(parts.fragment)


def page_faults(page: Page, style: str) -> list[str]:
    """Return what is wrong with a page's frames, pictures and tables under the site's style."""
    found = [f"the frame of {source} scrolls within the page" for source in page.frames]
    found += [f"the picture {source} has no name" for source in page.nameless]
    for selector in _HIDES_HEADS.findall(style):
        wanted = selector.split("*/")[-1].strip().removeprefix("table").lstrip(".")
        hidden = [
            classes
            for classes, in_paragraph in page.heads
            if not in_paragraph and (not wanted or wanted in classes.split())
        ]
        found += ["a table's head has words and is hidden"] * len(hidden)
    return found


def style_faults(style: str) -> list[str]:
    """Return what is wrong with the site's style on paper."""
    found, depth, media = [], 0, [""]
    for part in re.split(r"([{}])", re.sub(r"(?s)/\*.*?\*/", "", style)):
        if part == "{":
            depth += 1
        elif part == "}":
            depth -= 1
            media = media[: max(1, depth + 1)]
        else:
            if "invert(" in part and not any("screen" in rule for rule in media):
                found.append("site.css: pictures are inverted on paper too")
            rule = part.strip().split(";")[-1].split("\n")[-1]
            media = [*media[: depth + 1], rule]
    if style and not re.search(r"@media print \{\s*\.skip-to-content \{ display: none", style):
        found.append("site.css: the way past the menu is printed")
    return found


def faults(site: Path) -> list[str]:
    """Return what is wrong with a site, a line each."""
    site = site.resolve()
    pages = {
        path: Page(path.read_text(encoding="utf-8"))
        for path in site.rglob("*.html")
        if "_static" not in path.parts
    }
    sheet, options = (site / "_static" / name for name in ("site.css", "documentation_options.js"))
    style = sheet.read_text(encoding="utf-8") if sheet.is_file() else ""
    found, reached, waiting = style_faults(style), set(), [site / "index.html"]
    if options.is_file() and "NAVIGATION_WITH_KEYS: true" in options.read_text(encoding="utf-8"):
        found.append("an arrow key in code that scrolls leaves the page")
    for path, page in pages.items():
        where = path.relative_to(site)
        found += [f"{where}: {line}" for line in page_faults(page, style)]
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
