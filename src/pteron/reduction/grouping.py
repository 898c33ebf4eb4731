"""`Grouping`: a regressor's columns kept as base parameters, and how the others depend on them.

Each method of `base_parameters` returns one.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from pteron.reduction.certificate import Certificate

Share = Fraction | float | Any
"""A coefficient: a fraction where exact, a SymPy number where it holds roots, else a float."""

Shares = dict[int, dict[int, Share]]
"""`shares[j][k]`: how much of the dependent column j goes with the kept column k."""


@dataclass(frozen=True)
class Grouping:
    """Columns of a regressor that are kept, in their order, and the others' shares on them."""

    kept: tuple[int, ...]
    given: Shares
    certificate: Certificate
