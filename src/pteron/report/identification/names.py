"""Names of the model's terms, as the page sets them."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

_MINUS = "\u2212"
_NARROW = "\u202f"

_NAME = re.compile(r"\b(mgx|mgy|m|I)_([pule]\d*|L)\b")
_SHORT = {"m": "m", "I": "I", "mgx": "m\u03b3", "mgy": "m\u03b3"}
_FRICTION = re.compile(r"\bF([cv])(?:_(R\d)(?:_(\d))?|(\d))(?!\w)")
_OTHERS = re.compile(r"\b(offset|J_m)(\d)\b")


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
