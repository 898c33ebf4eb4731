"""Periodic motions as finite Fourier series, with exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect, expect_one_of
from pteron.equations.machine import closure_of
from pteron.errors import DataError, UnreachablePose
from pteron.identification.signals.states import FullMotion, home_mode
from pteron.kernels import Array, as_array
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator
from pteron.motion import Motion
from pteron.motion.trajectories.fourier import fourier_curve
from pteron.result import Result

Space = Literal["platform", "joints"]
"""The coordinates of a series: those of the platform's pose, or of the joints."""


@dataclass(frozen=True, eq=False, repr=False)
class FourierMotion(Result):
    """A periodic motion, q(t) = center + sum over h of a_h cos(h w t) + b_h sin(h w t).

    w = 2 pi / period. It is the finite Fourier series of Swevers et al. (1997), whose coefficients
    are those of the velocity: theirs are h w times these.

    Attributes
    ----------
    robot : Manipulator
        The machine.
    space : {"platform", "joints"}
        Whether q is the pose or the joint coordinates, for which direct kinematics must have a
        closed form.
    period : float
        The time after which the motion repeats, s.
    center : array, shape (n,)
        The mean coordinates, m or rad.
    cosines, sines : array, shape (H, n)
        The coefficients a_h and b_h of the harmonics h = 1 ... H, in the units of `center`.
    mode : int
        The assembly mode of a motion of the joints: the number, from 0, of its solution of direct
        kinematics in closed form; by default that of the home pose.

    Raises
    ------
    DataError
        If the period is not above 0, the shapes do not fit, or joints are given for a machine whose
        direct kinematics have no closed form.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.identification.excitation import FourierMotion
    >>> robot = pteron.load("quadrupteron")
    >>> swing = FourierMotion(
    ...     robot, "platform", 2.0, np.zeros(4), [[0.05, 0, 0, 0]], [[0, 0.05, 0, 0]])
    >>> swing.at(np.array([0.0, 0.5])).pose.round(12)
    array([[0.05, 0.  , 0.  , 0.  ],
           [0.  , 0.05, 0.  , 0.  ]])
    """

    robot: Manipulator
    space: Space
    period: float
    center: Array = field(repr=False)
    cosines: Array = field(repr=False)
    sines: Array = field(repr=False)
    mode: int = -1

    def __post_init__(self) -> None:
        expect_one_of(get_args(Space), space=self.space)
        if self.space == "joints" and not closure_of(self.robot).closed_form:
            raise DataError(
                'space: "joints" given, but direct kinematics of '
                f'{self.robot.name} has no closed form; choose "platform"'
            )
        expect(0.0 < self.period < np.inf, "period", f"{self.period} s", "a number above 0")
        n = self.robot.freedom
        for name in ("center", "cosines", "sines"):
            object.__setattr__(self, name, as_array(getattr(self, name), name, (n,)).copy())
        shapes, h = (self.center.shape, self.cosines.shape, self.sines.shape), len(self.cosines)
        if shapes != ((n,), (h, n), (h, n)) or not h:
            raise DataError(
                f"center, cosines, sines: shapes {shapes} given, ({n},) and twice (H, {n}) of the "
                "same number of harmonics expected, at least one"
            )
        if self.mode < 0:
            object.__setattr__(self, "mode", home_mode(self.robot))

    @property
    def harmonics(self) -> int:
        """Number of harmonics, H."""
        return len(self.cosines)

    @property
    def coefficients(self) -> Array:
        """Center, cosines and sines as one array (2 H + 1, n)."""
        return np.vstack([self.center, self.cosines, self.sines])

    def with_coefficients(self, coefficients: Array) -> FourierMotion:
        """Return the motion with other coefficients (2 H + 1, n)."""
        h = self.harmonics
        return replace(
            self,
            center=coefficients[0],
            cosines=coefficients[1 : h + 1],
            sines=coefficients[h + 1 :],
        )

    def at(self, time: ArrayLike) -> Motion:
        """Return the platform's motion at times (T,), s.

        Raises
        ------
        UnreachablePose
            If no pose has the joint coordinates of a motion of the joints.
        """
        times = _times(time)
        states = self.states(times)
        lost = ~np.isfinite(states.pose).all(axis=-1)
        if lost.any():
            k = int(np.argmax(lost))
            raise UnreachablePose(
                f"time {times[k]:g} s: no pose has the joint coordinates "
                f"{states.joints[k].tolist()} (m, rad at a crank); make the motion smaller",
                leg=0,
                shortfall=float("nan"),
                index=(k,),
            )
        return Motion(times, states.pose, states.velocity, states.acceleration)

    def joints(self, time: ArrayLike) -> tuple[Array, Array, Array]:
        """Return the joints' coordinates, rates and accelerations, (T, n) each, at times (T,)."""
        states = self.states(_times(time))
        return states.joints, states.rates, states.accelerations

    @property
    def duration(self) -> float:
        """The time after which the motion repeats, s."""
        return self.period

    def states(self, phase: Array, rate: ArrayLike = 1.0, gain: ArrayLike = 0.0) -> FullMotion:
        """Return the motion of platform and joints at phases (T,), s.

        `rate` (T,) is the derivative of the phase by time, 1 if the motion goes at its own speed,
        `gain` (T,), 1/s, the second derivative: q' = dq/dphase rate, and
        q'' = d2q/dphase2 rate^2 + dq/dphase gain.
        """
        robot = self.robot
        q, first, second = fourier_curve(self.coefficients, self.period, phase)
        rate, gain = np.reshape(rate, (-1, 1)), np.reshape(gain, (-1, 1))
        dq, ddq = first * rate, second * rate**2 + first * gain
        if self.space == "platform":
            return FullMotion.from_platform(robot, q, dq, ddq)
        poses: Array = evaluate_unchecked(robot, "closure_poses", np.vstack([self.center, q]))
        center, pose = poses[0, self.mode], poses[1:, self.mode]
        # Within a mode angles stay on one side of the singular orientations, half a turn at most.
        turned = (pose - center + np.pi) % (2.0 * np.pi) - np.pi
        pose = np.where(robot.wraps, center + turned, pose)
        velocity, acceleration = evaluate_unchecked(robot, "platform_motion", pose, dq, ddq)
        return FullMotion(pose, velocity, acceleration, q, dq, ddq)

    def uniform_times(self, count: int) -> Array:
        """Return `count` times, s, evenly over one period, without its end."""
        return np.asarray(np.arange(count) * (self.period / count), dtype=np.float64)


def _times(time: ArrayLike) -> Array:
    """Return times (T,) as an array; raise unless they are finite numbers in one dimension."""
    times = as_array(time, "time", ())
    fits = times.ndim == 1 and np.isfinite(times).all()
    expect(fits, "time", f"shape {times.shape}", "finite numbers of shape (T,)")
    return times
