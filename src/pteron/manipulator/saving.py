"""`save`: a manipulator written to a TOML file."""

from __future__ import annotations

from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from pteron.atomic import write_text
from pteron.manipulator.given import RobotLike, as_manipulator
from pteron.manipulator.manipulator import Manipulator


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


def text_of(robot: Manipulator) -> str:
    """Return the text of a manipulator's file; different machines have different texts."""
    from pteron.manipulator.writing import written

    return written(document_of(robot))


def document_of(robot: Manipulator) -> dict[str, Any]:
    """Return the contents of a manipulator's file."""
    from pteron.manipulator.leg_tables import leg_items

    own = robot.platform
    platform: dict[str, Any] = {"motion": own.motion, "axis": own.axis}
    if own.x_axis is not None:
        platform["x_axis"] = own.x_axis
    if own.angle_order != "rpy":
        platform["angles"] = own.angle_order
    platform |= {"tool": own.tool, **asdict(own.inertia)}
    for name in ("slides", "limits", "bars", "geared", "center", "second_axis"):
        if given := getattr(own, name):
            platform[name] = given
    radii = {} if robot.radii is None else {"radii": asdict(robot.radii)}
    legs = [{k: v for k, v in leg_items(leg).items() if v is not None} for leg in robot.legs]
    machine = {"name": robot.name, "gravity": robot.gravity, **radii}
    if robot.tools:
        machine["tools"] = [
            {k: v for k, v in asdict(tool).items() if v is not None} for tool in robot.tools
        ]
    if robot.home is not None:
        machine["home"] = {"pose": robot.home}
    machine |= {"platform": platform, "legs": legs}
    found: dict[str, Any] = _plain(machine)
    return found


def _plain(value: Any) -> Any:
    """Return a value as TOML has it: a body as a table, a tuple as a list."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
