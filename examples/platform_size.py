"""A design question: the size of a platform that needs little force and turns far.

The platform points are moved out from P; the machine's home pose, the largest force of a
pick-and-place cycle, and the conditioning of J follow.
"""

from dataclasses import replace

import numpy as np

import pteron
from pteron.motion import pick_and_place
from pteron.workspace import home_pose

robot = pteron.load("quadrupteron")
print("radius (mm)   cycle across (mm)   peak force (N)   condition number of J (m, rad)")
for radius in (0.03, 0.04, 0.06, 0.08):
    legs = tuple(
        replace(leg, platform_point=tuple(radius / 0.04 * np.array(leg.platform_point)))
        for leg in robot.legs
    )
    machine = replace(robot, legs=legs)
    home = home_pose(machine)
    cycle = pick_and_place(machine, home)
    forces = pteron.inverse_dynamics(machine, cycle.pose, cycle.velocity, cycle.acceleration)
    condition = np.linalg.cond(pteron.jacobian(machine, home))
    print(
        f"{1e3 * radius:11.0f}{305 * cycle.scale:20.0f}{np.abs(forces).max():17.1f}"
        f"{condition:17.1f}"
    )
