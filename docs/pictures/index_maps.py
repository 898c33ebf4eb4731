"""Draw the maps of docs/how-to: maps.png of a plane, tilts.png of a hexapod's angles."""

from __future__ import annotations

from pathlib import Path

from pteron.maps import map_index, pose_grid
from pteron.plots import map_figure


def draw(docs: Path) -> None:
    """Draw a Delta's condition number in a plane, and a hexapod's over its tilts."""
    tilts = {"roll": (-0.7, 0.7), "pitch": (-0.7, 0.7)}
    planes = {
        "maps": ("delta", "condition", {"z": -0.9}, None, 150),
        # As many points as the command beside it takes: both state one least value.
        "tilts": (
            "stewart",
            "condition_points",
            {"x": 0.0, "y": 0.0, "z": 2.0, "yaw": 0.0},
            tilts,
            None,
        ),
    }
    for name, (robot, index, held, ranges, points) in planes.items():
        grid = pose_grid(robot, held, ranges, points=points, rim=0.04)
        figure = map_figure(map_index(robot, index, grid))
        figure.savefig(docs / f"{name}.png", dpi=80, facecolor="white")
