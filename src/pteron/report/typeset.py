"""Numbers typeset for HTML pages, and the templates, texts and data that pages are made of."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from importlib.resources import files
from math import floor, isfinite, log10
from typing import Any

from jinja2 import Template
from markupsafe import Markup, escape

from pteron.platforms.coordinates import coordinate
from pteron.templates import template as any_template

_TINY = 1e-9
"""Size below which leading zeros are no longer counted."""

_MINUS = "\u2212"
"""The minus sign."""

_NARROW = "\u202f"
"""The narrow space within a unit."""

_COMMAND = r"pteron [a-z]+ ROBOT(?: --[a-z-]+ [\w.]*\w)+"
"""Pattern of a command of `pteron` in a text."""

_CODE = r"<code>\g<0></code>"
"""HTML of a command."""


def significant(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits; an exponent has what is below 1e-9.

    Examples
    --------
    >>> significant(0.0123456), significant(1234.6), significant(-2.0, 2), significant(-6e-14, 2)
    ('0.0123', '1235', '−2.0', '−6.0e−14')
    """
    if not isfinite(value):
        return "∞" if value > 0 else "\u2013"
    if value == 0.0:
        return "0"
    # 999.6 is 1000 in three digits: the size counts after rounding.
    text = f"{value:.{digits - 1}e}"
    rounded = float(text)
    if abs(rounded) < _TINY:
        return text.replace("-", _MINUS)
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


def measured(value: float, half: float) -> tuple[str, str]:
    """Return a value and half its interval, to the second digit of the latter.

    Examples
    --------
    >>> measured(1.2361326, 0.012752), measured(-0.004113744, 4.4e-05)
    (('1.236', '0.013'), ('−0.004114', '0.000044'))
    """
    if not isfinite(half) or half <= 0.0:
        return significant(value, 6), significant(half, 2)
    # 0.0996 is 0.10 in two digits: the size counts after rounding.
    places = max(1 - floor(log10(float(f"{half:.1e}"))), 0)
    return fixed(value, places), fixed(half, places)


def _millimetres(metres: float, places: int = 1) -> str:
    return fixed(1e3 * float(metres), places)


def compact(value: float, digits: int = 4) -> str:
    """Return a number with at most so many significant digits and no needless zeros."""
    return "0" if abs(value) < 1e-9 else f"{value:.{digits}g}".replace("-", _MINUS)


def triple(values: Iterable[float], factor: float = 1.0, digits: int = 4) -> str:
    """Return a vector, each component as `compact` has it."""
    return f"({', '.join(compact(factor * value, digits) for value in values)})"


def prose(text: str) -> Markup:
    """Return a message with true minus signs; commands and options are code, in one piece."""
    signed = re.sub(r"(?<![\w.-])-(?=\d)", "\u2212", str(escape(text)))
    commands = re.sub(_COMMAND, lambda found: re.sub(r"\S+", _CODE, found[0]), signed)
    return Markup(re.sub(r"(?<!<code>)--[a-z][a-z-]*(?: each)?", _CODE, commands))


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
        "prose": prose,
        "significant": significant,
        "symbol": lambda name: coordinate(name).symbol,
        "unit": lambda text: text.replace(" ", _NARROW).replace("^2", "²"),
    }
    return any_template(folder, name, **shared | filters)
