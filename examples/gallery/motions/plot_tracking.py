"""
How well a controller follows
=============================

A Quadrupteron picks up 0.5 kg in the middle of the cycle, which its controller does not know of.
"""

import pteron
from pteron.controllers import ComputedTorque
from pteron.motion import pick_and_place, simulate

robot = pteron.load("quadrupteron")
motion = pick_and_place(robot)
found = simulate(robot, motion, ComputedTorque(period=1e-3), payload=[(0.0, 0.0), (0.5, 0.5)])

# %%
# The error of the pose.
error = pteron.plots.tracking_figure(found.time, found.error, robot.coordinates)

# %%
# What the drives give, sample by sample.
forces = pteron.plots.forces_figure(found.time, found.forces, robot=robot)
