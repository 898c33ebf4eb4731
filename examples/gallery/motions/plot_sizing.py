"""
Sizing the motors of a Delta
============================

Which torque, at which speed, does a cycle with 1 kg ask of each drive?
"""

import pteron
from pteron.motion import pick_and_place, size, with_payload

robot = with_payload(pteron.load("delta"), 1.0)
found = size(robot, pick_and_place(robot))

# %%
# A dot is the root mean square, which heats the motor. In two of the quadrants the drive brakes.
torque_speed = pteron.plots.force_speed_figure(
    found.speeds, found.forces, rms=(found.rms_speeds, found.rms_forces), robot=robot
)

# %%
# The power of each drive, and of all: below zero it goes back into the supply.
power = pteron.plots.power_figure(found.time, found.power)
