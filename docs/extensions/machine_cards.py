"""The directive `machines`: a table of catalog machines as cards with picture, command and file."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

_CARD = """
::::{{container}} machine
:name: machine-{name}
![{name} at its home pose](catalog/{name}.png)

**`{name}`** {sentence}

**{legs}**

{source}{published}{own}

    pteron view {name}

{{download}}`Robot file <../src/pteron/manipulator/catalog/{name}.toml>`
::::
"""


def card(row: str) -> str:
    """Return the card, in Markdown, of a row of the table."""
    cells = (cell.strip() for cell in row.strip().strip("|").split("|"))
    name, sentence, legs, source, published, own = cells
    return _CARD.format(
        name=name.strip("`"),
        sentence=sentence,
        legs=legs.replace(", ", " · motion "),
        source=f"Source: {source}. " if source else "",
        published=f"Published: {published}. " if published else "",
        own=f"Ours: {own}.",
    )


class Machines(SphinxDirective):
    """Show each row of a table, after the two of its head, as a card."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the cards."""
        text = "".join(card(row) for row in [*self.content][2:])
        return [nodes.container("", *self.parse_text_to_nodes(text), classes=["machines"])]


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_directive("machines", Machines)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
