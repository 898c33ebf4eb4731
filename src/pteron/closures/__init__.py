"""Kinds of closures: how the legs' rows make up J, and back; `closures.closure` is the page."""

from pteron.closures.closure import Closure
from pteron.closures.constant_rows import ConstantRows
from pteron.closures.three_loci import ThreeLoci

KINDS: tuple[type[Closure], ...] = (ConstantRows, ThreeLoci)
"""The kinds of closures; the first that fits a machine's legs and platform serves it."""

__all__ = ["KINDS", "Closure"]
