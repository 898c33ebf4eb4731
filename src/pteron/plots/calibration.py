"""Pictures of a calibration: the machine as designed and as found, the tool's errors, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion import JointPoints, joint_guides, joint_points
from pteron.motion.enlarged_points import enlarged_guides, enlarged_points, greatest_difference
from pteron.plots.canvas import INK, MUTED, PAPER, WARNING, blank, real_figure, stack, zero_line
from pteron.plots.leg_curves import LEG_COLORS
from pteron.plots.machine_axes import MachineAxes
from pteron.plots.machine_drawing import (
    Scene,
    draw_directions,
    draw_machine,
    draw_surroundings,
    rods,
    scene_of,
)
from pteron.plots.machine_figures import gravity_of, machine_figure
from pteron.plots.ticks import nice_step
from pteron.shapes import PoseLike
from pteron.workspace import home_pose

_SHOWN = 0.05
"""Least length to which the greatest difference is enlarged, as a share of the machine's size."""

_RESIDUALS = {
    "position": "position (mm)",
    "angle": "angles (mrad)",
    "closure": "closure (mm or mrad)",
}
"""Names of kinds of residuals with their units; others are in mm under their own names."""


def differences_figure(
    drawn: RobotLike,
    calibrated: RobotLike,
    pose: PoseLike | None = None,
    *,
    enlarge: float | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of a machine in colours over another in grey, their difference enlarged.

    Both bring the platform to the same pose.

    Parameters
    ----------
    drawn, calibrated : Manipulator, name or path
        Two machines with the same kinds of legs: the grey one, and the one whose joints are moved
        away from it.
    pose : array, shape (m,), optional
        m and rad; by default the home pose of the grey one.
    enlarge : float, optional
        How many times differences are enlarged; by default a round number at which the greatest is
        well seen. The picture says it.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If the machines have other kinds of legs.
    UnreachablePose
        If one of them does not reach the pose.

    Examples
    --------
    >>> import pteron
    >>> from dataclasses import replace
    >>> drawn = pteron.load("linear-delta")
    >>> first = replace(drawn.legs[0], lower_length=0.23)
    >>> found = replace(drawn, legs=(first, *drawn.legs[1:]))
    >>> figure = pteron.plots.differences_figure(drawn, found)
    """
    machine, other = as_manipulator(drawn), as_manipulator(calibrated)
    expect_alike(machine, other)
    shown = home_pose(machine) if pose is None else finite_rows(machine, pose, "pose").ravel()
    points, there = joint_points(machine, shown), joint_points(other, shown)
    guides = joint_guides(machine, shown)
    size = scene_of(points, guides, None).size
    times = enlargement(greatest_difference(points, there), size) if enlarge is None else enlarge
    moved = enlarged_points(points, there, times)
    scene = scene_of(points, guides, gravity_of(machine))
    far = scene_of(moved, enlarged_guides(guides, joint_guides(other, shown), times), None)
    sheet = _draw_in_grey(scene, points, f"differences {times:g} times enlarged", ax)
    for color, guide in zip(LEG_COLORS, far.guides, strict=False):
        sheet.line(guide.path, color, 1.6, raised=-0.2)
    draw_machine(sheet, far, moved)
    draw_directions(sheet, scene)
    sheet.fill()
    return sheet.figure


def tool_errors_figure(
    robot: RobotLike,
    places: Array,
    errors: Array,
    *,
    enlarge: float | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the machine in its home pose, the tool's errors drawn as enlarged lines.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    places, errors : array, shape (N, 3)
        Where the tool is asked to be, and from there to where it goes, m; NaN is left out.
    enlarge : float, optional
        How many times the errors are enlarged; by default as in `differences_figure`.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure
    """
    machine = as_manipulator(robot)
    shown = home_pose(machine)
    points, guides = joint_points(machine, shown), joint_guides(machine, shown)
    scene = scene_of(points, guides, gravity_of(machine))
    known = np.isfinite(errors).all(axis=-1)
    greatest = float(np.linalg.norm(errors[known], axis=-1).max(initial=0.0))
    times = enlargement(greatest, scene.size) if enlarge is None else enlarge
    remark = f"errors {times:g} times enlarged, the greatest {1e3 * greatest:.3g} mm"
    sheet = _draw_in_grey(scene, points, remark, ax)
    for place, error in zip(places[known], errors[known], strict=True):
        sheet.line(np.array([place, place + times * error]), WARNING, 1.3, raised=2.0)
        sheet.mark(place, WARNING, PAPER, 3.2, raised=2.1)
    draw_directions(sheet, scene)
    sheet.fill()
    return sheet.figure


def row_residuals_figure(
    residuals: Array,
    kinds: Sequence[str],
    measured: NDArray[np.bool_],
    sound: NDArray[np.bool_],
    noise: dict[str, float],
    *,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the residuals of measurements by row, with a panel for each kind.

    Parameters
    ----------
    residuals, measured : array, shape (N, K)
        m or rad, and which of them count.
    kinds : sequence of str, K
        "position", "angle", "height" or "distance".
    sound : array of bool, shape (N,)
        Rows that are no outliers; the others are red rings.
    noise : dict
        Standard deviation by kind, m or rad: the band is two of them to each side.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure
    """
    named = np.array(kinds)
    shown = [kind for kind in noise if measured[:, named == kind].any()]
    labels = [_RESIDUALS.get(kind, f"{kind} (mm)") for kind in shown]
    figure = blank(5.6, 0.8 + 1.7 * len(shown), ax)
    rows = np.arange(1, len(residuals) + 1)
    for kind, axes in zip(shown, stack(figure, "row", labels), strict=True):
        zero_line(axes)
        band = 2e3 * noise[kind]
        axes.axhspan(-band, band, color=MUTED, alpha=0.16, linewidth=0.0)
        for column in np.flatnonzero(named == kind):
            for chosen, face, edge, size in (
                (sound, INK, INK, 2.6),
                (~sound, "none", WARNING, 5.0),
            ):
                here = chosen & measured[:, column]
                (marks,) = axes.plot(
                    rows[here], 1e3 * residuals[here, column], "o", markersize=size
                )
                marks.set(markerfacecolor=face, markeredgecolor=edge)
        axes.set_xlim(0.5, len(rows) + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    return real_figure(figure)


def enlargement(difference: float, size: float) -> float:
    """Return a round factor that makes a difference, m, visible in a picture of a size, m."""
    return nice_step(_SHOWN * size / difference) if difference > 1e-9 * size else 1.0


def expect_alike(robot: Manipulator, other: Manipulator) -> None:
    """Raise DataError if two machines differ in more than numbers."""
    if [leg.type for leg in robot.legs] != [leg.type for leg in other.legs] or (
        robot.coordinates != other.coordinates
    ):
        raise DataError(
            f"{other.name} is no machine to compare with {robot.name}: it has other legs, or its "
            "platform moves otherwise"
        )


def _draw_in_grey(
    scene: Scene, points: JointPoints, title: str, ax: Axes | SubFigure | None
) -> MachineAxes:
    """Return axes of a new figure with a machine in grey, below a title."""
    sheet = machine_figure(scene, title, ax)
    draw_surroundings(sheet, scene)
    for line, bar in zip(points.links, points.bars, strict=True):
        for ends in (*pairwise(line[:-1]), *rods(line, bar, scene.size)):
            sheet.line(np.array(ends), MUTED, 2.2, raised=-0.5)
    for part in points.parts:
        for corner in part.corners:
            sheet.line(np.array([part.hub, corner]), MUTED, 2.2, raised=-0.5)
    return sheet
