"""The numbers by which printers' firmware describes a linear Delta, fitted to a machine.

Towers stand on one radius R about the z axis at angles a_i; carriage i is at the height z +
sqrt(arm_i^2 - (x - R cos a_i)^2 - (y - R sin a_i)^2) over the bed, z = 0, and at end_i where its
end stop is. Klipper, Marlin and RepRapFirmware share these numbers. A machine whose towers lean, or
stand on different radii, gets those with the least error of its tool's position.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.export.printers.bed import find_bed, tool_of
from pteron.export.printers.centers import SAME, Center, bearing
from pteron.export.printers.sections import INSTEAD, mm, unfit_error
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, jacobian, random_poses
from pteron.manipulator import Manipulator

_LEAN = 0.1
"""Greatest slope against the z axis of the guides of a linear Delta."""

_INSIDE = 0.8
"""Share of the firmware's range that counts as the bed of a machine without limits."""

_WORST = 1e-3
"""Greatest error of the tool on the bed, m, with which the firmware's numbers are accepted."""


@dataclass(frozen=True)
class LinearDelta:
    """The firmware's numbers for a linear Delta, in m and degrees.

    Attributes
    ----------
    radius : float
        R, of the towers less the effector's.
    angles, arms : tuple of float
        Of each tower, and of its rods.
    ends : tuple of float or None
        z over the bed, on the axis, with a carriage at its end stop: `position_endstop`. None where
        the machine's file has no limits.
    zeros : tuple of float
        Height of each carriage over the bed where its joint coordinate is 0.
    rises : tuple of float
        1 where a coordinate grows upwards, -1 where downwards.
    level : float
        P's z in the machine's frame where the firmware's is 0.
    bed : float
        Radius of the bed that is well in reach.
    most : float
        Radius to which the firmware lets the tool go.
    deviation : float
        Greatest distance on the bed of the machine's place from the firmware's.
    """

    radius: float
    angles: tuple[float, ...]
    arms: tuple[float, ...]
    ends: tuple[float, ...] | None
    zeros: tuple[float, ...]
    rises: tuple[float, ...]
    level: float
    bed: float
    most: float
    deviation: float

    @property
    def error_comments(self) -> tuple[str, ...]:
        """The comment on a machine that these numbers describe with an error; else nothing."""
        if self.deviation <= SAME:
            return ()
        return (
            "The firmware has one radius, upright towers and rods that end at it: with the numbers "
            f"here the tool is up to {1e3 * self.deviation:.3f} mm from where it takes it to be, "
            f"over a bed of {1e3 * self.bed:.0f} mm radius.",
        )

    @classmethod
    def from_robot(cls, robot: Manipulator) -> LinearDelta:
        """Return the numbers of a machine.

        Raises
        ------
        ModelError
            If it is no linear Delta with three upright guides, its carriages above the platform.
        """
        machine = Machine.numeric(robot)
        centers = [Center.from_leg(machine, i) for i in range(len(robot.legs))]
        sliding_centers = [c for c in centers if c is not None and c.is_prismatic]
        if robot.platform.coordinates != ("x", "y", "z") or len(sliding_centers) != 3:
            raise ModelError(
                f"{robot.name}: no linear Delta, whose platform moves x, y and z by three rods on "
                f"guides, which is what M665 describes; {INSTEAD}"
            )
        return cls.from_centers(robot, sliding_centers, "M665")

    @classmethod
    def from_centers(cls, robot: Manipulator, centers: Sequence[Center], taker: str) -> LinearDelta:
        """Return the numbers from the spheres on which P moves; errors name `taker`."""
        for i, center in enumerate(centers, start=1):
            if np.hypot(*center.along[:2]) > _LEAN:
                raise unfit_error(robot, i, "its guide is not vertical, along z", taker)
        rises = np.array([np.sign(center.along[2]) for center in centers])
        limits = [leg.limits for leg in robot.legs]
        known = all(pair is not None for pair in limits)
        travels = np.array([pair or (0.0, 0.0) for pair in limits]) * rises[:, None]
        lowest, highest = travels.min(axis=1), travels.max(axis=1)
        feet = np.array([center.origin for center in centers])
        leans = np.array([center.along for center in centers]) * rises[:, None]
        _refuse_sliders_below(robot, centers, taker)
        # Towers as they stand where the carriages are on their way.
        towers = feet + (0.5 * (lowest + highest))[:, None] * leans
        radii, arms = np.hypot(*towers[:, :2].T), np.array([center.radius for center in centers])
        for i, arm in enumerate(arms, start=1):
            if arm <= radii.mean():
                reason = (
                    f"its rod of {mm(arm)} mm is shorter than the radius, {mm(radii.mean())} mm"
                )
                raise unfit_error(robot, i, reason, taker)
        radius = float(radii.mean())
        below = np.sqrt(arms**2 - radius**2)
        most = min(radius, float(arms.min()) - radius)
        level, good = -float(tool_of(robot)[2]), _INSIDE * most
        if known:
            low, high = (feet[:, 2] + end - below for end in (lowest, highest))
            level, good = find_bed(robot, most, float(low.max()), float(high.min()))
        angles = np.radians([bearing(tower) for tower in towers])
        start = np.array([radius, *angles, *arms, *(feet[:, 2] + highest - level)])
        solution, off = _fit_numbers(
            lambda p: _errors(robot, p, level, rises, highest, good), start, radius
        )
        if off > _WORST:  # then they may be anything
            i = int(np.argmax(np.abs(radii - np.median(radii)))) + 1
            reason = (
                f"is {mm(round(radii[i - 1], 9))} mm from the z axis or leans, unlike the others"
            )
            raise unfit_error(robot, i, reason, taker)
        radius, angles, arms = solution[0], solution[1:4], solution[4:7]
        ends = solution[7:] - np.sqrt(arms**2 - radius**2)
        zeros = solution[7:] - highest
        return cls(
            float(radius),
            tuple(float(a) for a in np.degrees(angles)),
            tuple(map(float, arms)),
            tuple(map(float, ends)) if known else None,
            tuple(map(float, zeros)),
            tuple(map(float, rises)),
            float(level),
            good,
            most,
            off,
        )


def _fit_numbers(
    errors: Callable[[Array], Array], start: Array, size: float
) -> tuple[Array, float]:
    """Return the least-squares numbers for errors (K, 3), and the greatest remaining error, m."""
    if np.abs(errors(start)).max() <= 0.1 * SAME:
        return start, 0.0
    accuracy = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-14)
    fit = scipy.optimize.least_squares(
        lambda numbers: errors(numbers).ravel(), start, x_scale=size, **accuracy
    )
    return fit.x, float(np.linalg.norm(fit.fun.reshape(-1, 3), axis=1).max())


def _refuse_sliders_below(robot: Manipulator, centers: Sequence[Center], taker: str) -> None:
    """Raise ModelError if a machine's sliders are below its platform."""
    poses = random_poses(robot, 50, seed=1, type_i=0.02, type_ii=0.0, limits=False)
    joints = inverse_kinematics(robot, poses)
    for i, center in enumerate(centers):
        height = center.origin[2] + center.along[2] * joints[:, i]
        if not (height > poses[:, 2]).all():
            reason = (
                "its slider is below the platform, and firmware has it above: turn the model over"
            )
            raise unfit_error(robot, i + 1, reason, taker)


def _errors(
    robot: Manipulator, numbers: Array, level: float, rises: Array, highest: Array, good: float
) -> Array:
    """Return where the machine's tool is (K, 3), from where the firmware takes it to be, m."""
    radius, angles, arms, ends = numbers[0], numbers[1:4], numbers[4:7], numbers[7:]
    turns = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    rings = [good * s * np.stack([np.cos(turns), np.sin(turns)], axis=-1) for s in (0.5, 1.0)]
    places = np.concatenate([np.zeros((1, 2)), *rings])
    poses = np.concatenate(
        [np.column_stack([places, np.full(len(places), level + z)]) for z in (0.0, 0.3 * good)]
    )
    towers = radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    away = poses[:, None, :2] - towers
    # Numbers that are tried may have rods that do not reach.
    up = np.sqrt(np.maximum(arms**2 - (away**2).sum(axis=-1), 0.0))
    heights = poses[:, 2:] - level + up
    # The firmware lets carriages down from their end stops by the way that it thinks right.
    joints = rises * (highest - (ends - heights))
    wrong = joints - inverse_kinematics(robot, poses)
    return np.asarray(np.linalg.solve(jacobian(robot, poses), wrong[..., None])[..., 0])
