"""The colours of all pictures, and the names under which a page may replace them.

The legs' four colours are Okabe and Ito's, which the colour-blind can tell apart. `svg` writes each
colour as a CSS variable with this value as its default, so that one picture serves a light and a
dark page.
"""

from __future__ import annotations

__all__ = ["GRID", "INK", "LEG_COLORS", "MUTED", "PAPER", "REACH", "VARIABLES", "WARNING"]

LEG_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
"""Of legs 1 to 4, in every picture and table."""

INK = "#1c2630"
"""Text and axes."""

MUTED = "#66727f"
"""Secondary text, rails, marks."""

GRID = "#d3dae1"
"""Grid lines."""

PAPER = "#fdfefe"
"""What lies under a picture: outlines of marks that must stand off it."""

REACH = "#3d6b8f"
"""Positions in reach."""

WARNING = "#b3261e"
"""Singularities."""

VARIABLES = {
    INK: "--ink",
    MUTED: "--muted",
    GRID: "--grid",
    PAPER: "--paper",
    REACH: "--reach",
    WARNING: "--warning",
    **{color: f"--leg{i + 1}" for i, color in enumerate(LEG_COLORS)},
}
"""The CSS variable of each colour."""
