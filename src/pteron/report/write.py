"""`write_report` and `write_motion_page`: a page and its numbers, written as files."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.atomic import checked_file, write_text, write_texts
from pteron.errors import OutputError, shorten
from pteron.json_values import fields_as_json, json_fields, json_text
from pteron.manipulator import RobotLike, as_manipulator
from pteron.manipulator.variants import elbows_of

if TYPE_CHECKING:
    from pteron.playback import Given
    from pteron.report.contents import Report

_WAY = "across up turn"
"""Attributes of the standard cycle that other motions lack."""

_PAGES = (".html", ".htm")
"""Endings of pages."""


def write_report(robot: RobotLike, folder: str | Path, *, motion: Given | None = None) -> Path:
    """Write the report on a machine: `report.html`, a self-contained page.

    `report.json` beside it holds the numbers. Each file is written whole or not at all, and the
    folder is made last.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    folder : str or path
        Where to write; made if it is missing.
    motion : Motion, Simulation, Table, str or path, optional
        The motion that the page shows, with the forces that the drives must give for it, in place
        of the standard pick-and-place cycle; see `pteron.playback.playback`.

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
        If the machine is singular at every pose, or becomes so in the motion.
    DataError, UnreachablePose
        If the motion cannot be read, or the machine cannot do it; the message says in which row,
        and which leg.
    """
    robot = as_manipulator(robot)
    # Matplotlib, SciPy and SymPy are behind these; the table of the paper needs none of them.
    from pteron.playback import playback
    from pteron.report.contents import contents
    from pteron.report.page import page

    target = checked_folder(folder)
    report = contents(robot, None if motion is None else playback(robot, motion))
    report_json = json_text(numbers(report))
    return write_texts(target, {"report.html": page(report), "report.json": report_json})[0]


def write_motion_page(robot: RobotLike, motion: Given, path: str | Path) -> Path:
    """Write a page that shows a motion: the machine in 3-D, its joints and drives.

    The page needs no other file or network. It is written whole or not at all.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    motion : Motion, Simulation, Table, str or path
        What it does: from Python, or a file with a table of the motion, of its joints, or a log;
        see `pteron.playback.playback`. Forces that come with it are shown; else
        those that the drives must give.
    path : str or path
        The page, whose name ends in .html; its folder must be there.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OutputError
        If the page cannot be written.
    DataError, UnreachablePose, SingularPose
        If the motion cannot be read, or the machine cannot do it; the message says in which row,
        and which leg.

    Examples
    --------
    >>> import pteron, tempfile
    >>> from pathlib import Path
    >>> from pteron.motion import pick_and_place
    >>> from pteron.report import write_motion_page
    >>> robot = pteron.load("tripteron")
    >>> cycle = pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     page = write_motion_page(robot, cycle, Path(folder) / "cycle.html")
    ...     page.stat().st_size < 1_000_000
    True
    """
    from pteron.playback import playback
    from pteron.report.motion_page import motion_page

    robot, target = as_manipulator(robot), checked_page(path)
    return write_text(target, motion_page(robot, playback(robot, motion)))


def checked_page(path: str | Path) -> Path:
    """Return a page's file after a check, without side effects, that it can be written.

    Raises
    ------
    OutputError
        If its name has another ending, it is a folder, or its folder is missing or closed.
    """
    target = Path(path)
    if target.suffix.lower() not in _PAGES:
        raise OutputError(
            f"{shorten(str(path), bare=True) or 'the name is empty'}: a page is written, whose "
            "name ends in .html"
        )
    checked_file(target)
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            return target
    except OSError as error:
        raise OutputError(f"{target}: cannot be written ({error.strerror or error})") from None


def checked_folder(path: str | Path) -> Path:
    """Return a folder after a check, without side effects, that it can be written."""
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


def checked_output(path: Path, sources: Iterable[str | Path]) -> Path:
    """Return the path of a model file, checked to replace no input and no description of a log.

    Raises
    ------
    OutputError
        If it is one.
    """
    for source in map(Path, sources):
        if source.resolve() == path.resolve():
            raise OutputError(f"{path}: would replace a file that is read; give another folder")
        if source.with_suffix(".toml").resolve() == path.resolve():
            raise OutputError(
                f"{path}: would be taken for the description of {source.name}; give another folder"
            )
    return path


def comment_lines(lines: Iterable[str]) -> str:
    """Return lines as comments at the head of a TOML file, which forbids control characters."""
    clean = ("".join(c if c.isprintable() else " " for c in line) for line in lines)
    return "".join(f"# {' '.join(line.split())}\n" for line in clean) + "#\n"


def numbers(report: Report) -> dict[str, Any]:
    """Return the numbers of a report as plain data in SI units and radians."""
    robot, volume, orientations = report.robot, report.volume, report.orientations
    return {
        "robot": robot.name,
        "motion": robot.platform.motion,
        **json_fields(coordinates=robot.coordinates),
        "joints": [vars(leg.joint) for leg in robot.legs],
        "drives": [asdict(leg.drive) if leg.drive else None for leg in robot.legs],
        "elbows": list(elbows_of(robot)),
        **json_fields(gravity=robot.gravity),
        **json_fields(tool=robot.platform.tool),
        **json_fields(doubts=report.doubts),
        "home": _home_numbers(report),
        "singular_orientations": None if orientations is None else orientations.singular.tolist(),
        "reach": volume
        and json_fields(
            volume=volume.volume,
            standard_error=volume.standard_error,
            unit=volume.unit,
            samples=volume.count,
            box=volume.box,
        ),
        "largest_tilt": report.tilt,
        "cycle": _cycle_numbers(report),
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


def _home_numbers(report: Report) -> dict[str, Any]:
    """Return the numbers at the home pose: margins, passive joints and the Jacobian."""
    return {
        "pose": report.home.tolist(),
        **json_fields(
            type_i=report.margins.type_i,
            type_ii=report.margins.type_ii,
            clearances=report.margins.joints,
            reserve=report.margins.least,
        ),
        "passive_joints": [vars(joint) for joint in report.passive],
        **json_fields(jacobian=report.jacobian.matrix, condition_number=report.jacobian.condition),
        "condition_radius": report.jacobian.radius,
    }


def _cycle_numbers(report: Report) -> dict[str, Any]:
    """Return the numbers of the cycle: its motion, forces, overloads and joints."""
    cycle, sizing, standard = report.cycle, report.sizing, report.standard
    return {
        "standard": standard is not None,
        "source": report.source or None,
        "scale": None if standard is None else standard.scale,
        "duration": cycle.duration,
        **(fields_as_json(standard, _WAY) if standard else dict.fromkeys(_WAY.split())),
        **json_fields(
            time=cycle.time,
            pose=cycle.pose,
            velocity=cycle.velocity,
            acceleration=cycle.acceleration,
        ),
        **json_fields(forces=report.forces, with_drives=report.has_drives),
        **json_fields(
            overloads=sizing.overloads,
            peak_forces=sizing.peak_forces,
            rms_forces=sizing.rms_forces,
            peak_speeds=sizing.peak_speeds,
        ),
        "joints": json_fields(
            least=report.joints.least,
            greatest=report.joints.greatest,
            limits=report.joints.limits,
            within=report.joints.within,
        ),
    }
