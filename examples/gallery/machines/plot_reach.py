"""
Where a machine can work
========================

A slice through the reach at one orientation. The shade deepens with the margin, in metres, to the
nearest end of a leg's reach or of a joint's way. Outside, the colour is that of the leg that
misses.
"""

import pteron
from pteron.motion import pick_and_place
from pteron.workspace import home_pose, reach_slice

robot = pteron.load("quadrupteron")
home = home_pose(robot)
cycle = pick_and_place(robot, home)
level = pteron.plots.reach_figure(reach_slice(robot, home, "xy"), path=cycle.pose[:, :3])

# %%
# The same in an upright plane. A line in a leg's colour is the end of its reach, where the leg is
# stretched or folded (type I).
upright = pteron.plots.reach_figure(reach_slice(robot, home, "xz"), path=cycle.pose[:, :3])
