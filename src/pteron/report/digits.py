"""Numbers and symbols as people read them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import floor, isfinite, log10

from markupsafe import Markup, escape

__all__ = ["compact", "expression", "fixed", "significant", "symbol", "triple"]

_MINUS = "\u2212"
_NAME = re.compile(r"\b(mgx|mgy|m|I)_([pule]\d*)\b")
_SHORT = {"m": "m", "I": "I", "mgx": "m\u03b3", "mgy": "m\u03b3"}


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
    places = max(digits - 1 - floor(log10(abs(rounded))), 0)
    return fixed(value, places)


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


def triple(values: Iterable[float], factor: float = 1.0) -> str:
    """Return a vector, each component with four significant digits and no needless zeros.

    Examples
    --------
    >>> triple((0.0, -0.34, 0.0), 1000.0)
    '(0, −340, 0)'
    """
    return f"({', '.join(compact(factor * value) for value in values)})"


def compact(value: float) -> str:
    """Return a number with at most four significant digits and no needless zeros.

    Examples
    --------
    >>> compact(-0.04), compact(0.123456), compact(1e-17)
    ('−0.04', '0.1235', '0')
    """
    return "0" if abs(value) < 1e-9 else f"{value:.4g}".replace("-", _MINUS)


def symbol(name: str) -> Markup:
    """Return a parameter's name as the paper sets it.

    Examples
    --------
    >>> symbol("mgx_u2")
    Markup('<i>mγ</i><sub>x,u2</sub>')
    """
    return expression(name)


def expression(text: str) -> Markup:
    """Return a sum of parameters, as the paper sets it; each term stays on one line."""

    def typeset(match: re.Match[str]) -> str:
        kind, body = match.groups()
        axis = f"{kind[2]}," if kind.startswith("mg") else ""
        return f"<i>{_SHORT[kind]}</i><sub>{axis}{body}</sub>"

    safe = str(escape(text)).replace("-", _MINUS)
    terms = re.sub(r"(\d) (?=[A-Za-z])", "\\1\u202f", safe)
    return Markup(_NAME.sub(typeset, terms))
