"""
A film of a motion
==================

``film`` writes what ``draw`` draws, frame by frame, as MP4 or GIF: for slides, or for those who do
not read curves. On the command line it is ``pteron film delta --forces -o cycle.mp4``.
"""

from pathlib import Path
from tempfile import gettempdir

import pteron
from pteron.motion import pick_and_place

robot = pteron.load("delta")
cycle = pick_and_place(robot)
torques = pteron.inverse_dynamics(robot, cycle.pose, cycle.velocity, cycle.acceleration)

# %%
# The film tells its speed in a corner. The line through the curves below says when it is.
pteron.plots.film(
    robot,
    cycle,
    Path(gettempdir()) / "cycle.gif",
    speed=0.5,
    fps=10.0,
    size=(480, 400),
    forces=torques,
)
