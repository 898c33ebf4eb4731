"""A machine, and its motion as animation frames, as plain data that `picture.js` draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pteron.dynamics import drive_forces
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Guide, JointPoints, Motion, joint_guides, joint_points
from pteron.motion.motion import interpolate_columns
from pteron.platforms.coordinates import SHOWN
from pteron.plots.machine_drawing import APART, base_outline, grid_step
from pteron.report.quantities import coordinate
from pteron.tolerances import SAME

_A_SECOND = 60.0
"""Frames for a second of real time: as many as screens show."""

_FEWEST, _MOST = 240, 2400
"""Bounds on the number of frames: enough to play a short motion slowly, few enough that the page of
a long one can be sent by mail."""

_DRAWN = 1000
"""Samples, about, of a line in a picture."""

_DECIMALS = 6
"""Decimals of the data, m or rad."""

_LITTLE = 1e-3
"""Least size (m, rad), or speed, that `SAME` is a share of."""


@dataclass(frozen=True)
class Frames:
    """F moments of a motion for animation.

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
    still : JointPoints
        Where the joints are in the picture that does not move, (...).
    guides : tuple of Guide
        What the legs' first joints move along in the motion.
    """

    time: Array
    pose: Array
    points: JointPoints
    forces: Array
    duration: float
    closed: bool
    still: JointPoints
    guides: tuple[Guide, ...]


def frames(
    robot: Manipulator, motion: Motion, forces: Array | None = None, still_pose: Array | None = None
) -> Frames:
    """Return the animation frames of a motion: about 60 a second, 240 to 2400 in all.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    motion : Motion
        One that it can do, with T samples.
    forces : array, shape (T, n), optional
        N or N m; those that the drives must give, with smooth friction, where they are left out.
    still_pose : array, shape (m,), optional
        The pose of the picture that does not move; where the motion begins if it is left out.

    Returns
    -------
    Frames
        Samples of the motion; where it has too few, moments between them, with forces in between.
    """
    count = int(np.clip(np.ceil(_A_SECOND * motion.duration), _FEWEST, _MOST))
    even = np.linspace(motion.time[0], motion.time[-1], count + 1)
    closed = is_closed(motion)
    if len(motion.time) > count:
        middles = (motion.time[:-1] + motion.time[1:]) / 2.0
        rows = np.unique(np.searchsorted(middles, even))
        rows = rows[: len(rows) - int(closed)]
        time, frame_forces = motion.time[rows], None if forces is None else forces[rows]
        pose, velocity, acceleration = (
            part[rows] for part in (motion.pose, motion.velocity, motion.acceleration)
        )
    else:
        time = even[: len(even) - int(closed)]
        frame_forces = None if forces is None else interpolate_columns(motion.time, forces, time)
        pose, velocity, acceleration = motion.at(time)
    if frame_forces is None:
        frame_forces = drive_forces(robot, pose, velocity, acceleration, smooth=True)
    still_points = joint_points(robot, motion.pose[0] if still_pose is None else still_pose)
    moments = time - motion.time[0], pose, joint_points(robot, pose), frame_forces
    return Frames(*moments, motion.duration, closed, still_points, joint_guides(robot, pose))


def is_closed(motion: Motion) -> bool:
    """Return whether a motion ends with the pose and the velocity of its beginning."""
    parts = motion.pose, motion.velocity
    sizes = [max(float(np.ptp(part, axis=0).max()), _LITTLE) for part in parts]
    return all(
        bool(np.abs(part[-1] - part[0]).max() <= SAME * size)
        for part, size in zip(parts, sizes, strict=True)
    )


def line_samples(count: int) -> slice:
    """Return the slice that thins samples out to the number a drawn line needs."""
    return slice(None, None, max(1, count // _DRAWN))


def scene(robot: Manipulator, shown: Frames) -> dict[str, Any]:
    """Return the machine and the frames of its motion as plain lists.

    Everything is in m, rad, s, N and N m; points are given as by `still_parts`.
    """
    quantity = coordinate([leg.joint for leg in robot.legs])
    return {
        **still_parts(robot, shown.guides, shown.still),
        **moving_parts(robot, shown.points),
        "duration": round(shown.duration, _DECIMALS),
        "closed": shown.closed,
        "time": _plain(shown.time),
        "pose": _plain(shown.pose),
        "scales": [SHOWN[unit][1] for unit in robot.units],
        "coordinates": _plain(shown.points.coordinates),
        "factors": quantity.factors,
        "forces": _plain(shown.forces),
        "units": [leg.joint.force_unit for leg in robot.legs],
    }


def still_parts(robot: Manipulator, guides: Sequence[Guide], home: JointPoints) -> dict[str, Any]:
    """Return the fixed parts of pictures of a machine, as plain lists.

    Points are in the base frame, m; of a planar machine along its pose's x and y and the plane's
    normal, in the plane. A `guide` is the path of a slider or of a crank's end, `bars` are what
    leads from a leg's line to each of parallel rods, over the machine's size, and `radii` those of
    the bodies where the file has them. `home` are the joints of one pose, from which the base of
    cranks and rams is known, and `grid` is the side of the squares, m.
    """
    planar, gravity = robot.platform.plane_normal is not None, np.array(robot.gravity)
    strength = float(np.linalg.norm(gravity)) or 1.0
    up = -gravity / strength if gravity.any() else np.array(robot.platform.frame[2])
    return {
        "planar": planar,
        "up": [0.0, 0.0, 1.0] if planar else _plain(up),
        "gravity": picture_points(robot, gravity / strength),
        "grid": grid_step(home, guides),
        "guides": [picture_points(robot, guide.path) for guide in guides],
        "slides": [guide.is_prismatic for guide in guides],
        "directions": _plain(np.array([guide.axis for guide in guides]) @ view_frame(robot).T),
        "bars": [None if bar is None else picture_points(robot, APART * bar) for bar in home.bars],
        "rams": home.rams,
        "base": picture_points(robot, base_outline(home, guides)),
        "radii": None if robot.radii is None else asdict(robot.radii),
    }


def moving_parts(robot: Manipulator, points: JointPoints) -> dict[str, Any]:
    """Return the moving parts of a machine's pictures in F poses, or one, as plain lists.

    A leg's `chains` in a frame are the points of its line.
    """
    lines = [picture_points(robot, line) for line in points.links]
    return {
        "parts": [
            {
                "hub": picture_points(robot, part.hub),
                "corners": picture_points(robot, part.corners),
                "triangles": None if part.triangles is None else part.triangles.tolist(),
            }
            for part in points.parts
        ],
        "position": picture_points(robot, points.reference),
        "tool": picture_points(robot, points.tool) if any(robot.platform.tool) else None,
        "axes": _plain(points.axes @ view_frame(robot).T),
        "chains": [list(legs) for legs in zip(*lines, strict=True)]
        if points.reference.ndim > 1
        else lines,
    }


def picture_points(robot: Manipulator, points: Array) -> Any:
    """Return points (..., 3) of the base frame in the pictures' frame, as plain lists."""
    flat = 1.0 if robot.platform.plane_normal is None else [1.0, 1.0, 0.0]
    return _plain(points @ view_frame(robot).T * flat)


def view_frame(robot: Manipulator) -> Array:
    """Return the axes (3, 3), as rows, of the frame of a machine's pictures."""
    return np.eye(3) if robot.platform.plane_normal is None else np.array(robot.platform.frame)


def _plain(array: Array) -> Any:
    """Return an array as nested lists of numbers, rounded for the page."""
    return (np.round(array, _DECIMALS) + 0.0).tolist()
