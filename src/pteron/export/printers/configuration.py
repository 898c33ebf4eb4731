"""Export of a configuration for Klipper, a printer firmware: its kinematic sections.

The kinematics are `generic_cartesian`, `delta` or `rotary_delta`; Klipper's formulas are in its
klippy/kinematics/ and klippy/chelper/. It takes machines that move x, y and z alone: those whose
joints are linear in the pose, and Deltas as regular as its few numbers can describe.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.export.descriptions import banner
from pteron.export.names import prefix_of
from pteron.export.printers.cartesian import cartesian
from pteron.export.printers.centers import Center
from pteron.export.printers.delta import delta
from pteron.export.printers.rotary_delta import rotary
from pteron.export.printers.sections import INSTEAD
from pteron.export.writing import write_export
from pteron.kernels.code import render_template
from pteron.manipulator import Manipulator, RobotLike, as_manipulator


def export_klipper(robot: RobotLike, folder: str | Path = ".") -> list[Path]:
    """Write the kinematic sections of a Klipper configuration, NAME.cfg.

    A machine whose joints are linear in the pose, as a Tripteron, becomes `generic_cartesian`; a
    Delta with vertical guides `delta`; one with cranks `rotary_delta`, if its towers or shoulders
    stand as regularly as Klipper has them. X, Y and Z are the tool's position in mm; Klipper's
    Deltas have no place for a tool beside the z axis, and the file says so. Pins, speeds and homing
    are left to who builds the machine.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its name becomes the file's.
    folder : path
        Where; made if it is missing.

    Returns
    -------
    list of Path
        The file written.

    Raises
    ------
    ModelError
        If Klipper cannot move this machine: what differs, and what to use instead.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> from pteron.export import export_klipper
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (path,) = export_klipper(pteron.load("tripteron-oblique"), folder)
    ...     print(next(line for line in path.read_text().splitlines() if "carriages:" in line))
    carriages: 1.063829787234042*x+0.310283687943262*z
    """
    robot = as_manipulator(robot)
    if robot.platform.coordinates != ("x", "y", "z"):
        pose = ", ".join(robot.platform.coordinates)
        raise ModelError(
            f"{robot.name}: Klipper moves x, y and z alone, and this machine's pose is {pose}; "
            f"{INSTEAD}"
        )
    if robot.redundancy:
        raise ModelError(
            f"{robot.name}: Klipper has one motor for each of x, y and z, and this machine has "
            f"{robot.joint_count}; {INSTEAD}"
        )
    text = render_template(
        "pteron.export",
        "klipper.cfg.j2",
        banner=[line for line in banner(robot, "Klipper configuration") if "SI units" not in line],
        found=_values(robot),
        tool=any(robot.platform.tool),
    )
    return write_export(folder, {f"{prefix_of(robot)}.cfg": text})


def _values(robot: Manipulator) -> dict[str, Any]:
    """Return the values of the template of the kinematics that the machine has."""
    machine = Machine.numeric(robot)
    if all(leg.row_is_constant for leg in machine.legs):
        return cartesian(robot)
    centers = [Center.from_leg(machine, i) for i in range(3)]
    if all(center is not None for center in centers):
        known_centers = [center for center in centers if center is not None]
        if all(center.is_prismatic for center in known_centers):
            return delta(robot, known_centers)
        if not any(center.is_prismatic for center in known_centers):
            return rotary(robot, known_centers)
    raise ModelError(
        f"{robot.name}: its legs are neither all linear in the pose, nor those of a Delta with "
        f"guides or with cranks, which is what Klipper knows; {INSTEAD}"
    )
