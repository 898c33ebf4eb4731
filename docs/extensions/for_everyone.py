"""What readers without a mouse, or with a screen reader, need of the site's HTML."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

_SCROLLS = re.compile(r"<pre>")
_CAPTION = 'class="caption" role="heading"'


def open_to_all(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object
) -> None:
    """Let code that scrolls be focused, and give the sidebar's captions a level."""
    if "body" in context:
        context["body"] = _SCROLLS.sub('<pre tabindex="0">', context["body"])
    tree = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = tree.replace(_CAPTION, f'{_CAPTION} aria-level="2"')


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx; the theme makes its sidebar at the usual priority."""
    app.connect("html-page-context", open_to_all, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
