"""The HTML page of the report on a calibration: one file that needs no other."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from pteron.calibration import Calibration
from pteron.calibration.measurements import error_unit
from pteron.errors import ModelError, PteronError
from pteron.kernels import Array
from pteron.kinematics import random_poses
from pteron.plots import (
    differences_figure,
    measure_figure,
    row_residuals_figure,
    tool_errors_figure,
)
from pteron.plots.ticks import nice_step
from pteron.report.calibration.firmware import FirmwareFit
from pteron.report.calibration.values import next_steps, notes, value_rows
from pteron.report.typeset import significant, template
from pteron.workspace import home_pose, reach_slice
from pteron.workspace.reach_slices import slice_planes

_POINTS = 41
"""Points along each side of a slice."""

_ARROWS = 60
"""Poses at which the tool's error is drawn in space."""

_LEVELS = 6
"""Shades of a map, about."""

MOST_ROWS = 12
"""Values that are in sight; those that changed less are folded."""


class ErrorMap(NamedTuple):
    """The tool's error on a slice, before and after, with its greatest value as text.

    `after` is None where all of it has the lightest shade.
    """

    plane: tuple[str, ...]
    before: Figure
    after: Figure | None
    greatest: list[str]
    unit: str


def page(
    calibration: Calibration, *, written: bool = True, firmware: FirmwareFit | None = None
) -> str:
    """Return the page as self-contained HTML; `written` says whether robot.toml is written."""
    document = template("calibration/page.html.j2", error_text=error_text)
    return document.render(
        result=calibration,
        robot=calibration.drawn,
        shown=calibration.observability,
        rows=value_rows(calibration),
        maps=error_maps(calibration),
        figures=_figures(calibration),
        notes=notes(calibration),
        written=written,
        firmware=firmware,
        most=MOST_ROWS,
        next_steps=next_steps(calibration, written=written, printer=firmware is not None),
    )


def error_text(error: float, kind: str) -> str:
    """Return an error of a kind of measurement with its unit, in the page's format."""
    return f"{significant(1e3 * error)} {error_unit(kind)}"


def error_maps(calibration: Calibration) -> list[ErrorMap]:
    """Return the tool's errors on the slices through the home pose of a machine's lengths.

    Where the platform turns only they are the angles', on the slices of these. All maps have the
    same levels, so that they compare.
    """
    robot, home = calibration.drawn, home_pose(calibration.drawn)
    lengths = set(robot.platform.lengths)
    kind = "position" if lengths else "angle"
    planes = slice_planes(robot)
    level = [plane for plane in planes if set(plane) <= lengths]
    errors_of_slices = []
    for plane in (level or planes)[:3]:
        with suppress(ModelError):
            cut = reach_slice(robot, home, plane, points=_POINTS)
            poses = cut.poses.reshape(-1, robot.freedom)
            drawn_errors, calibrated_errors = calibration.errors(poses)
            errors = np.linalg.norm(drawn_errors, axis=-1), calibrated_errors
            reached = (cut.status == 0).ravel() & np.isfinite(errors[0]) & np.isfinite(errors[1])
            if not reached.any() or not errors[0][reached].max() > 0.0:
                continue
            errors_on_slice = [
                np.where(reached, 1e3 * error, np.nan).reshape(cut.status.shape) for error in errors
            ]
            errors_of_slices.append((plane, cut, errors_on_slice))
    if not errors_of_slices:
        return []
    shades = levels(np.concatenate([e.ravel() for _, _, both in errors_of_slices for e in both]))
    maps = []
    for plane, cut, errors_on_slice in errors_of_slices:
        greatest = [error_text(1e-3 * float(np.nanmax(error)), kind) for error in errors_on_slice]
        before, after = errors_on_slice
        is_shaded = np.nanmax(after) > shades[1]
        drawn = measure_figure(cut, after, levels=shades) if is_shaded else None
        shown = measure_figure(cut, before, levels=shades)
        maps.append(ErrorMap(tuple(plane), shown, drawn, greatest, error_unit(kind)))
    return maps


def levels(errors: Array) -> list[float]:
    """Return round contour levels of errors on a map, the first below all of them."""
    low, high = float(np.nanmin(errors)), float(np.nanmax(errors))
    step = nice_step(max((high - low) / _LEVELS, 1e-3 * high, 1e-12))
    first, last = int(np.floor(low / step)), int(np.ceil(high / step))
    return [step * k for k in range(first, last + 1)]


def _figures(calibration: Calibration) -> dict[str, Any]:
    """Return the figures of the page by name; None for those that the machine does not allow."""
    fit, robot = calibration.fit, calibration.drawn
    rows = calibration.measurements.kind_of.tolist()
    residuals = row_residuals_figure(fit.residuals, rows, fit.measured, fit.kept, calibration.noise)
    figures: dict[str, Any] = {"residuals": residuals, "machine": None, "arrows": None}
    with suppress(PteronError):  # the found machine does not reach the drawn one's home
        figures["machine"] = differences_figure(robot, calibration.robot)
    if robot.platform.lengths:
        poses = random_poses(robot, _ARROWS, seed=0)
        errors, _ = calibration.errors(poses)
        if np.abs(errors).max(initial=0.0, where=np.isfinite(errors)) > 0.0:
            place, axes = robot.platform.placement(poses)
            tools = place + robot.platform.tool @ axes
            figures["arrows"] = tool_errors_figure(robot, tools, errors)
    return figures
