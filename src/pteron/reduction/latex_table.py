r"""Base parameters as a table in LaTeX, with the rules of the package booktabs."""

from __future__ import annotations

from collections.abc import Sequence

_NEEDS = r"% In the preamble: \usepackage{amsmath, booktabs}"
"""The comment above a table: the packages that it needs."""

_LONGEST = 55
"""Printed letters of a sum that stand in a line; the next term begins another."""

_SPECIAL = str.maketrans(
    {letter: rf"\{letter}" for letter in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)
"""Letters that mean something in LaTeX, and how they are written."""


def latex_table(
    name: str,
    sums: Sequence[str],
    printed: Sequence[str],
    values: Sequence[float],
    units: Sequence[str],
    digits: int,
) -> str:
    r"""Return a `table` of base parameters: number, sum, value and unit.

    Parameters
    ----------
    name : str
        Whose they are, for the caption.
    sums, printed : sequence of str
        Each sum in LaTeX's mathematics, and in plain text, which tells how wide it is.
    values : sequence of float
        SI units.
    units : sequence of str
        Such as "kg m^2".
    digits : int
        Significant digits of the values.
    """
    rows = [
        rf"    {i} & ${_break_lines(text, plain)}$ & ${_number(number, digits)}$ & {_unit(unit)} \\"
        for i, (text, plain, number, unit) in enumerate(
            zip(sums, printed, values, units, strict=True), start=1
        )
    ]
    fractions = any(r"\frac" in text for text in sums)
    lines = [
        *(_NEEDS, r"\begin{table}", r"  \centering"),
        *([r"  \renewcommand{\arraystretch}{1.4}"] if fractions else []),
        rf"  \caption{{Base inertial parameters of {name.translate(_SPECIAL)}.}}",
        *(r"  \label{tab:base-parameters}", r"  \begin{tabular}{@{}rlrl@{}}", r"    \toprule"),
        r"    & Base parameter & Value & Unit \\",
        *(r"    \midrule", *rows, r"    \bottomrule"),
        *(r"  \end{tabular}", r"\end{table}"),
    ]
    return "\n".join(lines)


def _break_lines(latex: str, printed: str) -> str:
    """Return a sum, in several lines where it is long."""
    widths = [_width(term) for term in _terms(printed)]
    if sum(widths) <= _LONGEST:
        return latex
    lines, width = [""], 0
    for term, size in zip(_terms(latex.replace(r"\frac", r"\tfrac")), widths, strict=True):
        if width and width + size > _LONGEST:
            lines.append("")
            width = 0
        lines[-1] += term
        width += size
    inner = r" \\ ".join(f"& {line.strip()}" for line in lines)
    return rf"\begin{{aligned}}[t] {inner} \end{{aligned}}"


def _width(printed: str) -> int:
    """Return the printed letters of a term: a fraction is as wide as its longer part."""
    top, _, bottom = printed.partition("/")
    letters = (sum(letter not in "_^*(){}" for letter in part) for part in (top, bottom))
    return max(letters)


def _terms(text: str) -> list[str]:
    """Return the terms of a sum with their signs; what is in brackets belongs to its term."""
    terms, depth = [""], 0
    for k, letter in enumerate(text):
        depth += (letter in "({") - (letter in ")}")
        if not depth and letter in "+-" and text[k - 1 : k + 2] == f" {letter} ":
            terms.append("")
        terms[-1] += letter
    return terms


def _number(number: float, digits: int) -> str:
    """Return a number in LaTeX with `digits` digits, a power of ten where it needs an exponent."""
    mantissa, _, exponent = f"{number:.{digits}g}".partition("e")
    return rf"{mantissa} \times 10^{{{int(exponent)}}}" if exponent else mantissa


def _unit(unit: str) -> str:
    """Return a unit in LaTeX, upright in math mode."""
    spaced = unit.replace(" ", r"\,")
    return rf"$\mathrm{{{spaced}}}$"
