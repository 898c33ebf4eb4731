"""`DutyCycle`: motions with rests, and the loads on a machine's drives, in place or elsewhere.

Integrals over a motion are Simpson's over each interval between two samples, of which the middle is
interpolated as `Motion.at` does: exact for cubics, and the error falls with the fourth power of the
interval where the motion is smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pteron.arguments import expect_to_fit
from pteron.dynamics import drive_forces, mass_matrix
from pteron.dynamics.joint_space import moved_inertias
from pteron.errors import DataError, SingularPose, UnreachablePose
from pteron.kernels import Array
from pteron.kinematics import jacobian, joint_accelerations, joint_rates
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.motion.motion import Motion
from pteron.motion.sizing.drive_loads import Sizing
from pteron.motion.sizing.friction_sentence import has_friction
from pteron.motion.sizing.places import Course, CyclePlace
from pteron.motion.trajectories.tool import Curve

_SAMPLES = 241
"""Most samples of a motion that is done at several places."""

_HALVES = np.array([0.0, 0.5, 1.0])


@dataclass(frozen=True)
class DutyCycle:
    """Motions one after the other, each with a rest behind it.

    Attributes
    ----------
    robot : Manipulator
        The machine, with its payload.
    motions : tuple of Motion
        At least one.
    rests : array, shape (M,)
        Time of the rest after each, s; 0 is none.
    wrench : array, shape (m,), or None
        On the platform all along.
    friction : float
        Dry friction of a drive that has none in the file, over the largest force on it.
    """

    robot: Manipulator
    motions: tuple[Motion, ...]
    rests: Array
    wrench: Array | None
    friction: float

    @cached_property
    def course(self) -> Course:
        """The tool's paths of the cycle's motions, relative to their common middle."""
        return Course.from_motions(self.robot, self.motions)

    def thin_out(self) -> DutyCycle:
        """Return the cycle with its motions resampled to at most `_SAMPLES` samples each."""
        motions = []
        for motion in self.motions:
            time = np.linspace(motion.time[0], motion.time[-1], _SAMPLES)
            motions.append(
                Motion(time, *motion.at(time)) if len(motion.time) > _SAMPLES else motion
            )
        return replace(self, motions=tuple(motions))

    def loads_at(self, places: Sequence[CyclePlace] = ()) -> Sizing:
        """Return the drive loads of the cycle at places; without places, where its motions are."""
        curves: list[Curve] = [(m.pose, m.velocity, m.acceleration) for m in self.motions]
        if places:
            count = sum(2.0 * curve[0].size for curve in curves)
            expect_to_fit("places", len(places), 10.0 * count * len(places))
            curves = list(self.course.curves_at(places))
            try:
                return self._loads_of_curves(curves, places)
            except (UnreachablePose, SingularPose) as error:
                raise DataError(f"places: {places[error.index[-1]]}: {error}") from None
        return self._loads_of_curves(curves, places)

    def _loads_of_curves(self, curves: Sequence[Curve], places: Sequence[CyclePlace]) -> Sizing:
        """Return the drive loads over motions (T, m), or over (T, W, m) at W places."""
        clock, inertias = float(self.motions[0].time[0]), []
        blocks: list[tuple[Array, ...]] = []
        for motion, curve, pause in zip(self.motions, curves, self.rests, strict=True):
            middles = (motion.time[:-1] + motion.time[1:]) / 2.0
            # The samples by themselves, so that an error's index is that of the motion.
            samples = motion.time, *self._loads(*curve)
            middle_loads = middles, *self._loads(*_sample_curve(motion.time, curve, middles))
            time, *loads = (_interleave(*pair) for pair in zip(samples, middle_loads, strict=True))
            blocks.append((clock + time - time[0], *loads))
            clock += motion.duration
            if pause:
                pose, zero_rates = (
                    np.repeat(curve[0][-1:], 3, axis=0),
                    np.zeros((3, *curve[0].shape[1:])),
                )
                blocks.append((clock + pause * _HALVES, *self._loads(pose, zero_rates, zero_rates)))
                clock += float(pause)
            inertias.append(self._inertia(curve[0]))
        time, forces, speeds, accelerations = (
            _join_parts(parts) for parts in zip(*blocks, strict=True)
        )
        assumed = self._assumed_friction(forces)
        for i, drive in enumerate(self.drives):
            forces[..., i] += assumed[i] * np.tanh(speeds[..., i] / drive.rest_speed)
        least, most = zip(*inertias, strict=True)
        return Sizing(
            self.robot,
            time,
            forces,
            speeds,
            accelerations,
            float(self.rests.sum()),
            np.stack([np.min(least, axis=0), np.max(most, axis=0)]),
            tuple(places),
            assumed,
        )

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives of the machine's file; an empty drive where the file has none."""
        return tuple(leg.drive or Drive() for leg in self.robot.legs)

    def _loads(self, pose: Array, velocity: Array, acceleration: Array) -> Curve:
        """Return drive forces, joint rates and joint accelerations (..., n) at platform states."""
        state = pose, velocity, acceleration
        return (
            drive_forces(self.robot, *state, self.wrench, smooth=True),
            joint_rates(self.robot, pose, velocity).actuated,
            joint_accelerations(self.robot, *state).actuated,
        )

    def _inertia(self, poses: Array) -> tuple[Array, Array]:
        """Return least and greatest reflected inertia (n,) at the joints, kg or kg m^2."""
        rows, mass = jacobian(self.robot, poses), mass_matrix(self.robot, poses)
        joint_inertias = moved_inertias(rows, mass).reshape(-1, self.robot.joint_count)
        return joint_inertias.min(axis=0), joint_inertias.max(axis=0)

    def _assumed_friction(self, forces: Array) -> Array:
        """Return the assumed dry friction (n,), N or N m, of drives without any in the file."""
        most = np.abs(forces).reshape(-1, self.robot.joint_count).max(axis=0)
        frictionless = [not has_friction(drive) for drive in self.drives]
        return np.asarray(self.friction * most * frictionless)


def _sample_curve(time: Array, curve: Curve, middles: Array) -> Curve:
    """Return a curve (T, ..., m) with two derivatives interpolated at other times."""
    flat = Motion(time, *(part.reshape(len(time), -1) for part in curve))
    shape = len(middles), *curve[0].shape[1:]
    pose, velocity, acceleration = (part.reshape(shape) for part in flat.at(middles))
    return pose, velocity, acceleration


def _interleave(samples: Array, middles: Array) -> Array:
    """Return samples (T, ...) with the middles (T - 1, ...) between them: (2 T - 1, ...)."""
    interleaved = np.empty((2 * len(samples) - 1, *samples.shape[1:]))
    interleaved[::2], interleaved[1::2] = samples, middles
    return interleaved


def _join_parts(parts: Sequence[Array]) -> Array:
    """Return arrays (T, ...) concatenated in time; the last row of each but one is repeated."""
    rows = [row for part in parts for row in (part, part[-1:])]
    return np.concatenate(rows[:-1])
