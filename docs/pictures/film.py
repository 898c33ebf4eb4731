"""Film delta.gif for README and the site: a Delta under its drives' forces, in simulation."""

from __future__ import annotations

from pathlib import Path

import pteron
from pteron.controllers import ComputedTorque
from pteron.motion import pick_and_place, simulate
from pteron.workspace import home_pose


def draw(docs: Path) -> None:
    """Write delta.gif: a pick-and-place cycle under computed torque, with the motors' torques."""
    robot = pteron.load("delta")
    cycle = pick_and_place(robot, home_pose(robot))
    run = simulate(robot, cycle, ComputedTorque())
    size = (640, 480)
    pteron.plots.film(robot, run.motion, docs / "delta.gif", fps=14.0, size=size, forces=run.forces)
