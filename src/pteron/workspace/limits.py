"""Why a machine has no pose to work in: which legs miss it, or which joints pass their limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.optimize import minimize  # type: ignore[import-untyped]

from pteron.equations.kinematics import passive_joints
from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics.sampling import search_ball
from pteron.legs.leg import Passive
from pteron.manipulator import Manipulator
from pteron.manipulator.manipulator import told_legs
from pteron.workspace.reserve import room_to_limits

_DRAWN = 20_000
_STARTS = 5

_TOUCH = 1e-6
"""Metres of common reach that count as none."""


def nowhere(robot: Manipulator) -> ModelError:
    """Return what is said of a machine that reaches no pose, or none within its joints' limits."""
    pose, drawn = _deepest(robot)
    margin = numeric(robot, "reach")(pose)[0]
    if float(margin.min()) > _TOUCH:
        reached = drawn[(numeric(robot, "reach")(drawn)[0] > _TOUCH).all(axis=-1)]
        return beyond_limits(robot, np.array([pose, *reached]))
    missed: dict[str, list[int]] = {}
    for i, m in enumerate(margin, start=1):
        if m < _TOUCH:
            missed.setdefault(f"{max(-m, 0.0):.3g} m", []).append(i)
    return ModelError(
        "no pose is in reach of all legs: at the best one they miss by "
        f"{', '.join(f'{way} ({told_legs(legs)})' for way, legs in missed.items())}; bring the "
        "guide points nearer or lengthen the links",
        subject=robot.name,
    )


def _deepest(robot: Manipulator) -> tuple[Array, Array]:
    """Return the pose at which the leg that misses it most misses least, and random ones."""
    center, radius = search_ball(robot)
    lengths = len(center)
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (_DRAWN, robot.freedom))
    drawn[:, :lengths] = center + radius * drawn[:, :lengths]
    drawn[:, lengths:] *= np.pi

    def margins(pose: Array) -> Array:
        return np.asarray(numeric(robot, "reach")(pose)[0])

    def deeper(start: Array) -> Array:
        found = minimize(
            lambda v: -v[-1],
            np.append(start, margins(start).min()),
            method="SLSQP",
            constraints={"type": "ineq", "fun": lambda v: margins(v[:-1]) - v[-1]},
        )
        return np.asarray(found.x[:-1])

    starts = drawn[np.argsort(-margins(drawn).min(axis=-1))[:_STARTS]]
    best = np.array([*starts, *map(deeper, starts)])
    return best[np.nanargmax(margins(best).min(axis=-1))], drawn


def beyond_limits(robot: Manipulator, poses: Array) -> ModelError:
    """Return what is said of a machine that at the best of poses, in reach, passes limits."""
    pose = poses[room_to_limits(robot, poses).min(axis=-1).argmax()]
    told = [
        f"{f'leg {at.leg}: ' if at.leg else ''}{at.noun} at {at.value:.4g} {at.unit} of "
        f"{at.told_limits('{:g}'.format)}"
        for at in limited_joints(robot, pose)
        if not at.least < at.value < at.most
    ]
    return ModelError(
        "no pose in reach of all legs keeps the joints' limits; nearest to it is one with "
        f"{', '.join(told)}; widen limits or move the guide points",
        subject=robot.name,
    )


@dataclass(frozen=True)
class LimitedJoint:
    """A joint that has limits, and where it is in a pose.

    Attributes
    ----------
    leg : int
        Its leg, from 1; 0 for the platform's angle.
    noun : str
        What it is: "slider", "elbow", ...
    actuated : bool
        Whether a drive moves it.
    unit : str
        Of the numbers, "m" or "rad".
    value, least, most : float
        Where it is, and its limits.
    only_most : bool
        Whether it is never below zero, as the angle in a cone, and only its greatest value a limit.
    """

    leg: int
    noun: str
    actuated: bool
    unit: str
    value: float
    least: float
    most: float
    only_most: bool = False

    def told_limits(self, told: Callable[..., str]) -> str:
        """Return its limits as words; `told` turns a value and the unit into text."""
        most = told(self.most, self.unit)
        return f"at most {most}" if self.only_most else f"{told(self.least, self.unit)} to {most}"


def limited_joints(robot: Manipulator, pose: Array) -> tuple[LimitedJoint, ...]:
    """Return all joints that have limits, actuated and passive, at a pose (m,) in reach."""
    joints = numeric(robot, "joint_coordinates")(pose)[0]
    angle, *legs = passive_joints(Machine.of(robot), ca.SX(ca.DM(pose)))
    found = [_limited(0, joint) for joint in angle]
    for i, (leg, q, passive) in enumerate(zip(robot.legs, joints, legs, strict=True), start=1):
        if leg.limits is not None:
            own = leg.joint
            found.append(LimitedJoint(i, own.noun, True, own.unit, float(q), *leg.limits))
        found += [_limited(i, joint) for joint in passive]
    return tuple(found)


def _limited(leg: int, at: Passive) -> LimitedJoint:
    limits = at.least, at.most, at.only_most
    return LimitedJoint(leg, at.noun, False, at.unit, float(at.value), *limits)
