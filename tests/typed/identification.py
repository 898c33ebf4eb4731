"""A log from a program's own arrays, identified."""

import numpy as np

import pteron
from pteron.identification import Identification, Log, identify
from pteron.identification.excitation import Limits, random_excitation
from pteron.progress import Progress

robot = pteron.load("tripteron")
motion = random_excitation(robot, limits=Limits(5.0, 60.0), period=3.0, seed=1)
states = motion.at(np.arange(3000) / 1000.0)
forces = pteron.inverse_dynamics(robot, states.pose, states.velocity, states.acceleration)
noise = 0.01 * np.random.default_rng(1).normal(size=forces.shape) * forces.std(axis=0)
joints = pteron.inverse_kinematics(robot, states.pose)
log = Log.of(robot, states.time, joints, forces + noise, source="my rig")
shares: list[float] = []
tell: Progress = shares.append
identification: Identification = identify(robot, log, progress=tell)
grade: str = identification.verdict.grade
print(grade, shares[-1] == 1.0, identification.base_values.shape)
