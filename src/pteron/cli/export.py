"""`pteron export`: code for a controller."""

from __future__ import annotations

from typing import Annotated, Literal

from pteron.cli.arguments import Elbows, Json, Robot, load_robot, option
from pteron.cli.screen import note, plain, show, show_json, spinner
from pteron.errors import DataError

_FUNCTIONS = (
    "adaptive",
    "adaptive_drives",
    "bias_forces",
    "closure_poses",
    "closure_rows",
    "computed_torque",
    "computed_torque_base",
    "coriolis_matrix",
    "direct_kinematics",
    "direct_step",
    "discriminants",
    "drive_accelerations",
    "drive_forces",
    "drive_forces_base",
    "feed_forward",
    "feed_forward_base",
    "feed_forward_pd",
    "feed_forward_pd_base",
    "forward_dynamics",
    "gravity_forces",
    "inverse_dynamics",
    "inverse_dynamics_base",
    "inverse_kinematics",
    "jacobian",
    "joint_accelerations",
    "joint_coordinates",
    "joint_feed_forward",
    "joint_feed_forward_base",
    "joint_points",
    "joint_rates",
    "joint_screws",
    "kinetic_energy",
    "link_jacobians",
    "link_vectors",
    "mass_matrix",
    "newton_step",
    "paper_regressor",
    "paper_terms",
    "passive_friction",
    "passive_room",
    "pd_gravity",
    "pd_gravity_base",
    "platform_motion",
    "platform_points",
    "potential_energy",
    "reach",
    "regressor",
    "squared_type_i",
    "type_ii",
)
"""Written out: help is shown before CasADi is loaded. A test holds it against what there is."""

_TRUSTED = "trustworthy"

Output = Literal["force", "torque", "percent"]
"""The library's own, which is slow to import."""


def export(
    robot: Robot,
    c: Annotated[str | None, option("c", "Write C99 to this folder.", "DIR")] = None,
    st: Annotated[str | None, option("st", "Write Structured Text to this folder.", "DIR")] = None,
    function: Annotated[
        list[str] | None,
        option("function", f"What to write; again for more: {', '.join(_FUNCTIONS)}.", "NAME"),
    ] = None,
    single: Annotated[bool, option("float", "C: float instead of double.")] = False,
    specialised: Annotated[
        bool, option("specialised", "C: fold the inertial parameters in.")
    ] = False,
    wrench: Annotated[
        bool, option("wrench", "Dynamics take a wrench on the platform too.")
    ] = False,
    output: Annotated[
        Output,
        option(
            "output",
            "What drives are told: force at the joints, torque of the motors, or percent of what "
            "they are rated for.",
            "UNIT",
        ),
    ] = "force",
    base: Annotated[
        str | None,
        option(
            "base",
            "The identification.json of pteron identify: its values go into the code.",
            "FILE",
            show_default=False,
        ),
    ] = None,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Write code for a controller: C99, or Structured Text for a PLC.

    Kinematics, Jacobian, dynamics and regressor, in functions that return a status, without
    allocation or state; with a test program and a CMakeLists.txt. Function blocks for a PLC are
    inverse kinematics and inverse dynamics unless others are named. A machine with drives has
    `feed_forward` as well: what the drives must give, with friction, and `joint_feed_forward`, the
    same from the motion of the joints. With --base they take what `pteron identify` found, as it
    lists it, and are called `feed_forward_base` and `joint_feed_forward_base`.
    """
    if c is None and st is None:
        raise DataError("--c, --st: neither given; say what to write, such as --c controller")
    machine = load_robot(robot, elbows)
    files = []
    with spinner(f"Writing code for {machine.name}"):
        from pteron.export import Real, export_c, export_st
        from pteron.export.identified import read_identified

        grade = read_identified(machine, base).grade if base is not None else _TRUSTED
        if c is not None:
            real: Real = "float" if single else "double"
            files += export_c(
                machine,
                function,
                c,
                real=real,
                specialised=specialised,
                wrench=wrench,
                output=output,
                base=base,
            )
        if st is not None:
            files += export_st(machine, function, st, wrench=wrench, output=output, base=base)
    if grade != _TRUSTED:
        note(f"Warning: {base}: the verdict on these values is: {grade}")
    if json:
        show_json({"robot": machine.name, "files": [str(path) for path in files]})
        return
    show(*(f"Written: {plain(str(path))}" for path in files))
