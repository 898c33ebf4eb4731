"""The legs of a machine at a pose, as numbers for engines' files: joint axes and bodies' frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from pteron.equations.machine import Machine, State
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.legs.leg import LegMotion
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class LegStance:
    """The joints and bodies of a leg in a pose; in K poses each vector is (K, 3).

    Attributes
    ----------
    prismatic, carries : tuple
        For each joint before the cut: whether it slides, and the body it carries, by letter.
    axes, points : tuple of array, shape (3,)
        Axis, and a point on it, of each of these joints, m.
    references : dict of array, shape (3,)
        Position of each body's reference point.
    along, across : dict of array, shape (3,)
        Each body's x, and its z if it turns in a plane.
    end : array, shape (3,)
        The platform point.
    coordinate : float
        Coordinate of the actuated joint.
    numbers : tuple of int
        The places of these joints in the leg's chain. A driven joint that passes a moment on to the
        platform, and no force on to a point, carries nothing of the leg, and is not among them.
    driven : int, optional
        The place in the chain of the driven joint, if it is among them.
    hinge : array, shape (3,), optional
        Axis of the revolute joint at the platform, where that alone joins the leg to a platform
        that tilts: the cut then holds the axis too.
    """

    prismatic: tuple[bool, ...]
    carries: tuple[str, ...]
    axes: tuple[Array, ...]
    points: tuple[Array, ...]
    references: dict[str, Array]
    along: dict[str, Array]
    across: dict[str, Array]
    end: Array
    coordinate: Any
    numbers: tuple[int, ...]
    driven: int | None
    hinge: Array | None = None


def leg_stances(robot: Manipulator, poses: Array) -> list[LegStance]:
    """Return the legs at a pose (m,), or at poses (K, m)."""
    function, names = _function(robot)
    arrays = dict(zip(names, function.call([ca.DM(poses.T)]), strict=True))
    batch = poses.shape[:-1]

    def vector(*name: Any) -> Array:
        """Return stacked values (..., size) by name, with the axes of the batch of poses first."""
        stances = np.asarray(arrays[name]).T
        return stances.reshape(*batch, -1)

    stances = []
    for i, motion in enumerate(_states(robot)[1].legs):
        numbers = _numbers_before_the_cut(robot, i, motion)
        joints = [motion.chain[k] for k in numbers]
        beyond = range(numbers[-1] + 1, len(motion.chain))
        hinged = robot.platform.tilts and len(beyond) == 1
        turning = [b for b, body in motion.bodies.items() if body.x is not None]
        stances.append(
            LegStance(
                tuple(joint.kind == "P" for joint in joints),
                tuple(joint.body for joint in joints),
                tuple(vector(i, "axis", k) for k in numbers),
                tuple(vector(i, "point", k) for k in numbers),
                {letter: vector(i, "reference", letter) for letter in motion.bodies},
                {letter: vector(i, "x", letter) for letter in turning},
                {b: vector(i, "z", b) for b in turning if motion.bodies[b].y is not None},
                vector(i, "end"),
                vector(i, "coordinate")[..., 0],
                numbers,
                next((k for k in numbers if motion.chain[k].driven), None),
                vector(i, "axis", beyond[0]) if hinged else None,
            )
        )
    return stances


def shaft_ratio(robot: Manipulator, i: int) -> float:
    """Return the actuated joint's angle per radian of phi, of a leg that follows the angle."""
    motion = _states(robot)[1].legs[i]
    return float(ca.evalf(ca.SX(motion.actuated_joint.gear)))


def _numbers_before_the_cut(robot: Manipulator, i: int, motion: LegMotion) -> tuple[int, ...]:
    """Return the indices, in a leg's chain, of its joints up to its last body."""
    leg = robot.legs[i]
    carried = [joint.body for joint in motion.chain if joint.body]
    if sorted(carried) != sorted(motion.bodies):
        raise ModelError(
            f"leg {i + 1}: {leg.type}: its chain's joints carry {carried}, but its bodies are "
            f"{list(motion.bodies)}; let each body's joint name it (Joint.body)",
            subject=robot.name,
        )
    if not carried:
        raise ModelError(
            f"leg {i + 1}: a {leg.type} leg has no bodies, and an engine moves nothing else; give "
            "its kind a body, however light",
            subject=robot.name,
        )
    last = max((k for k, joint in enumerate(motion.chain) if joint.body), default=-1)
    moved_joints = [k for k, joint in enumerate(motion.chain) if motion.pushes or not joint.driven]
    return tuple(k for k in moved_joints if k <= last)


@lru_cache(maxsize=64)
def _states(robot: Manipulator) -> tuple[Any, State]:
    """Return the symbolic pose (m,) of a machine and its kinematic state there."""
    pose = ca.SX.sym("pose", robot.freedom)
    return pose, Machine.numeric(robot).state(pose)


@lru_cache(maxsize=64)
def _function(robot: Manipulator) -> tuple[Any, list[tuple[Any, ...]]]:
    """Return the CasADi function from a pose to a stance's arrays, and the key of each output."""
    pose, state = _states(robot)
    parts: dict[tuple[Any, ...], Any] = {}
    for i, (motion, point) in enumerate(zip(state.legs, state.platform.points, strict=True)):
        for k, joint in enumerate(motion.chain):
            parts[i, "axis", k], parts[i, "point", k] = joint.axis, joint.point
        for letter, body in motion.bodies.items():
            parts[i, "reference", letter] = body.position
            if body.x is not None:
                parts[i, "x", letter] = body.x
            if body.y is not None:
                parts[i, "z", letter] = body.axes if body.solid is None else body.solid.axes[:, 2]
        parts[i, "end"], parts[i, "coordinate"] = point.position, motion.coordinate
    # What does not depend on the pose is made to: so that every output has a column for each pose.
    zero = 0 * pose[0]
    return ca.Function("stances", [pose], [part + zero for part in parts.values()]), list(parts)
