"""The report as one HTML page that needs nothing else: styles, script, pictures and data inside."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
from markupsafe import Markup, escape

import pteron
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import parameter_names, parameter_units
from pteron.plots import (
    forces_figure,
    outline,
    reach_figure,
    regularity_figure,
    robot_figure,
    svg,
)
from pteron.reduction import BaseParameters
from pteron.report.contents import Report
from pteron.report.typeset import expression, fixed, geometric, resource, template, triple

_FRAMES = 120
"""Frames of the moving picture; it repeats, so that the cycle's last sample is left out."""

_DECIMALS = 6

_LONGEST = 200
"""Characters of a sum that a person still reads; an oblique Quadrupteron's take thousands."""


def page(report: Report) -> str:
    """Return the page of a report, as HTML without any reference to another file or address."""
    robot = report.robot
    units = dict(zip(parameter_names(robot), parameter_units(robot), strict=True))
    made = template(
        "page.html.j2",
        degrees=lambda angle, places=1: fixed(float(np.degrees(angle)), places),
        mm=lambda metres, places=1: fixed(1e3 * float(metres), places),
        signed=lambda text: re.sub(r"(?<![\w.-])-(?=\d)", "\u2212", text),
        triple=triple,
        typeset=lambda text: escape(text).replace("J^-T", Markup("<b>J</b><sup>\u2212T</sup>")),
        zip=zip,
    )
    # JSON that cannot end the script element it stands in.
    data = json.dumps(scene(report), separators=(",", ":"), allow_nan=False)
    return made.render(
        report=report,
        robot=robot,
        cycle=report.cycle,
        legs=range(len(robot.legs)),
        figures=_figures(report),
        units=[units.get(name, "") for name in report.base.names],
        values=report.base.values(),
        symbols=in_symbols(report.base),
        version=pteron.__version__,
        style=resource("page.css"),
        script=resource("view.js"),
        scene=Markup(data.replace("<", "\\u003c")),
    )


def _figures(report: Report) -> dict[str, Any]:
    """Return the pictures as SVG: `robot`, `forces`, three of `reach`, and `regularity`."""
    robot, cycle, at = report.robot, report.cycle, report.orientations
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
    reach = []
    for cut in report.slices:
        title = f"Positions in reach in the {cut.plane[0]}-{cut.plane[1]} plane"
        figure = reach_figure(cut, path=path)
        reach.append(Markup(svg(figure, name=f"reach{cut.plane}", title=title)))
    regularity = None
    if at is not None:
        turns = cycle.pose[:, 3]
        used, home = (float(turns.min()), float(turns.max())), float(report.home[3])
        figure = regularity_figure(at.angles, at.regularity, at.singular, home=home, used=used)
        title = "Determinant of the Jacobian over the orientation"
        regularity = Markup(svg(figure, name="regularity", title=title))
    title = "Actuator forces over the pick-and-place cycle"
    return {
        "robot": Markup(svg(machine, name="robot", title=f"{robot.name} in its home pose")),
        "forces": Markup(svg(forces, name="forces", title=title)),
        "reach": reach,
        "regularity": regularity,
    }


def scene(report: Report) -> dict[str, Any]:
    """Return the machine and the frames of its motion as plain lists.

    Everything is in the base frame, in m, rad, s and N.
    """
    cycle, points = report.cycle, report.points
    step = (len(cycle.time) - 1) // _FRAMES
    frames = slice(0, _FRAMES * step, step)
    return {
        "up": _plain(cycle.up),
        "gravity": any(report.robot.gravity),
        "duration": round(cycle.duration, _DECIMALS),
        "rails": _plain(report.rails),
        "directions": _plain(np.array([leg.e for leg in report.robot.legs])),
        "outline": outline(report.home_points),
        "time": _plain(cycle.time[frames]),
        "pose": _plain(cycle.pose[frames]),
        "axes": _plain(points.axes[frames]),
        "sliders": _plain(points.sliders[frames]),
        "elbows": _plain(points.elbows[frames]),
        "platform": _plain(points.platform_points[frames]),
        "coordinates": _plain(points.coordinates[frames]),
        "forces": _plain(report.forces[frames]),
    }


def _plain(array: Array) -> Any:
    return (np.round(array, _DECIMALS) + 0.0).tolist()


def in_symbols(base: BaseParameters) -> dict[str, list[Any]] | None:
    """Return the base parameters in symbols, `sums`, and the symbols' values in m, `lengths`.

    None where they have none, or are too long.
    """
    try:
        lines = base.expressions(symbols=True)
    except ModelError:
        return None
    if max(map(len, lines)) > _LONGEST:
        return None
    used = set(re.findall(r"\b(?:l[ul]\d|s\d[xy])\b", " ".join(lines)))
    values = base.geometry_values.items()
    return {
        "sums": [geometric(expression(line)) for line in lines],
        "lengths": [(geometric(escape(name)), value) for name, value in values if name in used],
    }
