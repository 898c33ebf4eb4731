"""The paper's Table 1, a Quadrupteron's base parameters: coefficients as printed and computed."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pteron.manipulator import RobotLike
from pteron.reduction import base_parameters

PRINTED = (
    "m_p1 + m_u1 + 20.11 I_l1",
    "m_p2 + m_u2 + 38.58 I_l2",
    "m_p3 + m_u3 + 35.86 I_l3",
    "m_p4 + m_u4 + 38.58 I_l4",
    "I_u1 + 0.83 I_l1",
    "mgx_u2 + 5.94 I_l2",
    "mgy_u2",
    "I_u2 + 0.91 I_l2",
    "mgx_u3 + 5.99 I_l3",
    "mgy_u3",
    "I_u3 + I_l3",
    "mgx_u4 + 5.94 I_l4",
    "mgy_u4",
    "I_u4 + 0.91 I_l4",
    "m_l1 - 20.11 I_l1 + m_l4 - 38.58 I_l4 + 12.5 mgx_e - 12.5 mgy_e + 312.5 I_e",
    "mgx_l1 + 4.48 I_l1",
    "mgy_l1",
    "m_l2 - 38.58 I_l2 - m_l4 + 38.58 I_l4 - 25 mgx_e",
    "mgx_l2 + 6.21 I_l2",
    "mgy_l2",
    "m_l3 - 35.86 I_l3 + m_l4 - 38.58 I_l4 + 12.5 mgx_e + 12.5 mgy_e + 312.5 I_e",
    "mgx_l3 + 5.99 I_l3",
    "mgy_l3",
    "mgx_l4 + 6.21 I_l4",
    "mgy_l4",
    "m_e - 625 I_e",
)
"""The 26 rows as the paper prints them, in this project's names."""

RESTORED = frozenset({15, 21, 24})
"""Rows with cells that our text of the paper damages (15 has m gamma_x of the platform twice, 21
lacks two terms, 24 an axis): they stand here as the other rows and the machine's symmetry determine
them. docs/theory/corrections.md has each cell."""

_TERM = re.compile(r"([+-]?)\s*([\d.]+)?\s*([A-Za-z]\w*)")
"""Pattern of a term of a printed row: sign, coefficient, name."""


@dataclass(frozen=True)
class Row:
    """A base parameter: its name in the paper, ``P_b1`` to ``P_b26``, and its name here.

    The sums agree where they have the same terms, and every computed coefficient rounds to the
    printed one. Where the scan of the paper is damaged the row is restored, see `RESTORED`.
    """

    parameter: str
    kept: str
    printed: str
    computed: str
    agrees: bool
    restored: bool


def rows(robot: RobotLike = "quadrupteron") -> tuple[Row, ...]:
    """Return the rows of Table 1, computed for a Quadrupteron, by default the catalog's."""
    base = base_parameters(robot)  # Table 1
    columns = base.names, PRINTED, base.expressions(), base.expressions(digits=12)
    return tuple(
        Row(f"P_b{i}", name, printed, shown, agree(printed, exact), i in RESTORED)
        for i, (name, printed, shown, exact) in enumerate(zip(*columns, strict=True), start=1)
    )


def agree(printed: str, computed: str) -> bool:
    """Return whether two sums agree in the printed digits, as `Row` defines."""
    printed_terms, computed_terms = terms(printed), terms(computed)
    return printed_terms.keys() == computed_terms.keys() and all(
        round(float(computed_terms[name]), len(text.partition(".")[2])) == float(text)
        for name, text in printed_terms.items()
    )


def terms(text: str) -> dict[str, str]:
    """Return the coefficient of each term of a row as text, with its printed digits."""
    return {
        name: ("-" if sign == "-" else "") + (size or "1")
        for sign, size, name in _TERM.findall(text)
    }
