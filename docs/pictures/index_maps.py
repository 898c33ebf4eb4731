"""Draw the map of docs/how-to/maps.md: maps.png."""

from __future__ import annotations

from pathlib import Path

from pteron.maps import map_index, pose_grid
from pteron.plots import map_figure


def draw(docs: Path) -> None:
    """Draw a Delta's condition number in a plane."""
    grid = pose_grid("delta", {"z": -0.9}, points=150, rim=0.04)
    map_figure(map_index("delta", "condition", grid)).savefig(
        docs / "maps.png", dpi=80, facecolor="white"
    )
