"""The machine's equations of motion, linearised about a pose at rest or a moment of a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.dynamics import drive_forces
from pteron.equations.drives import drive_numbers
from pteron.equations.transmissions import DriveKind, actuator_numbers
from pteron.kernels import Array, geometry_only, program
from pteron.kernels.programs import motion_program
from pteron.kinematics import jacobian
from pteron.kinematics.evaluate import finite_pose
from pteron.legs import Drive
from pteron.manipulator import Manipulator, RobotLike, as_manipulator, parameters
from pteron.motion.simulation.plant import motor_states
from pteron.motion.simulation.sensors import encoder_of
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import PoseLike


@dataclass(frozen=True, eq=False, repr=False)
class LinearPlant(Result):
    """A machine with its drives, linearised: s' = A s + B F, with encoder readings C s.

    s are small changes of (q, q'), or with more joints than coordinates of (x, x'), then of the
    motors' coordinates and rates where transmissions bend, and of the currents' forces where these
    lag: S numbers in all.

    Attributes
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (m,)
        Where it was linearised.
    matrix : array, shape (S, S)
        A, of the joints' coordinates and their rates first, or the platform's; SI units.
    inputs : array, shape (S, n)
        B, of the forces that are asked of the drives.
    outputs : array, shape (2 n, S)
        C: coordinates and rates, of the joints or of the motors, where the encoders are.
    differenced : array, shape (n, S)
        Coordinates of which rates are the differences, where encoders tell no rates.
    """

    ROWS = "matrix:1 inputs:1"

    robot: Manipulator
    pose: Array
    matrix: Array
    inputs: Array
    outputs: Array
    differenced: Array

    @property
    def poles(self) -> Array:
        """Eigenvalues of A, (S,), rad/s: of the machine at constant drive forces."""
        return np.asarray(np.linalg.eigvals(self.matrix))

    def zero_order_hold(self, span: float) -> tuple[Array, Array]:
        """Return exp(A t) and the integral of exp(A s) B over a time span, s: the sampled plant."""
        size, count = self.inputs.shape
        block = np.zeros((size + count, size + count))
        block[:size] = np.hstack([self.matrix, self.inputs]) * span
        exponential = scipy.linalg.expm(block)[:size]
        return exponential[:, :size], exponential[:, size:]

    held = former_attribute("held", "zero_order_hold")


def linearise(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike | None = None,
    acceleration: PoseLike | None = None,
) -> LinearPlant:
    """Return a machine with its drives, linearised at a pose at rest or a moment of a motion.

    The drive forces are those that hold the machine there, or that the motion needs. The closed
    chain is fully included: at rest A contains J M^-1 J^T times the derivative of the gravity
    forces, and B is J M^-1 J^T, with the motors' inertia in M. For a moment of a motion A and B are
    those of that moment (frozen). The derivatives of the equations of `simulate` are exact: elastic
    transmissions and lagging currents have states of their own. Viscous friction is included; dry
    friction, which only adds damping, is not, nor are backlash, ripple and limits.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,)
        m and rad.
    velocity, acceleration : array, shape (m,), optional
        Of the motion; by default the machine rests.

    Returns
    -------
    LinearPlant

    Raises
    ------
    UnreachablePose, SingularPose
        If a leg does not reach the pose, or the machine is singular there.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import linearise
    >>> plant = linearise("tripteron", [0.0, 0.0, 0.0])
    >>> plant.matrix.shape, plant.inputs.shape
    ((6, 6), (6, 3))
    """
    robot = as_manipulator(robot)
    zero_rates = np.zeros(robot.freedom)
    quantities = (pose, velocity, acceleration)
    names = ("pose", "velocity", "acceleration")
    state = [
        finite_pose(robot, zero_rates if quantity is None else quantity, name)
        for quantity, name in zip(quantities, names, strict=True)
    ]
    smooth = with_linear_drives(robot)
    kind, n = DriveKind.from_robot(smooth), robot.joint_count
    motors = motor_states(smooth, *state)
    inputs = {
        **dict(zip(("pose", "velocity"), state, strict=False)),
        **{name: motors[name] for name, _ in kind.extra_states},
        "forces": drive_forces(smooth, *state),
        "wrench": np.zeros(len(robot.column_names["wrench"])),
        "parameters": parameters(robot),
        "drives": drive_numbers(smooth),
        "actuators": actuator_numbers(smooth),
    }
    function = _derivatives(geometry_only(robot), kind)
    derivatives = function(*(inputs[name] for name in function.name_in()))
    system, driven, turned = (np.asarray(part, dtype=float) for part in derivatives)
    rows, m = jacobian(robot, state[0]), robot.freedom
    # A motor that moves with its joint, and a current that does not lag, are no states.
    is_state = [kind.lag if name == "current" else kind.elastic for name, _ in kind.extra_states]
    state_indices = np.flatnonzero([*[True] * (2 * m), *np.ravel(is_state)])
    system, driven = system[np.ix_(state_indices, state_indices)], driven[state_indices]
    # From the platform's (x, x') to the joints' (q, q'): q' = J x' changes with x too.
    joint_motion = np.block([[rows, np.zeros((n, m))], [turned, rows]])
    change = np.eye(len(state_indices))
    if n == m:
        change[: 2 * n, : 2 * m] = joint_motion
        outputs = np.eye(2 * n, len(state_indices))
    else:  # more joints than coordinates: the state is the platform's
        outputs = np.hstack([joint_motion, np.zeros((2 * n, len(state_indices) - 2 * m))])
    matrix = np.linalg.solve(change.T, (change @ system).T).T
    differenced = outputs[:n].copy()
    bends = np.flatnonzero(kind.elastic)
    for k, i in enumerate(bends):
        encoder = encoder_of(smooth.legs[i].drive)
        for rows_of, place, is_read in (
            (outputs[i], 2 * m + k, encoder == "motor"),
            (outputs[i + n], 2 * m + k + len(bends), encoder != "joint"),
            (differenced[i], 2 * m + k, encoder != "joint"),
        ):
            if is_read:
                rows_of[:] = 0.0
                rows_of[place] = 1.0
    return LinearPlant(robot, state[0], matrix, change @ driven, outputs, differenced)


def with_linear_drives(robot: Manipulator) -> Manipulator:
    """Return a machine whose drives have no dry friction, backlash, ripple or limits."""
    drives = [
        drive
        and Drive(
            viscous=drive.viscous,
            offset=drive.offset,
            rotor_inertia=drive.rotor_inertia,
            ratio=drive.ratio,
            elastic=drive.elastic and replace(drive.elastic, backlash=0.0),
            current_time=drive.current_time,
        )
        for drive in (leg.drive for leg in robot.legs)
    ]
    pairs = zip(robot.legs, drives, strict=True)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in pairs))


@lru_cache(maxsize=16)
def _derivatives(robot: Manipulator, kind: DriveKind) -> ca.Function:
    """Return a CasADi function: Jacobians of the state derivative by state and drive forces."""
    plant_program = motion_program(robot, kind)
    names, symbols = [port.name for port in plant_program.inputs], plant_program.function.sx_in()
    by_name = dict(zip(names, symbols, strict=True))
    columns = (ca.vec(part) for part in plant_program.function.call(symbols))
    results = zip((port.name for port in plant_program.outputs), columns, strict=True)
    symbols_by_name = by_name | dict(results)
    state = ca.vertcat(*(by_name[name] for name in ("pose", "velocity", *dict(kind.extra_states))))
    rate_names = ("velocity", "acceleration", *dict(kind.extra_states).values())
    rates = ca.vertcat(*(symbols_by_name[name] for name in rate_names))
    pose, velocity = by_name["pose"], by_name["velocity"]
    joint_rates = ca.mtimes(program(robot, "jacobian", plain=True).function(pose).T, velocity)
    parts = [(rates, state), (rates, by_name["forces"]), (joint_rates, pose)]
    slopes = [ca.cse(ca.jacobian(*part)) for part in parts]
    return ca.Function("derivatives", symbols, slopes, names, ["matrix", "driven", "turned"])
