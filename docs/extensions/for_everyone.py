"""What readers without a mouse, or with a screen reader, need of the site's HTML."""

from __future__ import annotations

import re
from html import escape, unescape
from typing import Any

from sphinx.application import Sphinx

_CODE = re.compile(r"<pre>(.*?)</pre>", re.DOTALL)
_COLUMNS = re.compile(r"\S {2,}(?!#)\S")
"""A gap in a line that is not before a comment: the lines of the block stand in columns."""

_WRAPPER = re.compile(r'(<div class="math-wrapper[^>]*?) id="[^"]*"')
"""The box around an equation, which has the equation's own id."""

_CAPTION = 'class="caption" role="heading"'
_HEADING_OR_PICTURE = re.compile(r"<h[1-6][^>]*>(?P<heading>.*?)</h[1-6]>|<img\b[^>]*>", re.DOTALL)
_NAMELESS = re.compile(r'alt="(?:(?:[\w.-]+/)*[0-9a-f]{32,}(?:\.\w+)?|)"')
_THUMB = re.compile(
    r'(<img alt=")("[^>]*>.*?<div class="sphx-glr-thumbnail-title">)(.*?)(</div>)', re.DOTALL
)


def open_to_all(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object
) -> None:
    """Let code that scrolls be focused, name pictures, and give the sidebar's captions a level."""
    if "body" in context:
        context["body"] = name_pictures(break_lines(_WRAPPER.sub(r"\1", context["body"])))
    tree = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = tree.replace(_CAPTION, f'{_CAPTION} aria-level="2"')


def break_lines(body: str) -> str:
    """Return a page whose code can be focused; on a phone its lines break, unless it is a table."""

    def block(match: re.Match[str]) -> str:
        text = unescape(re.sub(r"<[^>]+>", "", match[1]))
        kind = "" if _COLUMNS.search(text) else ' class="breaks"'
        return f'<pre tabindex="0"{kind}>{match[1]}</pre>'

    return _CODE.sub(block, body)


def name_pictures(body: str) -> str:
    """Return a page whose pictures without a name, or with a file's, have one for who hears it.

    A thumbnail of the gallery has its title; the picture of a notebook's cell the heading above it.
    """
    body = _THUMB.sub(lambda m: f"{m[1]}{_text(m[3])}{m[2]}{m[3]}{m[4]}", body)
    heading = ""

    def named(match: re.Match[str]) -> str:
        nonlocal heading
        if match["heading"] is not None:
            heading = _text(match["heading"])
            return match[0]
        return _NAMELESS.sub(f'alt="Figure: {heading}"', match[0]) if heading else match[0]

    return _HEADING_OR_PICTURE.sub(named, body)


def _text(markup: str) -> str:
    """Return the words of a piece of HTML, for an attribute, without the mark of its link."""
    return escape(unescape(re.sub(r"<a class=\"headerlink.*?</a>|<[^>]+>", "", markup)).strip())


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx; the theme makes its sidebar at the usual priority."""
    app.connect("html-page-context", open_to_all, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
