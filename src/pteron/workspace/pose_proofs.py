"""Every pose of joint coordinates in a box, by intervals: none is missed, none is false.

With the joints held the legs' closures f (n,) vanish at a pose, n = m. A box X of poses, with
middle x, holds none where an interval of f excludes 0. Else let Y be the inverse of the middle of
the interval matrix f'(X). Every zero in X lies in Krawczyk's box

    K = x - Y f(x) + (1 - Y f'(X)) (X - x),

which is computed as a middle and radii. X is cut down to K, or halved where K is no narrower. Where
K lies in the interior of X there is exactly one zero (R. Krawczyk 1969; A. Neumaier, Interval
Methods for Systems of Equations, 1990). This is tried in a box slightly larger than what has been
cut down, since a zero may lie on a wall between two halves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.kernels.bounds import Bounded
from pteron.kernels.programs import numeric_program
from pteron.kinematics.direct import are_poses
from pteron.kinematics.evaluate import finite_rows
from pteron.kinematics.pose_conversions import pose_of, position_of, rotation_of
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.platforms.coordinates import wrap_angle
from pteron.result import Result
from pteron.shapes import JointsLike, Poses
from pteron.tolerances import SAME
from pteron.workspace.boxes import halve_boxes
from pteron.workspace.enclosing import enclosing_box

_BATCH = 4096
"""Boxes examined at a time, the last ones found first: few wait."""

_NARROWER = 0.7
"""Share of a side to which Krawczyk's box must shorten one side, or the box is halved."""

_SMALL, _WIDE = 1e-9, 1e-6
"""Side of a box that is not cut further, and half the side of the one in which its zero is proved,
as shares of the box asked for."""

_ROUNDING = 1e-14
"""Bound on the rounding of a sum of products of up to twelve terms, relative to their sizes."""


@dataclass(frozen=True, eq=False, repr=False)
class ProvedPoses(Result):
    """The poses of joint coordinates in a box.

    Attributes
    ----------
    poses : array, shape (k, m)
        Poses with the joint coordinates, each proved to be one, within 1e-9 of the box's sides.
    undecided : array, shape (u, 2, m)
        Boxes, least and greatest pose, that may hold further ones: next to poses where the machine
        is singular with these joints held, or boxes not examined. Elsewhere there are none.
    examined : int
        Number of boxes that were examined.
    """

    poses: Poses
    undecided: Array
    examined: int

    SHOWN = "poses is_complete examined"

    @property
    def is_complete(self) -> bool:
        """Whether it is proved that the box holds no other pose."""
        return not len(self.undecided)


def proved_poses(
    robot: RobotLike,
    joints: JointsLike,
    box: ArrayLike | None = None,
    *,
    all_branches: bool = False,
    most_boxes: int = 4_000_000,
) -> ProvedPoses:
    """Return every pose with the given joint coordinates in a box of poses, proved by intervals.

    It serves every kind of leg and platform. `pteron.direct_kinematics` is faster, and for most
    machines as sure; of P-R-U-R and R-P-U-R legs it may miss poses.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, which must have as many legs as coordinates.
    joints : array, shape (n,)
        Joint coordinates, m or rad.
    box : array, shape (2, m), optional
        Least and greatest pose, m and rad; by default all poses in reach.
    all_branches : bool
        As for `pteron.direct_kinematics`.
    most_boxes : int
        Number of boxes after which the search ends. A million takes a quarter of a minute or more.

    Returns
    -------
    ProvedPoses
        Without a box angles are those of `pteron.direct_kinematics`.

    Raises
    ------
    DataError
        If the box is none, or not finite.
    ModelError
        If the machine has more legs than coordinates, or without a box nothing bounds its reach.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import proved_poses
    >>> joints = pteron.inverse_kinematics("pentapteron", [0.02, 0.01, 0.03, 0.1, -0.2])
    >>> box = [[-0.05, -0.05, -0.05, -0.5, -0.5], [0.06, 0.06, 0.06, 0.5, 0.5]]
    >>> proved = proved_poses("pentapteron", joints, box)
    >>> proved.is_complete, proved.poses.round(9)
    (True, array([[ 0.02,  0.01,  0.03,  0.1 , -0.2 ]]))
    """
    robot = as_manipulator(robot)
    if robot.redundancy:
        raise ModelError(
            "a proof that no pose is missed needs as many legs as coordinates, not "
            f"{robot.joint_count} legs for {robot.freedom} coordinates; leave legs out of the file",
            subject=robot.name,
        )
    readings = finite_rows(robot, joints, "joints", "raise")
    if readings.shape != (robot.joint_count,):
        raise DataError(f"joints: one row of {robot.joint_count} is expected: {readings.shape}")
    closures = _Closures(_closures(robot, all_branches), readings)
    whole = _whole_box(robot, readings) if box is None else _as_box(robot, box)
    sides = whole[1] - whole[0]
    zeros, undecided, examined = _zeros(closures, whole, most_boxes)
    zeros = zeros[((zeros >= whole[0]) & (zeros <= whole[1])).all(axis=-1)]
    zeros = zeros[are_poses(robot, zeros, readings, all_branches=all_branches)]
    if box is None:  # three angles give an orientation twice
        zeros = pose_of(robot, position_of(robot, zeros), rotation_of(robot, zeros))
    return ProvedPoses(_distinct(robot, zeros, 2.0 * _WIDE * sides), undecided, examined)


def _as_box(robot: Manipulator, box: ArrayLike) -> Array:
    """Return a box of poses (2, m), checked."""
    corners = np.asarray(box, dtype=float)
    if corners.shape != (2, robot.freedom) or not np.isfinite(corners).all():
        expected = f"two poses of {robot.freedom} finite numbers, shape (2, {robot.freedom})"
        raise DataError(f"box: expected {expected}")
    if not (corners[0] < corners[1]).all():
        raise DataError("box: a least value is not below the greatest")
    return corners


def _whole_box(robot: Manipulator, joints: Array) -> Array:
    """Return a box (2, m) that holds every pose of joints (n,): angles within half a turn."""
    # Legs whose limits are their joints' coordinates reach no farther than they do when held.
    near = SAME * (1.0 + np.abs(joints))
    legs = [
        replace(leg, limits=(q - d, q + d) if leg.joint.unit == "m" else None)
        for leg, q, d in zip(robot.legs, joints.tolist(), near.tolist(), strict=True)
    ]
    robot = replace(robot, legs=tuple(legs))
    angular = robot.platform.angular
    if not robot.wraps[angular].all():
        raise ModelError("box: missing, as the angle has no end that is known", subject=robot.name)
    half = np.where(angular, np.pi * (1.0 + _WIDE), 0.0)
    low, high = -half, half
    low[~angular], high[~angular] = enclosing_box(robot, low, high)
    return np.stack([low, high])


@lru_cache(maxsize=64)
def _closures(robot: Manipulator, all_branches: bool) -> tuple[Bounded, range]:
    """Return the legs' closures by pose and joints, (m + n,), and which of its rows count."""
    built = numeric_program(robot, "closure_errors", plain=True)
    state = ca.SX.sym("state", robot.freedom + robot.joint_count)
    pose, joints = state[: robot.freedom], state[robot.freedom :]
    order = {"pose": pose, "joints": joints}
    outputs = built.function.call([order[port.name] for port in built.inputs])
    function = Bounded(ca.Function("closures", [state], outputs), built.outputs)
    return function, function.rows("any_branch" if all_branches else "errors")


class _Closures(NamedTuple):
    """The closures of held joints (n,)."""

    function: tuple[Bounded, range]
    joints: Array

    def bounds(self, boxes: Array) -> tuple[Array, Array]:
        """Return bounds (B, n) of the closures in boxes (B, 2, m); NaN where they have no value."""
        function, rows = self.function
        held = np.broadcast_to(self.joints, (len(boxes), len(self.joints)))
        low, high = (np.hstack([boxes[:, k], held]) for k in (0, 1))
        return function(low, high, rows)[:2]

    def slopes(self, boxes: Array) -> tuple[Array, Array]:
        """Return bounds (B, n, m) of the closures' slopes; infinite where they are undefined."""
        function, rows = self.function
        held = np.broadcast_to(self.joints, (len(boxes), len(self.joints)))
        low, high = (np.hstack([boxes[:, k], held]) for k in (0, 1))
        return function.slopes(low, high, rows, range(boxes.shape[2]))


class _Krawczyk(NamedTuple):
    """Krawczyk's box of each box (B, ...)."""

    middle: Array
    """(B, m)."""
    radius: Array
    """(B, m): infinite where the closures have no slopes everywhere in the box."""

    @classmethod
    def of(cls, closures: _Closures, boxes: Array) -> _Krawczyk:
        """Return the boxes in which the zeros in `boxes` (B, 2, m) lie."""
        middle, half = 0.5 * (boxes[:, 0] + boxes[:, 1]), 0.5 * (boxes[:, 1] - boxes[:, 0])
        half = half * (1.0 + _ROUNDING) + _ROUNDING * np.abs(middle)  # the middle is rounded
        low, high = closures.slopes(boxes)
        regular = np.asarray((np.isfinite(low) & np.isfinite(high)).all(axis=(1, 2)))
        unit = np.eye(boxes.shape[2])
        slope = np.where(regular[:, None, None], 0.5 * low + 0.5 * high, unit)
        spread = np.where(regular[:, None, None], 0.5 * high - 0.5 * low, 0.0)
        regular &= np.abs(np.linalg.det(slope)) > 0.0
        inverse = np.linalg.inv(np.where(regular[:, None, None], slope, unit))
        least, most = closures.bounds(np.stack([middle, middle], axis=1))
        error, doubt = 0.5 * (least + most), 0.5 * (most - least)
        sizes = np.abs(inverse)
        step = np.einsum("bij,bj->bi", inverse, error)
        doubt = np.einsum("bij,bj->bi", sizes, doubt + _ROUNDING * np.abs(error))
        away = np.abs(unit - inverse @ slope)
        away += sizes @ (spread + _ROUNDING * (np.abs(slope) + spread)) + _ROUNDING
        radius = np.einsum("bij,bj->bi", away, half) + doubt
        radius = radius * (1.0 + _ROUNDING) + _ROUNDING * (np.abs(middle) + np.abs(step))
        unknown = ~regular | ~np.isfinite(error).all(axis=1)
        center = np.where(unknown[:, None], middle, middle - step)
        return cls(center, np.where(unknown[:, None], np.inf, radius))


def _zeros(closures: _Closures, whole: Array, most: int) -> tuple[Array, Array, int]:
    """Return all zeros in a box (2, m), boxes left undecided, and the number examined."""
    sides = whole[1] - whole[0]
    boxes = whole[None]
    zeros, undecided, examined = [np.empty((0, len(sides)))], [np.empty((0, *whole.shape))], 0
    with np.errstate(all="ignore"):
        while len(boxes) and examined < most:
            batch, boxes = boxes[-_BATCH:], boxes[:-_BATCH]
            examined += len(batch)
            low, high = closures.bounds(batch)
            batch = batch[((low <= 0.0) & (high >= 0.0)).all(axis=1)]
            image = _Krawczyk.of(closures, batch)
            cut = batch.copy()
            cut[:, 0] = np.maximum(batch[:, 0], image.middle - image.radius)
            cut[:, 1] = np.minimum(batch[:, 1], image.middle + image.radius)
            met = np.flatnonzero((cut[:, 0] <= cut[:, 1]).all(axis=1))
            batch, cut = batch[met], cut[met]
            widths, before = cut[:, 1] - cut[:, 0], batch[:, 1] - batch[:, 0]
            is_large = np.asarray((widths > _SMALL * sides).any(axis=1))
            proved, doubtful = _prove_zeros(closures, cut[~is_large], sides)
            zeros.append(proved)
            undecided.append(doubtful)
            is_narrower = np.asarray((widths < _NARROWER * before).any(axis=1))
            halves = halve_boxes(cut[is_large & ~is_narrower], sides)
            boxes = np.concatenate([boxes, cut[is_large & is_narrower], halves])
    return np.concatenate(zeros), np.concatenate([*undecided, boxes]), examined


def _prove_zeros(closures: _Closures, boxes: Array, sides: Array) -> tuple[Array, Array]:
    """Return the zeros (K, m) of small boxes that are proved, and the boxes in which none is."""
    middle = 0.5 * (boxes[:, 0] + boxes[:, 1])
    wide = np.stack([middle - _WIDE * sides, middle + _WIDE * sides], axis=1)
    image = _Krawczyk.of(closures, wide)
    low, high = image.middle - image.radius, image.middle + image.radius
    is_proved = ((low > wide[:, 0]) & (high < wide[:, 1])).all(axis=1)
    return middle[is_proved], boxes[~is_proved]


def _distinct(robot: Manipulator, poses: Array, near: Array) -> Poses:
    """Return poses (K, m), those found on both sides of a wall once, in the order of the first."""
    distinct: list[Array] = []
    for pose in poses[np.lexsort(poses.T)]:
        away = [pose - other for other in distinct]
        for difference in away:
            difference[robot.wraps] = wrap_angle(difference[robot.wraps])
        if not any((np.abs(difference) <= near).all() for difference in away):
            distinct.append(pose)
    return np.array(distinct).reshape(-1, robot.freedom)
