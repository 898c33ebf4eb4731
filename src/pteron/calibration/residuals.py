"""Residuals of a calibration's measurements, and their slopes against all unknowns.

The pose x of a row follows from its readings q by direct kinematics, so that unknowns theta move it
by dx = -J^-1 (dq/dtheta) dtheta. Every measurement is a function of that pose and of a mark on the
platform.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

from pteron.calibration.guess import Block, Guess, across
from pteron.calibration.measurements import Measurements, length_columns, position_axes
from pteron.calibration.variations import slope_matrix, slope_terms
from pteron.equations.machine import numbers
from pteron.kernels.geometry_slopes import slope_columns, slopes_kernel
from pteron.manipulator import Manipulator

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

_STEPS = 12
"""Most of Newton's steps to a pose; from a measured or an earlier one two or three do."""

_CLOSED = 1e-12
"""Newton's step, as a share of the machine's size, below which the pose is found."""


class Rows(NamedTuple):
    """Residuals (N, K) of N rows: three of position, k of angles, one of height, one of distance.

    What was not measured has a residual and slopes of zero.
    """

    residuals: Array
    """Computed minus measured."""
    slopes: Array
    """(N, K, p), against all unknowns."""
    by_reading: Array
    """(N, K, 2 n), against the row's joint coordinates, and those of where its distance is from."""
    measured: NDArray[np.bool_]
    """(N, K)."""


class MachineSlopes:
    """Joint coordinates, poses and their slopes, for machines of one topology.

    Parameters
    ----------
    robot : Manipulator
        One of them.
    blocks : sequence of Block
        What is sought.
    """

    def __init__(self, robot: Manipulator, blocks: Sequence[Block]) -> None:
        self.blocks = blocks
        self.count = blocks[-1].where.stop if blocks else 0
        self._kernel = slopes_kernel(robot)
        self._columns = np.array([list(part) for part in slope_columns(robot)])
        self._round = np.array([leg.goes_round for leg in robot.legs])
        self._changes = next((b.changes for b in blocks if b.kind == "geometry"), ())
        self._terms = slope_terms(robot, self._changes)
        self._owner = np.array([change.leg for change in self._changes], dtype=int)
        self.size = max(leg.size for leg in robot.legs) or 1.0
        self._angular = np.flatnonzero(robot.platform.angular)
        self._lengths = length_columns(robot)
        self._axes = position_axes(robot)
        self._frame = next((b.where for b in blocks if b.kind == "frame"), None)

    def poses(self, guess: Guess, joints: Array, start: Array) -> Array:
        """Return the poses (N, m) of joint coordinates by Newton's steps; NaN where they fail."""
        geometry, poses = np.array(numbers(guess.robot)), np.array(start)
        left = np.arange(len(poses))
        for _ in range(_STEPS):
            found, jacobian, *_ = self._kernel(geometry, poses[left])
            missed = self._wrapped(joints[left] - found)
            step = _solved(jacobian, missed[..., None])[..., 0]
            poses[left] += step
            going = np.abs(step).max(axis=-1, initial=0.0) > _CLOSED * max(self.size, 1.0)
            left = left[going | np.isnan(step).any(axis=-1)]
            if not len(left) or np.isnan(poses[left]).any(axis=-1).all():
                break
        poses[left] = np.nan
        return poses

    def joints(self, guess: Guess, poses: Array) -> Array:
        """Return the joint coordinates (N, n) at poses."""
        return np.asarray(self._kernel(np.array(numbers(guess.robot)), poses)[0])

    def jacobian(self, guess: Guess, poses: Array) -> Array:
        """Return the joints' slopes (N, n, m) against the pose."""
        return np.asarray(self._kernel(np.array(numbers(guess.robot)), poses)[1])

    def pose_slopes(self, guess: Guess, given: Measurements, poses: Array) -> tuple[Array, Array]:
        """Return the slopes of poses at given joints (N, m, p), and of their marks (N, 3, p)."""
        chosen = np.arange(len(poses))
        place, turned, slopes = self._platform(guess, given, poses, chosen)
        _, moved = self._marks(guess, given, chosen, place, turned, slopes)
        lengths = np.eye(3) if len(self._lengths) == 3 else self._axes[self._lengths]
        whole = np.concatenate([lengths @ slopes[:, :3], slopes[:, 6:]], axis=1)
        return whole[..., : self.count], moved[..., : self.count]

    def _wrapped(self, missed: Array) -> Array:
        turned = (missed + np.pi) % (2.0 * np.pi) - np.pi
        return np.where(self._round, turned, missed)

    def rows(self, guess: Guess, given: Measurements, poses: Array, chosen: Numbers) -> Rows:
        """Return the residuals of chosen rows (by number) at their poses (N, m), of all rows."""
        n, k = len(chosen), len(self._angular)
        residuals = np.zeros((n, 5 + k))
        measured = ~np.isnan(np.hstack([part[chosen] for part in given.parts.values()]))
        # Against all unknowns, and behind them against the joint coordinates, of two rows
        legs = len(guess.robot.legs)
        slopes = np.zeros((n, 5 + k, self.count + 2 * legs))
        own = slopes[..., : self.count + legs]
        place, turned, moves = self._platform(guess, given, poses, chosen)
        point, moved = self._marks(guess, given, chosen, place, turned, moves)

        if measured[:, :3].any():
            # In the instrument's frame: turn' (p - shift).
            arms = point - guess.shift
            full = np.where(measured[:, :3], given.positions[chosen], 0.0) @ self._axes
            residuals[:, :3] = (arms @ guess.turn - full) @ self._axes.T
            local = guess.turn.T @ moved
            if (frame := self._frame) is not None:
                local[:, :, frame.start : frame.start + 3] -= guess.turn.T
                local[:, :, frame.start + 3 : frame.stop] += guess.turn.T @ _skew(arms)
            own[:, :3] = self._axes @ local
        if measured[:, 3 : 3 + k].any():
            own[:, 3 : 3 + k] = moves[:, 6:]
            self._angles(guess, given, poses, chosen, residuals, slopes)
        if measured[:, -2].any():
            planes = np.stack([guess.planes[given.planes[i]] for i in chosen])
            normals = planes[:, :3]
            residuals[:, -2] = _dot(normals, point) - planes[:, 3] - given.heights[chosen]
            own[:, -2] = np.einsum("ni,nik->nk", normals, moved)
            for block in self.blocks:
                if block.kind == "plane":
                    here = np.array([given.planes[i] == block.name for i in chosen])
                    tilt = across(guess.planes[block.name][:3])
                    slopes[here, -2, block.where] += np.column_stack(
                        [point[here] @ tilt, -np.ones(here.sum())]
                    )
        if measured[:, -1].any():
            apart, drifted = self._apart(guess, given, poses, chosen, point, moved)
            length = np.linalg.norm(apart, axis=-1)
            along = apart / np.where(length > 0.0, length, 1.0)[:, None]
            residuals[:, -1] = length - given.distances[chosen]
            slopes[:, -1] = np.einsum("ni,nik->nk", along, drifted)
        residuals[~measured], slopes[~measured] = 0.0, 0.0
        return Rows(residuals, slopes[..., : self.count], slopes[..., self.count :], measured)

    def _platform(
        self, guess: Guess, given: Measurements, poses: Array, chosen: Numbers
    ) -> tuple[Array, Array, Array]:
        """Return P, its axes' matrix, and slopes (N, 6 + k, p + n).

        They are those of the platform's twist and of the pose's angles, against all unknowns and
        the joint coordinates.
        """
        robot = guess.robot
        geometry = np.array(numbers(robot))
        at = poses[chosen]
        _, jacobian, raw, twists, place, turned, *shifts = self._kernel(geometry, at)
        if not robot.platform.tilts:
            twists = np.zeros_like(twists)
            lengths = robot.platform.directions
            twists[:, :3, : len(lengths)] = lengths.T
            if robot.platform.turns:
                twists[:, 3:, -1] = robot.platform.axis
            place, axes = robot.platform.at(at)
            turned = np.swapaxes(axes, -1, -2)
        rates = np.eye(len(robot.coordinates))[self._angular]
        moves = np.concatenate([twists, np.broadcast_to(rates, (len(at), *rates.shape))], axis=1)
        by_joint = np.swapaxes(
            _solved(np.swapaxes(jacobian, -1, -2), np.swapaxes(moves, -1, -2)), -1, -2
        )
        slopes = np.zeros((*moves.shape[:2], self.count))
        matrix = slope_matrix(robot, self._changes, self._terms, geometry)
        for block in self.blocks:
            if block.kind == "geometry":
                if shifts or (self._owner < 0).any():
                    against = np.stack(
                        [raw[:, i] @ matrix[part] for i, part in enumerate(self._columns)], axis=1
                    )
                    found = -by_joint @ against
                    for shift in shifts:
                        found[:, :6] += shift @ matrix[self._columns[0]]
                else:
                    found = np.empty((len(at), by_joint.shape[1], len(self._owner)))
                    for i, part in enumerate(self._columns):
                        mine = self._owner == i
                        against = raw[:, i] @ matrix[part][:, mine]
                        found[:, :, mine] = -by_joint[:, :, i, None] * against[:, None]
                slopes[:, :, block.where] = found
            elif block.kind in ("zeros", "scales"):
                found = by_joint[:, :, list(block.legs)]
                if block.kind == "scales":
                    found = found * given.readings[chosen][:, None, list(block.legs)]
                slopes[:, :, block.where] = found
        return place, turned, np.concatenate([slopes, by_joint], axis=-1)

    def _marks(
        self,
        guess: Guess,
        given: Measurements,
        chosen: Numbers,
        place: Array,
        turned: Array,
        slopes: Array,
    ) -> tuple[Array, Array]:
        """Return the rows' marks (N, 3) in the base frame and their slopes."""
        own = guess.marked(given.marks[i] for i in chosen.tolist())
        arms = np.einsum("nij,nj->ni", turned, own)
        moved = slopes[:, :3] - _skew(arms) @ slopes[:, 3:6]
        for block in self.blocks:
            if block.kind == "mark":
                here = np.array([given.marks[i] == block.name for i in chosen])
                moved[here, :, block.where] += turned[here]
        return place + arms, moved

    def _angles(
        self,
        guess: Guess,
        given: Measurements,
        poses: Array,
        chosen: Numbers,
        residuals: Array,
        slopes: Array,
    ) -> None:
        """Fill in the residuals of angles, and their slopes against an unknown frame."""
        angular, at = self._angular, poses[chosen]
        read = np.where(np.isnan(given.angles[chosen]), at[:, angular], given.angles[chosen])
        part = slice(3, 3 + len(angular))
        if self._frame is None:
            missed = at[:, angular] - read
            residuals[:, part] = (missed + np.pi) % (2.0 * np.pi) - np.pi
            return
        platform, whole = guess.robot.platform, at.copy()
        whole[:, angular] = read
        told, now = (np.swapaxes(platform.at(x)[1], -1, -2) for x in (whole, at))
        off = Rotation.from_matrix(now @ np.swapaxes(guess.turn @ told, -1, -2)).as_rotvec()
        rates = self._rates(guess, at)
        residuals[:, part] = np.einsum("nij,nj->ni", rates, off)
        slopes[:, part, self._frame.start + 3 : self._frame.stop] -= rates

    def _rates(self, guess: Guess, poses: Array) -> Array:
        """Return the matrix (N, k, 3) that takes an angular velocity to the angles' rates."""
        platform = guess.robot.platform
        if not platform.tilts:
            return np.broadcast_to(np.array(platform.axis), (len(poses), 1, 3))
        twists = self._kernel(np.array(numbers(guess.robot)), poses)[3]
        return np.asarray(np.linalg.pinv(twists[:, 3:, self._angular]))

    def _apart(
        self,
        guess: Guess,
        given: Measurements,
        poses: Array,
        chosen: Numbers,
        point: Array,
        moved: Array,
    ) -> tuple[Array, Array]:
        """Return marks less where their distances are from, anchors or other rows; with slopes."""
        apart, legs = point.copy(), len(guess.robot.legs)
        drifted = np.pad(moved, ((0, 0), (0, 0), (0, legs)))
        measured, origins = ~np.isnan(given.distances[chosen]), given.origins[chosen]
        between = measured & (origins >= 0)
        if between.any():
            others = origins[between]
            place, turned, slopes = self._platform(guess, given, poses, others)
            end, shifted = self._marks(guess, given, others, place, turned, slopes)
            apart[between] -= end
            drifted[between, :, : self.count] -= shifted[..., : self.count]
            drifted[between, :, -legs:] -= shifted[..., -legs:]
        for i in np.flatnonzero(measured & ~between):
            name = given.anchors[chosen[i]]
            apart[i] -= guess.anchors[name]
            for block in self.blocks:
                if block.kind == "anchor" and block.name == name:
                    drifted[i, :, block.where] -= np.eye(3)
        return apart, drifted


def _solved(matrix: Array, right: Array) -> Array:
    """Return matrix^-1 right of a stack; NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        found = np.full(np.broadcast_shapes(right.shape), np.nan)
        for i in range(len(matrix)):
            try:
                found[i] = np.linalg.solve(matrix[i], right[i])
            except np.linalg.LinAlgError:
                continue
        return found


def _skew(v: Array) -> Array:
    zero = np.zeros(len(v))
    x, y, z = v.T
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ni,ni->n", a, b))
