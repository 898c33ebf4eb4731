"""Machines of which pages state a number."""

from __future__ import annotations

import mechanisms

LIMITED = mechanisms.gated(
    ["quadrupteron", "3-rpr", "sprint-z3", "ankle", "stewart", "delta"], ["3-rpr", "ankle"]
)


FREE = ["quadrupteron", "delta", "par4", "five-bar", "quadrupteron-oblique"]


IN_THE_LOOP = ("five-bar", "quadrupteron", "delta", "par4", "stewart", "3-rrr")
