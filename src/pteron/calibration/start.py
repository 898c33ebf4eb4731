"""The start of a calibration: poses of the readings on the machine as drawn, frame and planes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.guess import Guess
from pteron.calibration.measurements import Measurements, length_columns, position_axes
from pteron.calibration.residuals import MachineSlopes
from pteron.errors import DataError
from pteron.kinematics import direct_kinematics
from pteron.manipulator import Manipulator
from pteron.workspace.home import home_pose

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

_FEW = 3
"""Positions that fix a frame, unless they are in line."""

_TURNED = 0.5
"""Angle, rad, between a measured pose and that of its readings from which they differ."""

_OTHER_MODE = 0.05
"""Height residual, as a share of the machine's size, from which another assembly mode is tried.

Assembly modes lie apart by a good part of the size, tolerances of millimetres move a
height by less than 1 % of it."""

_PLANE = 3
"""Least heights that fix a plane's normal."""


def starting_poses(guess: Guess, measurements: Measurements, *, modes: bool = True) -> Array:
    """Return the pose (N, m) of each row on a guess of the machine; NaN where it has none.

    Newton's method finds it from the measured pose, or from the home pose. Where that leads far
    away, across a singularity, or far from a measured height, it is the assembly mode that agrees
    with the row's measurements and, of those that agree alike, the one nearest to the start.
    Without `modes` these are not sought, and such a row has no pose.

    Raises
    ------
    DataError
        If the readings of more than half of the rows lead to no pose.
    """
    robot, joints = guess.robot, guess.joints(measurements.readings)
    home = home_pose(robot)
    slopes = MachineSlopes(robot, ())
    side = _sides(slopes.jacobian(guess, home[None]))
    begin, fully_measured = _measured_poses(guess, measurements, home)
    poses = slopes.poses(guess, joints, begin)
    with np.errstate(invalid="ignore"):  # of a pose that was not found
        sides = _sides(slopes.jacobian(guess, poses))
    far = np.abs(poses - begin) > np.where(robot.platform.angular, _TURNED, 0.2 * slopes.size)
    other = np.isnan(poses).any(axis=-1)
    other |= np.where(fully_measured, far.any(axis=-1), sides != side)
    off = _mode_errors(slopes, guess, measurements, poses, np.arange(len(measurements)))
    other |= ~(off <= _OTHER_MODE * slopes.size)
    if not modes:
        poses[other] = np.nan
    sought = np.flatnonzero(other if modes else np.zeros_like(other))
    for i, assembly_modes in zip(sought, fitting_poses(robot, joints[sought]), strict=True):
        if robot.redundancy:  # with large misfits, as of a wrong zero, no mode may be found
            assembly_modes = np.vstack([assembly_modes, poses[i]])
        several = assembly_modes[~np.isnan(assembly_modes).any(axis=-1)]
        if not len(several):
            poses[i] = np.nan
            continue
        # Of a row without a height all residuals are 0, but with more legs than coordinates.
        off = _mode_errors(slopes, guess, measurements, several, np.full(len(several), i))
        several = several[off <= off.min() + _OTHER_MODE * slopes.size]
        same = _sides(slopes.jacobian(guess, several)) == side
        several = several[same] if same.any() and not fully_measured[i] else several
        poses[i] = several[np.abs(several - begin[i]).max(axis=-1).argmin()]
    lost: NDArray[np.bool_] = np.asarray(np.isnan(poses).any(axis=-1))
    if 2 * lost.sum() > len(lost):
        first = int(np.argmax(lost))
        reading = np.round(measurements.readings[first], 6).tolist()
        raise DataError(
            f"{measurements.places[first]}: the readings {reading} lead to no pose of {robot.name} "
            f"as drawn, nor do those of {lost.sum()} of {len(lost)} rows; check their units, "
            "zeros, signs and order"
        )
    return poses


def _measured_poses(
    guess: Guess, measurements: Measurements, home: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return measured poses (N, m), home where none, and the mask (N,) of fully measured rows."""
    robot = guess.robot
    begin = np.tile(home, (len(measurements), 1))
    seen = ~np.isnan(measurements.angles)
    begin[:, robot.platform.angular] = np.where(
        seen, measurements.angles, begin[:, robot.platform.angular]
    )
    lengths = length_columns(robot)
    arms = guess.points(measurements.marks, begin) - robot.platform.placement(begin)[0]
    places = (measurements.positions - arms @ position_axes(robot).T)[:, lengths]
    if not measurements.setup.frame_known:
        return begin, np.zeros(len(measurements), dtype=bool)
    at = np.flatnonzero(~robot.platform.angular)
    begin[:, at] = np.where(np.isnan(places), begin[:, at], places)
    fully_measured = seen.all(axis=-1) & ~np.isnan(places).any(axis=-1)
    return begin, np.asarray(fully_measured)


def fitting_poses(robot: Manipulator, joints: Array) -> Array:
    """Return the poses (N, k, m) of joint coordinates in each assembly mode; NaN where none.

    Of more legs than coordinates, on a machine that differs from its drawing, they fit roughly.
    """
    tolerance = _OTHER_MODE * max(leg.size for leg in robot.legs) if robot.redundancy else None
    return direct_kinematics(robot, joints, tolerance=tolerance, on_failure="nan")


def _sides(jacobian: Array) -> Array:
    """Return the sides (N,) of type-II singularities, 1 or -1; 1 of redundant machines.

    Where n legs of m coordinates are more, singularities divide no space of poses.
    """
    n, m = jacobian.shape[1:]
    return np.asarray(np.sign(np.linalg.det(jacobian)) if n == m else np.ones(len(jacobian)))


def _mode_errors(
    slopes: MachineSlopes, guess: Guess, measurements: Measurements, poses: Array, rows: Numbers
) -> Array:
    """Return the greatest errors (K,), m, of heights of rows at poses, and of redundant joints."""
    errors = np.abs(_height_residuals(guess, measurements, poses, rows))
    if not guess.robot.redundancy:
        return errors
    levers = np.array([leg.lever for leg in guess.robot.legs])
    misfits = slopes.misfits(guess, guess.joints(measurements.readings[rows]), poses)
    return np.asarray(np.maximum(errors, np.abs(levers * misfits).max(axis=-1)))


def _height_residuals(
    guess: Guess, measurements: Measurements, poses: Array, rows: Numbers
) -> Array:
    """Return computed minus measured heights (K,) of rows at poses; 0 over no known plane."""
    names = [measurements.planes[i] for i in rows]
    unknown = {name for name, plane in measurements.setup.planes.items() if not plane.known}
    over = ~np.isnan(measurements.heights[rows]) & np.array([name not in unknown for name in names])
    residuals = np.zeros(len(rows))
    if over.any():
        planes = np.stack([guess.planes[name] for name in names])
        points = guess.points([measurements.marks[i] for i in rows], poses)
        heights = np.einsum("ni,ni->n", planes[:, :3], points) - planes[:, 3]
        residuals[over] = (heights - measurements.heights[rows])[over]
    return residuals


def place_surroundings(guess: Guess, measurements: Measurements, poses: Array) -> Guess:
    """Return the guess with unknown frames and planes fitted at poses of the drawn machine."""
    points = guess.points(measurements.marks, poses)
    seen = ~np.isnan(measurements.positions).any(axis=-1)
    if not measurements.setup.frame_known and seen.sum() >= _FEW:
        free = {name for name, mark in measurements.setup.marks.items() if not mark.known}
        fixed = np.array([name not in free for name in measurements.marks])[seen]
        used = np.flatnonzero(seen)[fixed] if fixed.sum() >= _FEW else np.flatnonzero(seen)
        p, y = points[used], measurements.positions[used]
        turn, _ = scipy.spatial.transform.Rotation.align_vectors(
            p - p.mean(axis=0), y - y.mean(axis=0)
        )
        matrix = turn.as_matrix()
        guess = replace(guess, turn=matrix, shift=p.mean(axis=0) - matrix @ y.mean(axis=0))
    planes = dict(guess.planes)
    over = ~np.isnan(measurements.heights)
    for name, plane in measurements.setup.planes.items():
        here = over & np.array([which == name for which in measurements.planes])
        if plane.known or not here.any():
            continue
        # n . p - d = h, as near to the described normal as three heights allow.
        normal = np.array(plane.normal)
        rows = np.column_stack([points[here], -np.ones(here.sum())])
        if here.sum() >= _PLANE and np.linalg.matrix_rank(rows - rows.mean(axis=0), 1e-3) >= 2:
            step = np.linalg.lstsq(
                rows, measurements.heights[here] - points[here] @ normal, rcond=1e-3
            )
            normal = normal + step[0][:3]
            normal = normal / np.linalg.norm(normal)
        planes[name] = np.append(
            normal, np.median(points[here] @ normal - measurements.heights[here])
        )
    return replace(guess, planes=planes)
