"""Numbers typeset for the pages, and the templates, texts and data that pages are made of."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from importlib.resources import files
from math import floor, isfinite, log10
from typing import Any

from jinja2 import Template
from markupsafe import Markup

from pteron.platforms.coordinates import coordinate
from pteron.templates import template as any_template

_MINUS = "\u2212"
"""The minus sign."""

_NARROW = "\u202f"
"""The narrow space within a unit."""


def significant(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits, without exponent.

    Examples
    --------
    >>> significant(0.0123456), significant(1234.6), significant(-2.0, 2)
    ('0.0123', '1235', '−2.0')
    """
    if not isfinite(value):
        return "∞" if value > 0 else "\u2013"
    if value == 0.0:
        return "0"
    # 999.6 is 1000 in three digits: the size counts after rounding.
    rounded = float(f"{value:.{digits - 1}e}")
    return fixed(value, max(digits - 1 - floor(log10(abs(rounded))), 0))


def fixed(value: float, places: int = 1) -> str:
    """Return a number with so many decimal places, a true minus and no negative zero.

    Examples
    --------
    >>> fixed(-12.34), fixed(-0.001)
    ('−12.3', '0.0')
    """
    text = f"{value:.{places}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", _MINUS)


def _millimetres(metres: float, places: int = 1) -> str:
    return fixed(1e3 * float(metres), places)


def compact(value: float, digits: int = 4) -> str:
    """Return a number with at most so many significant digits and no needless zeros."""
    return "0" if abs(value) < 1e-9 else f"{value:.{digits}g}".replace("-", _MINUS)


def triple(values: Iterable[float], factor: float = 1.0, digits: int = 4) -> str:
    """Return a vector, each component as `compact` has it."""
    return f"({', '.join(compact(factor * value, digits) for value in values)})"


def resource(name: str) -> Markup:
    """Return the text of one of the report's files, to stand in a page as it is."""
    return Markup((files("pteron.report") / name).read_text(encoding="utf-8"))


def embedded(data: Any) -> Markup:
    """Return data as JSON that may stand in a page's script element, which it cannot end."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c"))


def template(name: str, folder: str = "report", **filters: Callable[..., Any]) -> Template:
    """Return a page's template, with the filters of all pages and some of its own."""
    shared: dict[str, Callable[..., Any]] = {
        "compact": compact,
        "fixed": fixed,
        "mm": _millimetres,
        "significant": significant,
        "symbol": lambda name: coordinate(name).symbol,
        "unit": lambda text: text.replace(" ", _NARROW).replace("^2", "²"),
    }
    return any_template(folder, name, **shared | filters)
