"""Forces along a motion, and the parameters that they show."""

import numpy as np

import pteron
from pteron.motion import Motion, pick_and_place

robot = pteron.load("quadrupteron")
cycle: Motion = pick_and_place(robot)
forces = pteron.inverse_dynamics(robot, cycle.pose, cycle.velocity, cycle.acceleration)
base = pteron.base_parameters(robot)
regressor = pteron.base_regressor(robot, base, cycle.pose, cycle.velocity, cycle.acceleration)
error: float = float(np.abs(regressor @ base.values(robot) - forces).max())
rows: list[str] = [f"{name}: {row}" for name, row in zip(robot.force_names, forces.T, strict=True)]
print(base.rank, error < 1e-8, len(rows))
