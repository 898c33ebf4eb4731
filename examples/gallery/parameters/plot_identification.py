"""
Measured against predicted forces
=================================

A Tripteron that is up to 20 % off its drawing follows two motions. The first identifies it, the
second, which is not fitted, is the judge.
"""

import numpy as np

import pteron
from pteron.identification import Limits, Log, identify, random_excitation

drawn = pteron.load("tripteron")
rng = np.random.default_rng(0)
factors = np.r_[rng.uniform(0.8, 1.2, 3), rng.uniform(0.8, 1.2, 7).repeat(4)]
built = pteron.with_parameters(drawn, pteron.parameters(drawn) * factors)
time = np.arange(5000) / 500.0
logs = []
for seed in (1, 2):
    motion = random_excitation(drawn, period=5.0, limits=Limits(acceleration=8.0), seed=seed)
    joints, rates, _ = motion.joints(time)
    state = motion.at(time)
    measured = pteron.inverse_dynamics(built, state.pose, state.velocity, state.acceleration)
    measured += 5.0 * np.sign(rates) + 3.0 * rates + 0.2 * rng.normal(size=measured.shape)
    logs.append(Log(f"motion {seed}", time, joints, measured))
found = identify(drawn, logs[0], held_out=logs[1])

# %%
# What the first drive measured (grey) and what the model predicts; below, what is left.
(judge,) = found.held_out
forces = judge.measured[:, 0], judge.predicted[:, 0], judge.without_friction[:, 0]
compared = pteron.plots.comparison_figure(judge.time, *forces, judge.used[:, 0], leg=0)

# %%
# The base parameters with their 95 % intervals. Rings are the drawing's values.
base = found.model.base
units = [base.parameters[k].unit for k in base.kept]
count = len(base.names)
values, deviations = found.estimate.values[:count], found.estimate.deviations[:count]
parameters = pteron.plots.parameters_figure(
    base.names, values, intervals=1.96 * deviations, units=units, reference=base.values(drawn)
)
