"""Pictures of a machine in a pick-and-place cycle, and of its forces.

Writes `quadrupteron.png` and `forces.png` to the folder it is run in.
"""

import numpy as np

import pteron
from pteron.motion import joint_guides, joint_points, pick_and_place
from pteron.plots import forces_figure, robot_figure
from pteron.workspace import home_pose

robot = pteron.load("quadrupteron")
cycle = pick_and_place(robot, home_pose(robot))
forces = pteron.inverse_dynamics(robot, cycle.pose, cycle.velocity, cycle.acceleration)

points = joint_points(robot, cycle.pose[len(cycle.time) // 8])
guides = joint_guides(robot, cycle.pose)
machine = robot_figure(points, guides, gravity=np.array(robot.gravity), path=cycle.pose[:, :3])
machine.savefig("quadrupteron.png", dpi=160, facecolor="white")
forces_figure(cycle.time, forces, turning_point=cycle.duration / 2).savefig("forces.png", dpi=160)

print(f"cycle of {305 * cycle.scale:.0f} mm in {cycle.duration:.2f} s")
print("peak forces (N):", np.abs(forces).max(axis=0).round(1))
