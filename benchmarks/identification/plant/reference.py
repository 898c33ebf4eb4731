"""Periodic motions that a machine is made to follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import pteron
from plant.model import Array
from pteron.motion import FourierSeries

__all__ = ["Fourier", "Reference", "fourier_reference"]

Reference = Callable[[Array], tuple[Array, Array, Array]]
"""From times (T,) to joint coordinates, rates and accelerations, (T, n) each; it is hashable."""

_TYPE_I = 0.25
_TYPE_II = 0.3
"""The least type-I and type-II measures of a motion."""


@dataclass(frozen=True)
class Fourier:
    """A periodic motion of the platform, as a finite Fourier series about a pose.

    Attributes
    ----------
    robot : Manipulator
        Whose geometry takes the platform's motion to the joints.
    center : tuple of float
        The pose in the middle, m and rad.
    cosines, sines : tuple of tuple of float
        Coefficients (m, K), m and rad, of the harmonics 1..K.
    period : float
        s.
    """

    robot: pteron.Manipulator
    center: tuple[float, ...]
    cosines: tuple[tuple[float, ...], ...]
    sines: tuple[tuple[float, ...], ...]
    period: float

    def platform(self, time: Array) -> tuple[Array, Array, Array]:
        """Return pose, velocity and acceleration, (T, m) each."""
        cosines, sines = (tuple(zip(*rows, strict=True)) for rows in (self.cosines, self.sines))
        return FourierSeries(self.center, cosines, sines, self.period).at(time)

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        """Return joint coordinates, rates and accelerations, (T, n) each."""
        pose, velocity, acceleration = self.platform(np.asarray(time, dtype=float))
        rates = pteron.kinematics.joint_rates(self.robot, pose, velocity)
        accelerations = pteron.kinematics.joint_accelerations(
            self.robot, pose, velocity, acceleration
        )
        return pteron.inverse_kinematics(self.robot, pose), rates.actuated, accelerations.actuated


def fourier_reference(
    robot: pteron.Manipulator,
    seed: int = 0,
    *,
    harmonics: int = 10,
    period: float = 5.0,
    speed: float = 0.8,
    acceleration: float = 8.0,
) -> Fourier:
    """Return a random lively motion about the home pose.

    All coefficients are scaled alike until the first of these stops them: a type-I measure of
    0.25, a type-II measure of 0.3, a joint's limit, the greatest speed or acceleration of one.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    seed : int
        Of the random coefficients.
    harmonics : int
        Number of harmonics.
    period : float
        s.
    speed, acceleration : float
        The most that any joint does, m/s and m/s^2; rad/s and rad/s^2 of a crank.

    Returns
    -------
    Fourier
    """
    rng = np.random.default_rng(seed)
    spread = np.ones((robot.freedom, harmonics))
    # rad for m
    if robot.platform.tilts:
        arms = np.linalg.norm([leg.platform_point for leg in robot.legs], axis=-1)
        spread[robot.platform.angular] /= arms.mean()
    elif robot.platform.turns:
        spread[-1] *= 6.0
    a, b = rng.normal(size=(2, *spread.shape)) * spread
    center = tuple(pteron.workspace.home_pose(robot).tolist())
    time = np.linspace(0.0, period, 100 * harmonics, endpoint=False)

    def scaled(size: float) -> Fourier:
        return Fourier(robot, center, _rows(size * a), _rows(size * b), period)

    low, high = 0.0, 1.0
    for _ in range(30):
        size = (low + high) / 2.0
        if _serves(scaled(size), time, speed, acceleration):
            low = size
        else:
            high = size
    return scaled(low)


def _serves(motion: Fourier, time: Array, speed: float, acceleration: float) -> bool:
    pose, _, _ = motion.platform(time)
    margins = pteron.workspace.pose_margins(motion.robot, pose)
    if (
        margins.type_i.min() < _TYPE_I
        or margins.type_ii.min() < _TYPE_II
        or margins.joints.min() < 0.0
    ):
        return False
    _, rates, accelerations = motion(time)
    return bool(np.abs(rates).max() <= speed and np.abs(accelerations).max() <= acceleration)


def _rows(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())
