"""Kinds of legs, one file each; `legs.leg` is the page to read before writing another."""

from pteron.legs.kind import LegKind
from pteron.legs.prrr import PRRR
from pteron.legs.rss import RSS

KINDS: dict[str, type[LegKind]] = {kind.type: kind for kind in (PRRR, RSS)}
"""The kinds of legs that files may name, by their key `type`; add another here."""

__all__ = ["KINDS", "PRRR", "RSS", "LegKind"]
