"""Logs with a payload."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from logs_of_motions import machine
from mechanisms import CLIENTS, NIGHTLY

import pteron
from pteron.bodies.inertia import SpatialInertia
from pteron.identification.logs import Log
from pteron.identification.logs.description import Description
from pteron.identification.signals import Processing
from pteron.workspace import home_pose

SOME = ("ball-table",)


OTHERS = ("mixed", "3-rrr", "par4")


CENTRAL = Processing(derivatives="central")


EACH = pytest.mark.parametrize(
    ("name", "processing"),
    [
        *(
            pytest.param(name, None, marks=CLIENTS if name in SOME else NIGHTLY)
            for name in (*SOME, "five-bar", "quadrupteron", "delta-4", "random 3T 0", *OTHERS)
        ),
        ("quadrupteron-oblique", CENTRAL),
    ],
)


LOAD = pteron.bodies.PlanarInertia(0.35, (0.006, -0.009), 0.0011)


SOLID = SpatialInertia(
    0.15, (0.002, -0.003, 0.004), (0.0009, 0.0001, 0.00005, 0.0012, -0.0001, 0.0011)
)


NOISE = (1e-6, 0.01)
"""Counts of an encoder, m, and noise of the forces relative to their size."""


PERIOD, RATE = 3.0, 500.0


@lru_cache
def base_of(name):
    return pteron.base_parameters(machine(name))


@lru_cache
def motion(name, seed):
    """Return two periods of a smooth motion about the home pose: time, and three derivatives."""
    robot = machine(name)
    rng = np.random.default_rng(seed)
    time = np.arange(round(2 * PERIOD * RATE)) / RATE
    m = robot.freedom
    q = np.zeros((3, len(time), m))
    for h in range(1, 6):
        w = 2.0 * np.pi * h / PERIOD
        a, b = rng.normal(size=(2, m)) / h
        s, c = np.sin(w * time)[:, None], np.cos(w * time)[:, None]
        q += [a * s + b * c, w * (a * c - b * s), -w * w * (a * s + b * c)]
    # The mixed machine and the Delta are four times as large as most others.
    small = {"mixed": 0.2, "delta-4": 0.2, "five-bar": 0.02, "ball-table": 0.01}
    sizes = np.where(robot.platform.angular, 0.3, small.get(name, 0.05))
    q *= sizes / np.abs(q[0]).max(axis=0)
    q[0] += home_pose(robot)
    return time, q


def laden(robot, load=LOAD):
    """Return the machine with a body fixed to its platform."""
    load = SOLID if robot.platform.tilts else load
    inertia = load.of_values(np.add(robot.platform.inertia.values, load.values).tolist())
    return replace(robot, platform=replace(robot.platform, inertia=inertia))


@lru_cache
def clean(name, seed, load):
    """Return time, sliders, forces without noise, phase (the second half laden) and mode."""
    robot = machine(name)
    time, q = motion(name, seed)
    phase = (np.arange(len(time)) >= len(time) // 2).astype(int)
    empty, full = (pteron.inverse_dynamics(r, *q) for r in (robot, laden(robot, load)))
    rates = pteron.kinematics.joint_rates(robot, q[0], q[1]).actuated
    legs = np.arange(len(robot.legs))
    forces = np.where(phase[:, None] == 1, full, empty)
    forces += 2.0 * (1.0 + 0.1 * legs) * np.sign(rates) + (1.0 + 0.2 * legs) * rates + 0.3 * legs
    sliders = pteron.inverse_kinematics(robot, q[0])
    mode = 1 + int(pteron.kinematics.assembly_mode(robot, q[0, 0]))
    return time, sliders, forces, phase, mode


def make_log(name, seed=1, noise=(0.0, 0.0), draw=0, load=LOAD):
    time, sliders, forces, phase, mode = clean(name, seed, load)
    counts, share = noise
    if counts:
        sliders = np.round(sliders / counts) * counts
    size = np.sqrt((forces**2).mean(axis=0))
    forces = forces + share * size * np.random.default_rng(draw).normal(size=forces.shape)
    about = Description(period=PERIOD, assembly_mode=mode)
    return Log("log.csv", time, sliders, forces, payload=phase, description=about)


def halves(log):
    """Return the phases of a log as two logs that do not tell theirs."""
    middle = log.rows // 2
    parts = log.part(0, middle), log.part(middle, log.rows)
    return [replace(part, payload=None) for part in parts]
