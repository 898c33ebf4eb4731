"""`pteron export`: code for a controller, and models for other engines and tools."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pteron.cli.arguments import MachineArgument
from pteron.cli.motion_argument import Carried
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, plain
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator

_TRUSTED = "trustworthy"
"""The verdict on an identified model with which its export needs no warning."""

Output = Literal["force", "torque", "percent"]
"""A copy of `pteron.export.command_units.Output`: importing that would slow the command line."""

_TARGETS = (
    *("c", "st", "cuda", "mjcf", "sdf", "urdf", "pinocchio", "casadi", "fmu"),
    *("klipper", "marlin", "reprap", "linuxcnc"),
)
"""The options that name a folder to write to; `pteron.export.export_NAME` writes it."""

_CODE = ("c", "st", "cuda")
"""Those that take the options of functions, and may be given together."""


def export(
    machine: MachineArgument,
    *,
    c: str | None = None,
    st: str | None = None,
    klipper: str | None = None,
    marlin: str | None = None,
    reprap: str | None = None,
    linuxcnc: str | None = None,
    cuda: str | None = None,
    target: str | None = None,
    mjcf: str | None = None,
    sdf: str | None = None,
    urdf: str | None = None,
    pinocchio: str | None = None,
    casadi: str | None = None,
    fmu: str | None = None,
    function: list[str] | None = None,
    float_: bool = False,
    specialised: bool = False,
    wrench: bool = False,
    output: Output = "force",
    base: str | None = None,
    tool: str | None = None,
    gains: str | None = None,
) -> CommandResult:
    """Write code for a controller, or the machine in the format of another engine or tool.

    With --c, --st or --cuda: kinematics, Jacobian, dynamics and regressor, in functions that return
    a status, without allocation or state; C has a test program and a CMakeLists.txt. Function
    blocks for a PLC are inverse kinematics and inverse dynamics unless others are named. A machine
    with drives has `feed_forward` as well, the drives' forces with friction, and
    `joint_feed_forward`, the same from the motion of the joints. With --base they take the base
    parameters that `pteron identify` found, in its order, and are called `feed_forward_base` and
    `joint_feed_forward_base`. The other formats are written one at a time, with no options but
    --tool, --elbows and --json.

    A file of the same name that Pteron wrote is replaced, and the output says so where its content
    was another one, as after an edit; one that Pteron did not write is refused.

    Options
    -------
    --c DIR: Write C99 to this folder.
    --st DIR: Write Structured Text to this folder.
    --klipper DIR: Write the kinematics of a Klipper configuration.
    --marlin DIR: Write M665 and M666 of a linear Delta for Marlin.
    --reprap DIR: Write M665 and M666 of a linear Delta for RepRapFirmware.
    --linuxcnc DIR: Write kinematics for LinuxCNC.
    --cuda DIR: Write CUDA, for many states at once on an NVIDIA GPU, and a module for CuPy.
    --target NAME=DIR: Write with the export NAME of an installed package.

    Models
    ------
    --mjcf DIR: Write MuJoCo's MJCF.
    --sdf DIR: Write SDF, for Gazebo.
    --urdf DIR: Write URDF of the tree, and its closures.
    --pinocchio DIR: Write a module that makes Pinocchio's model.
    --casadi DIR: Write CasADi functions, for acados and the like.
    --fmu DIR: Write an FMU of FMI 3.0.

    Contents
    --------
    --function
    --float: C, CUDA: float instead of double.
    --specialised: C, CUDA: insert the inertial parameters as constants.
    --wrench: Dynamics take an external wrench on the platform as input.
    --output UNIT: Output to the drives: force at the joints, torque of the motors, or percent of
        the motors' rated torque.
    --base FILE: The identification.json of pteron identify, whose values go into the code.
    --tool NAME: Mount a tool that the machine's file lists under tools: the code has its body and
        its centre point.
    --gains FILE: The gains.toml of pteron tune: its controller is written too, beside what
        --function names.

    Examples
    --------
    pteron export quadrupteron --c controller
    pteron export my-robot.toml --c controller --float --function inverse_kinematics
    pteron export quadrupteron --st plc
    pteron export quadrupteron --cuda gpu
    pteron export quadrupteron --fmu models
    pteron export linear-delta --klipper printer
    pteron export robot.toml --base result/identification.json --c controller
    pteron export robot.toml --tool gripper --c controller
    """
    models = mjcf, sdf, urdf, pinocchio, casadi, fmu
    folders = (c, st, cuda, *models, klipper, marlin, reprap, linuxcnc)
    targets = {name: folder for name, folder in zip(_TARGETS, folders, strict=True) if folder}
    if target is not None:
        targets["target"] = target
    options: dict[str, object] = {"function": function, "float": float_, "gains": gains}
    options |= {"specialised": specialised, "wrench": wrench, "base": base}
    options |= {"output": output != "force"}
    _check(targets, [name for name, is_set in options.items() if is_set], tool)
    machine = Carried(tool=tool).mount_tool(machine)
    files = []
    from pteron.export.writing import recorded_replacements

    with spinner(f"Writing code for {machine.name}"), recorded_replacements() as replaced:
        from pteron.controllers import Controller, read_gains
        from pteron.export import Real, export_c, export_cuda, export_st
        from pteron.export.identified_parameters import read_identified

        grade = read_identified(machine, base).grade if base is not None else _TRUSTED
        asked_for: list[str | Controller] | None = [*function] if function else None
        if gains is not None:
            asked_for = [*(function or []), read_gains(machine, gains)]
        dynamics: dict[str, Any] = {"wrench": wrench, "output": output, "base": base}
        real: Real = "float" if float_ else "double"
        form: dict[str, Any] = {"real": real, "specialised": specialised, **dynamics}
        for place, write in ((c, export_c), (cuda, export_cuda)):
            if place is not None:
                files += write(machine, asked_for, place, **form)
        if st is not None:
            files += export_st(machine, asked_for, st, **dynamics)
        for name in targets.keys() - {*_CODE}:
            files += _export_target(machine, name, targets[name])
    if grade != _TRUSTED:
        note(f"Warning: {base}: the verdict on these values is: {grade}")
    record = {
        "robot": machine.name,
        "files": [str(path) for path in files],
        "replaced": [str(path) for path in replaced],
    }
    lines = [f"Replaced: {plain(str(path))}" for path in replaced]
    return CommandResult(record, lines, [path for path in files if path not in replaced])


def _export_target(machine: Manipulator, target: str, folder: str) -> list[Path]:
    """Return the files of a target; `folder` of an installed package's export is NAME=DIR."""
    if target != "target":
        files: list[Path] = getattr(import_module("pteron.export"), f"export_{target}")(
            machine, folder
        )
        return files
    from pteron.export.installed import export_named

    name, separator, place = folder.partition("=")
    if not (name and separator and place):
        raise DataError(f"--target: {folder!r} given, NAME=DIR expected, as in acme=controller")
    return export_named(name)(machine, place)


def _check(targets: dict[str, str], options: list[str], tool: str | None) -> None:
    """Raise DataError on no target, several (but C with Structured Text), or others' options."""
    if not targets:
        names = ", ".join(f"--{name}" for name in (*_TARGETS, "target"))
        raise DataError(f"{names}: none given; say what to write, such as --c controller")
    others = [name for name in targets if name not in _CODE]
    if others and len(targets) > 1:
        names = ", ".join(f"--{name}" for name in targets)
        raise DataError(f"{names}: give one at a time; only --c, --st and --cuda go together")
    if others and options:
        names = ", ".join(f"--{name}" for name in options)
        raise DataError(f"{names}: goes with --c, --st and --cuda, not --{others[0]}; leave it out")
    if "float" in options and not {"c", "cuda"} & {*targets}:
        raise DataError("--float: goes with --c and --cuda; Structured Text has LREAL alone")
    if tool is not None and "base" in options:
        raise DataError(
            f"--tool {tool}: not with --base, whose values are of the machine without it; leave it "
            "out, and let the controller call set_payload_base"
        )
