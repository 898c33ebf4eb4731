"""Construction of a Gymnasium environment's `World`, a machine with its task, from arguments."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from pteron.dynamics import drive_forces, mass_matrix
from pteron.dynamics.joint_space import mass_with_rotors, share_loads
from pteron.environments.world import ENDS, LEVER, World
from pteron.equations.drives import drives_of
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion import Machines, Motion, limits_of, longest_step
from pteron.workspace import home_pose, pose_margins

_STEP = 5e-4
"""Step of the integration, s, with which Runge and Kutta's method is exact to some micrometres."""

_LIVELY = 20.0
"""Acceleration, m/s^2, along all coordinates at once, assumed of drives without `max_force`."""

_LEAST = 0.2
"""Least margin of the poses at which episodes start and that are targets."""

_TOLERANCE, _SUCCESS = 0.005, 0.1
"""Usual distance to the target that is a success, m; at most this share of the way from home to the
rim of the starts and targets."""

_SPREAD = 0.25
"""Greatest distance of these poses from home, as a share of the longest leg."""


def world_of(
    robot: RobotLike,
    *,
    motion: Motion | None = None,
    period: float = 0.01,
    spread: float | None = None,
    tolerance: float | None = None,
    machines: Machines | None = None,
) -> World:
    """Return the simulated world of learning environments for a machine, after checks."""
    machine = as_manipulator(robot)
    sizes = {"period": period, "tolerance": tolerance, "spread": spread}
    for name, size in sizes.items():
        if size is not None and not (np.isfinite(size) and size > 0.0):
            raise DataError(f"{name}: {size} given, a number above 0 expected")
    if spread is None:
        spread = _SPREAD * max(leg.size for leg in machine.legs)
    home = _home(machine)
    least = min(_LEAST, float(pose_margins(machine, home).least) / 2.0)
    step = min(_STEP, longest_step(machine, home[None], machines) / 2.0, period)
    count = int(np.ceil(period / step - 1e-9))
    fixed = (home, _forces(machine, home), period, period / count, count)
    world = World(machine, *fixed, spread, tolerance or _TOLERANCE, least, motion, machines)
    box = world.travel(spread)
    # As far as the machine goes: of a hexapod with strokes of millimetres far less than asked.
    typical_travel = float(np.sqrt((world.metres(np.abs(box)) ** 2).mean()))
    spread = min(spread, typical_travel)
    tolerance = tolerance or min(_TOLERANCE, _SUCCESS * typical_travel)
    world = replace(world, box=box, spread=spread, tolerance=tolerance)
    if motion is not None:
        if not isinstance(motion, Motion):
            raise DataError(
                f"motion: {motion!r} given, a Motion expected, such as pteron.motion.replay makes "
                "of a table"
            )
        motion.repeat(2)
        low = world.margin_of(motion.pose) <= ENDS
        if low.any():
            at = float(motion.time[int(low.argmax())])
            raise DataError(
                f"motion: at {at:.4g} s it is out of reach, next to a singularity, or beyond the "
                "joints' limits; no episode could follow it"
            )
    return world


@lru_cache(maxsize=16)
def _home(robot: Manipulator) -> Array:
    """Return the machine's home pose (m,), read-only and cached."""
    home = home_pose(robot)
    home.setflags(write=False)
    return home


def _forces(robot: Manipulator, home: Array) -> Array:
    """Return the drive force (n,), N or N m, that an action of 1 stands for."""
    zero_rates = np.zeros(robot.freedom)
    rows = jacobian(robot, home)
    mass = mass_with_rotors(rows, mass_matrix(robot, home), drives_of(robot).inertia)
    most = np.where(robot.platform.angular, _LIVELY / LEVER, _LIVELY)
    lively = share_loads(rows, mass * most, robot.drive_strengths)
    enough = 2.0 * np.abs(drive_forces(robot, home, zero_rates, zero_rates)) + np.abs(lively).sum(
        axis=1
    )
    limits = limits_of(robot).force
    return np.where(np.isfinite(limits), limits, enough)
