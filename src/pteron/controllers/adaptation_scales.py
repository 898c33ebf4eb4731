"""Scales for adaptive control: the size of each estimate, and its rate of learning in a motion.

Estimates are base parameters and, for each drive, inertia, dry and viscous friction and offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol, runtime_checkable

import numpy as np

from pteron.bodies.parameters import body_places
from pteron.controllers.joint_masses import joint_masses, light_poses
from pteron.dynamics import drive_forces
from pteron.equations.control import ADAPTED
from pteron.equations.drives import drive_numbers
from pteron.errors import DataError
from pteron.kernels import Array, numeric
from pteron.kinematics import joint_accelerations, joint_rates
from pteron.manipulator import Manipulator, parameter_data, parameters
from pteron.reduction import BaseParameters, base_parameters, base_regressor

_TYPICAL = 0.5, 5.0
"""Speed and acceleration of a platform point in a typical motion, m/s and m/s^2."""

_TURNS = 10
"""Random velocities and accelerations at each pose of a typical motion."""

_HARDLY = 1e-3
"""Excitation that is added to every combination of estimates, as a share of the greatest."""

_NEAR = 0.1
"""Greatest disturbance, as a share, that is added at random to velocities and accelerations, since
errors of control move the machine too. It is bounded: one far sample would slow all learning."""

_SAMPLES = 400
"""Least number of samples that are left of a longer motion."""

_DRIVES = 0.1
"""Least size of a drive's estimates, as a share of its joint's typical force and of its mass."""


@dataclass(frozen=True)
class AdaptationScales:
    """The excitation of a machine's base parameters and drives by a motion."""

    robot: Manipulator
    base: BaseParameters
    motion: tuple[Array, Array, Array]

    @cached_property
    def columns(self) -> Array:
        """Drive forces (B, n, K) per unit of every estimated parameter, at B states."""
        n = self.robot.joint_count
        rates = joint_rates(self.robot, *self.motion[:2]).actuated
        seconds = joint_accelerations(self.robot, *self.motion).actuated
        drives = [seconds, np.sign(rates), rates, np.ones_like(rates)]
        blocks = [np.eye(n) * part[:, None, :] for part in drives]
        return np.concatenate([base_regressor(self.robot, self.base, *self.motion), *blocks], -1)

    @cached_property
    def scales(self) -> Array:
        """The magnitude (K,) of every estimated parameter, in its own unit.

        First moments count as the mass times the body's radius of gyration, even if they are zero;
        the drives' parameters are at least `_DRIVES` of what their joint needs.
        """
        nominal, sizes = parameters(self.robot), np.abs(parameters(self.robot))
        for places in body_places(parameter_data(self.robot)).values():
            if "I" in places:
                sizes[[places[k] for k in ("mgx", "mgy") if k in places]] = np.sqrt(
                    np.abs(nominal[places["m"]] * nominal[places["I"]])
                )
        forces = drive_forces(self.robot, *self.motion)
        force = _DRIVES * np.sqrt((forces**2).mean(axis=0))
        rates = joint_rates(self.robot, *self.motion[:2]).actuated
        speed = np.sqrt((rates**2).mean(axis=0))
        least = _DRIVES * joint_masses(self.robot), force, force / speed, force
        model_numbers = np.abs(drive_numbers(self.robot)[: len(ADAPTED) * self.robot.joint_count])
        drives = np.maximum(model_numbers, np.concatenate(least))
        return np.concatenate([np.abs(self.base.grouping) @ sizes, drives])

    def adaptation_matrix(
        self, damping: Array, count: int, rate: float, most: float
    ) -> tuple[Array, float]:
        """Return the factor L (count, count) of the adaptation gain, and the usual error over it.

        An estimate's error x acts as the force Y x; the joints with damping K (n,) respond by K^-1
        Y x, and the estimate changes by Gamma Y^T times that. So Gamma = L L^T is `rate` times the
        inverse of the mean of Y^T K^-1 Y, reduced where a parameter would be learnt faster than
        `most` somewhere in the motion. The second result is the mean norm of eta, where
        L eta is an error of the estimates by their `scales` with any signs.
        """
        scales = self.scales[:count]
        effects = self.columns[..., :count] * (scales / np.sqrt(damping)[:, None])
        mean = np.einsum("bik,bil->kl", effects, effects) / len(effects)
        excitations, axes = np.linalg.eigh(mean)
        excitations = excitations + _HARDLY * excitations[-1]
        whitened = effects @ (axes / np.sqrt(excitations))
        fastest = float(np.linalg.eigvalsh(whitened @ np.swapaxes(whitened, -1, -2)).max())
        rate = min(rate, most / fastest)
        matrix = scales[:, None] * axes * np.sqrt(rate / excitations)
        return matrix, float(np.sqrt(excitations.sum() / rate))


@runtime_checkable
class Moves(Protocol):
    """A motion, such as `pteron.motion.Motion`: samples (T, m) in m, rad and s."""

    @property
    def pose(self) -> Array:
        """Poses of the motion (T, m), m and rad."""

    @property
    def velocity(self) -> Array:
        """Velocities of the motion (T, m), m/s and rad/s."""

    @property
    def acceleration(self) -> Array:
        """Accelerations of the motion (T, m), m/s^2 and rad/s^2."""


def scales_of(robot: Manipulator, motion: Moves | None) -> AdaptationScales:
    """Return states of a motion, or of a typical one, with the parameters to be estimated."""
    if motion is None:
        return typical_scales(robot)
    if np.shape(motion.pose)[-1:] != (robot.freedom,):
        raise DataError(
            f"motion: poses of shape {np.shape(motion.pose)} given, (T, {robot.freedom}) expected: "
            f"{' '.join(robot.coordinates)} of {robot.name}"
        )
    if not (np.any(motion.velocity) and np.any(motion.acceleration)):
        raise DataError("motion: the platform rests all along, which shows nothing; give a motion")
    every_few = slice(None, None, max(len(motion.pose) // _SAMPLES, 1))
    rng, unit = np.random.default_rng(0), _units(robot)
    parts = []
    for samples, share in (
        (motion.pose, 0.0),
        (motion.velocity, _NEAR),
        (motion.acceleration, _NEAR),
    ):
        size = np.sqrt(((samples[every_few] / unit) ** 2).sum(axis=-1).mean())
        parts.append(
            samples[every_few]
            + share * size * unit * rng.uniform(-1.0, 1.0, samples[every_few].shape)
        )
    return AdaptationScales(robot, typical_scales(robot).base, (parts[0], parts[1], parts[2]))


@lru_cache(maxsize=32)
def typical_scales(robot: Manipulator) -> AdaptationScales:
    """Return states of a typical random motion with a machine's base parameters, reproducible.

    The poses are those of many random ones in which the legs are farthest from singular (type I),
    moved at 0.5 m/s and 5 m/s^2 in random directions.
    """
    poses, rng, unit = light_poses(robot), np.random.default_rng(0), _units(robot)
    bent = numeric(robot, "reach")(poses)[1].min(axis=-1)
    poses = poses[np.argsort(-bent)[: len(poses) // 3]].repeat(_TURNS, axis=0)
    velocity, acceleration = (
        size * unit * direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        for size, direction in zip(_TYPICAL, rng.normal(size=(2, *poses.shape)), strict=True)
    )
    return AdaptationScales(robot, base_parameters(robot), (poses, velocity, acceleration))


def _units(robot: Manipulator) -> Array:
    """Return the change of each coordinate of the pose (m,) that moves a platform point by 1 m."""
    lever = max(float(np.linalg.norm(leg.platform_point)) for leg in robot.legs)
    return np.where(robot.platform.angular & (lever > 0.0), 1.0 / (lever or 1.0), 1.0)
