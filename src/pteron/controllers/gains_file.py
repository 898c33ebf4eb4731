"""Gains in a file: `write_gains` and `read_gains`, a controller as TOML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from pteron.atomic import write_text
from pteron.controllers.adaptive import Adaptive
from pteron.controllers.computed_torque import ComputedTorque
from pteron.controllers.controller import Controller
from pteron.controllers.feed_forward_pd import FeedForwardPD
from pteron.controllers.pd_gravity import PDGravity
from pteron.errors import DataError, shorten
from pteron.manipulator import RobotLike, as_manipulator
from pteron.manipulator.machine_record import expect_machine, machine_record
from pteron.toml import read_toml

_KINDS: dict[str, type[Controller]] = {
    "pd": PDGravity,
    "feed-forward": FeedForwardPD,
    "computed-torque": ComputedTorque,
    "adaptive": Adaptive,
}
"""Names of the controllers in files, as on the command line."""

_ABOUT = ("controller", "robot", "joints", "margins", "machine")
"""Keys that are no numbers of the controller."""

_IDENTITY = ("name", "layout", "topology", "geometry")
"""Keys of the table `machine` but the dimensions."""


def gains_text(
    robot: RobotLike, controller: Controller, margins: Mapping[str, float] | None = None
) -> str:
    """Return a controller for a machine as TOML text, with margins as comments."""
    import tomlkit  # slow to load

    robot = as_manipulator(robot)
    kinds = {kind: name for name, kind in _KINDS.items()}
    entries: dict[str, Any] = {"controller": kinds[type(controller)], "robot": robot.name}
    entries["joints"] = list(robot.joint_names)
    numbers = {name: getattr(controller, name) for name in _numbers(type(controller))}
    if not isinstance(controller, Adaptive):
        n = robot.joint_count
        gains = controller.gains(robot)
        numbers |= {"proportional": gains[:n].tolist(), "derivative": gains[n : 2 * n].tolist()}
    entries |= {
        name: list(setting) if isinstance(setting, tuple) else setting
        for name, setting in numbers.items()
        if setting is not None
    }
    lines = [f"{name} = {tomlkit.item(setting).as_string()}" for name, setting in entries.items()]
    if margins:
        lines += ["", "[margins]  # the least anywhere: factor, rad, s and the disk margin"]
        lines += [
            f"{name} = {tomlkit.item(setting).as_string()}" for name, setting in margins.items()
        ]
    record = machine_record(robot)
    lines += ["", "[machine]  # compared with the machine that the gains are given to"]
    lines += [f"{name} = {tomlkit.item(record[name]).as_string()}" for name in _IDENTITY]
    lines += ["", "[machine.dimensions]"]
    lines += [f'"{name}" = {dimension}' for name, dimension in record["dimensions"].items()]
    return "\n".join(lines) + "\n"


def write_gains(robot: RobotLike, controller: Controller, path: str | Path) -> Path:
    """Write a controller for a machine as a TOML file, for `read_gains`.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    text = gains_text(as_manipulator(robot), controller)
    return write_text(Path(path), text)


def read_gains(robot: RobotLike, path: str | Path) -> Controller:
    """Return the controller stored in a file of gains; raise if it is for another machine.

    `pteron tune`, `write_gains` or a person may have written it. Its keys are `controller`, one of
    pd, feed-forward, computed-torque and adaptive, and the fields of the controller's class:
    `period`, `bandwidth`, `damping`, `proportional`, `derivative`.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine that it is for.
    path : str or path
        The file.

    Returns
    -------
    Controller

    Raises
    ------
    DataError
        If the file is not there, has other keys or numbers, or is for another machine: of other
        joints, of another topology, or with a dimension that differs by more than 1 %.
    """
    robot = as_manipulator(robot)
    record = read_toml(path, DataError, "there is no such file; pteron tune writes one")
    kind = _KINDS.get(str(record.get("controller")))
    if kind is None:
        raise DataError(
            f"{path}: controller: {shorten(record.get('controller'))} given, one of "
            f"{', '.join(_KINDS)} expected"
        )
    joints = record.get("joints", list(robot.joint_names))
    if joints != list(robot.joint_names):
        raise DataError(
            f"{path}: its joints are {shorten(joints)}, of {robot.name} they are "
            f"{' '.join(robot.joint_names)}; tune this machine"
        )
    expect_machine(record.get("machine"), robot, path)
    numbers = {key: number for key, number in record.items() if key not in _ABOUT}
    allowed = _numbers(kind)
    unknown = [key for key in numbers if key not in allowed]
    if unknown:
        raise DataError(f"{path}: {', '.join(unknown)}: unknown; {', '.join(allowed)} expected")
    try:
        controller = kind(**numbers)
        controller.gains(robot)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    return controller


def _numbers(kind: type[Controller]) -> list[str]:
    """Return the names of a controller class's fields that a file of gains holds."""
    return [field.name for field in fields(kind) if field.name != "motion"]
