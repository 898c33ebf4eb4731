"""`Simulation`, the result of `simulate`: its samples, and why it ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pteron.html_table import Column, Overview
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.manipulator.readings import reading_scales, to_readings
from pteron.motion.motion import Motion
from pteron.motion.simulation.motor_forces import limit_to_motors
from pteron.motion.trajectories.limits import limits_of
from pteron.renamed import former_attribute
from pteron.result import Result

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Result):
    """A machine's motion under the forces of its drives, at each sample of the controller.

    Attributes
    ----------
    robot : Manipulator
        The machine that moved.
    time : array, shape (T,)
        s, from 0.
    pose, velocity, acceleration : array, shape (T, m)
        The platform's motion; m, rad and s. The acceleration is the one right after the sample.
    joints, joint_rates : array, shape (T, n)
        m and m/s; rad and rad/s at cranks.
    motors, motor_rates : array, shape (T, n)
        Those of the motors, counted at the joints, which differ where transmissions bend.
    forces : array, shape (T, n)
        Forces that the motors give: from this sample on, limits and delay included, those of their
        curves and windings too; of a current that lags, what it gives at this sample. N, N m at
        cranks; ripple and cogging are beside them.
    asked : array, shape (T, n)
        Forces that the controller asked for at this sample.
    reference : Motion
        The motion asked of the machine, at the same times; where none was asked for, it rests.
    payload : array, shape (T,)
        The mass that it carried, kg.
    memory : array, shape (T, K)
        The controller's memory: of an adaptive one, its estimates.
    step : float
        Length of the integration's steps, s; NaN where they have no fixed length.
    stopped : str or None
        Why the simulation ended before its time.
    """

    robot: Manipulator
    time: Array
    pose: Array
    velocity: Array
    acceleration: Array
    joints: Array
    joint_rates: Array
    motors: Array
    motor_rates: Array
    forces: Array
    asked: Array
    reference: Motion
    payload: Array
    memory: Array
    step: float
    stopped: str | None

    def __repr__(self) -> str:
        """Return the machine, the duration and the count of samples in one line."""
        end = f"; stopped: {self.stopped}" if self.stopped else ""
        rows = f"{self.time[-1]:.6g} s, {len(self.time)} samples"
        return f"<Simulation of {self.robot.name!r}: {rows}{end}>"

    def summary(self) -> str:
        """Return tracking errors and each drive's loads as lines of text."""
        return self._overview().text

    def _overview(self) -> Overview:
        """Return errors, speeds, forces and saturation as a table, for notebooks."""
        headings = ("error, rms", "error, largest", "peak speed", "peak force", "at its limit")
        columns = [Column("coordinate"), *(Column(name, "number") for name in headings[:2])]
        columns += [Column("joint"), *(Column(name, "number") for name in headings[2:])]
        error = self.error
        parts = zip(
            self.robot.coordinates,
            self.robot.units,
            np.sqrt((error**2).mean(axis=0)),
            np.abs(error).max(axis=0),
            self.robot.joint_names,
            np.abs(self.joint_rates).max(axis=0),
            np.abs(self.forces).max(axis=0),
            self.saturated_share,
            (leg.joint for leg in self.robot.legs),
            strict=True,
        )
        rows = [
            (
                *(name, f"{rms:.4g} {unit}", f"{most:.4g} {unit}", joint),
                *(f"{speed:.4g} {kind.unit}/s", f"{force:.4g} {kind.force_unit}"),
                f"{100.0 * share:.3g} %",
            )
            for name, unit, rms, most, joint, speed, force, share, kind in parts
        ]
        about = f"simulated for {self.time[-1]:.6g} s, {len(self.time)} samples"
        notes = [f"Stopped: {self.stopped}"] if self.stopped else []
        return Overview(self.robot.name, about, columns, rows, notes)

    @property
    def error(self) -> Array:
        """Pose error: actual pose less reference, (T, m), m and rad."""
        return self.pose - self.reference.pose

    @property
    def motion(self) -> Motion:
        """The simulated motion of the platform."""
        return Motion(self.time, self.pose, self.velocity, self.acceleration)

    @property
    def saturated_share(self) -> Array:
        """Share of the samples, (n,), 0 to 1, in which a drive's command exceeded its limits."""
        beyond = np.abs(self.asked) > limits_of(self.robot).force
        beyond |= (
            np.abs(limit_to_motors(self.robot, self.asked, self.motor_rates) - self.asked) > 0.0
        )
        return np.asarray(beyond.mean(axis=0))

    def table(self) -> pl.DataFrame:
        """Return the samples as a table, a row for each time.

        The columns are t; x y z phi, dx dy dz dphi, ddx ddy ddz ddphi and xref yref zref phiref, as
        far as the machine has them; its joints (rho1, theta2) and their rates (drho1, dtheta2);
        forces (force1, torque2); and payload. Joints and forces are in the drives' units of
        reading: if a transmission is elastic and its encoder is at the motor, the joint's columns
        are the motor's. With elastic transmissions motor_rho1, ..., dmotor_rho1, ... are the
        motors' coordinates.
        """
        import polars as pl

        names, joints = self.robot.coordinates, self.robot.joint_names
        scales = reading_scales(self.robot)
        bends = [leg.drive.elastic if leg.drive else None for leg in self.robot.legs]
        behind = [elastic is not None and elastic.encoder == "motor" for elastic in bends]
        readings = np.where(behind, self.motors, self.joints)
        rates = np.where(behind, self.motor_rates, self.joint_rates)
        motors = [f"motor_{name}" for name in joints] if any(bends) else []
        blocks = (
            (names, self.pose),
            ([f"d{name}" for name in names], self.velocity),
            ([f"dd{name}" for name in names], self.acceleration),
            ([f"{name}ref" for name in names], self.reference.pose),
            (joints, to_readings(self.robot, readings)),
            ([f"d{name}" for name in joints], rates / scales),
            (motors, to_readings(self.robot, self.motors)[:, : len(motors)]),
            ([f"d{name}" for name in motors], (self.motor_rates / scales)[:, : len(motors)]),
            (self.robot.force_names, self.forces * scales),
        )
        columns = {"t": self.time}
        for titles, block in blocks:
            columns |= dict(zip(titles, block.T, strict=True))
        return pl.DataFrame(columns | {"payload": self.payload})

    saturated = former_attribute("saturated", "saturated_share")
