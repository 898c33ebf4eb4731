"""`pteron check`: whether a file is a machine that can work."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from rich.markup import escape
from typer import Argument

from pteron.cli.arguments import Json
from pteron.cli.progress import spinner
from pteron.cli.robots import load_robot, signs
from pteron.cli.screen import show, show_json, table
from pteron.errors import ModelError, PteronError

if TYPE_CHECKING:
    from pteron.manipulator import Leg, Manipulator

__all__ = ["check"]


def check(
    file: Annotated[str, Argument(metavar="FILE", help="A machine's TOML file.")],
    json: Json = False,
) -> None:
    """Check a machine's file and say what the machine is.

    It fails if the file is not valid, if the machine is singular at every pose, or if no pose is
    in reach of all its legs.
    """
    robot = load_robot(file)
    try:
        with spinner(f"Looking where {robot.name} can work"):
            found = _findings(robot)
    except PteronError as error:
        # What the library says of a machine begins with its name; the user gave a file.
        message = str(error).removeprefix(f"{robot.name}: ")
        raise ModelError(f"{file}: {message}") from None
    if json:
        show_json(found)
    else:
        _show(robot, found)


def _findings(robot: Manipulator) -> dict[str, Any]:
    from pteron.kinematics import singular_orientations
    from pteron.workspace import home_pose, reserve

    singular = singular_orientations(robot).tolist()
    home = home_pose(robot)
    return {
        "name": robot.name,
        "motion": robot.platform.motion,
        "coordinates": list(robot.coordinates),
        "gravity": list(robot.gravity),
        "working_mode": signs(robot),
        "legs": [_leg(leg) for leg in robot.legs],
        "singular_orientations": singular,
        "home_pose": home.tolist(),
        "home_reserve": float(reserve(robot, home).smallest),
    }


def _leg(leg: Leg) -> dict[str, Any]:
    return {
        "direction": list(leg.direction),
        "slider_direction": list(leg.e),
        "upper_length": leg.upper_length,
        "lower_length": leg.lower_length,
        "elbow": leg.elbow,
        "slider_limits": list(leg.slider_limits) if leg.slider_limits else None,
    }


def _show(robot: Manipulator, found: dict[str, Any]) -> None:
    show(
        f"[bold]{escape(robot.name)}[/bold]: a {robot.platform.motion} machine with "
        f"{len(robot.legs)} legs, pose {' '.join(robot.coordinates)}, "
        f"working mode {signs(robot)}"
    )
    numbers = ("leg", "upper (m)", "lower (m)")
    made = table("leg", "direction", "upper (m)", "lower (m)", "slider (m)", numbers=numbers)
    for i, leg in enumerate(robot.legs, start=1):
        made.add_row(
            str(i),
            _vector(leg.direction),
            f"{leg.upper_length:g}",
            f"{leg.lower_length:g}",
            "no limits" if leg.slider_limits is None else "{:g} to {:g}".format(*leg.slider_limits),
        )
    show(made)
    turns = ", ".join(f"{math.degrees(angle):.4g}" for angle in found["singular_orientations"])
    show(
        f"Singular orientations: {turns} deg" if turns else "Singular orientations: none",
        f"Home pose: {_vector(found['home_pose'])}, reserve {found['home_reserve']:.2f} of 1",
        "[green]This machine can work.[/green]",
    )


def _vector(values: Any) -> str:
    return f"({', '.join(f'{round(value, 4) + 0.0:g}' for value in values)})"
