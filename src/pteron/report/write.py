"""`write_report`: the page and its numbers, as files."""

from __future__ import annotations

import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.atomic import write_texts
from pteron.errors import OutputError
from pteron.manipulator import RobotLike, as_manipulator

if TYPE_CHECKING:
    from pteron.report.contents import Report


def write_report(robot: RobotLike, folder: str | Path) -> Path:
    """Write the report on a machine: `report.html`, one page that needs no other file or network.

    `report.json` beside it holds the numbers. Each file is written whole or not at all, and the
    folder is made last.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    folder : str or path
        Where to write; made if it is missing.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    ModelError
        If the machine reaches no pose.
    SingularPose
        If the machine is singular at every pose.
    """
    robot = as_manipulator(robot)
    # Matplotlib, SciPy and SymPy are behind these; the table of the paper needs none of them.
    from pteron.report.contents import contents
    from pteron.report.page import page

    target = checked_folder(folder)
    report = contents(robot)
    data = json.dumps(numbers(report), indent=1, allow_nan=False)
    return write_texts(target, {"report.html": page(report), "report.json": data + "\n"})[0]


def checked_folder(path: str | Path) -> Path:
    """Return a folder after a check, which leaves nothing behind, that it can be written."""
    if str(path) == "":
        raise OutputError("the folder's name is empty; name one")
    target = Path(path)
    there = next(folder for folder in (target, *target.parents) if folder.exists())
    try:
        with tempfile.TemporaryFile(dir=there):
            return target
    except OSError as error:
        reason = f"{there} is a file" if there != target else "it is a file"
        reason = reason if there.is_file() else error.strerror or str(error)
        raise OutputError(f"{target}: cannot be written to as a folder ({reason})") from None


def numbers(report: Report) -> dict[str, Any]:
    """Return the numbers of a report as plain data in SI units and radians."""
    robot, cycle, ranges = report.robot, report.cycle, report.joints
    orientations = report.orientations
    return {
        "robot": robot.name,
        "motion": robot.platform.motion,
        "coordinates": list(robot.coordinates),
        "joints": [vars(leg.joint) for leg in robot.legs],
        "drives": [asdict(leg.drive) if leg.drive else None for leg in robot.legs],
        "elbows": [leg.elbow for leg in robot.legs],
        "gravity": list(robot.gravity),
        "tool": list(robot.platform.tool),
        "doubts": list(report.doubts),
        "home": {
            "pose": report.home.tolist(),
            "type_i": report.reserve.type_i.tolist(),
            "type_ii": float(report.reserve.type_ii),
            "clearances": report.reserve.clearances.tolist(),
            "reserve": float(report.reserve.smallest),
            "passive_joints": [vars(joint) for joint in report.passive],
            "jacobian": report.jacobian.matrix.tolist(),
            "condition_number": report.jacobian.condition,
            "condition_radius": report.jacobian.radius,
        },
        "singular_orientations": None if orientations is None else orientations.singular.tolist(),
        "reach": {
            "volume": report.volume.volume,
            "standard_error": report.volume.standard_error,
            "unit": report.volume.unit,
            "samples": report.volume.count,
            "box": report.volume.box.tolist(),
        },
        "cycle": {
            "scale": cycle.scale,
            "duration": cycle.duration,
            "across": cycle.across.tolist(),
            "up": cycle.up.tolist(),
            "turn": cycle.turn,
            "time": cycle.time.tolist(),
            "pose": cycle.pose.tolist(),
            "velocity": cycle.velocity.tolist(),
            "acceleration": cycle.acceleration.tolist(),
            "forces": report.forces.tolist(),
            "with_drives": report.driven,
            "overloads": list(report.sizing.overloads),
            "peak_forces": report.sizing.peak_forces.tolist(),
            "rms_forces": report.sizing.rms_forces.tolist(),
            "peak_speeds": report.sizing.peak_speeds.tolist(),
            "joints": {
                "least": ranges.least.tolist(),
                "greatest": ranges.greatest.tolist(),
                "limits": [None if limits is None else list(limits) for limits in ranges.limits],
                "within": ranges.within.tolist(),
            },
        },
        "motors": report.sizing.table().to_dicts(),
        "base_parameters": {
            "rank": report.base.rank,
            "of": len(report.base.columns),
            "names": list(report.base.names),
            "expressions": list(report.base.expressions()),
            "values": report.base.values().tolist(),
        },
        "costs": [vars(cost) for cost in report.costs],
    }
