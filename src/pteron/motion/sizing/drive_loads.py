"""`Sizing`, the result of `size`: peaks, means, power and energy of each drive over a cycle.

Where the cycle is done at several places, each is the greatest of all places.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.html_table import Column, Overview
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.legs.motor_limits import motor_peak
from pteron.manipulator import Manipulator
from pteron.motion.sizing.drive_margins import DriveMargin, drive_margins
from pteron.motion.sizing.places import CyclePlace
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import PerJoint
from pteron.tolerances import ROUNDING

if TYPE_CHECKING:
    import polars as pl

HOLDING = 100.0
"""Ratio to the best one of the places where a joint moves, up to which a ratio is sought if it
rests at others."""


@dataclass(frozen=True, eq=False, repr=False)
class Sizing(Result):
    """The load on a machine's drives over one cycle: motions and rests, at one place or at several.

    Everything is at the joints, per leg: N and m/s of a slider, N m and rad/s of a crank, but for
    what is said to be at the motor. Forces are those of the drives: rigid bodies, friction, offset
    and the motors' inertia. Peaks, means, powers and energies are the greatest of all places.

    Attributes
    ----------
    robot : Manipulator
        The machine, with its payload if it carries one.
    time : array, shape (K,)
        The motions' samples and the middles between them, and the rests, s.
    forces : array, shape (K, n) or (K, W, n)
        Forces that the drives give, N or N m; of several places all of them.
    speeds, accelerations : array, shape (K, n) or (K, W, n)
        Of the joints, m/s and m/s^2, or rad/s and rad/s^2.
    dwell : float
        How long the platform rests in the cycle, s: the drives hold it, and friction helps neither
        way.
    load_inertia : array, shape (2, n)
        Least and greatest inertia of the rigid bodies at each joint, the other joints being held:
        the diagonal of J^-T M J^-1; kg or kg m^2.
    places : tuple of CyclePlace
        Where the cycle is done; empty where it is done as it stands.
    assumed_friction : array, shape (n,)
        Dry friction that was assumed where the machine's file has none, N or N m.
    """

    robot: Manipulator
    time: Array
    forces: Array
    speeds: Array
    accelerations: Array
    dwell: float
    load_inertia: Array
    places: tuple[CyclePlace, ...]
    assumed_friction: PerJoint

    def __repr__(self) -> str:
        """Return the machine's name and the cycle's duration in one line."""
        return f"<Sizing of {self.robot.name!r}: a cycle of {self.duration:.6g} s>"

    def summary(self) -> str:
        """Return force, speed and power of each drive as lines of text."""
        return self._overview().text

    def _overview(self) -> Overview:
        """Return the loads on each drive as a table, for notebooks."""
        headings = ("peak force", "rms force", "peak speed", "peak power", "mean power")
        columns = [Column("joint"), *(Column(name, "number") for name in headings)]
        columns_of_numbers = (
            *(self.peak_forces, self.rms_forces, self.peak_speeds),
            *(self.peak_power, self.mean_power),
        )
        rows = []
        for name, leg, *row in zip(
            self.robot.joint_names, self.robot.legs, *columns_of_numbers, strict=True
        ):
            force, speed = leg.joint.force_unit, f"{leg.joint.unit}/s"
            units = (force, force, speed, "W", "W")
            cells = (f"{number:.4g} {unit}" for number, unit in zip(row, units, strict=True))
            rows.append((name, *cells))
        about = f"drives over a cycle of {self.duration:.6g} s"
        return Overview(self.robot.name, about, columns, rows, self.overloads)

    @property
    def duration(self) -> float:
        """Duration of the cycle, rests included, s."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def loads(self) -> Array:
        """Load forces at the joints, N or N m: `forces` less those of the motors' inertia."""
        return self.forces - self.rotor_inertia * self.accelerations

    def select_place(self, place: int) -> Sizing:
        """Return the drive loads at one of several places of the cycle, by its index."""
        parts = (self.forces, self.speeds, self.accelerations)
        forces, speeds, accelerations = (part[:, place] for part in parts)
        return replace(self, forces=forces, speeds=speeds, accelerations=accelerations, places=())

    at = former_attribute("at", "select_place")
    where = former_attribute("where", "place_text")

    def worst(self, quantity: str) -> PerJoint:
        """Return for each drive the index in `places` where the load `quantity` is greatest.

        The quantity is "peak_force", "rms_force", "peak_speed", "rms_speed", "peak_power",
        "peak_braking", "given_energy" or "braked_energy".
        """
        return np.asarray(self._quantities_at_places[quantity].argmax(axis=0))

    @cached_property
    def _quantities_at_places(self) -> dict[str, Array]:
        """Each load quantity at each place, (W, n), by name; W = 1 without places."""
        shape = len(self.time), -1, self.robot.joint_count
        forces, speeds = self.forces.reshape(shape), self.speeds.reshape(shape)
        power = self.power.reshape(shape)
        driving, braking = np.maximum(power, 0.0), np.maximum(-power, 0.0)
        return {
            "peak_force": np.abs(forces).max(axis=0),
            "rms_force": np.sqrt(self.mean(forces**2)),
            "peak_speed": np.abs(speeds).max(axis=0),
            "rms_speed": np.sqrt(self.mean(speeds**2)),
            "peak_power": driving.max(axis=0),
            "peak_braking": braking.max(axis=0),
            "given_energy": self.integral(driving),
            "braked_energy": self.integral(braking),
        }

    def _greatest(self, quantity: str) -> PerJoint:
        """Return the greatest value of a load quantity over all places, for each joint (n,)."""
        return np.asarray(self._quantities_at_places[quantity].max(axis=0))

    def integral(self, samples: Array) -> Array:
        """Return the integral over the cycle, by Simpson's rule, of values (K, ...) at `time`."""
        spans = (self.time[2::2] - self.time[:-2:2]) / 6.0
        ends = samples[:-2:2] + 4.0 * samples[1::2] + samples[2::2]
        return np.asarray(np.tensordot(spans, ends, axes=1))

    def mean(self, samples: Array) -> Array:
        """Return the mean over the cycle of values (K, ...) at `time`."""
        return np.asarray(self.integral(samples) / self.duration)

    @property
    def peak_forces(self) -> PerJoint:
        """Largest absolute force of each drive (n,), N or N m."""
        return self._greatest("peak_force")

    @property
    def rms_forces(self) -> PerJoint:
        """Root mean square force of each drive over the cycle (n,), N or N m."""
        return self._greatest("rms_force")

    @property
    def peak_speeds(self) -> PerJoint:
        """Largest absolute speed of each joint (n,), m/s or rad/s."""
        return self._greatest("peak_speed")

    @property
    def rms_speeds(self) -> PerJoint:
        """Root mean square speed of each joint over the cycle (n,), m/s or rad/s."""
        return self._greatest("rms_speed")

    @property
    def power(self) -> Array:
        """Mechanical power of each motor, in the forces' shape, W: negative where it brakes."""
        return np.asarray(self.forces_with_losses * self.speeds)

    @property
    def peak_power(self) -> PerJoint:
        """Largest power that each drive delivers (n,), W."""
        return self._greatest("peak_power")

    @property
    def peak_braking(self) -> PerJoint:
        """Largest power that each drive absorbs, W, as a positive number."""
        return self._greatest("peak_braking")

    @property
    def given_energy(self) -> PerJoint:
        """Energy that each drive delivers over the cycle while it drives, J."""
        return self._greatest("given_energy")

    @property
    def braked_energy(self) -> PerJoint:
        """Energy that each drive absorbs over the cycle while it brakes, J, 0 or more."""
        return self._greatest("braked_energy")

    @property
    def energy(self) -> PerJoint:
        """Energy that each drive delivers over the cycle, less the energy it absorbs, J."""
        quantities = self._quantities_at_places
        return np.asarray((quantities["given_energy"] - quantities["braked_energy"]).max(axis=0))

    @property
    def net_energy(self) -> float:
        """Energy that all drives deliver over the cycle, less the energy they absorb, J.

        It is the energy that friction dissipates plus what the motion keeps; 0 if it is zero up to
        rounding.
        """
        driving, braking = (
            self._quantities_at_places[f"{key}_energy"].sum(axis=1) for key in ("given", "braked")
        )
        net = float((driving - braking).max())
        return net if abs(net) > ROUNDING * float(driving.max()) else 0.0

    @property
    def mean_power(self) -> PerJoint:
        """Mean over the cycle of the power that each drive delivers, rests included, W."""
        return self.given_energy / self.duration

    @property
    def mean_braking(self) -> PerJoint:
        """Mean over the cycle of the power that each drive absorbs, rests included, W."""
        return self.braked_energy / self.duration

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drive of each leg; an empty `Drive` where the machine's file has none."""
        return tuple(leg.drive or Drive() for leg in self.robot.legs)

    @property
    def rotor_inertia(self) -> PerJoint:
        """Each rotor's inertia reflected to the joint, ratio^2 rotor_inertia (n,), kg or kg m^2."""
        return np.array([drive.inertia for drive in self.drives])

    @property
    def inertia_ratios(self) -> PerJoint:
        """The greatest load inertia over the motor's, at each joint (n,).

        NaN without rotor inertia.
        """
        rotors = self.rotor_inertia
        return np.where(
            rotors > 0.0, self.load_inertia[1] / np.where(rotors > 0.0, rotors, 1.0), np.nan
        )

    @property
    def motor_torques(self) -> tuple[PerJoint, PerJoint]:
        """Root mean square and peak torque of each motor, N m; at the joint without a ratio.

        They include the losses of screws.
        """
        forces, gears = self.forces_with_losses, np.abs(self._gears)
        forces = forces.reshape(len(self.time), -1, self.robot.joint_count)
        squares = np.sqrt(self.mean(forces**2)).max(axis=0)
        return squares / gears, np.abs(forces).max(axis=(0, 1)) / gears

    @property
    def motor_speeds(self) -> tuple[PerJoint, PerJoint]:
        """Root mean square and peak speed of each motor, rad/s; of the joint without a ratio."""
        gears = np.abs(self._gears)
        return self.rms_speeds * gears, self.peak_speeds * gears

    @property
    def _gears(self) -> PerJoint:
        """The ratio of each drive (n,), rad/m or rad/rad."""
        return np.array([drive.gear for drive in self.drives])

    @cached_property
    def forces_with_losses(self) -> Array:
        """The forces times ratio that each motor gives, in the forces' shape, N or N m.

        A screw of efficiency e divides by e the load that it drives, and multiplies by e the load
        that drives it; at rest it passes the load.
        """
        screws = [drive.screw for drive in self.drives]
        shares = np.array([1.0 if screw is None else screw.efficiency for screw in screws])
        if (shares == 1.0).all():
            return self.forces
        way = np.sign(self.loads * self.speeds)
        return np.asarray(self.loads * shares**-way + self.rotor_inertia * self.accelerations)

    def squares(self, leg: int) -> tuple[Array, Array, Array]:
        """Return the cycle means of f^2, f q'' and q''^2, f being the load force of a leg.

        Each has the shape (), or (W,) for W places.
        """
        force, mixed, acceleration = (part[..., leg - 1] for part in self._squares)
        return force, mixed, acceleration

    @cached_property
    def _squares(self) -> tuple[Array, Array, Array]:
        """Cycle means of force^2, force times acceleration, acceleration^2, (n,) or (W, n) each."""
        f, a = self.loads, self.accelerations
        return self.mean(f * f), self.mean(f * a), self.mean(a * a)

    @cached_property
    def margins(self) -> tuple[DriveMargin, ...]:
        """The margins (limit over load) of each drive's limits in the cycle, leg by leg."""
        needed = {name: self._greatest(name) for name in ("peak_force", "peak_speed")}
        # What heats a motor includes the losses of its screw.
        needed["rms_force"] = self.motor_torques[0] * np.abs(self._gears)
        return drive_margins(self.robot, needed, self.forces, self.speeds)

    @cached_property
    def overloads(self) -> tuple[str, ...]:
        """Lines of text, one for each drive limit exceeded: leg, limit and load."""
        exceeded = [margin for margin in self.margins if margin.margin < 1.0]
        exceeded.sort(key=lambda margin: margin.quantity == "rms_force")
        return tuple(margin.overload_text(self.place_text(margin)) for margin in exceeded)

    def place_text(self, margin: DriveMargin) -> str:
        """Return in words the place of the cycle where a drive margin is least.

        The text is empty without places.
        """
        if not self.places:
            return ""
        leg = margin.leg - 1
        if margin.quantity == "force_at_speed":
            peak = motor_peak(self.drives[leg], self.forces[..., leg], self.speeds[..., leg])
            return f" {self.places[peak.at % len(self.places)]}"
        return f" {self.places[self.worst(margin.quantity)[leg]]}"

    def table(self) -> pl.DataFrame:
        """Return a table of drive loads with a row for each leg, SI units at the joint.

        Cells of quantities that a drive does not have are empty.
        """
        import polars as pl

        joints = [leg.joint for leg in self.robot.legs]
        turning = np.array([drive.ratio is not None for drive in self.drives])
        rms, peak = self.motor_torques
        mean_speed, fastest = self.motor_speeds
        numbers = {
            **json_fields(
                peak_force=self.peak_forces,
                rms_force=self.rms_forces,
                peak_speed=self.peak_speeds,
                rms_speed=self.rms_speeds,
                peak_power=self.peak_power,
                mean_power=self.mean_power,
                peak_braking=self.peak_braking,
                mean_braking=self.mean_braking,
                given_energy=self.given_energy,
                braked_energy=self.braked_energy,
            ),
            "least_load_inertia": self.load_inertia[0],
            "greatest_load_inertia": self.load_inertia[1],
            "rotor_inertia": np.where(self.rotor_inertia > 0.0, self.rotor_inertia, np.nan),
            "inertia_ratio": self.inertia_ratios,
            "ratio": [np.nan if drive.ratio is None else drive.ratio for drive in self.drives],
            "best_ratio": np.where(np.isfinite(best := best_ratios(self)), best, np.nan),
            "peak_motor_torque": np.where(turning, peak, np.nan),
            "rms_motor_torque": np.where(turning, rms, np.nan),
            "peak_motor_speed": np.where(turning, fastest, np.nan),
            "rms_motor_speed": np.where(turning, mean_speed, np.nan),
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
    """Return the gear ratio that minimises a motor's root mean square torque over the cycle.

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
    moving = acceleration > ROUNDING**2 * max(
        float(sizing.squares(i)[2].max()) for i in range(1, sizing.robot.joint_count + 1)
    )
    if rotor_inertia == 0.0 or not moving.any():
        return math.inf
    optimal_ratios = np.sqrt(np.sqrt(force[moving] / acceleration[moving]) / rotor_inertia)
    least, most = float(optimal_ratios.min()), float(optimal_ratios.max())
    if not moving.all():  # where it only holds, more is better
        most *= HOLDING
    if most - least <= ROUNDING * most:
        return most
    # The greatest of convex functions of i^2.
    solution = scipy.optimize.minimize_scalar(
        lambda log: float(mean_squares(sizing, leg, math.exp(log), rotor_inertia).max()),
        bounds=(math.log(least), math.log(most)),
        method="bounded",
        options={"xatol": ROUNDING},
    )
    return math.exp(solution.x)


def mean_squares(sizing: Sizing, leg: int, ratio: float, rotor_inertia: float) -> Array:
    """Return the mean square of a motor's torque over the cycle, () or (W,), (N m)^2."""
    force, mixed, acceleration = sizing.squares(leg)
    square = force / ratio**2 + 2.0 * rotor_inertia * mixed
    return np.maximum(square + (rotor_inertia * ratio) ** 2 * acceleration, 0.0)


def best_ratios(sizing: Sizing) -> PerJoint:
    """Return the gear ratio of least rms torque for each drive; NaN without rotor inertia.

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
