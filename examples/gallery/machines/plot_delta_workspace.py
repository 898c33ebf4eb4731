"""
Workspace and condition number of a Delta
=========================================

A condition number of 1 means that the platform moves alike in all directions at the same speeds of
the joints. Towards the rim one direction becomes slow, or weak.
"""

import numpy as np

import pteron
from pteron.workspace import home_pose, reach_slice

robot = pteron.load("delta")
cut = reach_slice(robot, home_pose(robot), "xz", points=121)
reach = pteron.plots.reach_figure(cut)

# %%
# All three rows of a Delta's Jacobian have one unit, rad/m: nothing needs to be made alike.
jacobians = pteron.jacobian(robot, cut.poses, on_failure="nan")
condition = np.linalg.cond(np.nan_to_num(jacobians))  # infinite where a leg does not reach
dexterity = pteron.plots.condition_figure(cut.first, cut.second, condition, names=("x", "z"))
