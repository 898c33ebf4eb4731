"""`reactions`: forces and moments in all joints and guides of the legs, at rest or in motion."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.dynamics import inverse_dynamics
from pteron.equations.machine import Machine
from pteron.errors import DataError
from pteron.indices.internal_forces import (
    Equations,
    apply_matrices,
    balance_loads,
    blocks,
    inverse,
    platform_wrench,
    size_of,
    wrench_shift,
)
from pteron.kernels import Array, as_array
from pteron.kinematics.evaluate import evaluate_kernel, finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import OnFailure, PoseLike


@dataclass(frozen=True, eq=False, repr=False)
class Reactions(Result):
    """Forces and moments in the legs' joints: those of the base's side on the platform's side.

    Attributes
    ----------
    names : tuple of tuple of str
        For each leg its joints from the base to the platform: P0, R1, R2, R3, R4 of a P-R-R-R leg,
        whose first joint is its guide.
    points : array, shape (..., n, j, 3)
        Their places, m, in the base frame: of a guide that of its slider; NaN, here and below, for
        a joint that a leg does not have.
    forces, moments : array, shape (..., n, j, 3)
        N, and N m about that point, in the base frame, the actuators' forces included.
    actuators : array, shape (..., n)
        Forces of the actuators, N or N m: that of `inverse_dynamics`.
    redundancy : int
        Number of the machine's self-stresses: sets of reactions that balance each other. Where it
        is not 0 the reactions are not unique, and those are returned whose norm is the least.
    length : float
        By which moments are divided in that norm, m.
    unheld : array, shape (...)
        The part of the load that the legs, as they are modelled, cannot hold, N: moments that would
        tilt the platform count over the legs' mean size. It is 0 where they hold all of it.
    """

    ROWS = "unheld actuators:1 forces:3 moments:3"

    names: tuple[tuple[str, ...], ...]
    points: Array
    forces: Array
    moments: Array
    actuators: Array
    redundancy: int
    length: float
    unheld: Array

    @property
    def is_unique(self) -> bool:
        """Whether statics alone determine the joint reactions (no self-stress)."""
        return self.redundancy == 0

    unique = former_attribute("unique", "is_unique")


def reactions(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike | None = None,
    acceleration: PoseLike | None = None,
    wrench: PoseLike | None = None,
    *,
    moment: ArrayLike | None = None,
    length: float | None = None,
    on_failure: OnFailure = "raise",
) -> Reactions:
    """Return the forces and moments in all joints and guides, by Newton and Euler.

    Bodies are assumed flat, with centres of mass in the plane of their joints, as the inertial
    parameters define nothing else. Parallel rods are treated as one rod that transmits an axial
    force and a couple normal to the rods' plane. For an overconstrained machine the reactions of
    least norm are returned, the norm being the root of the sum over all joints of |force|^2 +
    |moment / length|^2; statics does not determine them completely, see `redundancy`.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    velocity, acceleration : array, shape (..., m), optional
        The platform's motion; at rest by default.
    wrench : array, shape (..., m), optional
        Wrench on the platform at P: a force in N and, where it turns, a moment about k in N m;
        where it tilts a force and a moment, (..., 6). A joint between platform and base, at the
        centre of a 3R or 2R platform, bears what the legs do not.
    moment : array, shape (..., 3), optional
        A moment on the platform beside it, in the base frame, N m; what of it turns the platform
        belongs in `wrench`.
    length : float, optional
        Length by which moments are divided in the norm, m; the legs' mean size by default.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    Reactions

    Raises
    ------
    DataError
        If the length is not above 0.
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> from pteron.indices import reactions
    >>> found = reactions("tripteron-router", [0.0, 0.0, 0.0], wrench=[80.0, 80.0, -120.0])
    >>> found.names[0], found.redundancy, found.actuators.round(3)
    (('P0', 'R1', 'R2', 'R3'), 3, array([-80.912, -80.912, 157.886]))
    """
    robot = as_manipulator(robot)
    norm_length = size_of(robot) if length is None else float(length)
    if not norm_length > 0.0:
        raise DataError(f"length: {norm_length:g} m given, a number above 0 expected")
    zero_inputs = {"wrench": np.zeros(len(robot.platform.wrench_columns))}
    zero_rates = np.zeros(robot.freedom)
    quantities = {
        "pose": pose,
        "velocity": velocity,
        "acceleration": acceleration,
        "wrench": wrench,
    }
    states = [
        zero_inputs.get(name, zero_rates)
        if part is None
        else finite_rows(robot, part, name, on_failure)
        for name, part in quantities.items()
    ]
    states.append(np.zeros(3) if moment is None else as_array(moment, "moment", (3,)))
    # Errors name a state of the whole batch.
    evaluate_kernel(robot, "inverse_dynamics", on_failure, *states[:3])
    batch_shape = np.broadcast_shapes(*(part.shape[:-1] for part in states))
    flat = [
        np.broadcast_to(part, (*batch_shape, part.shape[-1])).reshape(-1, part.shape[-1])
        for part in states
    ]
    parts = [_solve_reactions(robot, norm_length, *block) for block in blocks(flat)]
    points, passed, actuators, unheld = (
        np.concatenate(part).reshape((*batch_shape, *part[0].shape[1:]))
        for part in list(zip(*parts, strict=True))[:4]
    )
    return Reactions(
        _names(robot),
        points,
        passed[..., :3],
        passed[..., 3:],
        actuators,
        max(part[4] for part in parts),
        norm_length,
        unheld,
    )


def _solve_reactions(
    robot: Manipulator,
    length: float,
    pose: Array,
    velocity: Array,
    acceleration: Array,
    wrench: Array,
    moment: Array,
) -> tuple[Array, Array, Array, Array, int]:
    """Return joint points, wrenches (B, n, j, 6), actuator forces, residual, self-stress count.

    If a self-stress leaves the wrenches undetermined, the minimum-norm solution is taken.
    """
    state = pose, velocity, acceleration
    balance = Equations(*evaluate_kernel(robot, "reactions", "nan", *state))
    batch, n, joints, _ = balance.passed.shape
    points, passed = balance.points.copy(), np.full(balance.passed.shape, np.nan)
    actuators, unheld = np.full((batch, n), np.nan), np.full(batch, np.nan)
    solvable = np.isfinite(balance.rows).all(axis=(-2, -1))
    solvable &= np.isfinite(wrench).all(axis=-1) & np.isfinite(moment).all(axis=-1)
    points[~solvable] = np.nan
    if not solvable.any():
        return points, passed, actuators, unheld, 0
    solvable_balance = Equations(*(part[solvable] for part in balance))
    load = platform_wrench(robot, wrench, moment)
    right, presumed = solvable_balance.right.copy(), solvable_balance.presumed_right.copy()
    right[:, : robot.freedom] -= apply_matrices(solvable_balance.loads, wrench[solvable])
    presumed[:, :6] -= load[solvable][:, : presumed.shape[-1]]
    if robot.redundancy:  # statics leaves the drives' forces open: they are as they are shared
        shared = inverse_dynamics(robot, *state, wrench, on_failure="nan")[solvable]
        right = np.concatenate([right, shared - solvable_balance.driven], axis=1)
        rows = [solvable_balance.rows, solvable_balance.driven_rows]
        solvable_balance = solvable_balance._replace(rows=np.concatenate(rows, axis=1))
    balanced = balance_loads(robot, solvable_balance, right[..., None], presumed[..., None])
    forces, redundancy = balanced.forces[..., 0], balanced.stresses.shape[-1]
    present = np.isfinite(solvable_balance.passed[..., 0])
    spread = wrench_shift(solvable_balance.ends[:, :, None] - solvable_balance.points)
    leg_shifts = np.zeros((len(forces), n, joints, 6, n, 6))
    for i in range(n):
        leg_shifts[:, i, :, :, i, :] = np.where(present[:, i, :, None, None], spread[:, i], 0.0)
    passing = leg_shifts.reshape(len(forces), -1, 6 * n)
    offsets = np.where(present[..., None], solvable_balance.passed, 0.0).reshape(len(forces), -1)
    if redundancy:
        scale = np.tile([1.0, 1.0, 1.0, 1 / length, 1 / length, 1 / length], n * joints)
        stress_inverse = inverse(scale[:, None] * (passing @ balanced.stresses))
        forces = forces - apply_matrices(
            balanced.stresses @ stress_inverse, scale * (apply_matrices(passing, forces) + offsets)
        )
    joint_wrenches = (apply_matrices(passing, forces) + offsets).reshape(-1, n, joints, 6)
    passed[solvable] = np.where(present[..., None], joint_wrenches, np.nan)
    actuators[solvable] = (
        apply_matrices(solvable_balance.driven_rows, forces) + solvable_balance.driven
    )
    unheld[solvable] = np.linalg.norm(balanced.missed[..., 0], axis=-1)
    return points, passed, actuators, unheld, redundancy


def _names(robot: Manipulator) -> tuple[tuple[str, ...], ...]:
    """Return the names of each leg's joints: "P0", "R1" and so on, as in the paper."""
    machine = Machine.numeric(robot)
    legs = machine.state(ca.SX.zeros(robot.freedom)).legs
    return tuple(tuple(f"{joint.kind}{k}" for k, joint in enumerate(leg.chain)) for leg in legs)
