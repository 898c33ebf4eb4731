"""Names of the library in the text of pages lead to the reference: `pteron.load`, `follow(...)`."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

_NAME = re.compile(r"(pteron(?:\.\w+)+|[\w.]+(?=\())(?:\(.*\))?", re.DOTALL)
"""A dotted name of the library, or a call."""


class LinkNames(SphinxTransform):
    """Make code in a line that is a name, or a call, a link; an unknown name stays code."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Wrap what is neither in a link nor in a heading."""
        if self.env.docname.startswith("reference/"):
            return
        for code in list(self.document.findall(nodes.literal)):
            match = _NAME.fullmatch(code.astext())
            linked = (nodes.reference, nodes.title, pending_xref)
            if match is None or isinstance(code.parent, linked):
                continue
            link = pending_xref(
                "",
                refdomain="py",
                reftype="obj",
                reftarget=match[1],
                refdoc=self.env.docname,
                refexplicit=True,
            )
            link["py:module"] = self.env.ref_context.get("py:module")
            code.replace_self(link)
            link += code


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_transform(LinkNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
