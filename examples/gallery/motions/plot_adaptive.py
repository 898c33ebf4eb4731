"""
A controller that learns the masses
===================================

Slotine and Li's controller believes that every body weighs 30 % less than it does. In the course of
four cycles it learns what the motion asks for, and the error goes.
"""

import pteron
from pteron.controllers import Adaptive
from pteron.motion import pick_and_place, simulate

robot = pteron.load("delta")
believed = pteron.with_parameters(robot, 0.7 * pteron.parameters(robot))
cycle = pick_and_place(robot, duration=0.5, samples=251)
found = simulate(
    robot, cycle.repeat(4), Adaptive(period=1e-3, motion=cycle), model=believed, step=2e-4
)

# %%
# The error over four cycles.
error = pteron.plots.tracking_figure(found.time, found.error, robot.coordinates)
