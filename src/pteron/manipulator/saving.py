"""`save`: a manipulator written to a TOML file."""

from __future__ import annotations

from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from pteron.atomic import write_text
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.robot_like import RobotLike, as_manipulator


def save(robot: RobotLike, path: str | Path) -> Path:
    """Write a manipulator to a TOML file that `load` reads back without loss.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    path : str or path
        The file; it is replaced whole, or not at all.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    return write_text(path, text_of(as_manipulator(robot)))


def dumps(robot: RobotLike) -> str:
    """Return the text of a manipulator's file, as `save` writes it.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    str
        TOML, which `loads` reads back without loss.

    Examples
    --------
    >>> from pteron.manipulator import dumps
    >>> dumps("delta").splitlines()[2]
    'name = "delta"'
    """
    return text_of(as_manipulator(robot))


def to_dict(robot: RobotLike) -> dict[str, Any]:
    """Return the tables of a manipulator's file, as `from_dict` and `json` take them.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    dict
        Strings, numbers, lists and dictionaries, by the keys of a robot file.

    Examples
    --------
    >>> from pteron.manipulator import to_dict
    >>> to_dict("delta")["platform"]["motion"]
    '3T'
    """
    return document_of(as_manipulator(robot))


def text_of(robot: Manipulator) -> str:
    """Return the TOML text of a machine's file; equal machines have equal texts."""
    from pteron.manipulator.writing import robot_text

    return robot_text(document_of(robot))


def document_of(robot: Manipulator) -> dict[str, Any]:
    """Return the tables of a machine's file as a dictionary."""
    from pteron.manipulator.leg_tables import leg_items

    moving_platform = robot.platform
    platform: dict[str, Any] = {"motion": moving_platform.motion, "axis": moving_platform.axis}
    if moving_platform.x_axis is not None:
        platform["x_axis"] = moving_platform.x_axis
    if moving_platform.angle_order != "rpy":
        platform["angles"] = moving_platform.angle_order
    platform |= {"tool": moving_platform.tool, **asdict(moving_platform.inertia)}
    for name in ("slides", "limits", "bars", "geared", "center", "second_axis", "axis_offset"):
        if attribute := getattr(moving_platform, name):
            platform[name] = attribute
    radii = {} if robot.radii is None else {"radii": asdict(robot.radii)}
    legs = [{k: v for k, v in leg_items(leg).items() if v is not None} for leg in robot.legs]
    machine = {"name": robot.name, "gravity": robot.gravity, **radii}
    if robot.tools:
        machine["tools"] = [
            {k: v for k, v in asdict(tool).items() if v is not None} for tool in robot.tools
        ]
    if robot.home is not None:
        machine["home"] = {"pose": robot.home}
    if robot.distribution is not None:
        shares = asdict(robot.distribution).items()
        machine["distribution"] = {k: v for k, v in shares if v is not None}
    if robot.template is not None:
        template = asdict(robot.template)
        machine["template"] = {k: v for k, v in template.items() if v or k != "rider"}
    if robot.owner:
        machine["owner"] = dict(robot.owner)
    machine |= {"platform": platform, "legs": legs}
    tables: dict[str, Any] = _plain(machine)
    return tables


def _plain(content: Any) -> Any:
    """Return content converted for TOML: dataclasses to tables, tuples to lists."""
    if isinstance(content, dict):
        return {key: _plain(part) for key, part in content.items()}
    if isinstance(content, list | tuple):
        return [_plain(part) for part in content]
    return asdict(content) if is_dataclass(content) and not isinstance(content, type) else content
