"""Pages of the benchmarks' results, which stand outside docs."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

ROOT = Path(__file__).parents[2]

RESULTS = {
    "benchmarks/RESULTS": "measured/benchmarks",
    "benchmarks/identification/RESULTS": "measured/identification",
}
"""Pages of the repository, and where they stand in the site."""


_OUTPUT = re.compile(r"(?ms)^```console\n\$ (.*?)\n.*?^```$")

_LEAD = """
The tables of [How sure, and how fast](../evidence.md) show the main numbers and explain them. This
page has the whole output of each benchmark, folded: open a line to see what its command printed.
"""


def _with_folded_outputs(text: str) -> str:
    """Return a page whose outputs are folded below the commands that printed them."""
    folded = _OUTPUT.sub(
        lambda match: (
            '```{raw} html\n<details class="output"><summary><code>'
            f"{match[1]}</code></summary>\n```\n\n{match[0]}\n\n"
            "```{raw} html\n</details>\n```"
        ),
        text,
    )
    title, _, rest = folded.partition("\n")
    return f"{title}\n{_LEAD}{rest}" if folded != text else text


def copy_results(app: Sphinx) -> None:
    """Copy the results into the folder of the sources, where they have changed."""
    for source, page in RESULTS.items():
        text = _with_folded_outputs((ROOT / f"{source}.md").read_text(encoding="utf-8"))
        path = Path(app.srcdir) / f"{page}.md"
        path.parent.mkdir(exist_ok=True)
        for picture in (ROOT / source).parent.glob("*.svg"):
            shutil.copy(picture, path.parent)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


class LinkResults(SphinxTransform):
    """Let links to the results lead to their pages."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Change the targets of links to the repository's pages."""
        places = {str(ROOT / source): page for source, page in RESULTS.items()}
        for node in self.document.findall(pending_xref):
            node["reftarget"] = places.get(node["reftarget"], node["reftarget"])


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("builder-inited", copy_results)
    app.add_transform(LinkResults)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
