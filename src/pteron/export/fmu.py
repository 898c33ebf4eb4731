"""Export of an FMU of FMI 3.0: a machine with its drives, for model exchange and co-simulation.

The exported C is inside, with `fmu.c` around it, and compiled for the computer that writes it.
CasADi's DaeBuilder (3.8) would write model exchange alone, and could not end a simulation where a
leg does not reach.
"""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from pteron.bodies.inertia import inertia_count
from pteron.dynamics import drive_forces
from pteron.errors import DataError, ModelError
from pteron.export.c import CPrinter, c_texts
from pteron.export.descriptions import banner
from pteron.export.fmu_variables import fmu_variables
from pteron.export.functions import exported_functions
from pteron.export.names import prefix_of
from pteron.export.start_pose import start_pose
from pteron.export.tools import tool_lines
from pteron.export.writing import write_export
from pteron.kernels import Array, as_array
from pteron.kernels.c import c_compiler
from pteron.kernels.code import render_template
from pteron.kernels.compilers import compile_library
from pteron.kinematics import inverse_kinematics
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.readings import refuse_readings

_FUNCTIONS = (
    "drive_accelerations",
    "joint_coordinates",
    "jacobian",
    "squared_type_i",
    "set_payload",
)
"""Functions of the exported C that `fmu.c` calls."""

LEAST = 0.01
"""The type-I measure of a leg at which a simulation ends."""

_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
"""Flags of the C compiler."""

_CALL = {
    "pose": "state",
    "velocity": "state + M",
    "forces": "values->forces",
    "wrench": "values->wrench",
    "parameters": "values->parameters",
    "drives": "values->drives",
}
"""The expression in C for each input of `drive_accelerations`."""

_DATES = (1980, 1, 1, 0, 0, 0)
"""Date of the files inside, fixed so that the same machine gives the same bytes."""


def export_fmu(
    robot: RobotLike, folder: str | Path = ".", *, pose: ArrayLike | None = None
) -> list[Path]:
    """Write a machine with its drives as an FMU of FMI 3.0, its sources inside.

    Inputs are the drives' forces and a wrench on the platform at P; states are the pose and its
    rate; outputs are these, the acceleration, the joint coordinates and their rates. Friction, with
    tanh(q'/rest_speed), and the motors' inertia are in it. Parameters are a payload and the numbers
    of the drives. It starts at rest, and its forces hold it there unless others are given. Where a
    leg's type-I measure falls below 0.01 the simulation ends, with a message.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its name becomes the file's.
    folder : path
        Where; made if it is missing.
    pose : array_like, shape (m,), optional
        To start from, m and rad; by default zero where that is a good pose, else one in the middle
        of the reach. The user of the FMU may set another.

    Returns
    -------
    list of Path
        NAME.fmu.

    Raises
    ------
    ModelError
        If there is no C compiler, or it fails.
    DataError
        If `pose` has another shape.
    UnreachablePose, SingularPose
        If `pose` cannot be started from.
    OutputError
        If the folder cannot be written.
    """
    robot = as_manipulator(robot)
    refuse_readings(robot, "an FMU")
    prefix = prefix_of(robot)
    start = start_pose(robot) if pose is None else _checked_pose(robot, pose)
    zeros = np.zeros(robot.freedom)
    forces = drive_forces(robot, start, zeros, zeros)
    exported = exported_functions(
        robot, _FUNCTIONS, specialised=False, wrench=True, output="force", base=None
    )
    tables = {table.name: table.values for function in exported for table in function.tables}
    call = [_CALL[port.name] for port in exported[0].inputs]
    texts = {name: text for name, text in c_texts(robot, exported).items() if prefix in name}
    del texts[f"test_{prefix}.c"]
    variables = {
        "banner": banner(robot, "FMU of FMI 3.0"),
        "name": quoteattr(robot.name),
        "description": quoteattr(" ".join([*banner(robot, "FMU")[:1], *tool_lines(robot)])),
        "tool": quoteattr(f"Pteron {version('pteron')}"),
        "quoted": lambda attribute: quoteattr(str(attribute)),
        "prefix": prefix,
        "upper": prefix.upper(),
        "printer": CPrinter(prefix, "double"),
        "number": CPrinter(prefix, "double").number,
        "freedom": robot.freedom,
        "joint_count": robot.joint_count,
        "wrench_count": len(robot.platform.wrench_columns),
        "inertia_count": inertia_count(robot.platform.inertia.kinds),
        "inertial": tables["parameters"],
        "drives": tables["drives"],
        "least_square": LEAST**2,
        "layout": fmu_variables(robot, start, forces),
        "start": np.concatenate([start, zeros]),
        "forces": np.asarray(forces),
        "acceleration_call": ", ".join([*call, "found + M"]),
    }
    # The token says which modelDescription.xml goes with which binary: a digest of all of it.
    parts = {
        name: render_template("pteron.export", f"{name}.j2", token="", **variables)
        for name in ("fmu.c", "modelDescription.xml")
    }
    digest = hashlib.sha256("".join([*texts.values(), *parts.values()]).encode()).hexdigest()
    for name in parts:
        parts[name] = render_template("pteron.export", f"{name}.j2", token=digest[:32], **variables)
    sources = texts | {"fmu.c": parts["fmu.c"]}
    binary, place = _compile_library(prefix, sources)
    build = render_template("pteron.export", "buildDescription.xml.j2", prefix=prefix)
    members = {
        "modelDescription.xml": parts["modelDescription.xml"].encode(),
        "sources/buildDescription.xml": build.encode(),
        **{f"sources/{name}": text.encode() for name, text in sources.items()},
        place: binary,
    }
    return write_export(folder, {f"{prefix}.fmu": _zip_files(members)})


def _checked_pose(robot: Manipulator, pose: ArrayLike) -> Array:
    """Return the pose to start from, after a check that the machine can be there."""
    start = as_array(pose, "pose", np.shape(pose))
    if start.shape != (robot.freedom,):
        names = ", ".join(robot.platform.coordinates)
        raise DataError(f"pose: shape {start.shape} given, ({robot.freedom},) expected: {names}")
    inverse_kinematics(robot, start)
    return start


def _compile_library(prefix: str, sources: Mapping[str, str]) -> tuple[bytes, str]:
    """Return the shared library and its place in the FMU.

    Raises
    ------
    ModelError
        If there is no compiler, or it fails.
    """
    command = c_compiler()
    if command is None:
        raise ModelError(
            "fmu: an FMU needs a C compiler, which is not here; install gcc or clang, or set the "
            "environment variable CC to one"
        )
    place, suffix = _platform()
    with tempfile.TemporaryDirectory() as scratch:
        library = Path(scratch) / f"{prefix}{suffix}"
        advice = "set the environment variable CC to another compiler"
        compile_library(command, _FLAGS, sources, library, "fmu: its code", advice)
        return library.read_bytes(), f"binaries/{place}/{library.name}"


def _platform() -> tuple[str, str]:
    """Return the folder that FMI 3.0 gives to binaries of this machine, and their suffix."""
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    known = {"win32": ("windows", ".dll"), "darwin": ("darwin", ".dylib")}
    system, suffix = known.get(sys.platform, ("linux", ".so"))
    return f"{machine}-{system}", suffix


def _zip_files(members: Mapping[str, bytes]) -> bytes:
    """Return a zip archive of members, names to contents, with fixed dates: reproducible."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, _DATES), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
