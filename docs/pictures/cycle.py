"""Draw a cycle: the Quadrupteron of README, and the torques of the first result."""

from __future__ import annotations

import runpy
import shutil
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import pteron
from pteron.motion import pick_and_place
from pteron.plots import forces_figure
from pteron.workspace import home_pose

EXAMPLE = Path(__file__).parents[2] / "examples" / "picture.py"


def draw(docs: Path) -> None:
    """Draw quadrupteron.png, as examples/picture.py does, and start/torques.png."""
    with TemporaryDirectory() as folder:
        with chdir(folder), redirect_stdout(StringIO()):
            runpy.run_path(str(EXAMPLE), run_name="__main__")
        shutil.copy(Path(folder) / "quadrupteron.png", docs)
    robot = pteron.load("delta")
    cycle = pick_and_place(robot, home_pose(robot))
    torques = pteron.inverse_dynamics(robot, cycle.pose, cycle.velocity, cycle.acceleration)
    (docs / "start").mkdir(exist_ok=True)
    figure = forces_figure(cycle.time, torques, robot=robot, turning_point=cycle.duration / 2)
    figure.savefig(docs / "start" / "torques.png", dpi=110)
