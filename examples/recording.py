"""A simulated machine, to try identification with: it follows a motion, and writes a log.

It stands for the real one: every body is up to 20 % off the drawing, its joints have friction, its
encoders 20 bits a turn (1 um on sliders), and its forces 1 % of noise.

    python recording.py                           # a random motion of the Delta: log.csv
    python recording.py ROBOT MOTION.csv LOG.csv  # the motion of a file, as pteron excite writes it
"""

import sys
from dataclasses import replace

import numpy as np
import polars as pl

import pteron
from pteron.identification import Limits, random_excitation

RATE = 1000.0

name, motion, log = sys.argv[1:] or ("delta", "random", "log.csv")
drawn = pteron.load(name)
rng = np.random.default_rng(0)

# The machine as it was built.
owners = [(p.body, p.legs) for p in pteron.manipulator.parameter_data(drawn)]
factors = {owner: rng.uniform(0.8, 1.2) for owner in owners}
built = pteron.with_parameters(
    drawn, pteron.parameters(drawn) * [factors[owner] for owner in owners]
)
n = drawn.freedom

# Friction is a share of what the joints carry, whichever way the machine hangs.
home, rest = pteron.workspace.home_pose(drawn), np.zeros(n)
hung = [replace(drawn, gravity=tuple(pull)) for pull in 9.81 * np.eye(3)]
load = np.sqrt(np.mean([pteron.inverse_dynamics(one, home, rest, rest) ** 2 for one in hung]))
k = np.arange(n)
coulomb, viscous, offset = load * np.array([0.12 + 0.06 * k, 0.06 + 0.006 * k, 0.012 * k])

# The motion that it follows.
if motion == "random":
    time = np.arange(5000) / RATE
    state = random_excitation(drawn, limits=Limits(speed=5.0, acceleration=60.0), seed=1).at(time)
    path = [state.pose, state.velocity, state.acceleration]
else:
    table = pl.read_csv(motion)
    time = table["t"].to_numpy()
    path = [table[[d + x for x in drawn.coordinates]].to_numpy() for d in ("", "d", "dd")]

# What its controller records.
joints = pteron.inverse_kinematics(drawn, path[0])
rates = pteron.kinematics.joint_rates(drawn, *path[:2]).actuated
forces = pteron.inverse_dynamics(built, *path)
forces += coulomb * np.sign(rates) + viscous * rates + offset
forces += 0.01 * np.sqrt((forces**2).mean(axis=0)) * rng.normal(size=forces.shape)
steps = np.array([2.0 * np.pi / 2**20 if leg.joint.unit == "rad" else 1e-6 for leg in drawn.legs])
columns = dict(zip(drawn.joint_names, (np.round(joints / steps) * steps).T, strict=True))
columns |= dict(zip(drawn.force_names, forces.T, strict=True))
pl.DataFrame({"t": time, **columns}).write_csv(log)
print(f"{log}: {len(time)} samples, forces up to {np.abs(forces).max():.3g}")
