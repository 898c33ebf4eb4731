"""Numbers typeset for HTML pages, and the templates, texts and data that pages are made of."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from datetime import date
from importlib.resources import files
from math import floor, isfinite, log10
from typing import TYPE_CHECKING, Any

from jinja2 import Template
from markupsafe import Markup, escape

import pteron
from pteron.platforms.coordinates import coordinate
from pteron.short_numbers import power_of_ten
from pteron.templates import template as any_template

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TINY, _HUGE = 1e-6, 1e7
"""Sizes below and from which zeros are no longer counted: numbers have a power of ten."""

_LEAST = 1e-3
"""Percentage below which no digits are shown."""

_DIGITS = 8
"""Most significant digits of a value, however narrow its interval."""

_MINUS = "\u2212"
"""The minus sign."""

_SPACE = "\u00a0"
"""The space within a number."""

_NARROW = "\u202f"
"""The narrow space within a unit."""

_COMMAND = r"pteron [a-z]+ (?:ROBOT|\S+\.toml)(?: --[a-z-]+ [\w.]*\w)*"
"""Pattern of a command of `pteron` in a text."""

_CODE = r"<code>\g<0></code>"
"""HTML of a command."""


def significant(number: float, digits: int = 3) -> str:
    r"""Return a number to significant digits, tiny and huge ones with a power of ten.

    Examples
    --------
    >>> significant(0.0123456), significant(1234.6), significant(-2.0, 2), significant(-6e-14, 2)
    ('0.0123', '1235', '−2.0', '−6.0\xa0×\xa010⁻¹⁴')
    """
    if not isfinite(number):
        return "∞" if number > 0 else "\u2013"
    if number == 0.0:
        return "0"
    # 999.6 is 1000 in three digits: the size counts after rounding.
    text = f"{number:.{digits - 1}e}"
    rounded = float(text)
    if not _TINY <= abs(rounded) < _HUGE:
        mantissa, _, power = text.partition("e")
        return f"{mantissa.replace('-', _MINUS)}{_SPACE}\u00d7{_SPACE}{power_of_ten(int(power))}"
    return format_fixed(number, max(digits - 1 - floor(log10(abs(rounded))), 0))


def percent(share: float, digits: int = 3) -> str:
    r"""Return a percentage; below the least one shown it is "< least %".

    Examples
    --------
    >>> percent(12.345), percent(3.1e-10)
    ('12.3\xa0%', '<\xa00.001\xa0%')
    """
    if 0.0 <= share < _LEAST:
        return f"<\u00a0{_LEAST:g}\u00a0%"
    return f"{significant(share, digits)}\u00a0%"


def format_fixed(number: float, places: int = 1) -> str:
    """Return a number with `places` decimals, a true minus sign and no negative zero.

    Examples
    --------
    >>> format_fixed(-12.34), format_fixed(-0.001)
    ('−12.3', '0.0')
    """
    text = f"{number:.{places}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", _MINUS)


def value_with_uncertainty(estimate: float, half: float) -> tuple[str, str]:
    """Return a value and half its interval as texts, both rounded to two digits of the half.

    Examples
    --------
    >>> value_with_uncertainty(1.2361326, 0.012752), value_with_uncertainty(-0.004113744, 4.4e-05)
    (('1.236', '0.013'), ('−0.004114', '0.000044'))
    """
    if not isfinite(half) or half <= abs(estimate) * 10.0 ** (1 - _DIGITS):
        digits = _DIGITS if 0.0 < half < abs(estimate) else 6
        return significant(estimate, digits), significant(half, 2)
    # 0.0996 is 0.10 in two digits: the size counts after rounding.
    places = max(1 - floor(log10(float(f"{half:.1e}"))), 0)
    return format_fixed(estimate, places), format_fixed(half, places)


def _millimetres(metres: float, places: int = 1) -> str:
    """Return a length in m as millimetres, to a number of decimals."""
    return format_fixed(1e3 * float(metres), places)


def compact(number: float, digits: int = 4) -> str:
    """Return a number to at most `digits` significant digits, without trailing zeros."""
    return "0" if abs(number) < 1e-9 else f"{number:.{digits}g}".replace("-", _MINUS)


def triple(vector: Iterable[float], factor: float = 1.0, digits: int = 4) -> str:
    """Return a vector in brackets, each component formatted by `compact`."""
    return f"({', '.join(compact(factor * component, digits) for component in vector)})"


def prose(text: str) -> Markup:
    """Return a message as HTML, with true signs, and commands and options as code."""
    signed = re.sub(r"(?<![\w.-])-(?=\d)", "\u2212", str(escape(text)))
    signed = re.sub(r"(?<=\d) x (?=\w)", " \u00d7 ", signed).replace("^2", "²")
    commands = re.sub(_COMMAND, lambda command: re.sub(r"\S+", _CODE, command[0]), signed)
    return Markup(re.sub(r"(?<!<code>)--[a-z][a-z-]*(?: each)?", _CODE, commands))


def _css_string(text: str) -> Markup:
    """Return a text as the contents of a string in a style sheet, all but letters escaped."""
    return Markup("".join(c if c.isalnum() else f"\\{ord(c):x} " for c in text))


def resource(name: str, folder: str = "report") -> Markup:
    """Return the text of a file of the report, to be embedded in a page."""
    return Markup((files("pteron") / folder / name).read_text(encoding="utf-8"))


def embed_json(content: Any) -> Markup:
    """Return data as JSON for a page's script element, "<" escaped."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c"))


def _svg(figure: Figure, name: str, title: str, **options: Any) -> Markup:
    """Return a figure for a page, with a unique `name` and a `title` on what it shows."""
    from pteron.plots import svg  # Matplotlib is behind it, which few pages need.

    return svg(figure, name=name, title=title, **options)


def template(name: str, folder: str = "report", **filters: Callable[..., Any]) -> Template:
    """Return a page's template, with the common style and filters, and extra ones."""
    shared: dict[str, Callable[..., Any]] = {
        "compact": compact,
        "css": _css_string,
        "fixed": format_fixed,
        "mm": _millimetres,
        "percent": percent,
        "prose": prose,
        "significant": significant,
        "svg": _svg,
        "triple": triple,
        "symbol": lambda name: coordinate(name).symbol,
        "unit": lambda text: text.replace(" ", _NARROW).replace("^2", "²"),
    }
    page_template = any_template(folder, name, **shared | filters)
    today = date.today()
    page_template.globals.update(
        style=resource("page.css"), version=pteron.__version__, today=f"{today.day} {today:%B %Y}"
    )
    return page_template
