"""
As fast as the drives allow
===========================

The same path, twice: as a polynomial in time that just keeps the limits, and with every moment at a
limit of one drive or another.
"""

import pteron
from pteron.motion import cycle_path, limits_of, pick_and_place, shortest, time_optimal

robot = pteron.load("quadrupteron")
cycle = pick_and_place(robot)
limits = limits_of(robot, force=60.0, speed=1.5)

# %%
# The smooth motion touches a limit, of a force or of a slider's speed, at single moments.
smooth = shortest(robot, cycle.cycle.at, limits)
state = smooth.pose, smooth.velocity, smooth.acceleration
gentle = pteron.plots.forces_figure(smooth.time, pteron.drive_forces(robot, *state), robot=robot)

# %%
# The fastest one is always at a limit.
fastest = time_optimal(robot, cycle_path(cycle), limits)
state = fastest.pose, fastest.velocity, fastest.acceleration
quick = pteron.plots.forces_figure(fastest.time, pteron.drive_forces(robot, *state), robot=robot)

# %%
# Its pose and the derivatives of it.
courses = pteron.plots.trajectory_figure(fastest.time, *state, names=robot.coordinates)
