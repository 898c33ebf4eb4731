"""
Assembly modes of a 3-RRR
=========================

With its joints held, a machine may be put together in several ways. ``direct_kinematics`` returns
them all; a planar 3-RRR has up to six.
"""

import numpy as np

import pteron

robot = pteron.load("3-rrr")
joints = pteron.inverse_kinematics(robot, [0.02, -0.04, 0.29])
poses = pteron.direct_kinematics(robot, joints, all_branches=True)
poses = poses[np.isfinite(poses).all(axis=-1)]

# %%
# The cranks are the same in all pictures. A pose whose elbows are on other sides belongs to another
# working mode.
signs = pteron.kinematics.working_mode(robot, poses, joints)
modes = {tuple(leg.elbow for leg in mode.legs): mode for mode in pteron.working_modes(robot)}
machines = [modes[tuple(sign)] for sign in signs.tolist()]
titles = [f"\u03c6 = {np.degrees(pose[2]):.0f}\u00b0" for pose in poses]
assemblies = pteron.plots.poses_figure(machines, poses, titles=titles, columns=3)
