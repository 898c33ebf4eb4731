"""`pteron catalog`: the machines that come with Pteron."""

from __future__ import annotations

from pteron.cli.arguments import Json
from pteron.cli.robots import signs
from pteron.cli.screen import show, show_json, table

__all__ = ["catalog"]


def catalog(json: Json = False) -> None:
    """List the machines that come with Pteron."""
    from pteron.manipulator import catalog as names
    from pteron.manipulator import load

    machines = [load(name) for name in names()]
    if json:
        show_json(
            [
                {
                    "name": robot.name,
                    "motion": robot.platform.motion,
                    "coordinates": list(robot.coordinates),
                    "legs": len(robot.legs),
                    "working_mode": signs(robot),
                }
                for robot in machines
            ]
        )
        return
    made = table("name", "motion", "pose", "legs", "elbows", numbers=("legs",))
    for robot in machines:
        made.add_row(
            robot.name,
            robot.platform.motion,
            " ".join(robot.coordinates),
            str(len(robot.legs)),
            signs(robot),
        )
    show(made)
