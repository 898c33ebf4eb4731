"""Residuals of a calibration's measurements, and their slopes against all unknowns.

The pose x of a row follows from its readings q by direct kinematics, so that unknowns theta move it
by dx = -J^-1 (dq/dtheta) dtheta. Every measurement is a function of that pose and of a mark on the
platform. With more legs than coordinates no pose has all readings exactly: q = q(x) + N s, with the
pose x that fits them best, misfits s, and columns N across those of J. The misfits, or closures,
should be 0, which counts as measured; and the square matrix [J N] takes the place of J.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.guess import Guess, UnknownBlock, plane_axes
from pteron.calibration.measurements import Measurements, length_columns, position_axes
from pteron.equations.machine import numbers
from pteron.equations.variations import slope_matrix, slope_terms
from pteron.kernels.geometry_slopes import slope_columns, slopes_kernel
from pteron.manipulator import Manipulator

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

_STEPS = 12
"""Most of Newton's steps to a pose; from a measured or an earlier one two or three do."""

_CLOSED = 1e-12
"""Newton's step, as a share of the machine's size, below which the pose is found."""


class ResidualRows(NamedTuple):
    """Residuals (N, K) of N rows: of position, angles, closure, height and distance.

    Three are of position, k of angles, n - m of closure, and one each of height and distance.
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

    def __init__(self, robot: Manipulator, blocks: Sequence[UnknownBlock]) -> None:
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
        self._angle_part = slice(3, 3 + len(self._angular))
        self._closure_part = slice(3 + len(self._angular), -2)
        self._lengths = length_columns(robot)
        self._axes = position_axes(robot)
        self._frame = next((b.where for b in blocks if b.kind == "frame"), None)

    def poses(self, guess: Guess, joints: Array, start: Array) -> Array:
        """Return the poses (N, m) of joint coordinates by Newton's steps; NaN where they fail."""
        geometry, poses = np.array(numbers(guess.robot)), np.array(start)
        open_rows = np.arange(len(poses))
        for _ in range(_STEPS):
            joints_at, jacobian, *_ = self._kernel(geometry, poses[open_rows])
            residuals = self._wrap_angles(joints[open_rows] - joints_at)
            square = self._square_jacobian(jacobian)
            step = self._solve_stack(square, residuals[..., None])[:, : poses.shape[1], 0]
            poses[open_rows] += step
            unconverged = np.abs(step).max(axis=-1, initial=0.0) > _CLOSED * max(self.size, 1.0)
            open_rows = open_rows[unconverged | np.isnan(step).any(axis=-1)]
            if not len(open_rows) or np.isnan(poses[open_rows]).any(axis=-1).all():
                break
        poses[open_rows] = np.nan
        return poses

    def joints(self, guess: Guess, poses: Array) -> Array:
        """Return the joint coordinates (N, n) at poses."""
        return self._outputs(guess, poses)[0]

    def jacobian(self, guess: Guess, poses: Array) -> Array:
        """Return the joints' slopes (N, n, m) against the pose."""
        return self._outputs(guess, poses)[1]

    def misfits(self, guess: Guess, joints: Array, poses: Array) -> Array:
        """Return joint coordinates (N, n) less those at poses, m and rad."""
        return self._wrap_angles(joints - self.joints(guess, poses))

    def pose_slopes(
        self, guess: Guess, measurements: Measurements, poses: Array
    ) -> tuple[Array, Array]:
        """Return the slopes of poses at given joints (N, m, p), and of their marks (N, 3, p)."""
        _, mark_slopes, slopes = self._marks(guess, measurements, poses, np.arange(len(poses)))
        lengths = self._axes[self._lengths] @ slopes[:, :3]
        pose_slopes = np.concatenate([lengths, slopes[:, 6:]], axis=1)
        pose_slopes = pose_slopes[:, : poses.shape[1]]
        return pose_slopes[..., : self.count], mark_slopes[..., : self.count]

    def _wrap_angles(self, missed: Array) -> Array:
        """Return differences of joint angles that turn endlessly within -pi and pi."""
        turned = (missed + np.pi) % (2.0 * np.pi) - np.pi
        return np.where(self._round, turned, missed)

    def rows(
        self, guess: Guess, measurements: Measurements, poses: Array, chosen: Numbers
    ) -> ResidualRows:
        """Return the residuals of the `chosen` rows (indices), at all rows' poses (N, m)."""
        measured = ~np.isnan(np.hstack([part[chosen] for part in measurements.parts.values()]))
        point, separations, slopes = self.slopes(guess, measurements, poses, chosen, measured)
        residuals = np.zeros(measured.shape)
        if measured[:, :3].any():
            full = np.where(measured[:, :3], measurements.positions[chosen], 0.0) @ self._axes
            residuals[:, :3] = ((point - guess.shift) @ guess.turn - full) @ self._axes.T
        if measured[:, self._angle_part].any():
            angles = self._angles(guess, poses[chosen], measurements.angles[chosen])
            residuals[:, self._angle_part] = angles
        if measured[:, self._closure_part].any():
            joints = guess.joints(measurements.readings[chosen])
            misfits = self.misfits(guess, joints, poses[chosen])
            square = self._square_jacobian(self.jacobian(guess, poses[chosen]))
            across = square[..., poses.shape[1] :]
            residuals[:, self._closure_part] = np.einsum("nij,ni->nj", across, misfits)
        if measured[:, -2].any():
            planes = np.stack([guess.planes[measurements.planes[i]] for i in chosen])
            over = np.einsum("ni,ni->n", planes[:, :3], point) - planes[:, 3]
            residuals[:, -2] = over - measurements.heights[chosen]
        if measured[:, -1].any():
            residuals[:, -1] = np.linalg.norm(separations, axis=-1) - measurements.distances[chosen]
        residuals[~measured], slopes[~measured] = 0.0, 0.0
        return ResidualRows(
            residuals, slopes[..., : self.count], slopes[..., self.count :], measured
        )

    def slopes(
        self,
        guess: Guess,
        measurements: Measurements,
        poses: Array,
        chosen: Numbers,
        measured: NDArray[np.bool_],
    ) -> tuple[Array, Array, Array]:
        """Return marks (N, 3), their separations from the ends of distances, and slopes.

        Slopes (N, K, p + 2 n) are against all unknowns, and behind them against the joint
        coordinates, of two rows.
        """
        legs, frame = len(guess.robot.legs), self._frame
        point, moved, moves = self._marks(guess, measurements, poses, chosen)
        slopes = np.zeros((*measured.shape, self.count + 2 * legs), dtype=point.dtype)
        row_slopes = slopes[..., : self.count + legs]
        if measured[:, :3].any():
            # In the instrument's frame: turn' (p - shift).
            turn = self._numbers(guess.turn)
            local = turn.T @ moved
            if frame is not None:
                arms = point - self._numbers(guess.shift)
                local[:, :, frame.start : frame.start + 3] -= turn.T
                local[:, :, frame.start + 3 : frame.stop] += turn.T @ _skew(arms)
            row_slopes[:, :3] = self._base_vectors(self._axes) @ local
        if measured[:, 3:-2].any():
            row_slopes[:, 3:-2] = moves[:, 6:]
            if frame is not None:
                rates = self._rates(guess, poses[chosen])
                slopes[:, self._angle_part, frame.start + 3 : frame.stop] -= rates
        if measured[:, -2].any():
            normals = np.stack([guess.planes[measurements.planes[i]][:3] for i in chosen])
            row_slopes[:, -2] = np.einsum("ni,nik->nk", self._base_vectors(normals), moved)
            for block in self.blocks:
                if block.kind == "plane":
                    here = np.array([measurements.planes[i] == block.name for i in chosen])
                    tilt = self._base_vectors(plane_axes(guess.planes[block.name][:3]).T).T
                    slopes[here, -2, block.where] += np.column_stack(
                        [point[here] @ tilt, -np.ones(here.sum(), dtype=point.dtype)]
                    )
        separations = point.copy()
        if measured[:, -1].any():
            drifted = np.zeros((*moved.shape[:2], moved.shape[2] + legs), dtype=point.dtype)
            drifted[..., : moved.shape[2]] = moved
            origins = measurements.origins[chosen]
            between = measured[:, -1] & (origins >= 0)
            if between.any():
                end, shifted, _ = self._marks(guess, measurements, poses, origins[between])
                separations[between] -= end
                drifted[between, :, : self.count] -= shifted[..., : self.count]
                drifted[between, :, -legs:] -= shifted[..., -legs:]
            for i in np.flatnonzero(measured[:, -1] & ~between):
                name = measurements.anchors[chosen[i]]
                separations[i] -= self._base_vectors(guess.anchors[name])
                for block in self.blocks:
                    if block.kind == "anchor" and block.name == name:
                        drifted[i, :, block.where] -= np.eye(3, dtype=point.dtype)
            slopes[:, -1] = np.einsum("ni,nik->nk", self._unit(separations), drifted)
        return point, separations, slopes

    def _marks(
        self, guess: Guess, measurements: Measurements, poses: Array, chosen: Numbers
    ) -> tuple[Array, Array, Array]:
        """Return the rows' marks (N, 3) in the base frame, and slopes against all unknowns.

        Behind these against the joint coordinates: the marks' (N, 3, p + n), and those of the
        platform's twist, the pose's angles and the closures (N, 6 + k + n - m, p + n).
        """
        outputs = self._outputs(guess, poses[chosen])
        joints, jacobian, raw, twists, place, turned, *shifts = outputs
        square, angles = self._square_jacobian(jacobian), 6 + len(self._angular)
        n, m = jacobian.shape[1:]
        moves = np.zeros((len(chosen), angles + n - m, n), dtype=twists.dtype)
        moves[:, :6, :m] = twists
        moves[:, 6:angles, :m] = np.eye(m, dtype=twists.dtype)[self._angular]
        moves[:, angles:, m:] = np.eye(n - m, dtype=twists.dtype)
        by_joint = np.swapaxes(
            self._solve_stack(np.swapaxes(square, -1, -2), np.swapaxes(moves, -1, -2)), -1, -2
        )
        slopes = np.zeros((*moves.shape[:2], self.count), dtype=moves.dtype)
        for block in self.blocks:
            if block.kind == "geometry":
                slopes[:, :, block.where] = self._geometry_slopes(guess, by_joint, raw, shifts)
            elif block.kind in ("zeros", "scales"):
                joint_slopes = by_joint[:, :, list(block.legs)]
                if block.kind == "scales":
                    read = self._readings(measurements.readings[chosen], joints)
                    joint_slopes = joint_slopes * read[:, None, list(block.legs)]
                slopes[:, :, block.where] = joint_slopes
        slopes = np.concatenate([slopes, by_joint], axis=-1)
        marks = self._numbers(guess.mark_points(measurements.marks[i] for i in chosen.tolist()))
        arms = np.einsum("nij,nj->ni", turned, marks)
        moved = slopes[:, :3] - _skew(arms) @ slopes[:, 3:6]
        for block in self.blocks:
            if block.kind == "mark":
                here = np.array([measurements.marks[i] == block.name for i in chosen])
                moved[here, :, block.where] += turned[here]
        return place + arms, moved, slopes

    def _geometry_slopes(
        self, guess: Guess, by_joint: Array, raw: Array, shifts: Sequence[Array]
    ) -> Array:
        """Return slopes (N, 6 + k, v) against the variations of the geometry."""
        matrix, several = self._matrix(guess), bool(shifts) or bool((self._owner < 0).any())
        slopes = np.zeros((*by_joint.shape[:2], len(self._owner)), dtype=by_joint.dtype)
        for i, part in enumerate(self._columns):
            mine = np.full(len(self._owner), fill_value=True) if several else self._owner == i
            against = raw[:, i] @ matrix[part][:, mine]
            slopes[:, :, mine] -= by_joint[:, :, i, None] * against[:, None]
        for shift in shifts:
            slopes[:, :6] += shift @ matrix[self._columns[0]]
        return slopes

    def _angles(self, guess: Guess, at: Array, measured: Array) -> Array:
        """Return the residuals (N, k) of the angles measured at poses (N, m)."""
        angular, platform = self._angular, guess.robot.platform
        read = np.where(np.isnan(measured), at[:, angular], measured)
        if self._frame is None:
            return np.asarray((at[:, angular] - read + np.pi) % (2.0 * np.pi) - np.pi)
        measured_poses = at.copy()
        measured_poses[:, angular] = read
        measured_turn, turn = (
            np.swapaxes(platform.placement(x)[1], -1, -2) for x in (measured_poses, at)
        )
        rotations = scipy.spatial.transform.Rotation.from_matrix(
            turn @ np.swapaxes(guess.turn @ measured_turn, -1, -2)
        ).as_rotvec()
        return np.asarray(np.einsum("nij,nj->ni", self._rates(guess, at), rotations))

    def _rates(self, guess: Guess, poses: Array) -> Array:
        """Return the matrix (N, k, 3) that takes an angular velocity to the angles' rates."""
        turning = self._outputs(guess, poses)[3][:, 3:, self._angular]
        transposed = np.swapaxes(turning, -1, -2)
        return self._solve_stack(transposed @ turning, transposed)

    # What `exact_rank` does otherwise, in integers modulo a prime

    def _outputs(self, guess: Guess, poses: Array) -> list[Array]:
        """Return the kernel's outputs at poses: joint coordinates, Jacobians, slopes, frames."""
        return [*self._kernel(np.array(numbers(guess.robot)), poses)]

    def _square_jacobian(self, jacobian: Array) -> Array:
        """Return Jacobians (N, n, m) with n - m columns of unit length across theirs: (N, n, n)."""
        n, m = jacobian.shape[1:]
        if n == m:
            return jacobian
        outside = np.linalg.qr(jacobian, mode="complete")[0][..., m:]
        return np.concatenate([jacobian, outside], axis=-1)

    def _matrix(self, guess: Guess) -> Array:
        """Return the slopes of the geometry's numbers against its variations."""
        geometry = np.array(numbers(guess.robot))
        return slope_matrix(guess.robot, self._changes, self._terms, geometry)

    def _readings(self, readings: Array, joints: Array) -> Array:
        """Return the readings (N, n) whose products with scale errors are errors of the joints."""
        return readings

    def _base_vectors(self, vectors: Array) -> Array:
        """Return vectors of the base frame (..., 3)."""
        return vectors

    def _numbers(self, array: Array) -> Array:
        """Return numbers in this class's arithmetic: floating point."""
        return array

    def _unit(self, vectors: Array) -> Array:
        """Return vectors (N, 3) divided by their lengths; zero vectors unchanged."""
        length = np.linalg.norm(vectors, axis=-1)
        return np.asarray(vectors / np.where(length > 0.0, length, 1.0)[:, None])

    def _solve_stack(self, matrix: Array, right: Array) -> Array:
        """Return matrix^-1 right of a stack; NaN where a matrix is singular."""
        with np.errstate(invalid="ignore"):  # of poses that are lost
            singular = np.linalg.det(matrix) == 0.0
        return np.asarray(np.linalg.solve(np.where(singular[:, None, None], np.nan, matrix), right))


def _skew(v: Array) -> Array:
    """Return the matrices (N, 3, 3) of the cross product with vectors (N, 3)."""
    zero = np.zeros(len(v), dtype=v.dtype)
    x, y, z = v.T
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
