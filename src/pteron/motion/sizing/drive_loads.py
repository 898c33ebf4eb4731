"""`Sizing`, the result of `size`: peaks, means, power and energy of each drive over a cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pteron.html_table import Column, html_table
from pteron.json_values import picked
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.motion.overloads import overloads
from pteron.shapes import PerJoint

if TYPE_CHECKING:
    import polars as pl

_STILL = 1e-9
"""Share of the fastest joint's acceleration below which a joint counts as still: rounding."""

_NONE = 1e-9
"""Share of the drives' energy below which its net sum counts as zero: rounding."""


@dataclass(frozen=True, repr=False)
class Sizing:
    """The load on a machine's drives over one cycle: a motion, and perhaps a rest after it.

    Everything is at the joints, per leg: N and m/s of a slider, N m and rad/s of a crank, but for
    what is said to be at the motor. Forces are those of the drives: rigid bodies, friction, offset
    and the motors' inertia.

    Attributes
    ----------
    robot : Manipulator
        The machine, with its payload if it carries one.
    time : array, shape (K,)
        The motion's samples and the middles between them, s.
    forces : array, shape (K, n)
        Forces that the drives give, N or N m.
    loads : array, shape (K, n)
        The same without the motors' inertia: what does not depend on the ratio.
    speeds, accelerations : array, shape (K, n)
        Of the joints, m/s and m/s^2, or rad/s and rad/s^2.
    dwell : float
        How long the platform rests after the motion, s.
    holding : array, shape (n,)
        Forces at that rest, where friction helps neither way.
    load_inertia : array, shape (2, n)
        Least and greatest inertia of the rigid bodies at each joint, the other joints being held:
        the diagonal of J^-T M J^-1; kg or kg m^2.
    """

    robot: Manipulator
    time: Array
    forces: Array
    loads: Array
    speeds: Array
    accelerations: Array
    dwell: float
    holding: Array
    load_inertia: Array

    def __repr__(self) -> str:
        """Return the sizing in a line; `table` has it all."""
        return f"<Sizing of {self.robot.name!r}: a cycle of {self.duration:.6g} s>"

    def _repr_html_(self) -> str:
        headings = ("peak force", "rms force", "peak speed", "peak power", "mean power")
        columns = [Column("joint"), *(Column(name, "number") for name in headings)]
        values = (
            *(self.peak_forces, self.rms_forces, self.peak_speeds),
            *(self.peak_power, self.mean_power),
        )
        rows = []
        for name, leg, *found in zip(self.robot.joint_names, self.robot.legs, *values, strict=True):
            force, speed = leg.joint.force_unit, f"{leg.joint.unit}/s"
            units = (force, force, speed, "W", "W")
            told = (f"{value:.4g} {unit}" for value, unit in zip(found, units, strict=True))
            rows.append((name, *told))
        about = f"drives over a cycle of {self.duration:.6g} s"
        return html_table(self.robot.name, about, columns, rows, self.overloads)

    @property
    def duration(self) -> float:
        """The cycle's time, the rest included, s."""
        return float(self.time[-1] - self.time[0]) + self.dwell

    def integral(self, values: Array) -> Array:
        """Return the integral over the motion, by Simpson's rule, of values (K, ...) at `time`."""
        spans = (self.time[2::2] - self.time[:-2:2]) / 6.0
        ends = values[:-2:2] + 4.0 * values[1::2] + values[2::2]
        return np.asarray(np.tensordot(spans, ends, axes=1))

    def mean(self, values: Array, resting: ArrayLike = 0.0) -> Array:
        """Return the mean over the cycle of values (K, ...), which are `resting` at the rest."""
        whole = self.integral(values) + self.dwell * np.asarray(resting)
        return np.asarray(whole / self.duration)

    @cached_property
    def peak_forces(self) -> PerJoint:
        """Largest size of each force, N or N m."""
        return np.asarray(np.maximum(np.abs(self.forces).max(axis=0), self._held))

    @cached_property
    def rms_forces(self) -> PerJoint:
        """Root mean square of each force over the cycle, N or N m: what heats a motor."""
        return np.asarray(np.sqrt(self.mean(self.forces**2, self.holding**2)))

    @cached_property
    def peak_speeds(self) -> PerJoint:
        """Largest speed of each joint, m/s or rad/s."""
        return np.asarray(np.abs(self.speeds).max(axis=0))

    @cached_property
    def rms_speeds(self) -> PerJoint:
        """Root mean square of each speed over the cycle, m/s or rad/s."""
        return np.asarray(np.sqrt(self.mean(self.speeds**2)))

    @property
    def _held(self) -> PerJoint:
        return np.asarray(np.abs(self.holding) * (self.dwell > 0.0))

    @cached_property
    def power(self) -> Array:
        """Mechanical power of each drive (K, n), W: negative where it brakes."""
        return np.asarray(self.forces * self.speeds)

    @property
    def peak_power(self) -> PerJoint:
        """Largest power that each drive gives, W."""
        return np.asarray(self.power.max(axis=0, initial=0.0))

    @property
    def peak_braking(self) -> PerJoint:
        """Largest power that each drive takes back, W, as a positive number."""
        return np.asarray((-self.power).max(axis=0, initial=0.0))

    @cached_property
    def given_energy(self) -> PerJoint:
        """Energy that each drive gives over the cycle while it drives, J."""
        return self.integral(np.maximum(self.power, 0.0))

    @cached_property
    def braked_energy(self) -> PerJoint:
        """Energy that each drive takes back over the cycle while it brakes, J, 0 or more."""
        return self.integral(np.maximum(-self.power, 0.0))

    @property
    def energy(self) -> PerJoint:
        """Energy that each drive gives over the cycle, less what it takes back, J."""
        return np.asarray(self.given_energy - self.braked_energy)

    @property
    def net_energy(self) -> float:
        """Energy that all drives together give over the cycle, less what they take back, J.

        It is what friction takes, and the motion leaves; 0 where it is none but for rounding.
        """
        given, net = float(self.given_energy.sum()), float(self.energy.sum())
        return net if abs(net) > _NONE * given else 0.0

    @property
    def mean_power(self) -> PerJoint:
        """Mean of what each drive gives while it drives, over the whole cycle, W."""
        return self.given_energy / self.duration

    @property
    def mean_braking(self) -> PerJoint:
        """Mean of what each drive takes back while it brakes, over the whole cycle, W."""
        return self.braked_energy / self.duration

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives; an empty one where the file has none."""
        return tuple(leg.drive or Drive() for leg in self.robot.legs)

    @property
    def rotor_inertia(self) -> PerJoint:
        """Each motor's inertia at the joint, ratio^2 rotor_inertia, kg or kg m^2."""
        return np.array([drive.inertia for drive in self.drives])

    @property
    def inertia_ratios(self) -> PerJoint:
        """The greatest load's inertia over the motor's, at the joint; NaN where it has no rotor."""
        rotors = self.rotor_inertia
        return np.where(
            rotors > 0.0, self.load_inertia[1] / np.where(rotors > 0.0, rotors, 1.0), np.nan
        )

    @property
    def motor_torques(self) -> tuple[PerJoint, PerJoint]:
        """Root mean square and peak at each motor, N m; of one without a ratio as at the joint."""
        gears = np.array([abs(drive.gear) for drive in self.drives])
        return self.rms_forces / gears, self.peak_forces / gears

    def squares(self, leg: int) -> tuple[float, float, float]:
        """Return the means over the cycle of f^2, f q'' and q''^2, f being the load of a leg."""
        i = leg - 1
        f, a, held = self.loads[:, i], self.accelerations[:, i], self.holding[i]
        means = self.mean(np.stack([f * f, f * a, a * a], axis=-1), [held**2, 0.0, 0.0])
        return float(means[0]), float(means[1]), float(means[2])

    @cached_property
    def overloads(self) -> tuple[str, ...]:
        """Loads beyond the drives' limits, a line each: which leg, which limit, and by how much."""
        found = list(overloads(self.robot, [self.peak_forces], self.speeds))
        legs = zip(self.robot.legs, self.drives, self.rms_forces, strict=True)
        for i, (leg, drive, rms) in enumerate(legs, start=1):
            rated, unit = drive.rated_force, leg.joint.force_unit
            if rated is not None and rms > rated:
                found.append(
                    f"leg {i}: the cycle takes {rms:.4g} {unit} root mean square, but the motor "
                    f"gives {rated:.4g} {unit} all the time (rated_torque and ratio)"
                )
        return tuple(found)

    def table(self) -> pl.DataFrame:
        """Return a table, one row a leg: SI units, at the joint but for motor_torque.

        What a drive has not is empty.
        """
        import polars as pl

        joints = [leg.joint for leg in self.robot.legs]
        turning = np.array([drive.ratio is not None for drive in self.drives])
        rms, peak = self.motor_torques
        numbers = {
            **picked(
                self,
                "peak_force=peak_forces rms_force=rms_forces peak_speed=peak_speeds",
                "rms_speed=rms_speeds peak_power mean_power peak_braking mean_braking",
                "given_energy braked_energy",
            ),
            "least_load_inertia": self.load_inertia[0],
            "greatest_load_inertia": self.load_inertia[1],
            "rotor_inertia": np.where(self.rotor_inertia > 0.0, self.rotor_inertia, np.nan),
            "inertia_ratio": self.inertia_ratios,
            "ratio": [np.nan if drive.ratio is None else drive.ratio for drive in self.drives],
            "best_ratio": np.where(np.isfinite(best := best_ratios(self)), best, np.nan),
            "peak_motor_torque": np.where(turning, peak, np.nan),
            "rms_motor_torque": np.where(turning, rms, np.nan),
        }
        columns = [pl.Series(k, np.asarray(v), nan_to_null=True) for k, v in numbers.items()]
        return pl.DataFrame(
            [
                pl.Series("leg", range(1, self.robot.joint_count + 1)),
                pl.Series("joint", [joint.noun for joint in joints]),
                pl.Series("force_unit", [joint.force_unit for joint in joints]),
                pl.Series("speed_unit", [f"{joint.unit}/s" for joint in joints]),
                *columns,
            ]
        )


def best_ratio(sizing: Sizing, leg: int, rotor_inertia: float) -> float:
    """Return the ratio at which a motor's root mean square torque over the cycle is least.

    T^2 = <f^2> / i^2 + 2 J <f q''> + J^2 i^2 <q''^2> is least at i^2 = rms(f) / (J rms(q'')): the
    load and the rotor then take equal parts of the torque.

    Parameters
    ----------
    sizing : Sizing
        What the cycle asks of the joints.
    leg : int
        From 1.
    rotor_inertia : float
        J, kg m^2.

    Returns
    -------
    float
        rad/m or rad/rad; infinite where the joint does not accelerate, or J is 0.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import best_ratio, pick_and_place, size
    >>> robot = pteron.load("tripteron")
    >>> found = size(robot, pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5, duration=0.5))
    >>> round(best_ratio(found, 1, 3e-5), 1)
    295.1
    """
    force, _, acceleration = sizing.squares(leg)
    all_joints = sizing.mean(sizing.accelerations**2)
    if rotor_inertia == 0.0 or acceleration <= _STILL**2 * float(all_joints.max()):
        return math.inf
    return math.sqrt(math.sqrt(force / acceleration) / rotor_inertia)


def best_ratios(sizing: Sizing) -> PerJoint:
    """Return the best ratio of each drive's own motor, rad/m or rad/rad; NaN where it has no rotor.

    Parameters
    ----------
    sizing : Sizing
        What the cycle asks of the joints.

    Returns
    -------
    array, shape (n,)
    """
    return np.array(
        [
            best_ratio(sizing, i, drive.rotor_inertia) if drive.rotor_inertia else np.nan
            for i, drive in enumerate(sizing.drives, start=1)
        ]
    )
