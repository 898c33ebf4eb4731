"""`pteron workspace --from`: how far a machine can go from a pose, and what stops it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from pteron.cli.motion_argument import given_pose
from pteron.cli.pose_ranges import pose_text
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import plain, table, warn
from pteron.errors import ModelError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.workspace import Box, Condition, Travel


def travel_result(
    robot: Manipulator, text: str, floors: Mapping[str, float], warnings: list[str]
) -> CommandResult:
    """Return the travel from a typed pose along each coordinate, the largest box, tilt and ball."""
    from pteron.kernels.functions import TYPE_II
    from pteron.workspace import conditions, largest_ball, largest_box, largest_tilt, travel

    pose = given_pose(robot, text, "--from")
    warn(warnings)
    type_ii = floors["type_ii"] or TYPE_II
    required = conditions(robot, type_i=floors["type_i"], type_ii=type_ii)
    box, tilt, radius = None, None, None
    with spinner(f"Proving how far {robot.name} can go"):
        travels = travel(robot, pose, given=required)
        with suppress(ModelError):  # nothing stops it in a direction
            box = largest_box(robot, pose, given=required) if robot.platform.lengths else None
        # Else it does not tilt to every side, or the level pose at this place cannot be used.
        with suppress(ModelError):
            tilt = largest_tilt(robot, pose, given=required).tilt
            radius = largest_ball(robot, pose, given=required).radius
    rows = list(zip(robot.coordinates, travels.low, travels.high, travels.stops, strict=True))
    record = {
        "robot": robot.name,
        "pose": travels.pose.tolist(),
        "floors": dict(floors),
        "travel": {
            name: {
                "low": _number(low),
                "high": _number(high),
                "stops": [None if stop is None else str(stop) for stop in stops],
            }
            for name, low, high, stops in rows
        },
        "box": box and dict(zip(robot.coordinates, box.box.T.tolist(), strict=True)),
        "tilt": tilt,
        "ball": radius,
        "proved": True,
        "warnings": warnings,
    }
    return CommandResult(record, _lines(robot, travels, box, tilt, radius))


def _number(travel: float) -> float | None:
    """Return a travel, or None where nothing stops it."""
    return float(travel) if math.isfinite(travel) else None


def _lines(
    robot: Manipulator, travels: Travel, box: Box | None, tilt: float | None, radius: float | None
) -> list[Any]:
    """Return the lines of a printout: pose, table of travels, largest box, tilt and ball."""
    places = zip(robot.coordinates, travels.pose.tolist(), strict=True)
    where = ", ".join(pose_text(name, q) for name, q in places)
    angles = robot.platform.angles
    rows = [
        (f"{sign}{name}", _travel_text(travel, name in angles), _stop_text(stop))
        for i, name in enumerate(robot.coordinates)
        for sign, travel, stop in zip(
            "-+", (travels.low[i], travels.high[i]), travels.stops[i], strict=True
        )
    ]
    lines: list[Any] = [
        f"[bold]{plain(robot.name)}[/bold] from {where}",
        "Proved travel along each coordinate, the others held:",
        table("towards", "travel", "what stops it", rows=rows, numbers=("travel",)),
    ]
    if box is not None:
        low, high = box.box - travels.pose
        spans = ", ".join(
            f"{name} {1e3 * low[i]:.4g} to +{1e3 * high[i]:.4g} mm"
            for i, name in enumerate(robot.coordinates)
            if name not in angles
        )
        held = ", the orientation held" if angles else ""
        lines.append(f"Largest box about it, proved{held}, from the pose: {spans}")
    if tilt is not None:
        lines.append(f"Tilt to every side at this place, proved: {math.degrees(tilt):.4g} deg")
    if radius is not None:
        lines.append(
            f"Largest ball of positions about it, level, proved: radius {1e3 * radius:.4g} mm"
        )
    return lines


def _travel_text(travel: float, is_angle: bool) -> str:
    """Return a travel with its unit: mm or degrees."""
    if not math.isfinite(travel):
        return "no end"
    return f"{math.degrees(travel):.4g} deg" if is_angle else f"{1e3 * travel:.4g} mm"


def _stop_text(stop: Condition | None) -> str:
    """Return what stops a travel, as text."""
    return "nothing" if stop is None else plain(str(stop))
