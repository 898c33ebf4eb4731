"""The base parameters in symbols of the geometry, where they are short enough to read."""

from __future__ import annotations

import re
from dataclasses import dataclass

from markupsafe import Markup, escape

from pteron.errors import ModelError
from pteron.reduction import BaseParameters
from pteron.report.digits import expression

__all__ = ["InSymbols", "geometric", "in_symbols"]

_LONGEST = 200
"""Characters of a sum that a person still reads; an oblique Quadrupteron's take thousands."""

_LENGTH = re.compile(r"\bl([ul]\d)\b")
_OFFSET = re.compile(r"\bs(\d)([xy])\b")
_POWER = re.compile(r"\^(\d+)")


@dataclass(frozen=True)
class InSymbols:
    """Base parameters in symbols.

    Attributes
    ----------
    sums : tuple of str
        The sums as HTML, in the order of the base parameters.
    lengths : tuple of (str, float)
        The symbols as HTML, and what they stand for, m.
    """

    sums: tuple[Markup, ...]
    lengths: tuple[tuple[Markup, float], ...]


def in_symbols(base: BaseParameters) -> InSymbols | None:
    """Return the base parameters in symbols; None where they have none, or are too long."""
    try:
        lines = base.expressions(symbols=True)
    except ModelError:
        return None
    if max(map(len, lines)) > _LONGEST:
        return None
    used = set(re.findall(r"\b(?:l[ul]\d|s\d[xy])\b", " ".join(lines)))
    values = base.geometry_values.items()
    return InSymbols(
        tuple(geometric(expression(line)) for line in lines),
        tuple((geometric(escape(name)), value) for name, value in values if name in used),
    )


def geometric(text: Markup) -> Markup:
    r"""Return a text with its geometric symbols as the paper sets them.

    Examples
    --------
    >>> geometric(Markup("lu1/ll1^2")), geometric(Markup("1/(2*s1y)"))
    (Markup('<i>l</i><sub>u1</sub>/<i>l</i><sub>l1</sub><sup>2</sup>'),
     Markup('1/(2\u202f<i>s</i><sub>1y</sub>)'))
    """
    marked = _LENGTH.sub(r"<i>l</i><sub>\1</sub>", str(text).replace("*", "\u202f"))
    marked = _OFFSET.sub(r"<i>s</i><sub>\1\2</sub>", marked)
    return Markup(_POWER.sub(r"<sup>\1</sup>", marked))
