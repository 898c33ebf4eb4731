"""Numbers, symbols and templates of the pages."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from importlib.resources import files
from math import floor, isfinite, log10
from typing import Any

import jinja2
from markupsafe import Markup, escape

_MINUS = "\u2212"
_NARROW = "\u202f"

_NAME = re.compile(r"\b(mgx|mgy|m|I)_([pule]\d*|L)\b")
_SHORT = {"m": "m", "I": "I", "mgx": "m\u03b3", "mgy": "m\u03b3"}
_FRICTION = re.compile(r"\bF([cv])(?:_(R\d)(?:_(\d))?|(\d))(?!\w)")
_OTHERS = re.compile(r"\b(offset|J_m)(\d)\b")
_LENGTH = re.compile(r"\bl([ul]\d)\b")
_OFFSET = re.compile(r"\bs(\d)([xy])\b")
_POWER = re.compile(r"\^(\d+)")


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


def compact(value: float) -> str:
    """Return a number with at most four significant digits and no needless zeros."""
    return "0" if abs(value) < 1e-9 else f"{value:.4g}".replace("-", _MINUS)


def triple(values: Iterable[float], factor: float = 1.0) -> str:
    """Return a vector, each component as `compact` has it."""
    return f"({', '.join(compact(factor * value) for value in values)})"


def expression(text: str) -> Markup:
    """Return a sum of parameters, friction and other terms, as the paper sets it.

    Each term stays on one line.

    Examples
    --------
    >>> expression("mgx_u2"), expression("offset1 + 9.81 J_m1")
    (Markup('<i>mγ</i><sub>x,u2</sub>'),
     Markup('offset<sub>1</sub> + 9.81\u202f<i>J</i><sub>m1</sub>'))
    """

    def inertial(match: re.Match[str]) -> str:
        kind, body = match.groups()
        axis = f"{kind[2]}," if kind.startswith("mg") else ""
        return f"<i>{_SHORT[kind]}</i><sub>{axis}{body}</sub>"

    def friction(match: re.Match[str]) -> str:
        index = ",".join(part for part in (match[2], match[3]) if part) or match[4]
        return f"<i>F</i><sub>{match[1]}{',' if match[2] else ''}{index}</sub>"

    def other(match: re.Match[str]) -> str:
        name = "<i>J</i><sub>m" if match[1] == "J_m" else "offset<sub>"
        return f"{name}{match[2]}</sub>"

    safe = str(escape(text)).replace("-", _MINUS)
    found = _NAME.sub(inertial, re.sub(r"(\d) (?=[A-Za-z])", rf"\1{_NARROW}", safe))
    return Markup(_OTHERS.sub(other, _FRICTION.sub(friction, found)))


def geometric(text: Markup) -> Markup:
    r"""Return a text with its geometric symbols as the paper sets them.

    Examples
    --------
    >>> geometric(Markup("lu1/ll1^2")), geometric(Markup("1/(2*s1y)"))
    (Markup('<i>l</i><sub>u1</sub>/<i>l</i><sub>l1</sub><sup>2</sup>'),
     Markup('1/(2\u202f<i>s</i><sub>1y</sub>)'))
    """
    marked = _LENGTH.sub(r"<i>l</i><sub>\1</sub>", str(text).replace("*", _NARROW))
    marked = _OFFSET.sub(r"<i>s</i><sub>\1\2</sub>", marked)
    return Markup(_POWER.sub(r"<sup>\1</sup>", marked))


def resource(name: str) -> Markup:
    """Return the text of one of the report's files, to stand in a page as it is."""
    return Markup((files("pteron.report") / name).read_text(encoding="utf-8"))


def template(name: str, **filters: Callable[..., Any]) -> jinja2.Template:
    """Return a page's template: strict, escaped, with the shared filters and some of its own."""
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("pteron", "report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {
        "compact": compact,
        "expression": expression,
        "fixed": fixed,
        "significant": significant,
        "unit": lambda text: text.replace(" ", _NARROW).replace("^2", "²"),
        **filters,
    }
    return made.get_template(name)
