"""
A motion that shows the parameters
==================================

Identification rests on motions that make every base parameter felt. These are periodic, within the
limits of the joints; ``pteron excite`` searches for the best ones.
"""

import numpy as np

import pteron
from pteron.identification import Limits, random_excitation

robot = pteron.load("delta")
motion = random_excitation(robot, period=5.0, limits=Limits(speed=5.0, acceleration=60.0), seed=1)
time = np.linspace(0.0, 5.0, 1001)
joints = pteron.plots.joints_figure(time, *motion.joints(time), robot=robot)

# %%
# Where the platform goes.
poses = motion.at(time).pose
machine = pteron.plots.draw(robot, poses[0], along=poses)
