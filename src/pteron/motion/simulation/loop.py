"""The loop of a simulation: at each sample forces are asked for, limited, delayed, integrated."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Protocol, runtime_checkable

import numpy as np

from pteron.dynamics import drive_accelerations
from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator
from pteron.motion.motion import Motion, told_pose
from pteron.motion.simulation.plant import Plant
from pteron.motion.simulation.simulation import Simulation
from pteron.motion.simulation.stops import (
    first_beyond_limits,
    first_singular,
    told_limit,
    told_singular,
    why_not_further,
)
from pteron.motion.trajectories.limits import limits_of

_WHOLE = 1e-9
"""Part of a sample, from rounding, by which a delay of whole samples may miss them."""


@runtime_checkable
class ControlLaw(Protocol):
    """A controller's law for one machine; `pteron.controllers` has some."""

    def memory(self, pose: Array, velocity: Array) -> Array:
        """Return its memory at the start, (K,)."""

    def __call__(
        self,
        pose: Array,
        velocity: Array,
        acceleration: Array,
        joints: Array,
        joint_rates: Array,
        memory: Array,
    ) -> tuple[Array, Array]:
        """Return forces (n,) and the next memory, from the reference and the measured joints."""


ForceSource = Callable[[int, Array, Array, Array], tuple[Array, Array]]
"""Gives the forces asked of the drives, (n,), and the next memory, from the sample's number, the
joints' coordinates and rates, and the memory."""


@dataclass(frozen=True)
class Loads:
    """The payload and the wrench on the platform at each sample."""

    masses: Array
    machines: Mapping[float, Manipulator]
    """The machine with each of the masses."""
    wrench: Callable[[float], Array]


def run(
    robot: Manipulator,
    plant: Plant,
    source: ForceSource,
    memory: Array,
    reference: Motion,
    loads: Loads,
    delay: float,
    *,
    limits: bool,
) -> Simulation:
    """Simulate; `limits` says whether joints' limits and singularities of type II end it."""
    time = reference.time
    joints_of, rates_of = numeric(robot, "joint_coordinates"), numeric(robot, "joint_rates")
    most = limits_of(robot).force
    # A command acts `whole` samples and a part of one after it was asked for; before there are any,
    # the first one holds the machine.
    period = float(time[1] - time[0])
    delay = min(delay, period * len(time))  # later than the end is never
    whole = int(delay / period + _WHOLE)
    late = max(delay - whole * period, 0.0)
    late = late if late > _WHOLE * period else 0.0
    commands: deque[Array] = deque(maxlen=whole + 2)
    rows: list[tuple[Array, ...]] = []
    why = None
    for k, now in enumerate(time):
        joints = joints_of(plant.pose)[0]
        rates = rates_of(plant.pose, plant.velocity)[0]
        asked, memory = source(k, joints, rates, memory)
        commands.append(np.clip(asked, -most, most))
        while len(commands) < whole + 2:
            commands.append(commands[0])
        before, after = commands[0], commands[1]
        forces = before if late else after
        rows.append((plant.pose, plant.velocity, joints, rates, forces, asked, memory))
        if not np.isfinite(asked).all():
            why = (
                f"no forces are asked for at the joints {told_pose(joints)}: they have no pose "
                "near the last one, or the wanted pose is out of the controller's reach"
            )
            break
        if k + 1 < len(time):
            loaded = loads.machines[float(loads.masses[k])]
            span, wrench = float(time[k + 1] - now), loads.wrench(float(now))
            if not (
                plant.go(loaded, late, before, wrench)
                and plant.go(loaded, span - late, after, wrench)
            ):
                why = why_not_further(robot, plant.pose, plant.velocity)
                break
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    end = len(rows)
    if limits:
        ends = {
            first_beyond_limits(robot, columns[0], columns[2]): told_limit,
            first_singular(robot, columns[0]): told_singular,
        }
        first = min((k for k in ends if k is not None), default=None)
        if first is not None:
            end, why = first + 1, ends[first](robot, columns[0][first])
    stopped = None if why is None else f"at {min(plant.time, time[end - 1]):.4g} s: {why}"
    pose, velocity, joints, rates, forces, asked, known = (part[:end] for part in columns)
    acceleration = np.empty_like(pose)
    wrenches = np.array([loads.wrench(float(t)) for t in time[:end]])
    for mass, loaded in loads.machines.items():
        at = loads.masses[:end] == mass
        acceleration[at] = drive_accelerations(
            loaded, pose[at], velocity[at], forces[at], wrenches[at], on_failure="nan"
        )
    return Simulation(
        robot,
        time[:end],
        pose,
        velocity,
        acceleration,
        joints,
        rates,
        forces,
        asked,
        Motion(*(getattr(reference, field.name)[:end] for field in fields(Motion))),
        loads.masses[:end],
        known,
        min(plant.step, period),
        stopped,
    )
