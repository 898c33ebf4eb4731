"""`size`: forces, speeds and inertia at each drive over a motion, integrated to loads (`Sizing`).

Integrals over the motion are Simpson's over each interval between two samples, of which the middle
is interpolated as `Motion.at` does: exact for cubics, and the error falls with the fourth power of
the interval where the motion is smooth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pteron.dynamics import drive_forces, mass_matrix
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics import jacobian, joint_accelerations, joint_rates
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.sizing.drive_loads import Sizing

_AT_REST = 1e-6
"""Share of the motion's greatest speed below which its end is at rest."""


def size(
    robot: RobotLike, motion: Motion, *, dwell: float = 0.0, wrench: ArrayLike | None = None
) -> Sizing:
    """Return the load of a motion on each drive: its forces and speeds, and their integrals.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, with what its file says of the drives; `with_payload` gives it a payload.
    motion : Motion
        One cycle.
    dwell : float
        Time for which the platform rests after the motion, s; the drives hold it there.
    wrench : array, shape (m,), optional
        Load on the platform at P all along: a force in N and, where it turns, a moment about k
        in N m; of a platform that tilts a force and a moment, (6,).

    Returns
    -------
    Sizing

    Raises
    ------
    UnreachablePose, SingularPose
        If the machine cannot do a pose of the motion.
    DataError
        If the motion has another number of coordinates than the machine, its time does not ascend,
        or it is to be followed by a rest and does not end at rest.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import pick_and_place, size
    >>> robot = pteron.load("tripteron")
    >>> cycle = pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5, duration=0.5)
    >>> found = size(robot, cycle, dwell=0.1)
    >>> round(found.duration, 3), found.peak_forces.round(1)
    (0.6, array([78.1,  7.5, 47.7]))
    """
    robot = as_manipulator(robot)
    _check(robot, motion, dwell)
    middles = (motion.time[:-1] + motion.time[1:]) / 2.0
    load = None if wrench is None else np.asarray(wrench, dtype=float)
    if load is not None and load.shape != (robot.freedom,):
        raise DataError(
            f"wrench: shape {load.shape} given, ({robot.freedom},) expected: one wrench for the "
            "whole motion"
        )
    at_samples = motion.pose, motion.velocity, motion.acceleration
    # The samples by themselves, so that an error's index is that of the motion.
    parts = [_joints(robot, at_samples, load), _joints(robot, motion.at(middles), load)]
    forces, speeds, accelerations = (
        _interleaved(*pair) for pair in zip(parts[0], parts[1], strict=True)
    )
    rotors = np.array([0.0 if leg.drive is None else leg.drive.inertia for leg in robot.legs])
    rest = np.zeros(robot.freedom)
    inverse = np.linalg.inv(jacobian(robot, motion.pose))
    felt = np.einsum("kai,kab,kbi->ki", inverse, mass_matrix(robot, motion.pose), inverse)
    return Sizing(
        robot,
        _interleaved(motion.time, middles),
        forces,
        forces - rotors * accelerations,
        speeds,
        accelerations,
        float(dwell),
        drive_forces(robot, motion.pose[-1], rest, rest, load, smooth=True),
        np.stack([felt.min(axis=0), felt.max(axis=0)]),
    )


def _joints(
    robot: Manipulator, state: tuple[Array, Array, Array], wrench: Array | None
) -> tuple[Array, Array, Array]:
    """Return forces of the drives, rates and accelerations of the joints (T, n)."""
    return (
        drive_forces(robot, *state, wrench, smooth=True),
        joint_rates(robot, *state[:2]).actuated,
        joint_accelerations(robot, *state).actuated,
    )


def _interleaved(samples: Array, middles: Array) -> Array:
    found = np.empty((2 * len(samples) - 1, *samples.shape[1:]))
    found[::2], found[1::2] = samples, middles
    return found


def _check(robot: Manipulator, motion: Motion, dwell: float) -> None:
    """Refuse a motion that is not one of this machine, and a rest that cannot be."""
    expected = (len(motion.time), robot.freedom)
    for name in ("pose", "velocity", "acceleration"):
        if getattr(motion, name).shape != expected:
            raise DataError(
                f"motion.{name}: shape {getattr(motion, name).shape} given, {expected} expected: a "
                f"row for each time, and {' '.join(robot.coordinates)} of {robot.name}"
            )
    motion.expect_ascending()
    if not (np.isfinite(dwell) and dwell >= 0.0):
        raise DataError(f"dwell: {dwell} given, 0 s or more expected")
    speeds = np.abs(motion.velocity)
    if dwell and (speeds[-1] > _AT_REST * speeds.max()).any():
        raise DataError(
            f"dwell: {dwell:g} s of rest asked for, but the motion does not end at rest; leave it "
            "out"
        )
