"""Drives: friction, motor inertia, and the machine's acceleration under drive forces.

The numbers of a drive are those of `pteron.legs.drive.Drive`.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.motion import Expression
from pteron.equations.kinematics import jacobian
from pteron.equations.lagrangian import generalized_wrench, mass_matrix, solve_positive_definite
from pteron.equations.machine import Machine, State
from pteron.equations.virtual_work import generalized_forces
from pteron.legs import Drive, Stribeck
from pteron.manipulator import Manipulator


class Drives(NamedTuple):
    """The numbers of all drives at their joints, (n, 1) each; SI units, as in `Drive`."""

    inertia: Expression
    coulomb: Expression
    viscous: Expression
    offset: Expression
    stribeck: Expression
    stribeck_speed: Expression
    rest_speed: Expression

    @classmethod
    def from_vector(cls, numbers: Expression) -> Drives:
        """Return drive parameters from a vector (7 n, 1), as `drive_numbers` returns it."""
        return cls(*ca.vertsplit(numbers, numbers.shape[0] // len(cls._fields)))


def drive_numbers(robot: Manipulator) -> NDArray[np.float64]:
    """Return the drive parameters (7 n,) of a machine: inertia, friction and so on, each (n,).

    A leg without a drive has no friction and no motor inertia.
    """
    rows = []
    for leg in robot.legs:
        drive = leg.drive or Drive()
        stribeck = drive.stribeck or Stribeck(0.0, 1.0)
        rows.append(
            (
                *(drive.inertia, drive.coulomb, drive.viscous, drive.offset),
                *(stribeck.force, stribeck.speed, drive.rest_speed),
            )
        )
    return np.array(rows).T.ravel()


def drives_of(robot: Manipulator) -> Drives:
    """Return the drive parameters of a machine as arrays by name, (n,) each."""
    return Drives(*drive_numbers(robot).reshape(len(Drives._fields), -1))


def drive_names(robot: Manipulator) -> tuple[str, ...]:
    """Return the names of the drive parameters (7 n,): "coulomb_1" for leg 1, and so on."""
    legs = range(1, robot.joint_count + 1)
    return tuple(f"{name}_{i}" for name in Drives._fields for i in legs)


def dry_friction(drives: Drives, rates: Expression) -> Expression:
    """Return the magnitude (n, 1) of dry friction at joint rates: Coulomb's plus Stribeck's."""
    return drives.coulomb + drives.stribeck * ca.exp(-((rates / drives.stribeck_speed) ** 2))


def friction(drives: Drives, rates: Expression, *, smooth: bool) -> Expression:
    """Return friction plus offset forces (n, 1) at joint rates, N or N m.

    Dry friction has the sign of the rate, or if `smooth` tanh(q' / rest_speed).
    """
    side = _ahead(rates) - _ahead(-rates)
    if smooth:  # tanh(q'/rest_speed), by an exponential that controllers have and none overflows
        small = ca.exp(-2 * ca.fabs(rates) / drives.rest_speed)
        side = side * (1 - small) / (1 + small)
    return dry_friction(drives, rates) * side + drives.viscous * rates + drives.offset


def _ahead(rates: Expression) -> Expression:
    """Return 1 where a rate is positive, else 0."""
    return ca.if_else(rates > 0, 1, 0)


def joint_motion(state: State) -> tuple[Expression, Expression]:
    """Return rates and accelerations of the actuated joints, (n, 1) each."""
    return (
        ca.vertcat(*(leg.rate for leg in state.legs)),
        ca.vertcat(*(leg.acceleration for leg in state.legs)),
    )


def drive_forces(
    drives: Drives, rates: Expression, accelerations: Expression, *, smooth: bool
) -> Expression:
    """Return forces (n, 1) of friction, offset and motor inertia at given joint motion."""
    return drives.inertia * accelerations + friction(drives, rates, smooth=smooth)


def drive_accelerations(
    machine: Machine,
    pose: Expression,
    velocity: Expression,
    forces: Expression,
    parameters: Expression,
    wrench: Expression,
    drives: Drives,
) -> Expression:
    """Return the platform's acceleration x'' (m, 1) under drive forces (n, 1) and a wrench.

    The drives' friction, offsets and the motors' inertia, reflected to the joints, are included.
    """
    state = machine.state(pose, velocity)
    rows = jacobian(state)
    drive_loads = drive_forces(drives, *joint_motion(state), smooth=True)
    load = ca.mtimes(rows.T, forces - drive_loads) + generalized_wrench(machine, state, wrench)
    load -= generalized_forces(machine, state, parameters)
    mass = mass_with_rotors(machine, pose, parameters, rows, drives.inertia)
    return solve_positive_definite(mass, load)


def mass_with_rotors(
    machine: Machine,
    pose: Expression,
    parameters: Expression,
    rows: Expression,
    rotors: Expression,
) -> Expression:
    """Return the mass matrix with rotor inertias, M + J^T D J (m, m), at a pose."""
    mass = mass_matrix(machine, pose, parameters)
    return mass + ca.mtimes(rows.T, ca.mtimes(ca.diag(rotors), rows))
