"""Simulated encoders of joints and motors: rounded, delayed, rates from differences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pteron.equations.transmissions import DriveKind
from pteron.errors import DataError, shorten
from pteron.kernels import Array, Program, as_array
from pteron.kinematics import inverse_kinematics, joint_rates
from pteron.legs import Drive
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class Sensors:
    """The encoders of the actuated joints, and of motors whose transmissions bend.

    Parameters
    ----------
    encoder : float or array, shape (n,)
        Step of the encoders at the joints, m or rad: a coordinate is rounded to its multiples, and
        rates are differences of two of them, so that they lag half a sample. 0: coordinates and
        rates are exact.
    cutoff : float, optional
        Cut-off of a filter of first order on the rates, Hz; without effect on exact ones.
    noise : float or array, shape (n,)
        Standard deviation of the coordinates' noise before they are rounded, m or rad.
    seed : int
        Seed of the noise.
    motor_encoder : float or array, shape (n,), optional
        Step of encoders at the motors, counted at the joints; by default that of `encoder`.
    delay : float
        How old a reading is when the controller gets it, s.
    samples : int
        A further delay, in whole samples.
    """

    encoder: float | tuple[float, ...] = 0.0
    cutoff: float | None = None
    noise: float | tuple[float, ...] = 0.0
    seed: int = 0
    motor_encoder: float | tuple[float, ...] | None = None
    delay: float = 0.0
    samples: int = 0

    def __post_init__(self) -> None:
        for name in ("encoder", "noise", "motor_encoder", "delay"):
            numbers = getattr(self, name)
            array = as_array(
                0.0 if numbers is None and name == "motor_encoder" else numbers, name, ()
            )
            scalar = name == "delay" and array.ndim
            if scalar or not (np.isfinite(array).all() and (array >= 0.0).all()):
                expected = "0 s or more" if name == "delay" else "0 or more"
                raise DataError(f"{name}: {numbers} given, {expected} expected")
        for name in ("seed", "samples"):
            samples: object = getattr(self, name)
            if not isinstance(samples, int) or isinstance(samples, bool) or samples < 0:
                raise DataError(
                    f"{name}: {shorten(samples)} given, a whole number of 0 or more expected"
                )
        cutoff = 1.0 if self.cutoff is None else as_array(self.cutoff, "cutoff", ())
        if np.ndim(cutoff) or not (np.isfinite(cutoff) and cutoff > 0.0):
            raise DataError(f"cutoff: {self.cutoff} given, a frequency above 0 Hz expected")


def encoder_arrays(
    sensors: Sensors, robot: Manipulator, period: float, state: Mapping[str, Array]
) -> dict[str, Array]:
    """Return the loop's arrays of encoder resolution, noise and initial memory, by name.

    The angle of a crank that can turn all the way round jumps by a full turn: its readings continue
    by the shorter way.
    """
    pose, velocity = state["pose"], state["velocity"]
    joints = inverse_kinematics(robot, pose)
    rates = joint_rates(robot, pose, velocity).actuated
    at_motors = sensors.encoder if sensors.motor_encoder is None else sensors.motor_encoder
    numbers = {"encoder": sensors.encoder, "noise": sensors.noise, "motor_encoder": at_motors}
    steps, noises, fine = (
        _joint_array(setting, key, len(joints)) for key, setting in numbers.items()
    )
    round_ = np.array([float(leg.goes_round) for leg in robot.legs])
    if "motor" in state:
        soft = DriveKind.from_robot(robot).elastic
        joints = np.concatenate([joints, np.where(soft, state["motor"], joints)])
        rates = np.concatenate([rates, np.where(soft, state["motor_rate"], rates)])
        steps, noises = np.concatenate([steps, fine]), np.tile(noises, 2)
        round_ = np.concatenate([round_, np.where(soft, 0.0, round_)])
    encoders = [encoder_of(leg.drive) for leg in robot.legs]
    arrays = {
        "encoders": encoder_memory(joints, rates, steps, period),
        "steps": steps,
        "noises": noises,
        "round": round_,
        "share": np.array([_share(sensors, period)]),
        "at_motor": np.array(
            [
                *(float(e == "motor") for e in encoders),
                *(float(e in ("motor", "both")) for e in encoders),
            ]
        ),
    }
    return {name: setting.reshape(1, 1, -1) for name, setting in arrays.items()}


def encoder_memory(joints: Array, rates: Array, steps: Array, period: float) -> Array:
    """Return the initial memory (..., 4 E) of encoders at joints and rates (..., E).

    `steps` (E,) are the encoders' resolutions, m or rad, and `period`, s, is the sampling period.
    """
    last_readings = joints - period * rates
    widths = np.where(steps > 0.0, steps, 1.0)
    last_readings = np.where(steps > 0.0, steps * np.round(last_readings / widths), last_readings)
    return np.concatenate([joints, np.zeros_like(joints), last_readings, rates], axis=-1)


def encoder_noise(
    sensors: Sensors, robot: Manipulator, samples: int, machines: range | None = None
) -> dict[str, Array]:
    """Return {"noise": standard normal noise (B, samples, encoders)}, B machines."""
    count = robot.joint_count * (2 if DriveKind.from_robot(robot).bends else 1)
    if not np.any(sensors.noise):
        return {"noise": np.zeros((1, 1, count))}
    seeds = [sensors.seed] if machines is None else [(sensors.seed, i) for i in machines]
    drawn = [np.random.default_rng(seed).standard_normal((samples, count)) for seed in seeds]
    return {"noise": np.array(drawn)}


def encoder_of(drive: Drive | None) -> str:
    """Return the place of a drive's encoder: "motor", "joint" or "both"; rigid drives have both."""
    return drive.elastic.encoder if drive and drive.elastic else "rigid"


def rate_shares(sensors: Sensors, robot: Manipulator, period: float) -> Array:
    """Return the filter gain of each estimated rate (n,); NaN where the rate is measured.

    A rate is estimated from differences of an encoder that rounds or is noisy; it is the motor's
    rate if the drive's encoder is at the motor.
    """
    count = robot.joint_count
    at_motors = sensors.encoder if sensors.motor_encoder is None else sensors.motor_encoder
    settings = {"encoder": sensors.encoder, "noise": sensors.noise, "motor_encoder": at_motors}
    steps, noises, fine = (_joint_array(setting, key, count) for key, setting in settings.items())
    motors = [encoder_of(leg.drive) in ("motor", "both") for leg in robot.legs]
    rough = np.where(motors, fine, steps) + noises > 0.0
    return np.where(rough, _share(sensors, period), np.nan)


def _share(sensors: Sensors, period: float) -> float:
    """Return the gain (0 to 1) of the low-pass filter that estimates rates from differences."""
    if sensors.cutoff is None:
        return 1.0
    return -float(np.expm1(-2.0 * np.pi * sensors.cutoff * period))


def expect_encoders(robot: Manipulator, law: Program) -> None:
    """Raise if the law needs motor readings where a drive has its encoder at the joint only."""
    motor_readings = [port.name for port in law.inputs if port.name in ("motors", "motor_rates")]
    legs_without = [
        str(i) for i, leg in enumerate(robot.legs, 1) if encoder_of(leg.drive) == "joint"
    ]
    if motor_readings and legs_without:
        raise DataError(
            f"controller: needs {' and '.join(motor_readings)}, which no sensor gives: the encoder "
            f"of leg {', '.join(legs_without)} of {robot.name} is at the joint; take joints and "
            'joint_rates, or give its drive.elastic encoder = "both"'
        )


def _joint_array(setting: float | tuple[float, ...], name: str, count: int) -> Array:
    """Return a sensor setting for each joint (n,); a scalar is broadcast."""
    array = np.asarray(setting, dtype=float)
    if array.shape not in ((), (count,)):
        raise DataError(
            f"{name}: shape {array.shape} given, one number or {count} expected, one for each joint"
        )
    return np.broadcast_to(array, (count,)).copy()
