"""
Working modes
=============

Each leg reaches a pose with its elbow on one side or on the other. These choices, four for two legs
and sixteen for four, are the machine's working modes; its file says which one it has.
"""

import pteron
from pteron.workspace import home_pose

robot = pteron.load("five-bar")
modes = pteron.working_modes(robot)
elbows = ["".join("+" if leg.elbow > 0 else "\u2212" for leg in mode.legs) for mode in modes]
four = pteron.plots.poses_figure(modes, home_pose(robot), titles=elbows, columns=2)

# %%
# Two of the sixteen modes of a Quadrupteron, in one pose.
quadrupteron = pteron.load("quadrupteron")
two = [pteron.working_modes(quadrupteron)[k] for k in (0, 15)]
elbows = ["".join("+" if leg.elbow > 0 else "\u2212" for leg in mode.legs) for mode in two]
pair = pteron.plots.poses_figure(two, [0.0, 0.0, 0.0, 0.2], titles=elbows)
