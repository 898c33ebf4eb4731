"""The room of a machine over its workspace: its cell, what is kept out of, and links that touch."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from pteron.design.choosing.job import Job
from pteron.design.choosing.kinds import slides
from pteron.equations.clearance import meetings, squared_distance
from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator

_STEPS = 6
"""Points along a link at which it is outside of keep-out boxes."""

_SPARE = 1e-3
"""Metres by which links are farther apart in a search than is asked at last."""

_CLOSE = 0.01
"""Metres of clearance whose lack counts as much as another bound missed by the whole."""

Misses = dict[str, tuple[float, str]]
"""By how much bounds are missed, as a share of them, and in words."""


class Room:
    """The room that a job leaves machines of a kind."""

    def __init__(self, job: Job, robot: Manipulator) -> None:
        self._job, self._robot = job, robot

    def judged(
        self, robot: Manipulator, poses: Array, middle: Array
    ) -> tuple[dict[str, float], Misses]:
        """Return the sizes of a machine at poses (N, m), m, and what it misses.

        `middle` is the pose with the tool in the middle of the workspace.
        """
        cell, floor = self._job.cell, self._job.floors.clearance
        points = np.asarray(numeric(robot, "joint_points")(poses)[0])
        center = tool_places(robot, middle[None])[0]
        tools = tool_places(robot, poses)
        flat = np.vstack([points.reshape(-1, 3), tools]) - center
        flat = flat[np.isfinite(flat).all(axis=1)]
        low, high = flat.min(axis=0) - cell.margin, flat.max(axis=0) + cell.margin
        width, depth, height = map(float, high - low)
        figures = {"footprint": width * depth, "width": width, "depth": depth, "height": height}
        most = dict(zip(("width", "depth"), cell.footprint or (np.inf, np.inf), strict=True))
        most["height"] = cell.height or np.inf
        found: Misses = {
            name: (figures[name] / m - 1.0, f"{name} {figures[name]:.4g} m, at most {m:g} m asked")
            for name, m in most.items()
            if figures[name] > m
        }
        clear = self._clearance(robot, poses, points)
        if clear < floor + _SPARE:
            asked = f"at least {1e3 * floor:g} mm asked, and {1e3 * _SPARE:g} mm to spare"
            told = f"clearance {1e3 * clear:.3g} mm, {asked}"
            found["clearance"] = (floor + _SPARE - clear) / _CLOSE, told
        found |= self._outside(low, high)
        found |= self._inside(points - center)
        return figures, found

    def _outside(self, low: Array, high: Array) -> Misses:
        cell, center = self._job.cell, np.array(self._job.workspace.center or (0.0, 0.0, 0.0))
        if cell.low is None or cell.high is None:
            return {}
        beyond = float(np.maximum(cell.low - (center + low), center + high - cell.high).max())
        return {"cell": (beyond, f"parts {beyond:.3g} m outside the cell")} if beyond > 0.0 else {}

    def _inside(self, points: Array) -> Misses:
        center = np.array(self._job.workspace.center or (0.0, 0.0, 0.0))
        ends = np.linspace(0.0, 1.0, _STEPS)[:, None, None]
        lines = points[..., :-1, :][..., None, :, :] + center
        lines = lines + ends * np.diff(points, axis=-2)[..., None, :, :]
        depths = [
            float(np.nanmax(np.minimum(lines - box.low, box.high - lines).min(axis=-1)))
            for box in self._job.keep_out
        ]
        depth = max(depths, default=-np.inf) + self._job.cell.margin
        return (
            {"keep-out": (depth, f"parts {depth:.3g} m inside a keep-out box")}
            if depth > 0.0
            else {}
        )

    def _clearance(self, robot: Manipulator, poses: Array, points: Array) -> float:
        """Return the least distance of bodies, m; `points` are those of the joints at the poses.

        Guides, whose ends a program of many machines does not know, are measured to the links of
        other legs.
        """
        radii, found = robot.radii, [np.inf]
        assert radii is not None  # every design has them
        known = np.asarray(numeric(robot, "least_clearances")(poses)[0])
        for (a, b), values in zip(self._meetings, known.reshape(len(poses), -1).T, strict=True):
            found.append(values.min() - getattr(radii, a) - getattr(radii, b))
        thick = radii.guide + max(radii.upper, radii.lower)
        for i, low, high in _guides(robot):
            others = np.delete(points, i, axis=-3)
            starts, ends = others[..., :-1, :].reshape(-1, 3), others[..., 1:, :].reshape(-1, 3)
            guide = (np.tile(end[:, None], len(starts)) for end in (low, high))
            squares = np.array(_squared_distances()(*guide, starts.T, ends.T))
            found.append(float(np.sqrt(np.nanmin(squares))) - thick)
        return float(min(found))

    @cached_property
    def _meetings(self) -> list[tuple[Any, Any]]:
        """Kinds of bodies that may meet, but for guides."""
        return meetings(self._robot)


def tool_places(robot: Manipulator, poses: Array) -> Array:
    """Return the places (N, 3) of the tool's centre point at poses (N, m)."""
    places, axes = robot.platform.at(poses)
    return np.asarray(places + np.array(robot.platform.tool) @ axes)


def _guides(robot: Manipulator) -> Iterator[tuple[int, Array, Array]]:
    """Yield the legs whose joints slide on guides, and the guides' ends."""
    for i, leg in enumerate(robot.legs):
        if slides(leg) and leg.limits is not None and leg.joint_axis is not None:
            r, e = np.array(leg.guide_point), np.array(leg.joint_axis)
            yield i, r + leg.limits[0] * e, r + leg.limits[1] * e


@lru_cache(maxsize=1)
def _squared_distances() -> ca.Function:
    """Return the function of the ends of two segments that gives their squared distance."""
    p, p_end, q, q_end = (ca.SX.sym(name, 3) for name in ("p", "p_end", "q", "q_end"))
    square = squared_distance((p, p_end), (q, q_end))
    return ca.Function("squared_distance", [p, p_end, q, q_end], [square])
