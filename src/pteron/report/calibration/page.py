"""The HTML page of the report on a calibration: one file that needs no other."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

import pteron
from pteron.calibration import Calibration
from pteron.errors import ModelError, PteronError
from pteron.kernels import Array
from pteron.kinematics import random_poses
from pteron.plots import (
    differences_figure,
    measure_figure,
    row_residuals_figure,
    svg,
    tool_errors_figure,
)
from pteron.plots.canvas import nice_step
from pteron.report.calibration.values import notes, value_rows
from pteron.report.typeset import resource, significant, template
from pteron.workspace import home_pose, reach_slice
from pteron.workspace.reach_slices import slice_planes

_POINTS = 41
"""Points along each side of a slice."""

_ARROWS = 60
"""Poses at which the tool's error is drawn in space."""

_LEVELS = 6
"""Shades of a map, about."""

_FINE = 1e-4
"""Greatest error, m, of a map in micrometres."""


class ErrorMap(NamedTuple):
    """The tool's error on a slice, before and after, as SVG, with its greatest value as text."""

    plane: str
    before: Markup
    after: Markup
    greatest: list[str]
    units: list[str]


def page(result: Calibration) -> str:
    """Return the page as HTML without reference to another file."""
    made = template("calibration/page.html.j2", scaled=scaled)
    return made.render(
        result=result,
        robot=result.drawn,
        shown=result.observability,
        rows=value_rows(result),
        maps=error_maps(result),
        figures=_figures(result),
        notes=notes(result),
        version=pteron.__version__,
        style=resource("page.css") + resource("identification/page.css"),
    )


def scaled(value: float, kind: str) -> str:
    """Return an error of a kind of measurement with its unit."""
    return f"{significant(1e3 * value)} mrad" if kind == "angle" else length(value)


def length(value: float) -> str:
    """Return a length in mm, a small one in micrometres."""
    if abs(value) < _FINE:
        return f"{significant(1e6 * value)} µm"
    return f"{significant(1e3 * value)} mm"


def error_maps(result: Calibration) -> list[ErrorMap]:
    """Return the tool's errors on the slices through the home pose of a machine's lengths."""
    robot, home = result.drawn, home_pose(result.drawn)
    planes = slice_planes(robot)
    level = [plane for plane in planes if set(plane) <= set(robot.platform.lengths)]
    found = []
    for plane in (level or planes)[:3]:
        with suppress(ModelError):
            cut = reach_slice(robot, home, plane, points=_POINTS)
            before, after = result.errors(cut.poses.reshape(-1, robot.freedom))
            errors = np.linalg.norm(before, axis=-1), after
            reached = (cut.status == 0).ravel() & np.isfinite(errors[0]) & np.isfinite(errors[1])
            if not reached.any() or not errors[0][reached].max() > 0.0:
                continue
            drawn, units = [], []
            for error, when in zip(errors, ("before", "after"), strict=True):
                greatest = float(error[reached].max())
                factor, unit = (1e6, "µm") if greatest < _FINE else (1e3, "mm")
                values = np.where(reached, factor * error, np.nan).reshape(cut.status.shape)
                figure = measure_figure(cut, values, levels=levels(values))
                title = f"The tool's error {when} in the {'-'.join(plane)} plane, {unit}"
                drawn.append(svg(figure, name=f"{when}{''.join(plane)}", title=title))
                units.append(unit)
            most = tuple(length(float(error[reached].max())) for error in errors)
            found.append(ErrorMap("-".join(plane), drawn[0], drawn[1], list(most), units))
    return found


def levels(values: Array) -> list[float]:
    """Return round levels of a map, of which the first is below all of its values."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    step = nice_step(max((high - low) / _LEVELS, 1e-3 * high, 1e-12))
    first, last = int(np.floor(low / step)), int(np.ceil(high / step))
    return [step * k for k in range(first, last + 1)]


def _figures(result: Calibration) -> dict[str, Any]:
    fit, robot = result.fit, result.drawn
    kinds = [*["position"] * 3, *["angle"] * int(robot.platform.angular.sum())]
    residuals = row_residuals_figure(
        fit.residuals, [*kinds, "height", "distance"], fit.measured, fit.kept, result.noise
    )
    made: dict[str, Any] = {
        "residuals": svg(residuals, name="residuals", title="Residuals by row"),
        "machine": None,
        "arrows": None,
    }
    with suppress(PteronError):  # the found machine does not reach the drawn one's home
        figure = differences_figure(robot, result.robot)
        made["machine"] = svg(figure, name="machine", title="The machine drawn and found")
    poses = random_poses(robot, _ARROWS, seed=0)
    errors, _ = result.errors(poses)
    if np.abs(errors).max(initial=0.0, where=np.isfinite(errors)) > 0.0:
        place, axes = robot.platform.at(poses)
        tools = place + robot.platform.tool @ axes
        figure = tool_errors_figure(robot, tools, errors)
        made["arrows"] = svg(figure, name="arrows", title="The tool's errors as drawn, enlarged")
    return made
