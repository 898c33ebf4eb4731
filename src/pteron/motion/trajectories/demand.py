"""Demand of a curve of poses x(p) on joints and drives: largest rate p' within limits, and peaks.

The drives' forces are c + a p'' + b p'^2, and friction: dry friction by the sign of the joint's
motion, viscous friction by its speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.equations.drives import drives_of
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.bisection import bisect_condition
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.legs import Drive
from pteron.legs.motor_limits import motor_peak
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import pose_text
from pteron.motion.trajectories.limits import MotionLimits
from pteron.motion.trajectories.tool import Curve, tool_path
from pteron.result import Result
from pteron.tolerances import EXACT

_CREEP = 1e-30
"""Rate of either sign that a reversing joint gets instead of 0, for dry friction both ways."""

_HALVINGS = 50
"""Bisections for the place where a joint reverses."""

_WORDS = {
    "speed": ("moves at up to", "{unit}/s"),
    "acceleration": ("accelerates by up to", "{unit}/s^2"),
    "force": ("takes up to", "{force_unit}"),
    "force_at_speed": ("takes", "{force_unit}"),
    "tool_speed": ("moves at up to", "m/s"),
    "tool_acceleration": ("accelerates by up to", "m/s^2"),
}
"""For each quantity that has a limit: a verb, and its unit."""


class Demand(NamedTuple):
    """Joint motion and forces that K poses on a curve need, (K, n) each but for the tool's."""

    first: Array
    """dq/dp and d2q/dp2 of the joints."""
    second: Array
    static: Array
    """c: forces at rest, the offset included."""
    growth: Array
    """a, of p''; the motors' inertia included."""
    square: Array
    """b, of p'^2."""
    dry: Array
    """(2, n): dry friction at least and, with what is more at rest, at most."""
    viscous: Array
    """(n,)"""
    tool: tuple[Array, Array]
    """Derivatives of the tool's place (K, k) by p."""

    def by_parameter(self, rate: Array, gain: Array) -> Demand:
        """Return the demand by another parameter, by which p has the derivatives (K,)."""
        r, g = rate[:, None], gain[:, None]
        speed, bend = self.tool
        return self._replace(
            first=self.first * r,
            second=self.second * r**2 + self.first * g,
            growth=self.growth * r,
            square=self.square * r**2 + self.growth * g,
            tool=(speed * r, bend * r**2 + speed * g),
        )

    def between(self, first: int, last: int) -> Demand:
        """Return the demand at poses from index `first` to before `last`."""
        part = slice(first, last)
        speed, bend = self.tool
        return self._replace(
            first=self.first[part],
            second=self.second[part],
            static=self.static[part],
            growth=self.growth[part],
            square=self.square[part],
            tool=(speed[part], bend[part]),
        )

    def drive_forces(self, rate: Array, gain: Array) -> Array:
        """Return drive forces (2, K, n) at p' and p'' (K,), with least and greatest dry friction.

        The actual drive forces lie between the two.
        """
        moving = np.sign(self.first * rate[:, None])
        rigid = self.static + self.growth * gain[:, None] + self.square * rate[:, None] ** 2
        return np.asarray(
            rigid + self.viscous * self.first * rate[:, None] + self.dry[:, None] * moving
        )


def demand(robot: Manipulator, pose: Array, first: Array, second: Array) -> Demand:
    """Return coefficients of drive forces, joint and tool rates in p' and p'' at poses (K, m)."""
    zero_rates = np.zeros_like(pose)
    weight = evaluate_unchecked(robot, "inverse_dynamics", pose, zero_rates, zero_rates)
    rates = evaluate_unchecked(robot, "joint_rates", pose, first)[0]
    bends = evaluate_unchecked(robot, "joint_accelerations", pose, first, second)[0]
    drives = drives_of(robot)
    accelerated_forces = evaluate_unchecked(robot, "inverse_dynamics", pose, zero_rates, first)
    moving_forces = evaluate_unchecked(robot, "inverse_dynamics", pose, first, second)
    _, speed, bend = tool_path(robot.platform, pose, first, second)
    return Demand(
        rates,
        bends,
        weight + drives.offset,
        accelerated_forces - weight + drives.inertia * rates,
        moving_forces - weight + drives.inertia * bends,
        np.array([drives.coulomb, drives.coulomb + drives.stribeck]),
        np.asarray(drives.viscous),
        (speed, bend),
    )


def demand_between(
    robot: Manipulator, states: Callable[[Array], Curve], at: Array
) -> tuple[Array, Demand, Array]:
    """Return curve parameters, the `Demand` and poses (K, m) there, joint reversals inserted.

    `states` returns the curve at ascending parameters. Where a joint reverses between two of them,
    dry friction changes its sign and a force jumps: that parameter is inserted twice, with either
    sign of the rate.
    """
    turns, joints = _reversals(robot, states, at)
    all_places = np.concatenate([at, turns, turns])
    order = np.argsort(all_places, kind="stable")
    pose, first, second = states(all_places[order])
    needs = demand(robot, pose, first, second)
    rates = needs.first.copy()
    rows = np.argsort(order)[len(at) :]
    rates[rows, np.tile(joints, 2)] = np.repeat([_CREEP, -_CREEP], len(turns))
    return all_places[order], needs._replace(first=rates), pose


def _reversals(
    robot: Manipulator, states: Callable[[Array], Curve], at: Array
) -> tuple[Array, NDArray[np.intp]]:
    """Return curve parameters (R,) at which joints reverse, and the joint index of each (R,)."""

    def rates(places: Array) -> Array:
        """Return the joint rates (R, n) at curve parameters (R,)."""
        return np.asarray(evaluate_unchecked(robot, "joint_rates", *states(places)[:2])[0])

    known = rates(at)
    k, joints = np.nonzero(known[1:] * known[:-1] < 0.0)
    ahead, low, high = known[k, joints] > 0.0, at[k], at[k + 1]
    if len(k):
        each = np.arange(len(k))
        low, _ = bisect_condition(
            lambda places: (rates(places)[each, joints] > 0.0) == ahead, low, high, _HALVINGS
        )
    stop_rows, stop_joints = np.nonzero((known[1:-1] == 0.0) & (known[2:] * known[:-2] < 0.0))
    return np.concatenate([low, at[stop_rows + 1]]), np.concatenate([joints, stop_joints])


def curve_rate(
    robot: Manipulator, curve: Curve, limits: MotionLimits, most: float = np.inf
) -> float:
    """Return the largest constant p' <= `most` at which a curve of poses (K, m) keeps limits."""
    return most_rate(robot, demand(robot, *curve), limits, curve[0], most)


def most_rate(
    robot: Manipulator, needs: Demand, limits: MotionLimits, poses: Array, most: float = np.inf
) -> float:
    """Return the largest constant p' <= `most` at which the demand keeps the limits at all poses.

    It is infinite if no limit is reached.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = [
            limits.speed / np.abs(needs.first),
            np.sqrt(limits.acceleration / np.abs(needs.second)),
            limits.tool_speed / np.linalg.norm(needs.tool[0], axis=-1),
            np.sqrt(limits.tool_acceleration / np.linalg.norm(needs.tool[1], axis=-1)),
        ]
        least = min(float(np.nanmin(rate, initial=most)) for rate in rates)
    joints, force, fall, back = limits.force_lines
    if not len(joints):
        return least
    # The margin on each side of a drive's force: square p'^2 + root p' <= margin.
    rows, first = [], needs.first[:, joints]
    expect_strength(robot, needs, limits, poses)
    for dry in needs.dry:
        static_forces = needs.static + dry * np.sign(needs.first)
        for side in (1.0, -1.0):
            parts = force - side * static_forces[:, joints], side * needs.square[:, joints]
            root = side * (needs.viscous[joints] + back) * first + fall * np.abs(first)
            rows.append([*parts, root])
    margin, square, root = (np.concatenate([row[k].ravel() for row in rows]) for k in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        below = root + np.sqrt(root**2 + 4.0 * square * margin)
        edge = np.where(below > 0.0, 2.0 * margin / below, np.inf)
    if not np.isfinite(least):
        least = float(np.nanmin(edge[(square > 0.0) | (square == 0.0)], initial=np.inf))
    # Friction may pass a limit between two speeds where what is slower, and faster, keeps it.
    step = EXACT
    while np.isfinite(least):
        over = square * least**2 + root * least > margin + EXACT * np.abs(margin)
        if not over.any():
            break
        # An edge may be off by rounding: it is left by a step, the longer the more were taken.
        least = min(float(edge[over].min()), least * (1.0 - step))
        step = min(2.0 * step, 0.1)
    return least


def expect_strength(robot: Manipulator, needs: Demand, limits: MotionLimits, poses: Array) -> None:
    """Raise if forces at rest at poses (K, m) exceed a drive's limit: no speed is slow enough."""
    joints, force, _, _ = limits.force_lines
    strength = np.full(needs.static.shape[-1], np.inf)
    np.minimum.at(strength, joints, force)
    both = needs.static + needs.dry[:, None] * np.sign(needs.first)
    static_forces = both[np.abs(both).argmax(axis=0), *np.indices(needs.static.shape)]
    over = np.abs(static_forces) - strength
    if not (over >= 0.0).any():
        return
    k, i = np.unravel_index(int(np.nanargmax(over)), over.shape)
    joint = robot.legs[i].joint
    raise ModelError(
        f"leg {i + 1}: its drive gives {strength[i]:.4g} {joint.force_unit}, but the machine's "
        f"weight and dry friction alone take {abs(static_forces[k, i]):.4g} {joint.force_unit} at "
        f"pose {pose_text(poses[k])}: no motion is slow enough; take another path, a lighter load "
        "or a stronger drive",
        subject=robot.name,
    )


@dataclass(frozen=True, eq=False, repr=False)
class Peak(Result):
    """The largest size of a quantity in a motion, beside its limit."""

    name: str
    """ "speed", "acceleration" or "force" of a joint; "tool_speed" or "tool_acceleration". Where
    limits have lines, "force_at_speed" too: the force nearest to what its motor gives at its speed.
    """
    leg: int
    """Its leg, from 1; 0 for the tool."""
    size: float
    unit: str
    limit: float
    """Infinite where there is none."""
    at: int
    """The sample."""

    @property
    def share(self) -> float:
        """The peak value over its limit; 0 without a limit, infinite if the limit is 0."""
        return self.size / self.limit if self.limit else math.inf

    def phrase(self) -> str:
        """Return as text the peak value and its limit: "leg 1 takes ..., its limit is ..."."""
        who = f"leg {self.leg}" if self.leg else "the tool"
        verb, _ = _WORDS[self.name]
        where = " at that speed" if self.name == "force_at_speed" else ""
        return (
            f"{who} {verb} {self.size:.4g} {self.unit}, its limit{where} is {self.limit:.4g} "
            f"{self.unit}"
        )


def peaks(
    robot: RobotLike, pose: Array, velocity: Array, acceleration: Array, limits: MotionLimits
) -> tuple[Peak, ...]:
    """Return the largest values in a motion (T, m): of each leg and quantity, then of the tool.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity, acceleration : array, shape (T, m)
        The motion; m, rad and s.
    limits : MotionLimits
        The limits beside them.

    Returns
    -------
    tuple of Peak
    """
    robot = as_manipulator(robot)
    needs = demand(robot, pose, velocity, acceleration)
    ones = np.ones(len(pose))
    drive_forces = needs.drive_forces(ones, 0.0 * ones)
    force = np.abs(drive_forces).max(axis=0)
    largest = []
    for name, sizes in (
        ("speed", np.abs(needs.first)),
        ("acceleration", np.abs(needs.second)),
        ("force", force),
    ):
        for i, leg in enumerate(robot.legs):
            unit = _WORDS[name][1].format(unit=leg.joint.unit, force_unit=leg.joint.force_unit)
            at = int(np.argmax(sizes[:, i]))
            size = float(sizes[at, i])
            largest.append(Peak(name, i + 1, size, unit, float(getattr(limits, name)[i]), at))
    for i, leg in enumerate(robot.legs):
        if not any(limits.lines[i : i + 1]):
            continue
        size, most, at = motor_peak(leg.drive or Drive(), drive_forces[..., i], needs.first[:, i])
        limit_fields = leg.joint.force_unit, most, at % len(pose)
        largest.append(Peak("force_at_speed", i + 1, size, *limit_fields))
    for name, part in zip(("tool_speed", "tool_acceleration"), needs.tool, strict=True):
        sizes = np.linalg.norm(part, axis=-1)
        at = int(np.argmax(sizes))
        limit = float(getattr(limits, name))
        largest.append(Peak(name, 0, float(sizes[at]), _WORDS[name][1], limit, at))
    return tuple(largest)
