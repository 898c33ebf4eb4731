"""A box that the machine is proved to reach, and its home."""

import pteron
from pteron.workspace import Box, home_pose, pose_margins, prove

robot = pteron.load("linear-delta")
home = home_pose(robot)
box = Box(tuple(home - 0.02), tuple(home + 0.02))
proof = prove(robot, box, type_i=0.05, type_ii=0.05)
margins = pose_margins(robot, home)
least = float(margins.least)
print(proof.holds, least > 0.0)
