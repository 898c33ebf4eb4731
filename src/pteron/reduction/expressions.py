"""Base parameters as text, SymPy, LaTeX and HTML.

SymPy is imported only for shares in symbols, since it is slow to import.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from pteron.bodies.parameters import Parameter
from pteron.reduction.grouping import Share, Shares

Terms = Mapping[int, Share]
"""The terms of a base parameter: shares by the number of the column, a parameter."""

_MINUS = "\u2212"
"""The minus sign of HTML texts."""

_NARROW = "\u202f"
"""The narrow space that stands for a product's sign in HTML."""

_WORD = re.compile(r"[A-Za-z]\w*")

_FACTORED = 60
"""Operations up to which a share is factored, to be read; longer ones only cost minutes."""


def terms_of(column: int, shares: Shares) -> dict[int, Share]:
    """Return the terms of a kept column's base parameter, columns with shares, itself first."""
    terms: dict[int, Share] = {column: Fraction(1)}
    return terms | {j: shares[j][column] for j in sorted(shares) if shares[j].get(column, 0) != 0}


def as_text(columns: Sequence[Parameter], terms: Terms, digits: int) -> str:
    """Return a base parameter such as ``m_p1 + m_u1 + 20.11 I_l1``."""

    def product(column: int, share: Share) -> tuple[bool, str]:
        """Return whether a column's term is subtracted, and its text."""
        minus, size = _write_terms(share, digits, str)
        size = size.replace("**", "^")
        return minus, f"{size} {columns[column].name}" if size else columns[column].name

    return _sum(terms, product)


def as_html(columns: Sequence[Parameter], terms: Terms, digits: int) -> str:
    """Return a base parameter in HTML, in the paper's notation; each term stays on one line."""

    def product(column: int, share: Share) -> tuple[bool, str]:
        """Return whether a column's term is subtracted, and its HTML."""
        minus, size = _write_terms(share, digits, _html_share)
        name = html_name(columns[column])
        gap = " " if _is_symbolic(share) else _NARROW
        return minus, f"{size}{gap}{name}" if size else name

    return _sum(terms, product).replace("-", _MINUS)


def as_latex(columns: Sequence[Parameter], terms: Terms, digits: int) -> str:
    """Return a base parameter in LaTeX, in the paper's notation."""

    def product(column: int, share: Share) -> tuple[bool, str]:
        """Return whether a column's term is subtracted, and its LaTeX."""
        if _is_symbolic(share):
            from sympy import latex

            minus, factor = _signed_text(share)
            size = latex(factor, symbol_names=_geometry_names(share))
            size = rf"\left({size}\right)" if factor.is_Add or size.startswith("-") else size
        else:
            minus, size = _write_terms(share, digits, str)
        name = _latex_name(columns[column])
        return minus, f"{size}\\, {name}" if size else name

    return _sum(terms, product)


def _sum(terms: Terms, product: Callable[[int, Share], tuple[bool, str]]) -> str:
    """Return a sum whose terms are signs and products."""
    text = ""
    for column, share in terms.items():
        minus, term = product(column, share)
        joint = (" - " if minus else " + ") if text else ("-" if minus else "")
        text += joint + term
    return text


def _write_terms(share: Share, digits: int, write: Callable[[Any], str]) -> tuple[bool, str]:
    """Return a share's sign and size: empty for one, in brackets where it holds symbols."""
    if not _is_symbolic(share):
        factor = float(share)
        size = f"{abs(factor):.{digits}g}"
        return factor < 0, "" if size == "1" else size
    minus, quotient = _signed_text(share)
    top, bottom = quotient.as_numer_denom()
    # A sum needs brackets under a sign or over a denominator.
    text = f"({write(top)})" if top.is_Add and bottom != 1 else write(top)
    if bottom != 1:
        text += f"/({write(bottom)})" if bottom.is_Mul or bottom.is_Add else f"/{write(bottom)}"
    return minus, f"({text})"


def _is_symbolic(share: Share) -> bool:
    """Return whether a share contains symbols of SymPy."""
    return bool(getattr(share, "free_symbols", None))


def _signed_text(share: Any) -> tuple[bool, Any]:
    """Return whether a share is written with a minus sign, and what is then written after it."""
    from sympy import factor

    size = factor(share) if share.count_ops() <= _FACTORED else share
    minus = size.could_extract_minus_sign()
    return minus, -size if minus else size


def as_sympy(names: Sequence[str], terms: Terms) -> Any:
    """Return a base parameter as a SymPy sum; fractions stay exact."""
    from sympy import Add, Mul, Symbol, sympify

    return Add(*(Mul(sympify(share), Symbol(names[j])) for j, share in terms.items()))


def _latex_name(parameter: Parameter) -> str:
    """Return a parameter's name in LaTeX, as "I_{z,u1}", or a first moment as m times gamma."""
    letter, body, axis = _parts(parameter)
    if parameter.length_power == 1:
        return rf"m_{{{body}}}\gamma_{{{body},{axis}}}"
    return f"{letter}_{{{','.join(filter(None, (axis, body)))}}}"


def html_name(parameter: Parameter) -> str:
    """Return a parameter's name in HTML, as the paper writes it."""
    letter, body, axis = _parts(parameter)
    first = "m\u03b3" if parameter.length_power == 1 else letter
    return f"<i>{first}</i><sub>{','.join(filter(None, (axis, body)))}</sub>"


def _parts(parameter: Parameter) -> tuple[str, str, str]:
    """Return a parameter's letter, its body, and the axis or axes that it is of."""
    body, kind = parameter.body + parameter.suffix, parameter.kind
    return kind[0], body, kind[-1] if parameter.length_power == 1 else kind[1:]


def html_symbol(name: str) -> str:
    """Return a geometric symbol in HTML: lu1 is l with the index u1."""
    return f"<i>{name[0]}</i><sub>{name[1:]}</sub>"


def _html_share(share: Any) -> str:
    """Return an expression of geometric symbols in HTML."""
    names = {symbol.name for symbol in share.free_symbols}
    text = re.sub(r"\*\*(\d+)", r"<sup>\1</sup>", str(share)).replace("*", _NARROW)
    return _WORD.sub(lambda w: html_symbol(w[0]) if w[0] in names else w[0], text)


def _geometry_names(share: Any) -> dict[Any, str]:
    """Return LaTeX names: lu1 is l_{u1}, s1x is s_{1x}."""
    return {symbol: f"{symbol.name[0]}_{{{symbol.name[1:]}}}" for symbol in share.free_symbols}
