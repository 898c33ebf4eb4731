"""Logs with faults."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from logs_of_motions import Friction, log_of, machine

from pteron.identification import identify

RATE = 300.0


def brisk(robot):
    """Return a motion of a size and pace that suits a machine."""
    metres = 0.12 * float(np.mean([leg.size for leg in robot.legs if leg.size]))
    return {"size": metres, "turn": 0.5, "period": 2.0, "duration": 8.0, "rate": RATE}


@lru_cache
def clean(name, seed=0, dry=0.05):
    """Return a machine, its log without noise, and its friction, a share of the forces' spread."""
    robot = machine(name) if isinstance(name, str) else name
    bare = Friction(*np.zeros((3, len(robot.legs))))
    size = log_of(robot, friction=bare, seed=seed, **brisk(robot)).forces.std(axis=0)
    friction = Friction(dry * size, 0.02 * size, 0.01 * size)
    return robot, log_of(robot, friction=friction, seed=seed, **brisk(robot)), friction


def noisy(log, seed=0, noise=0.01):
    rng = np.random.default_rng(seed)
    size = np.sqrt((log.forces**2).mean(axis=0))
    joints = log.joints + 2e-7 * rng.normal(size=log.joints.shape)
    return replace(
        log, joints=joints, forces=log.forces + noise * size * rng.normal(size=log.forces.shape)
    )


def found(robot, log, **how):
    return identify(robot, log, cad=None, **how)


def late_by(log, delay):
    at = log.time - delay
    return np.stack([np.interp(at, log.time, force) for force in log.forces.T], axis=-1)
