"""Pages of source code lead back to the reference, though a name may stand there under two names.

viewcode takes it that all of a file is documented under one module. Here `PRRR` is told as
`pteron.legs.PRRR`, and its equations beside it as `pteron.legs.prrr.PRRREquations`.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

_FOLDER = "_modules/"
_BACK = re.compile(r'<a class="viewcode-back" href="([^"#]*)#([^"]*)">(.*?)</a>')


def forget_built_in(app: Sphinx, env: BuildEnvironment) -> None:
    """Leave modules without a source out of the list of sources."""
    modules: dict[str, Any] = getattr(env, "_viewcode_modules", {})
    for name in [name for name, entry in modules.items() if entry is False]:
        del modules[name]


def lead_back(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object
) -> None:
    """Let each link of a source's page lead to where its name is told."""
    if not page.startswith(_FOLDER) or "body" not in context:
        return
    module = page.removeprefix(_FOLDER).replace("/", ".")
    objects = app.env.domains.python_domain.objects

    def told(found: re.Match[str]) -> str:
        last = found[2].removeprefix(f"{module}.").removeprefix("pteron.")
        names = [found[2], f"{module}.{last}", f"pteron.{last}"]
        for name in names:
            entry = objects.get(name)
            if entry is not None:
                place = app.builder.get_relative_uri(page, entry.docname)
                return f'<a class="viewcode-back" href="{place}#{entry.node_id}">{found[3]}</a>'
        return ""

    context["body"] = _BACK.sub(told, context["body"])


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("env-updated", forget_built_in, priority=900)
    app.connect("html-page-context", lead_back)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
