"""A machine, and its motion as animation frames, as plain data that `view.js` draws on a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pteron.dynamics import drive_forces
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Guide, JointPoints, Motion, joint_points
from pteron.platforms.coordinates import SHOWN
from pteron.plots.machine_drawing import APART, base_outline
from pteron.report.quantities import coordinate

_A_SECOND = 60.0
"""Frames for a second of real time: as many as screens show."""

_FEWEST, _MOST = 240, 2400
"""Bounds on the number of frames: enough to play a short motion slowly, few enough that the page of
a long one can be sent by mail."""

_DRAWN = 1000
"""Samples, about, of a line in a picture."""

_DECIMALS = 6
"""Decimals of the data, m or rad."""

_SAME = 1e-6
"""Greatest gap between the ends of a closed motion, as a share of its size, or of its speed."""

_LITTLE = 1e-3
"""Least size (m, rad), or speed, that `_SAME` is a share of."""


@dataclass(frozen=True)
class Frames:
    """F moments of a motion, to be drawn.

    Attributes
    ----------
    time : array, shape (F,)
        s, from the motion's beginning.
    pose : array, shape (F, m)
        m and rad.
    points : JointPoints
        Where the machine's joints are, (F, ...).
    forces : array, shape (F, n)
        N or N m.
    duration : float
        Of the motion, s.
    closed : bool
        Whether it ends as it begins; then its last moment is its first, and is left out.
    """

    time: Array
    pose: Array
    points: JointPoints
    forces: Array
    duration: float
    closed: bool


def frames(robot: Manipulator, motion: Motion, forces: Array | None = None) -> Frames:
    """Return a motion as the moments that are drawn: about sixty a second, but not too many.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    motion : Motion
        One that it can do, with T samples.
    forces : array, shape (T, n), optional
        N or N m; those that the drives must give, with smooth friction, where they are left out.

    Returns
    -------
    Frames
        Samples of the motion; where it has too few, moments between them, with forces in between.
    """
    wanted = int(np.clip(np.ceil(_A_SECOND * motion.duration), _FEWEST, _MOST))
    even = np.linspace(motion.time[0], motion.time[-1], wanted + 1)
    closed = is_closed(motion)
    if len(motion.time) > wanted:
        middles = (motion.time[:-1] + motion.time[1:]) / 2.0
        rows = np.unique(np.searchsorted(middles, even))
        rows = rows[: len(rows) - int(closed)]
        time, given = motion.time[rows], None if forces is None else forces[rows]
        pose, velocity, acceleration = (
            part[rows] for part in (motion.pose, motion.velocity, motion.acceleration)
        )
    else:
        time = even[: len(even) - int(closed)]
        given = None if forces is None else _between(motion.time, forces, time)
        pose, velocity, acceleration = motion.at(time)
    if given is None:
        given = drive_forces(robot, pose, velocity, acceleration, smooth=True)
    start = motion.time[0]
    points = joint_points(robot, pose)
    return Frames(time - start, pose, points, given, motion.duration, closed)


def is_closed(motion: Motion) -> bool:
    """Say whether a motion ends in the pose, and with the velocity, of its beginning."""
    parts = motion.pose, motion.velocity
    sizes = [max(float(np.ptp(part, axis=0).max()), _LITTLE) for part in parts]
    return all(
        bool(np.abs(part[-1] - part[0]).max() <= _SAME * size)
        for part, size in zip(parts, sizes, strict=True)
    )


def few(count: int) -> slice:
    """Return the slice of so many samples that a line in a picture needs."""
    return slice(None, None, max(1, count // _DRAWN))


def _between(time: Array, values: Array, at: Array) -> Array:
    return np.column_stack([np.interp(at, time, column) for column in values.T])


def scene(
    robot: Manipulator, shown: Frames, guides: Sequence[Guide], home: JointPoints, grid: float
) -> dict[str, Any]:
    """Return the machine and the frames of its motion as plain lists.

    Everything is in m, rad, s, N and N m, in the base frame; of a planar machine along its pose's x
    and y and the plane's normal, in the plane. A leg's `chains` in a frame are the points of its
    line, a `guide` the way of its slider or of its crank's end, its `bars` what leads from the line
    to each of parallel rods, over the machine's size. `home` are the joints of one pose, from which
    the base of cranks and rams is known, and `grid` is the side of the squares.
    """
    planar, points = robot.platform.planar, shown.points
    turn = np.array(robot.platform.frame) if planar else np.eye(3)

    def seen(array: Array) -> Any:
        return _plain(array @ turn.T * ([1.0, 1.0, 0.0] if planar else 1.0))

    gravity = np.array(robot.gravity)
    strength = float(np.linalg.norm(gravity)) or 1.0
    up = -gravity / strength if gravity.any() else np.array(robot.platform.frame[2])
    lines = [seen(line) for line in points.links]
    quantity = coordinate([leg.joint for leg in robot.legs])
    return {
        "planar": planar,
        "up": [0.0, 0.0, 1.0] if planar else _plain(up),
        "gravity": seen(gravity / strength),
        "grid": grid,
        "duration": round(shown.duration, _DECIMALS),
        "closed": shown.closed,
        "guides": [seen(guide.path) for guide in guides],
        "slides": [guide.slides for guide in guides],
        "directions": _plain(np.array([guide.axis for guide in guides]) @ turn.T),
        "bars": [None if bar is None else seen(APART * bar) for bar in points.bars],
        "rams": points.rams,
        "base": seen(base_outline(home, guides)),
        "parts": [
            {
                "hub": seen(part.hub),
                "corners": seen(part.corners),
                "triangles": None if part.triangles is None else part.triangles.tolist(),
            }
            for part in points.parts
        ],
        "position": seen(points.reference),
        "tool": seen(points.tool) if any(robot.platform.tool) else None,
        "time": _plain(shown.time),
        "pose": _plain(shown.pose),
        "scales": [SHOWN[unit][1] for unit in robot.units],
        "axes": _plain(points.axes @ turn.T),
        "chains": [list(legs) for legs in zip(*lines, strict=True)],
        "coordinates": _plain(points.coordinates),
        "factors": quantity.factors,
        "forces": _plain(shown.forces),
        "units": [leg.joint.force_unit for leg in robot.legs],
    }


def _plain(array: Array) -> Any:
    return (np.round(array, _DECIMALS) + 0.0).tolist()
