"""The pictures of a page, as SVG."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from pteron.plots import (
    forces_figure,
    reach_figure,
    regularity_figure,
    robot_figure,
    svg,
)
from pteron.report.contents import Report
from pteron.report.digits import fixed

__all__ = ["Figures", "figures"]


@dataclass(frozen=True)
class Figures:
    """The pictures; `regularity` is None for 3T."""

    robot: Markup
    forces: Markup
    reach: tuple[Markup, ...]
    regularity: Markup | None


def figures(report: Report) -> Figures:
    """Return the pictures of a report."""
    robot, cycle = report.robot, report.cycle
    gravity = np.array(robot.gravity)
    path = cycle.pose[: len(cycle.time) // 2 + 1, :3]
    machine = robot_figure(
        report.home_points,
        report.rails,
        gravity=gravity if gravity.any() else None,
        path=path,
        angle=f"φ = {fixed(float(np.degrees(report.home[3])), 0)}°" if robot.platform.turns else "",
    )
    forces = forces_figure(cycle.time, report.forces, turning_point=cycle.duration / 2.0)
    return Figures(
        _inline(svg(machine, name="robot", title=f"{robot.name} in its home pose")),
        _inline(svg(forces, name="forces", title="Actuator forces over the pick-and-place cycle")),
        tuple(
            _inline(
                svg(
                    reach_figure(cut, path=path),
                    name=f"reach{cut.plane}",
                    title=f"Positions in reach in the {cut.plane[0]}-{cut.plane[1]} plane",
                )
            )
            for cut in report.slices
        ),
        _regularity(report),
    )


def _regularity(report: Report) -> Markup | None:
    at, turns = report.orientations, report.cycle.pose[:, -1]
    if at is None:
        return None
    figure = regularity_figure(
        at.angles,
        at.regularity,
        at.singular,
        home=float(report.home[3]),
        used=(float(turns.min()), float(turns.max())),
    )
    return _inline(
        svg(figure, name="regularity", title="Determinant of the Jacobian over the orientation")
    )


def _inline(text: str) -> Markup:
    return Markup(text)
