"""Base parameters as text, SymPy and LaTeX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from sympy import Add, Float, Integer, Mul, Rational, Symbol, factor, latex

from pteron.bodies.parameters import Parameter
from pteron.reduction.grouping import Share, Shares

Terms = Mapping[int, Share]

_FACTORED = 60
"""Operations up to which a share is factored, to be read; longer ones only cost minutes."""


def terms_of(kept: int, given: Shares) -> dict[int, Share]:
    """Return the share of every column in the base parameter of a kept one, itself first."""
    own: dict[int, Share] = {kept: Fraction(1)}
    return own | {j: given[j][kept] for j in sorted(given) if given[j].get(kept, 0) != 0}


def as_text(names: Sequence[str], terms: Terms, digits: int) -> str:
    """Return a base parameter such as ``m_p1 + m_u1 + 20.11 I_l1``."""
    text = ""
    for column, share in terms.items():
        value, exact = _plain(share)
        rounded = f"{abs(value):.{digits}g}"
        size = f"({exact.lstrip('-')}) " if exact else "" if rounded == "1" else f"{rounded} "
        minus = exact.startswith("-") if exact else value < 0
        joint = ("- " if minus else "+ ") if text else ("-" if minus else "")
        text += f" {joint}{size}{names[column]}" if text else f"{joint}{size}{names[column]}"
    return text


def _plain(share: Share) -> tuple[float, str]:
    """Return a share's value, and its text where it holds geometric symbols."""
    if not _is_symbolic(share):
        return float(share), ""
    minus, size = _signed(share)
    top, bottom = size.as_numer_denom()
    # A sum needs brackets under a sign or over a denominator, and must not show its own sign.
    text = f"({top})" if top.is_Add else str(top)
    if bottom != 1:
        text += f"/({bottom})" if bottom.is_Mul or bottom.is_Add else f"/{bottom}"
    return 0.0, ("-" if minus else "") + text.replace("**", "^")


def _is_symbolic(share: Share) -> bool:
    return bool(getattr(share, "free_symbols", None))


def _signed(share: Any) -> tuple[bool, Any]:
    """Return whether a share is written with a minus sign, and what is then written after it."""
    size = factor(share) if share.count_ops() <= _FACTORED else share
    minus = size.could_extract_minus_sign()
    return minus, -size if minus else size


def as_sympy(names: Sequence[str], terms: Terms) -> Any:
    """Return a base parameter as a SymPy sum; fractions stay exact."""
    return Add(*(Mul(_sympified(share), Symbol(names[j])) for j, share in terms.items()))


def as_latex(columns: Sequence[Parameter], terms: Terms, digits: int) -> str:
    """Return a base parameter in LaTeX, in the paper's notation."""
    text = ""
    for column, share in terms.items():
        if _is_symbolic(share):
            minus, value = _signed(share)
            size = latex(value, symbol_names=_geometry_names(share))
            size = rf"\left({size}\right)" if value.is_Add or size.startswith("-") else size
        else:
            value = float(share)
            rounded = f"{abs(value):.{digits}g}"
            size = "" if rounded == "1" else rounded
            minus = value < 0
        joint = ("- " if minus else "+ ") if text else ("-" if minus else "")
        name = _latex_name(columns[column])
        body = f"{size}\\, {name}" if size else name
        text += f" {joint}{body}" if text else f"{joint}{body}"
    return text


def _sympified(share: Share) -> Any:
    if isinstance(share, Fraction):
        return Rational(share.numerator, share.denominator)
    if isinstance(share, float):
        return Float(share)
    return Integer(share) if isinstance(share, int) else share


def _latex_name(parameter: Parameter) -> str:
    body = parameter.body + parameter.suffix
    if parameter.length_power == 1:
        return rf"m_{{{body}}}\gamma_{{{body},{parameter.kind[-1]}}}"
    return f"{parameter.kind}_{{{body}}}"


def _geometry_names(share: Any) -> dict[Any, str]:
    """Return LaTeX names: lu1 is l_{u1}, s1x is s_{1x}."""
    return {symbol: f"{symbol.name[0]}_{{{symbol.name[1:]}}}" for symbol in share.free_symbols}
