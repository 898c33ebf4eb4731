"""The description of each page, for search engines and previews of links."""

from __future__ import annotations

import textwrap
from html import escape, unescape
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.nodes import clean_astext

_LENGTH = 200
"""Characters that search engines show."""


def describe(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Add the first paragraph of a page, or its title, to the page's head."""
    title = unescape(str(context.get("title") or app.config.html_title))
    first = next(doctree.findall(nodes.paragraph), None) if doctree else None
    text = clean_astext(first) if first else f"{title}, a page of the documentation of Pteron."
    shown = {
        "og:title": title,
        "og:site_name": app.config.project,
        "og:type": "website",
        "og:description": textwrap.shorten(text, _LENGTH, placeholder=" ..."),
    }
    tags = [f'<meta name="description" content="{escape(shown["og:description"])}">']
    tags += [f'<meta property="{key}" content="{escape(text)}">' for key, text in shown.items()]
    context["metatags"] = "\n".join([context.get("metatags", ""), *tags])


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("html-page-context", describe)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
