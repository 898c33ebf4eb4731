"""Export of CasADi functions for optimal control: serialised, with a module that loads them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.equations import drives
from pteron.equations.kinematics import jacobian
from pteron.equations.machine import Machine, closure_of
from pteron.export.descriptions import banner
from pteron.export.functions import has_drives
from pteron.export.names import prefix_of
from pteron.export.start_pose import good_poses, keeps_limits, start_pose
from pteron.export.writing import write_export
from pteron.kernels import program, specialise_program
from pteron.kernels.code import render_template
from pteron.manipulator import Manipulator, RobotLike, as_manipulator, parameters
from pteron.manipulator.readings import refuse_readings

_NAMES = {
    "inverse_kinematics": "joint_coordinates",
    "direct_kinematics": "closure_poses",
    "direct_step": "direct_step",
    "jacobian": "jacobian",
    "type_i_squares": "squared_type_i",
    "type_ii": "type_ii",
    "mass_matrix": "mass_matrix",
    "bias_forces": "bias_forces",
    "inverse_dynamics": "inverse_dynamics",
    "forward_dynamics": "forward_dynamics",
}
"""The library's function behind each exported function, by the latter's name."""

_LOADED = ("inverse_dynamics", "forward_dynamics")
"""Exported functions that take a wrench on the platform too."""


def casadi_functions(robot: RobotLike) -> dict[str, ca.Function]:
    """Return a machine's kinematics and dynamics as CasADi functions, to build upon.

    They are expressions of SX, so that CasADi differentiates them exactly and writes C from them.
    All arguments and results are columns, or matrices as `pteron` has them; inertial parameters and
    the numbers of the drives are folded in. Dry friction is smooth, tanh(q'/rest_speed), and so are
    its derivatives, also where a joint rests.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, with n joints and m pose coordinates.

    Returns
    -------
    dict of str to casadi.Function
        `inverse_kinematics` (pose) -> joints; `direct_kinematics` (joints) -> poses (k, m), in
        reach or not, or `direct_step` (joints, pose) -> found, type_ii, bent where there is no
        closed form; `jacobian` (pose) -> (n, m); `type_i_squares` (pose) -> (n), the squares of the
        legs' type-I measures, negative out of reach, and `type_ii` (pose): what a path must keep
        away from zero; `mass_matrix` (pose); `bias_forces` (pose, velocity), h of M x'' + h =
        J^T F; `inverse_dynamics` (pose, velocity, acceleration, wrench) -> forces and
        `forward_dynamics` (pose, velocity, forces, wrench) -> acceleration of the rigid bodies;
        `drive_forces` and `drive_accelerations`, the same with friction and the motors' inertia;
        `state_rates` (state, forces, wrench) -> rates, state = (pose, velocity). SI units, radians.

    Raises
    ------
    ModelError
        If `robot` is no manipulator.

    Examples
    --------
    >>> import pteron
    >>> from pteron.export import casadi_functions
    >>> functions = casadi_functions(pteron.load("quadrupteron"))
    >>> functions["inverse_dynamics"].name_in()
    ['pose', 'velocity', 'acceleration', 'wrench']
    """
    robot = as_manipulator(robot)
    refuse_readings(robot, "CasADi's functions")
    missing = "direct_step" if closure_of(robot).closed_form else "direct_kinematics"
    functions = {n: _plain(robot, n, what) for n, what in _NAMES.items() if n != missing}
    functions |= {function.name(): function for function in _drive_functions(robot)}
    return functions


def _plain(robot: Manipulator, name: str, what: str) -> ca.Function:
    """Return a library function with the machine's parameters, its matrices by rows."""
    library = specialise_program(
        program(robot, what, wrench=what in _LOADED), {"parameters": parameters(robot)}
    )
    symbols = library.function.sx_in()
    results = [
        expression.T if len(port.shape) == 2 else ca.reshape(expression, -1, 1)
        for expression, port in zip(library.function.call(symbols), library.outputs, strict=True)
    ]
    names = [port.name for port in library.inputs], [port.name for port in library.outputs]
    return ca.Function(name, symbols, results, *names)


def _drive_functions(robot: Manipulator) -> Iterator[ca.Function]:
    """Yield the functions of the drives, whose tanh CasADi can differentiate at rest too.

    The form that controllers have, by an exponential and a sign, has derivative zero there.
    """
    machine, m, n = Machine.numeric(robot), robot.freedom, robot.joint_count
    sizes = dict.fromkeys(("pose", "velocity", "acceleration"), m) | {"forces": n}
    sizes["wrench"] = len(robot.platform.wrench_columns)
    symbols = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    pose, velocity, acceleration, forces, wrench = symbols.values()
    machine_drives = drives.Drives.from_vector(ca.SX(ca.DM(drives.drive_numbers(robot))))
    rates = ca.mtimes(jacobian(machine.state(pose)), velocity)
    dry = drives.dry_friction(machine_drives, rates) * ca.tanh(rates / machine_drives.rest_speed)
    others = machine_drives._replace(coulomb=ca.SX(n, 1), stribeck=ca.SX(n, 1))
    inertia = ca.SX(ca.DM(parameters(robot)))

    rigid = _plain(robot, "rigid", "inverse_dynamics")(pose, velocity, acceleration, wrench)
    moving = drives.joint_motion(machine.state(pose, velocity, acceleration))
    needed = rigid + drives.drive_forces(others, *moving, smooth=True) + dry
    moved = drives.drive_accelerations(
        machine, pose, velocity, forces - dry, inertia, wrench, others
    )
    yield _function("drive_forces", symbols, ("acceleration",), forces=needed)
    yield _function("drive_accelerations", symbols, ("forces",), acceleration=moved)
    state = ca.SX.sym("state", 2 * m)
    parts = [state[:m], state[m:]]
    rates_of = ca.substitute([moved], [pose, velocity], parts)[0]
    yield ca.Function(
        "state_rates",
        [state, forces, wrench],
        [ca.cse(ca.vertcat(state[m:], rates_of))],
        ["state", "forces", "wrench"],
        ["rates"],
    )


def _function(
    name: str, symbols: dict[str, Expression], middle: Sequence[str], **results: Expression
) -> ca.Function:
    """Return a CasADi function of pose, velocity, `middle` and wrench, densified and simplified."""
    inputs = ["pose", "velocity", *middle, "wrench"]
    outputs = [ca.cse(ca.densify(expression)) for expression in results.values()]
    return ca.Function(name, [symbols[k] for k in inputs], outputs, inputs, list(results))


def export_casadi(robot: RobotLike, folder: str | Path = ".") -> list[Path]:
    """Write a machine's CasADi functions, a module that loads them, and an example.

    The module needs CasADi alone. Its `ocp_model` has the names that acados and the like ask for:
    x, u, p, xdot, f_expl_expr, f_impl_expr, con_h_expr. The example finds the motion from rest to
    rest with the least forces by direct multiple shooting.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its name becomes the files' prefix.
    folder : path
        Where; made if it is missing.

    Returns
    -------
    list of Path
        A `.casadi` file for each of `casadi_functions`, `load_NAME.py` and `example_NAME.py`.

    Raises
    ------
    ModelError
        If `robot` is no manipulator.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> from pteron.export import export_casadi
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = export_casadi(pteron.load("delta"), folder)
    >>> sorted(path.name for path in files)[-2:]
    ['example_delta.py', 'load_delta.py']
    """
    robot = as_manipulator(robot)
    functions, prefix = casadi_functions(robot), prefix_of(robot)
    files: dict[str, str | bytes] = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name, function in functions.items():
            path = Path(scratch, f"{prefix}_{name}.casadi")
            function.save(str(path))
            files[path.name] = path.read_bytes()
    start, end = _ends(robot)
    least, most = zip(*(leg.limits or (None, None) for leg in robot.legs), strict=True)
    variables = {
        "banner": banner(robot, "CasADi functions"),
        "prefix": prefix,
        "coordinates": robot.platform.coordinates,
        "units": dict.fromkeys(robot.units),
        "in_base_axes": robot.platform.wrench_in_base_axes,
        "functions": {name: str(function) for name, function in functions.items()},
        "casadi": ca.__version__,
        "driven": has_drives(robot),
        "start": start,
        "end": end,
        "least": list(least),
        "most": list(most),
        "forces": [leg.drive.max_force if leg.drive else None for leg in robot.legs],
    }
    for name in ("load", "example"):
        text = render_template("pteron.export", f"{name}_casadi.py.j2", **variables)
        files[f"{name}_{prefix}.py"] = text
    return write_export(folder, files)


def _ends(robot: Manipulator) -> tuple[list[float], list[float]]:
    """Return the start and end poses of the example: a short straight path within all limits.

    Raises
    ------
    ModelError
        If the machine has no pose to start from.
    """
    start, others = start_pose(robot), good_poses(robot)[:50]
    for share in (0.2, 0.1, 0.05, 0.02, 0.01):
        for pose in others:
            way = start + share * np.linspace(0.0, 1.0, 20)[:, None] * (pose - start)
            if keeps_limits(robot, way).all():
                return start.tolist(), [float(f"{v:.4g}") for v in way[-1]]
    return start.tolist(), start.tolist()
