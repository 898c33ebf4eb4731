"""A first result: joint coordinates and forces of a Quadrupteron's pose, and the pose again."""

import numpy as np

import pteron

robot = pteron.load("quadrupteron")
pose = np.array([0.01, -0.02, 0.03, 0.2])  # x, y, z in m and phi in rad

sliders = pteron.inverse_kinematics(robot, pose)
print("sliders (m):          ", sliders.round(4))

for mode, found in enumerate(pteron.direct_kinematics(robot, sliders), start=1):
    print(f"assembly mode {mode}:       ", found.round(4))

velocity, acceleration = np.array([0.1, 0.0, -0.2, 1.0]), np.array([2.0, 1.0, 0.0, 5.0])
forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
print("forces (N):           ", forces.round(3))

back = pteron.forward_dynamics(robot, pose, velocity, forces)
print("acceleration, again:  ", back.round(12))

# A batch: poses on a line. Those that a leg does not reach become NaN instead of an error.
line = np.zeros((7, 4))
line[:, 0] = np.linspace(0.0, 0.12, 7)
print("reach along x:        ", pteron.inverse_kinematics(robot, line, on_failure="nan")[:, 2])
