"""Draw the machines of the catalog at home, for docs/catalog.md: catalog/NAME.png."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pteron
from pteron.motion import joint_guides, joint_points
from pteron.plots import robot_figure
from pteron.workspace import home_pose


def draw(docs: Path) -> None:
    """Draw all of them."""
    (docs / "catalog").mkdir(exist_ok=True)
    for name in pteron.catalog():
        robot = pteron.load(name)
        home = home_pose(robot)
        guides = joint_guides(robot, home[None])
        figure = robot_figure(joint_points(robot, home), guides, gravity=np.array(robot.gravity))
        path = docs / "catalog" / f"{name}.png"
        figure.savefig(path, dpi=50, facecolor="white", bbox_inches="tight")
