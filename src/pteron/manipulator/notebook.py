"""A machine as a notebook shows it: a table of its legs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pteron.html_table import Cell, Column, html_table

if TYPE_CHECKING:
    from pteron.legs import LegKind


def machine_table(robot: Any) -> str:
    """Return a machine's legs as an HTML table under a line on its platform."""
    driven = any(leg.drive for leg in robot.legs)
    columns = [
        *(Column("leg", "number"), Column("kind"), Column("joint"), Column("limits")),
        *(Column("guide point, m"), Column("platform point, m"), Column("masses, kg")),
        *([Column("drive")] if driven else []),
    ]
    names = robot.joint_names
    rows = []
    for i, (leg, name) in enumerate(zip(robot.legs, names, strict=True), start=1):
        masses = " + ".join(
            f"{dict(zip(body.kinds, body.values, strict=True))['m']:.4g}"
            for body in leg.bodies.values()
        )
        cells: list[Cell] = [i, leg.type, f"{leg.joint.noun} {name}", _limits(leg)]
        cells += [_numbers(leg.guide_point), _numbers(leg.platform_point), masses]
        rows.append([*cells, *([_drive(leg)] if driven else [])])
    platform = robot.platform
    gravity = f"gravity {_numbers(robot.gravity)} m/s\u00b2" if any(robot.gravity) else "no gravity"
    about = (
        f"{platform.motion} platform of {platform.inertia.mass:.4g} kg, pose "
        f"({', '.join(robot.coordinates)}), {gravity}"
    )
    return html_table(robot.name, about, columns, rows)


def _numbers(components: Sequence[float]) -> str:
    """Return numbers as text with four digits, commas and true minus signs."""
    return ", ".join(f"{component:.4g}" for component in components).replace("-", "\u2212")


def _limits(leg: LegKind) -> str:
    """Return a leg's joint limits as text with the unit, or "none"."""
    if leg.limits is None:
        return "none"
    low, high = (f"{limit:.4g}".replace("-", "\u2212") for limit in leg.limits)
    return f"{low} to {high} {leg.joint.unit}"


def _drive(leg: LegKind) -> str:
    """Return as text the force and speed limit of a leg's drive."""
    drive, joint = leg.drive, leg.joint
    if drive is None:
        return "none"
    limits = ((drive.max_force, joint.force_unit), (drive.max_speed, f"{joint.unit}/s"))
    limit_texts = [f"{limit:.4g} {unit}" for limit, unit in limits if limit is not None]
    return f"up to {', '.join(limit_texts)}" if limit_texts else "without limits"
