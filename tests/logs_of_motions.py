"""Synthetic logs: a machine's own dynamics along a motion, friction, noise and gaps at will."""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from mechanisms import CATALOG, MECHANISMS

import pteron
from pteron.identification.logs import Description, Log
from pteron.workspace import home_pose


@lru_cache
def machine(name):
    """Return a machine that the tests share: of `MECHANISMS`, the catalog, or a file of `data`."""
    for known in (MECHANISMS, CATALOG):
        if name in known:
            return known[name]
    if name in pteron.catalog():
        return pteron.load(name)
    return pteron.load(Path(__file__).with_name("data") / f"{name}.toml")


@dataclass(frozen=True)
class Friction:
    """Coulomb and viscous friction and offset of n joints, (n,) each."""

    coulomb: np.ndarray
    viscous: np.ndarray
    offset: np.ndarray

    @classmethod
    def of(cls, n):
        k = np.arange(n)
        return cls(2.0 + 0.2 * k, 1.0 + 0.3 * k, 0.3 * k - 0.4)

    @property
    def values(self):
        """In the order of the model: (3 n,)."""
        return np.r_[self.coulomb, self.viscous, self.offset]

    def forces(self, rates):
        return self.coulomb * np.sign(rates) + self.viscous * rates + self.offset


def motion(robot, time, *, seed=0, period=4.0, harmonics=4, size=0.04, turn=0.3):
    """Return pose, velocity and acceleration of a Fourier motion about the home pose."""
    rng = np.random.default_rng(seed)
    home = home_pose(robot)
    weights = rng.normal(size=(harmonics, 2, len(home)))

    def series(instants):
        parts = np.zeros((3, len(instants), len(home)))
        for h, (a, b) in enumerate(weights, start=1):
            w = 2.0 * np.pi * h / period
            s, c = np.sin(w * instants)[:, None], np.cos(w * instants)[:, None]
            parts[0] += (a * s + b * c) / h
            parts[1] += w * (a * c - b * s) / h
            parts[2] -= w * w * (a * s + b * c) / h
        return parts

    # The same motion, whatever the instants are at which it is asked for.
    largest = np.abs(series(np.linspace(0.0, period, 1000))[0]).max(axis=0)
    sizes = np.where(robot.platform.angular, turn, size)
    parts = series(time) * sizes / largest
    parts[0] += home
    return parts


def log_of(
    robot,
    *,
    time=None,
    duration=8.0,
    rate=300.0,
    joint_noise=0.0,
    force_noise=0.0,
    friction=None,
    seed=0,
    noise_seed=0,
    description=None,
    **shape,
):
    """Return the log of a motion, whose values are `truth(model)`."""
    if time is None:
        time = np.arange(round(duration * rate)) / rate
    pose, velocity, acceleration = motion(robot, time, seed=seed, **shape)
    joints = pteron.inverse_kinematics(robot, pose)
    rates = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    forces = forces + (friction or Friction.of(len(robot.legs))).forces(rates)
    rng = np.random.default_rng(noise_seed)
    joints = joints + joint_noise * rng.normal(size=joints.shape)
    forces = forces + force_noise * rng.normal(size=forces.shape)
    about = description or Description()
    names = {"symbols": tuple(leg.joint for leg in robot.legs), "coordinates": robot.coordinates}
    return Log("log.csv", time, joints, forces, description=about, **names)


def truth(model):
    """Return the values that a model of friction and offset has in `log_of`."""
    robot = model.robot
    return np.r_[model.base.values(robot), Friction.of(len(robot.legs)).values]


def pieces(log, size):
    """Yield a log in parts of a size, as a reader would."""
    for start in range(0, log.rows, size):
        yield log.part(start, start + size)


def without(log, start, stop):
    """Return a log with a gap: rows from start to stop are missing."""
    kept = np.r_[0:start, stop : log.rows]
    cut = {
        name: None if getattr(log, name) is None else getattr(log, name)[kept]
        for name in ("time", "joints", "forces", "pose", "payload")
    }
    return replace(log, **cut)
