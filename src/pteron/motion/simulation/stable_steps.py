"""The longest stable step of the simulation, from the modes of the machine linear about rest."""

from __future__ import annotations

import math

import numpy as np

from pteron.dynamics import mass_matrix
from pteron.dynamics.joint_space import joint_mobilities, mass_with_rotors
from pteron.equations.drives import Drives, drives_of
from pteron.equations.transmissions import DriveKind
from pteron.errors import DataError, PteronError
from pteron.kernels import Array, as_array, program
from pteron.kernels.samples import Evaluated
from pteron.kinematics import jacobian
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.simulation.machines import Machines
from pteron.shapes import PoseLike

_STABLE = 2.0
"""Greatest product of a step and the fastest decay rate, 1/s.

Runge and Kutta's method of fourth order is stable to 2.78.
"""

_SHORTEST = 1e-8
"""A step that must be shorter than this, s, points to a mistake in the drives' numbers."""


def longest_step(robot: RobotLike, poses: PoseLike, machines: Machines | None = None) -> float:
    """Return the longest stable step of the simulation, s; infinite if nothing limits it.

    It is limited by the fastest of these: the decay of rates by viscous friction or by a winding at
    its supply's limit, the vibration of motors and joints on elastic transmissions, and the lag of
    currents. Dry friction needs no short steps. `poses` (..., m) are those where the machine may
    be. For several machines the step is stable for all of them, at the pose with the least mass at
    the joints.
    """
    return _longest_stable_step(as_manipulator(robot), poses, machines)[0]


def _longest_stable_step(
    robot: Manipulator, poses: PoseLike, machines: Machines | None = None
) -> tuple[float, str]:
    """Return the longest stable integration step, s, and a phrase that names its cause."""
    kind, drives = DriveKind.from_robot(robot), drives_of(robot)
    if machines is not None:
        parts = machines.drives.reshape(len(machines), len(drives), -1)
        drives = Drives(*np.moveaxis(parts, 1, 0))
    drives = drives._replace(viscous=drives.viscous + _supply_damping(robot))
    longest = float("inf"), ""
    if drives.viscous.any() or kind.bends or any(kind.lugre):
        rows, mass = jacobian(robot, poses), mass_matrix(robot, poses)
        if machines is not None:
            index = joint_mobilities(rows, mass).sum(axis=-1).argmax()
            rows = rows.reshape(-1, *rows.shape[-2:])[index]
            places = as_array(poses, "poses", (robot.freedom,)).reshape(-1, robot.freedom)
            each = Evaluated("mass", program(robot, "mass_matrix"))(
                {"pose": np.tile(places[index], (len(machines), 1))},
                {"mass_parameters": machines.parameters_with_payload[:, None]},
            )
            mass = next(iter(each.values())).reshape(-1, *mass.shape[-2:])
        longest = _step_of_drives(robot, rows, mass, drives)
    for i, leg in enumerate(robot.legs, start=1):
        lag = leg.drive and leg.drive.current_time
        if lag and _STABLE * lag < longest[0]:
            longest = _STABLE * lag, f"leg {i}: the current's time constant"
    return longest


def _supply_damping(robot: Manipulator) -> Array:
    """Return (n,) the decrease of drive force per joint rate where the supply voltage limits it."""
    falls = np.zeros(robot.joint_count)
    for i, leg in enumerate(robot.legs):
        if leg.drive and leg.drive.winding:
            winding = leg.drive.winding
            falls[i] = (leg.drive.gear * winding.torque_constant) ** 2 / winding.resistance
    return falls


def _step_of_drives(
    robot: Manipulator, rows: Array, mass: Array, drives: Drives
) -> tuple[float, str]:
    """Return the longest stable step, s, and its cause, from Jacobian, mass matrix and drives."""
    kind, longest = DriveKind.from_robot(robot), (float("inf"), "")
    if drives.viscous.any() or kind.bends:
        system, bent = _linear_machine(robot, rows, mass, drives)
        if kind.bends:
            rates, vectors = np.linalg.eig(system)
        else:  # without springs the eigenvalues are those of the friction's part alone, and zeros
            rates = np.linalg.eigvals(system[..., robot.freedom :, robot.freedom :])
        fastest = int(np.abs(rates).argmax())
        rate = float(np.abs(rates.flat[fastest]))
        if rate > 0.0:
            longest = _STABLE / rate, "viscous friction"
            if kind.bends:
                shapes = np.moveaxis(bent @ vectors[..., : bent.shape[-1], :], -1, -2)
                soft = np.abs(shapes.reshape(-1, robot.joint_count)[fastest]) * kind.elastic
                longest = longest[0], f"leg {soft.argmax() + 1}: the stiffness of its transmission"
    if any(kind.lugre):
        rotors = np.where(kind.elastic, 0.0, drives.inertia)
        mobilities = joint_mobilities(rows, mass_with_rotors(rows, mass, rotors))
        for i, leg in enumerate(robot.legs):
            if leg.drive and leg.drive.lugre:
                ease = 1.0 / drives.inertia[..., i] if kind.elastic[i] else mobilities[..., i]
                # A bound on the eigenvalue of a spring with a damper.
                bristle = leg.drive.lugre
                rate = float(np.max(np.sqrt(bristle.stiffness * ease) + bristle.damping * ease))
                if _STABLE / rate < longest[0]:
                    longest = _STABLE / rate, f"leg {i + 1}: the stiffness of its bristles"
    return longest


def modes(robot: RobotLike, poses: PoseLike) -> tuple[Array, Array]:
    """Return the eigenvalues of the machine with its drives, linearised about rest at poses.

    The linear machine is M x'' = J^T (k d + c d') and I w' = -k d - c d' - b w, with d the
    deflection of each transmission; backlash, dry friction and the change of gravity forces with
    the pose are neglected.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    poses : array, shape (..., m)
        m and rad.

    Returns
    -------
    eigenvalues : array of complex, shape (..., K)
        1/s, K twice the number of coordinates and of motors that move by themselves.
    bent : array of complex, shape (..., n, K)
        The deflection of each transmission in each mode; 0 where it is rigid.

    Raises
    ------
    UnreachablePose, SingularPose
        If a leg does not reach a pose, or is singular there.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from dataclasses import replace
    >>> from pteron.motion import modes
    >>> robot = pteron.load("tripteron")
    >>> bends = pteron.legs.Drive(rotor_inertia=0.5, elastic=pteron.legs.Elastic(stiffness=2e5))
    >>> robot = replace(robot, legs=tuple(replace(leg, drive=bends) for leg in robot.legs))
    >>> np.sort(modes(robot, np.zeros(3))[0].imag)[-3:].round()  # rad/s
    array([686., 686., 699.])
    """
    robot = as_manipulator(robot)
    rows, mass = jacobian(robot, poses), mass_matrix(robot, poses)
    system, bent = _linear_machine(robot, rows, mass, drives_of(robot))
    rates, vectors = np.linalg.eig(system)
    soft = np.array(DriveKind.from_robot(robot).elastic)
    return rates, np.where(soft[:, None], bent @ vectors[..., : bent.shape[-1], :], 0.0)


def _linear_machine(
    robot: Manipulator, rows: Array, mass: Array, drives: Drives
) -> tuple[Array, Array]:
    """Return the linear machine's matrix (..., 2 K, 2 K) and the deflections (..., n, K).

    The K coordinates are those of the pose, then those of the motors behind elastic transmissions.
    """
    bends = [leg.drive and leg.drive.elastic for leg in robot.legs]
    stiffness, damping = (
        np.array([getattr(elastic, name) if elastic else 0.0 for elastic in bends])
        for name in ("stiffness", "damping")
    )
    soft = np.array([elastic is not None for elastic in bends])
    m, n = robot.freedom, robot.joint_count
    selection = np.eye(n)[soft]
    bent = np.concatenate(
        [-rows, np.broadcast_to(selection.T, (*rows.shape[:-2], n, len(selection)))], -1
    )
    rigid = np.where(soft, 0.0, 1.0)

    def assemble(joints: Array, motors: Array, springs: Array) -> Array:
        """Return the matrix (..., K, K) of coefficients (..., n) at joints, motors, springs."""
        joint_part = rows.mT @ (joints[..., None] * rows)
        spring_part = bent.mT @ (springs[:, None] * bent)
        matrix = np.zeros(
            np.broadcast_shapes(joint_part.shape[:-2], spring_part.shape[:-2])
            + spring_part.shape[-2:]
        )
        matrix += spring_part
        matrix[..., :m, :m] += joint_part
        matrix[..., m:, m:] += motors[..., soft, None] * np.eye(len(selection))
        return matrix

    inertia = assemble(rigid * drives.inertia, drives.inertia, np.zeros(n))
    inertia = np.broadcast_to(inertia, (*mass.shape[:-2], *inertia.shape[-2:])).copy()
    inertia[..., :m, :m] += mass
    drag = assemble(rigid * drives.viscous, drives.viscous, damping)
    pull = assemble(np.zeros(n), np.zeros(n), stiffness)
    size = m + len(selection)
    system = np.zeros((*inertia.shape[:-2], 2 * size, 2 * size))
    system[..., :size, size:] = np.eye(size)
    system[..., size:, :size] = -np.linalg.solve(inertia, pull)
    system[..., size:, size:] = -np.linalg.solve(inertia, drag)
    return system, bent


def allowed_step(
    robot: Manipulator,
    poses: Array,
    step: float,
    *,
    usual: bool = True,
    machines: Machines | None = None,
) -> float:
    """Return min(step, longest stable step), s; raise if that is too short to be sensible.

    Raises
    ------
    DataError
        If a step that is not the `usual` one is too long for a transmission, bristles or a current,
        or no sensible step is stable. One that is too long for viscous friction alone is shortened.
    """
    try:
        longest, why = _longest_stable_step(robot, poses, machines)
    except PteronError:
        return step  # the first sample says what is wrong with the pose
    if longest < _SHORTEST:
        raise DataError(
            f"drives: {why} asks for steps below {_SHORTEST:g} s; make "
            + ("viscous smaller" if why.startswith("viscous") else "it softer, or slower")
        )
    if step > longest and why.startswith("leg") and not usual:
        digit = 10.0 ** (math.floor(math.log10(longest)) - 1)
        longest = digit * math.floor(longest / digit)  # so that the printed step is accepted
        raise DataError(
            f"step: {step:g} s given, but {why} asks for {longest:.2g} s at most; give a shorter "
            "one, or none"
        )
    return min(step, longest)
