"""Coverage: how often stated intervals, and the joint region of all values, hold the truth.

Logs of 20 s at 1 kHz are made from a machine's own equations, with friction, so that nothing but
noise is wrong with them: white noise on the forces, or noise that remembers the last 10 ms or
200 ms; encoders that are exact, usual (1 um, on cranks 20 bits a turn) or ten times coarser, and
10 us of jitter. Each is identified by the default path, again and again with other noise. Printed
are the share of the 95 % intervals and of the 95 % regions that hold the truth, and the mean square
distance of the truth in the stated covariance, over the number of values: 1 where that is right.

    python benchmarks/identification/regions.py [--repetitions 200] [machine ...]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np
import plant
from scipy.signal import lfilter  # type: ignore[import-untyped]

import pteron
from pteron.identification import (
    METHODS,
    Estimate,
    Log,
    Model,
    identification_model,
    observations_of,
    preprocessing_for_log,
)
from pteron.identification.estimators import ESTIMATORS
from pteron.kernels import Array
from pteron.legs import Drive

RATE = 1000.0
DURATION = 20.0
FORCE_NOISE = 0.01
"""Standard deviation, as a share of each force's root mean square."""

JITTER = 1e-5
"""Standard deviation of the sampling times, s."""

MEMORIES = {"white": 0.0, "AR(1) 0.9": 0.9, "AR(1) 0.995": 0.995}
"""Correlation of the forces' noise between samples."""

_TWENTY_BITS = 2.0 * np.pi / 2**20


@dataclass(frozen=True)
class Machine:
    """A machine's motion, and its encoders' step, m or rad."""

    speed: float = 0.8
    acceleration: float = 8.0
    period: float = 5.0
    encoder: float = 1e-6


MACHINES = {
    "quadrupteron": Machine(),
    "delta": Machine(6.0, 80.0, encoder=_TWENTY_BITS),
    "par4": Machine(10.0, 120.0, 4.0, _TWENTY_BITS),
}


@dataclass(frozen=True)
class Bench:
    """A machine, its motion, and what it would say without noise."""

    model: Model
    truth: Array
    time: Array
    joints: Array
    rates: Array
    forces: Array

    @classmethod
    def of(cls, name: str) -> Bench:
        """Move a machine of the catalog; dry friction is 15 % of the forces, viscous 10 %."""
        about = MACHINES[name]
        robot = pteron.load(name)
        motion = plant.fourier_reference(
            robot, period=about.period, speed=about.speed, acceleration=about.acceleration
        )
        time = np.arange(round(DURATION * RATE)) / RATE
        joints, rates, _ = motion(time)
        bare = pteron.inverse_dynamics(robot, *motion.platform(time))
        size, speed = (np.sqrt((signal**2).mean(axis=0)) for signal in (bare, rates))
        friction = 0.15 * size, 0.1 * size / speed, 0.02 * size
        legs = tuple(
            replace(leg, drive=Drive(coulomb=c, viscous=v, offset=o))
            for leg, c, v, o in zip(robot.legs, *(one.tolist() for one in friction), strict=True)
        )
        forces = pteron.drive_forces(replace(robot, legs=legs), *motion.platform(time))
        model = identification_model(robot)
        return cls(model, np.r_[model.base.values(robot), *friction], time, joints, rates, forces)

    def log(self, encoder: float, memory: float, seed: int) -> Log:
        """Return what the sensors say."""
        rng = np.random.default_rng(seed)
        late = JITTER * np.clip(rng.normal(size=(len(self.time), 1)), -3.0, 3.0)
        joints = self.joints
        if encoder > 0.0:
            # The steps lie elsewhere each time, as those of a machine that was referenced anew.
            zero = encoder * rng.uniform(size=joints.shape[1])
            joints = encoder * np.round((joints + late * self.rates - zero) / encoder) + zero
        white = rng.normal(size=self.forces.shape)
        noise = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white, axis=0)
        noise *= FORCE_NOISE * np.sqrt((self.forces**2).mean(axis=0))
        return Log("the motion", self.time, joints, self.forces + noise)

    def estimate(self, log: Log, estimator: str) -> Estimate:
        """Identify by the default path."""
        preprocessing = preprocessing_for_log(self.model.robot, log)
        return ESTIMATORS[estimator](observations_of(self.model, log, preprocessing))


@dataclass(frozen=True)
class Held:
    """Shares of intervals and regions that held the truth, and its mean square distance."""

    intervals: float
    regions: float
    distance: float


def held(bench: Bench, encoder: float, memory: float, repetitions: int, estimator: str) -> Held:
    """Identify again and again with other noise."""
    intervals, regions, distances = [], [], []
    for seed in range(repetitions):
        found = bench.estimate(bench.log(encoder, memory, seed), estimator)
        low, high = found.intervals()
        intervals.append(((low <= bench.truth) & (bench.truth <= high)).mean())
        regions.append(found.p_value(bench.truth) >= 0.05)
        distances.append(found.distance(bench.truth) ** 2 / len(bench.truth))
    return Held(float(np.mean(intervals)), float(np.mean(regions)), float(np.mean(distances)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("machines", nargs="*", default=list(MACHINES))
    parser.add_argument("--repetitions", type=int, default=200)
    parser.add_argument("--estimator", default="weighted", choices=METHODS)
    given = parser.parse_args()
    print("| machine | values | encoder | noise of the forces | intervals | regions | distance |")
    print("| --- | ---: | ---: | --- | ---: | ---: | ---: |")
    for name in given.machines:
        bench, step = Bench.of(name), MACHINES[name].encoder
        cases = [(step, memory) for memory in MEMORIES] + [(0.0, "white"), (10.0 * step, "white")]
        for encoder, memory in cases:
            found = held(bench, encoder, MEMORIES[memory], given.repetitions, given.estimator)
            print(
                f"| {name} | {len(bench.truth)} | {1e6 * encoder:.3g} | {memory} | "
                f"{100 * found.intervals:.1f} % | {100 * found.regions:.1f} % | "
                f"{found.distance:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
