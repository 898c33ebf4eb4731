"""Identification: a machine that differs from its drawing, from a recorded motion."""

import numpy as np

import pteron
from pteron.identification import Limits, Log, identify, random_excitation

drawn = pteron.load("tripteron")
rng = np.random.default_rng(0)

# The machine as it was built: every body up to 20 % lighter or heavier than the drawing says.
sliders, links, platform = 3, 6, 1
factors = np.r_[rng.uniform(0.8, 1.2, sliders), rng.uniform(0.8, 1.2, links + platform).repeat(4)]
built = pteron.with_parameters(drawn, pteron.parameters(drawn) * factors)


def recorded(seed: int) -> Log:
    """Return what sensors would have logged: 10 s at 1 kHz, friction and noise included."""
    motion = random_excitation(
        drawn, harmonics=5, period=5.0, limits=Limits(acceleration=8.0), seed=seed
    )
    time = np.arange(10_000) / 1000.0
    state = motion.at(time)
    joints, rates, _ = motion.joints(time)
    forces = pteron.inverse_dynamics(built, state.pose, state.velocity, state.acceleration)
    forces += 5.0 * np.sign(rates) + 3.0 * rates
    noise = 0.01 * np.sqrt((forces**2).mean(axis=0)) * rng.normal(size=forces.shape)
    return Log(f"motion {seed}", time, np.round(joints / 1e-6) * 1e-6, forces + noise)


found = identify(drawn, recorded(1), held_out=recorded(2))

print(found.verdict.grade)
for reason in found.verdict.reasons:
    print(" ", reason)

truth = found.model.base.values(built)
print(f"\n{'base parameter':28}{'identified':>12}{'+-95 %':>9}{'true':>9}{'drawn':>9}")
rows = zip(
    found.model.base.names,
    found.estimate.values,
    1.96 * found.estimate.deviations,
    truth,
    found.model.base.values(drawn),
    strict=False,
)
for name, value, reach, true, before in rows:
    print(f"{name:28}{value:12.5f}{reach:9.5f}{true:9.5f}{before:9.5f}")
