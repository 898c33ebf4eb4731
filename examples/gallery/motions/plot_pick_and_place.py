"""
Forces of a pick-and-place cycle
================================

The standard cycle goes 25 mm up, 305 mm across and 25 mm down, and back. What does it ask of the
actuators of a Quadrupteron?
"""

import pteron
from pteron.motion import pick_and_place

robot = pteron.load("quadrupteron")
cycle = pick_and_place(robot)

# %%
# The machine at four moments of the way out. The dotted line is the tool's way.
moments = [0, 80, 120, 200]
machine = pteron.plots.poses_figure(
    robot,
    cycle.pose[moments],
    titles=[f"{1e3 * time:.0f} ms" for time in cycle.time[moments]],
    along=cycle.pose,
    columns=2,
)

# %%
# The forces of the rigid bodies, as ``pteron forces`` computes them.
forces = pteron.inverse_dynamics(robot, cycle.pose, cycle.velocity, cycle.acceleration)
curves = pteron.plots.forces_figure(
    cycle.time, forces, robot=robot, turning_point=cycle.duration / 2
)
