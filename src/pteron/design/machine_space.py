"""The space that a machine takes over its workspace: cell, keep-out boxes, clearances."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from pteron.design.job import Job
from pteron.design.kinds import slides
from pteron.equations.clearance import meetings, squared_distance
from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator

_HALVINGS = 24
"""Steps of the ternary search for a line's deepest point in a box; each keeps 2/3."""

_SPARE = 1e-3
"""Additional clearance of a search over the requirement, m."""

TIGHT = 2e-3
"""Length by which a search shrinks the cell and grows keep-out boxes, m."""

_CLOSE = 0.01
"""Missing clearance, m, that costs as much as a bound violated by 100 %."""

Misses = dict[str, tuple[float, str]]
"""By how much bounds are missed, as a share of them, and in words."""


class MachineSpace:
    """The space that a task allows machines of a kind."""

    def __init__(self, job: Job, robot: Manipulator) -> None:
        self._job, self._robot = job, robot

    def evaluate(
        self, robot: Manipulator, poses: Array, middle: Array
    ) -> tuple[dict[str, float], Misses]:
        """Return a machine's extents at poses (N, m), m, by name, and the space limits it exceeds.

        `middle` is the pose with the tool in the middle of the workspace.
        """
        floor = self._job.floors.clearance
        points = np.asarray(numeric(robot, "joint_points")(poses)[0])
        figures, misses = self.judge_extents(
            self._extents_of_points(robot, poses, points, middle).min(axis=0), TIGHT
        )
        clear = self._clearance(robot, poses, points)
        if clear < floor + _SPARE:
            requirement = f"at least {1e3 * floor:g} mm asked, and {1e3 * _SPARE:g} mm to spare"
            words = f"clearance {1e3 * clear:.3g} mm, {requirement}"
            misses["clearance"] = (floor + _SPARE - clear) / _CLOSE, words
        return figures, misses

    def extents(
        self, robot: Manipulator, poses: Array, middle: Array, fixed: Array | None = None
    ) -> Array:
        """Return a machine's extents at poses (N, 6 + boxes), from the tool's middle, m.

        The columns are the least coordinates, the negated greatest ones, and the distance to each
        keep-out box. The box (2, 3) around `fixed` parts, such as motors, is within the extents.
        """
        points = np.asarray(numeric(robot, "joint_points")(poses)[0])
        extents = self._extents_of_points(robot, poses, points, middle)
        if fixed is not None:
            center = tool_places(robot, middle[None])[0]
            box = np.concatenate([fixed[0] - center, center - fixed[1]])
            extents[:, :6] = np.minimum(extents[:, :6], box)
        return extents

    def _extents_of_points(
        self, robot: Manipulator, poses: Array, points: Array, middle: Array
    ) -> Array:
        """Return low ends, negated high ends (N, 6) and distances outside keep-outs (N, b), m."""
        margin, center = self._job.cell.margin, tool_places(robot, middle[None])[0]
        starts, ends = (part - center for part in _lines(robot, poses, points))
        both = np.stack([starts, ends])
        low, high = np.nanmin(both, axis=(0, 2)) - margin, np.nanmax(both, axis=(0, 2)) + margin
        at = np.array(self._job.workspace.center or (0.0, 0.0, 0.0))
        depths = [
            np.nanmax(
                _depths(starts + at, ends + at, np.array(box.low), np.array(box.high)), axis=1
            )
            for box in self._job.keep_out
        ]
        return np.column_stack([low, -high, *(-depth - margin for depth in depths)])

    def judge_extents(self, extents: Array, tight: float = 0.0) -> tuple[dict[str, float], Misses]:
        """Return sizes in m by name from extents (6 + boxes,), and the space limits they exceed.

        The limits are tightened by `tight`, m.
        """
        cell, (low, high, outside) = self._job.cell, np.split(extents, [3, 6])
        high = -high
        width, depth, height = map(float, high - low)
        figures = {"footprint": width * depth, "width": width, "depth": depth, "height": height}
        most = dict(zip(("width", "depth"), cell.footprint or (np.inf, np.inf), strict=True))
        most["height"] = cell.height or np.inf
        spare = f", and {1e3 * tight:g} mm to spare" if tight else ""
        misses: Misses = {
            name: (
                (figures[name] + tight) / m - 1.0,
                f"{name} {figures[name]:.4g} m, at most {m:g} m asked{spare}",
            )
            for name, m in most.items()
            if figures[name] + tight > m
        }
        if cell.low is not None and cell.high is not None:
            at = np.array(self._job.workspace.center)
            beyond = float(np.maximum(cell.low - (at + low), at + high - cell.high).max())
            if beyond + tight > 0.0:
                misses["cell"] = beyond + tight, f"{_parts(beyond)} outside the cell{spare}"
        inside = -float(outside.min(initial=np.inf))
        if inside + tight > 0.0:
            misses["keep-out"] = inside + tight, f"{_parts(inside)} inside a keep-out box{spare}"
        return figures, misses

    def _clearance(self, robot: Manipulator, poses: Array, points: Array) -> float:
        """Return the least distance between bodies, m, at poses with the given joint points.

        The distances between guides and links of other legs are computed apart, as shared programs
        do not know the guides' ends.
        """
        radii, distances = robot.radii, [np.inf]
        assert radii is not None  # every design has them
        known = np.asarray(numeric(robot, "least_clearances")(poses)[0])
        for (a, b), clearances in zip(self._meetings, known.reshape(len(poses), -1).T, strict=True):
            distances.append(clearances.min() - getattr(radii, a) - getattr(radii, b))
        thick = radii.guide + max(radii.upper, radii.lower)
        for i, low, high in _guides(robot):
            others = np.delete(points, i, axis=-3)
            starts, ends = others[..., :-1, :].reshape(-1, 3), others[..., 1:, :].reshape(-1, 3)
            first, last = (np.tile(end[:, None], len(starts)) for end in (low, high))
            distances.append(
                float(np.nanmin(segment_distances(first, last, starts.T, ends.T))) - thick
            )
        return float(min(distances))

    @cached_property
    def _meetings(self) -> list[tuple[Any, Any]]:
        """Pairs of kinds of bodies that may collide, guides excluded."""
        return meetings(self._robot)


def _parts(beyond: float) -> str:
    """Return the start of a message: parts go beyond a limit by `beyond` m."""
    return f"parts {beyond:.3g} m" if beyond > 0.0 else "parts nearly"


def tool_places(robot: Manipulator, poses: Array) -> Array:
    """Return the places (N, 3) of the tool's centre point at poses (N, m)."""
    places, axes = robot.platform.placement(poses)
    return np.asarray(places + np.array(robot.platform.tool) @ axes)


def _lines(robot: Manipulator, poses: Array, points: Array) -> tuple[Array, Array]:
    """Return start and end points (N, L, 3) of links, guides and lines from P to legs and tool."""
    count, place = len(poses), robot.platform.placement(poses)[0]
    legs = points.reshape(count, -1, *points.shape[-2:])
    tips = np.concatenate([legs[:, :, -1], tool_places(robot, poses)[:, None]], axis=1)
    guides = [(np.tile(a, (count, 1, 1)), np.tile(b, (count, 1, 1))) for _, a, b in _guides(robot)]
    starts = [legs[:, :, :-1].reshape(count, -1, 3), np.repeat(place[:, None], tips.shape[1], 1)]
    ends = [legs[:, :, 1:].reshape(count, -1, 3), tips]
    return (
        np.concatenate([*starts, *(a for a, _ in guides)], axis=1),
        np.concatenate([*ends, *(b for _, b in guides)], axis=1),
    )


def _depths(starts: Array, ends: Array, low: Array, high: Array) -> Array:
    """Return the greatest depth of line segments (..., 3) inside a box, m; negative outside.

    Along a line the depth is concave, so that ternary search finds its maximum.
    """

    def depth(share: Array) -> Array:
        """Return the depths (...) of segment points in the box, m, at line parameters 0 to 1."""
        at = starts + share[..., None] * (ends - starts)
        return np.asarray(np.minimum(at - low, high - at).min(axis=-1))

    first, last = np.zeros(starts.shape[:-1]), np.ones(starts.shape[:-1])
    for _ in range(_HALVINGS if np.isfinite(starts).any() else 0):
        third = (last - first) / 3.0
        falls = depth(first + third) > depth(last - third)
        first, last = np.where(falls, first, first + third), np.where(falls, last - third, last)
    return depth(0.5 * (first + last))


def _guides(robot: Manipulator) -> Iterator[tuple[int, Array, Array]]:
    """Yield (leg index, guide start (3,), guide end (3,)) of each leg that slides on a guide."""
    for i, leg in enumerate(robot.legs):
        if slides(leg) and leg.limits is not None and leg.joint_axis is not None:
            r, e = np.array(leg.guide_point), np.array(leg.joint_axis)
            yield i, r + leg.limits[0] * e, r + leg.limits[1] * e


def segment_distances(start: Array, end: Array, other: Array, other_end: Array) -> Array:
    """Return the distances (K,), m, of pairs of line segments with these ends (3, K)."""
    squares = np.array(_squared_distances()(start, end, other, other_end))
    return np.asarray(np.sqrt(squares.reshape(-1)))


@lru_cache(maxsize=1)
def _squared_distances() -> ca.Function:
    """Return the CasADi function of two segments' four end points: their squared distance."""
    p, p_end, q, q_end = (ca.SX.sym(name, 3) for name in ("p", "p_end", "q", "q_end"))
    square = squared_distance((p, p_end), (q, q_end))
    return ca.Function("squared_distance", [p, p_end, q, q_end], [square])
