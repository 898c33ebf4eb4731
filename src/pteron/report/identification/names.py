"""Names of values and of recordings, as a page shows them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import PurePath

from markupsafe import Markup

from pteron.report.digits import expression

__all__ = ["short_sources", "shortened", "typeset"]

_FRICTION = re.compile(r"\bF([cv])(?:_(R\d)(?:_(\d))?|(\d))(?!\w)")
_OTHERS = re.compile(r"\b(offset|J_m)(\d)\b")
_PAYLOAD = re.compile(r"\b(mgx|mgy|m|I)_L\b")
_KINDS = {"m": "m", "I": "I", "mgx": "m\u03b3", "mgy": "m\u03b3"}


def typeset(text: str) -> Markup:
    """Return a sum of inertial parameters, friction and other terms, as the paper sets it.

    Examples
    --------
    >>> typeset("offset1 + 9.81 J_m1")
    Markup('offset<sub>1</sub> + 9.81\u202f<i>J</i><sub>m1</sub>')
    """

    def friction(match: re.Match[str]) -> str:
        index = ",".join(part for part in (match[2], match[3]) if part) or match[4]
        return f"<i>F</i><sub>{match[1]}{',' if match[2] else ''}{index}</sub>"

    def other(match: re.Match[str]) -> str:
        name = "<i>J</i><sub>m" if match[1] == "J_m" else "offset<sub>"
        return f"{name}{match[2]}</sub>"

    def payload(match: re.Match[str]) -> str:
        axis = f"{match[1][2]}," if match[1].startswith("mg") else ""
        return f"<i>{_KINDS[match[1]]}</i><sub>{axis}L</sub>"

    found = _PAYLOAD.sub(payload, str(expression(text)))
    return Markup(_OTHERS.sub(other, _FRICTION.sub(friction, found)))


def short_sources(sources: Iterable[str]) -> dict[str, str]:
    """Return what recordings are called on a page: without folders, unless two would be alike."""
    every = list(dict.fromkeys(sources))
    names = [PurePath(source).name or source for source in every]
    return {
        source: name if names.count(name) == 1 else source
        for source, name in zip(every, names, strict=True)
    }


def shortened(text: str, sources: Mapping[str, str]) -> str:
    """Return a message with the recordings called as on the page."""
    for source in sorted(sources, key=len, reverse=True):
        text = text.replace(source, sources[source])
    return text
