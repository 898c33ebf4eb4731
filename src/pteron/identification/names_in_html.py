"""Identified values in HTML: sums of inertial parameters, and names of other terms."""

from __future__ import annotations

from markupsafe import Markup

from pteron.identification.model import Model, Term
from pteron.reduction.expressions import html_name


def html_expressions(model: Model) -> tuple[Markup, ...]:
    """Return the values of a model in HTML: sums of parameters, or names of terms."""
    texts = [*model.base.expressions("html"), *map(_term_html, model.kept_terms)]
    joining = {term.name: _term_html(term) for term in model.joining_terms}
    return tuple(map(Markup, model.with_joins(texts, joining, minus="\u2212", gap="\u202f")))


def html_names(model: Model) -> dict[str, Markup]:
    """Return the names of a model's values in HTML."""
    base = (html_name(model.base.parameters[column]) for column in model.base.kept)
    texts = (*base, *(_term_html(term) for term in model.kept_terms))
    return {name: Markup(text) for name, text in zip(model.names, texts, strict=True)}


def _term_html(term: Term) -> str:
    """Return the name of a term; a word is not in italics, as a letter is."""
    letter = term.letter if term.kind == "offset" else f"<i>{term.letter}</i>"
    return f"{letter}<sub>{term.subscript}</sub>"
