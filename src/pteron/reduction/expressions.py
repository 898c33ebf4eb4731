"""Base parameters as text, SymPy and LaTeX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from sympy import Add, Float, Integer, Mul, Rational, Symbol, factor, latex

from pteron.reduction.grouping import Share, Shares

__all__ = ["as_latex", "as_sympy", "as_text"]

Terms = Mapping[int, Share]


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
    if getattr(share, "free_symbols", None):
        return 0.0, _fraction_text(factor(share))
    return float(share), ""


def _fraction_text(expression: Any) -> str:
    """Return numerator / denominator; SymPy itself prints 1/x^2 as x^(-2)."""
    top, bottom = expression.as_numer_denom()
    minus = top.could_extract_minus_sign()
    top = -top if minus else top
    text = str(top)
    # A sum needs brackets under a sign or over a denominator, and must not show its own sign.
    if top.is_Add and (minus or bottom != 1 or text.startswith("-")):
        text = f"({text})"
    if bottom != 1:
        text += f"/({bottom})" if bottom.is_Mul or bottom.is_Add else f"/{bottom}"
    return ("-" if minus else "") + text.replace("**", "^")


def as_sympy(names: Sequence[str], terms: Terms) -> Any:
    """Return a base parameter as a SymPy sum; fractions stay exact."""
    return Add(*(Mul(_sympified(share), Symbol(names[j])) for j, share in terms.items()))


def as_latex(names: Sequence[str], terms: Terms, digits: int) -> str:
    """Return a base parameter in LaTeX, in the paper's notation."""
    text = ""
    for column, share in terms.items():
        if getattr(share, "free_symbols", None):
            size = latex(factor(share), symbol_names=_geometry_names(share))
            minus = size.startswith("-")
            size = size.lstrip("- ")
        else:
            value = float(share)
            rounded = f"{abs(value):.{digits}g}"
            size = "" if rounded == "1" else rounded
            minus = value < 0
        joint = ("- " if minus else "+ ") if text else ("-" if minus else "")
        body = f"{size}\\, {_latex_name(names[column])}" if size else _latex_name(names[column])
        text += f" {joint}{body}" if text else f"{joint}{body}"
    return text


def _sympified(share: Share) -> Any:
    if isinstance(share, Fraction):
        return Rational(share.numerator, share.denominator)
    if isinstance(share, float):
        return Float(share)
    return Integer(share) if isinstance(share, int) else share


def _latex_name(name: str) -> str:
    kind, body = name.split("_", 1)
    if kind.startswith("mg"):
        return rf"m_{{{body}}}\gamma_{{{body},{kind[-1]}}}"
    return f"{kind}_{{{body}}}"


def _geometry_names(share: Any) -> dict[Any, str]:
    """Return LaTeX names: lu1 is l_{u1}, s1x is s_{1x}."""
    return {symbol: f"{symbol.name[0]}_{{{symbol.name[1:]}}}" for symbol in share.free_symbols}
