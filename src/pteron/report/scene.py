"""What the moving picture of a page needs: the joints' positions in each of its frames."""

from __future__ import annotations

from typing import Any

import numpy as np

from pteron.kernels import Array
from pteron.plots import outline
from pteron.report.contents import Report

__all__ = ["FRAMES", "scene"]

FRAMES = 120
"""Of the moving picture; it repeats, so that the cycle's last sample, its first, is left out."""

_DECIMALS = 6


def scene(report: Report) -> dict[str, Any]:
    """Return the machine and its frames as plain lists: m, rad, s and N, in the base frame."""
    cycle, points = report.cycle, report.points
    step = (len(cycle.time) - 1) // FRAMES
    frames = slice(0, FRAMES * step, step)
    gravity = np.array(report.robot.gravity)
    return {
        "up": _plain(cycle.up),
        "gravity": bool(gravity.any()),
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
