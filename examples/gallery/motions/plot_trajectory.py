"""
A path through several poses
============================

Straight lines whose corners are rounded, there and back, within limits of the joints: the pose, its
velocity and its acceleration over time. Lengths and the angle stand beside each other.
"""

import pteron
from pteron.motion import limits_of, line_path, polynomial_motion, return_path

robot = pteron.load("quadrupteron")
corners = [[0.0, 0.0, 0.0, 0.0], [0.06, 0.03, 0.02, 0.3], [0.06, -0.05, 0.02, 0.0]]
path = return_path(line_path(robot, corners, 0.02))
motion = polynomial_motion(robot, path, limits=limits_of(robot, speed=0.5, acceleration=5.0))
state = motion.pose, motion.velocity, motion.acceleration
courses = pteron.plots.trajectory_figure(motion.time, *state, names=robot.coordinates)

# %%
# What the sliders do.
joints = pteron.inverse_kinematics(robot, motion.pose)
rates = pteron.kinematics.joint_rates(robot, motion.pose, motion.velocity).actuated
sliders = pteron.plots.joints_figure(motion.time, joints, rates, robot=robot)
