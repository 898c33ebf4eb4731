"""Equations with the paper's numbers, linked to the code and back.

A numbered equation has the label `eq-NUMBER`. `CODE` says where each stands in the code: on a page
of the theory the links to it follow the equation, and in the reference the code's docstring links
to the equation. So does "Eq. (15)" in any docstring.
"""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from equation_code import CODE
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.math import MathDomain
from sphinx.transforms import SphinxTransform

_CITED = re.compile(r"(\bEqs?\.\s+)(\(?\d+\)?(?:(?:,? (?:and|or|to)\s+|,\s+)\(?\d+\)?)*)")
"""Equations cited in a docstring: "Eq. (10)", "Eqs. (13) and (14)", "Eqs. 1 and 2, or 6 and 7"."""


class NumberedByLabel(MathDomain):
    """The domain of equations; `eq-15` is number 15, wherever it stands."""

    def note_equation(self, docname: str, labelid: str, location: Any = None) -> None:
        """Note an equation under the number that its label says."""
        super().note_equation(docname, labelid, location)
        self.data["objects"][labelid] = (docname, labelid.removeprefix("eq-"))


class CodeOfEquations(SphinxTransform):
    """Put the links to the code behind every numbered equation."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Add a line to each equation that `CODE` names."""
        for block in list(self.document.findall(nodes.math_block)):
            places = CODE.get((block.get("label") or "").removeprefix("eq-"))
            if places is None:
                continue
            line = nodes.paragraph("", "In the code: ", classes=["equation-code"])
            for k, place in enumerate(places):
                if k:
                    line += nodes.Text(", ")
                line += pending_xref(
                    "",
                    nodes.literal("", place.removeprefix("pteron.")),
                    refdomain="py",
                    reftype="func",
                    reftarget=place,
                    refexplicit=True,
                    refwarn=True,
                )
            block.parent.insert(block.parent.index(block) + 1, line)


def cited(text: str) -> list[str]:
    """Return the numbers of the equations that a text cites, as it cites them."""
    return [number for _, found in _CITED.findall(text) for number in re.findall(r"\d+", found)]


def _role(number: str) -> str:
    return f":eq:`eq-{number}`"


def link_equations(
    app: Sphinx, what: str, name: str, thing: object, options: Any, lines: list[str]
) -> None:
    """Turn the equations that a docstring cites, or that stand in its code, into links."""

    def linked(found: re.Match[str]) -> str:
        return found[1] + re.sub(r"\(?(\d+)\)?", lambda one: _role(one[1]), found[2])

    text = "\n".join(lines)
    told = set(cited(text))
    text = _CITED.sub(linked, text)
    more = [number for number, places in CODE.items() if name in places and number not in told]
    if more:
        text += f"\n\nTheory: {', '.join(map(_role, more))}.\n"
    lines[:] = text.split("\n")


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_domain(NumberedByLabel, override=True)
    app.add_transform(CodeOfEquations)
    app.connect("autodoc-process-docstring", link_equations, priority=600)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
