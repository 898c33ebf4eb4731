"""A parallel robot in MuJoCo: its exported MJCF, with constraints that hold joints that stick.

Of Pteron it has the bodies, in space, and where their loops close (`pteron.export`). MuJoCo finds
the passive joints' motion by itself, and its constraint forces carry what the legs do to the
platform.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import pteron
from pteron.export import Tree, mjcf, tree
from pteron.legs.ram import RamLeg

__all__ = ["Array", "actuated_coordinates", "joint_damping", "loop_rows", "mujoco_model", "opened"]

Array = NDArray[np.float64]
"""Floats of any shape."""

_PARALLEL = 1.0 - 1e-12


def opened(robot: pteron.Manipulator) -> Tree:
    """Return the machine with its loops cut, without drives: the plant has its own.

    Limits are left out, but for strokes of rams, within which a motion has to stay.
    """
    legs = tuple(
        replace(leg, drive=None, limits=leg.limits if isinstance(leg, RamLeg) else None)
        for leg in robot.legs
    )
    return tree(replace(robot, legs=legs, platform=replace(robot.platform, limits=None)))


def mujoco_model(machine: Tree, step: float) -> Any:
    """Return the model: its coordinates are the pose, what gears turn, where bars are, the legs.

    Each leg has three: slider, R1 and R2; or crank, and the angles of the universal joint between
    it and its rod; or two angles of a shaft or a ram and its length. A crank and its link under a
    platform that tilts are two. Its constraints are first the loops', three rows for each leg, then
    three for each bar's hinge and one for each gear, then those that can hold an actuated joint
    that sticks, which are not active.

    Parameters
    ----------
    machine : Tree
        The machine, with its real inertia; a shaft turns its platform one to one.
    step : float
        Step of the integration, s.

    Returns
    -------
    mujoco.MjModel
    """
    import mujoco

    spec = mujoco.MjSpec.from_string(mjcf(machine, step=step))
    for name in _actuated(machine):
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=name,
            active=False,
            data=np.zeros(12),
            solref=spec.equalities[0].solref,
            solimp=spec.equalities[0].solimp,
        )
    return spec.compile()


def actuated_coordinates(machine: Tree) -> NDArray[np.int64]:
    """Return which coordinates are the actuated joints (n,)."""
    names = [joint.name for joint in machine.joints]
    return np.array([names.index(name) for name in _actuated(machine)])


def _actuated(machine: Tree) -> list[str]:
    """Return what the actuated joints are called in the model: a shaft's is the platform's."""
    legs, names = machine.robot.legs, machine.robot.joint_names
    return ["phi" if leg.follows_angle else one for leg, one in zip(legs, names, strict=True)]


def loop_rows(machine: Tree) -> int:
    """Return how many rows the constraints have that are always active."""
    return 3 * len(machine.closings) + len(machine.joints) - len(machine.free)


def joint_damping(machine: Tree) -> Array:
    """Return C: passive joints with a unit coefficient load the coordinates with -C q'.

    It is for P-R-R-R and R-S-S legs, no shaft, and a platform that does not tilt.

    What is beyond the constraints is told by what is before them. R3 of a P-R-R-R leg turns at
    -theta_l', or at phi' - theta_l' about d where d is parallel to k and no R4 follows; every R4
    turns at phi'. The end of a rod turns as its tip does, back, and its hinge at phi'.
    """
    robot = machine.robot
    n, first = len(robot.legs), int(actuated_coordinates(machine)[0])
    unit = np.eye(first + 3 * n)
    turn = unit[robot.freedom - 1]
    rows = []
    legs: tuple[Any, ...] = robot.legs
    for i, leg in enumerate(legs):
        actuated, upper, lower = unit[first + 3 * i : first + 3 * i + 3]
        rows += [upper, lower]
        if isinstance(leg, pteron.legs.Leg):
            along = float(np.dot(leg.direction, robot.platform.axis))
            if robot.platform.turns and abs(along) > _PARALLEL:
                rows.append(np.sign(along) * turn - upper - lower)
                continue
            rows.append(-upper - lower)
        else:
            rows += [-lower, -actuated - upper]
        if robot.platform.turns:
            rows.append(turn)
    rates = np.array(rows)
    damping: Array = rates.T @ rates
    return damping
