"""Direct kinematics without closed form: every pose (assembly mode) of given joint coordinates.

Platforms with one angle phi are solved here, those that tilt by `tilting_assembly`.

With their joints held, n legs keep points of the platform on spheres, circles or planes, in n - 1
dimensions. Moved by the points' offsets at phi these meet at P. A sphere, circle or plane is a row
s = (w, m, h) with w v.v + m.v + h = 0, and <s, s'> = m.m' - 2 (w h' + w' h) is, up to scale, the
cosine of the angle at which two of them meet. The n rows have one null vector (v.v, v, 1) up to
scale, and it is a point exactly if the Gram matrix G of their products is singular:

    det G(phi) = 0,  G = G_0 + G_c cos(phi) + G_s sin(phi),

as the products depend on the distances between centers and planes alone. So there are 2 n solutions
phi, real or complex: 8 modes of four legs and 6 of three, and 4 if all legs but one are planes.
They are the eigenvalues of a quadratic eigenvalue problem in tan(phi / 2). Where phi slides the
platform's halves there are 2 for each leg that is no plane.

Two modes may have one phi: where all cranks of a Par4 have one angle, its tips lie in a plane, of
which the modes are mirror images. The rows then have two null vectors, a line, which meets the
spheres twice, and det G has a double zero, of which rounding leaves half the digits. Hence at each
phi that is nearly real both points of the line of the two smallest singular values are tried, and
Newton's steps on the closures themselves, which are regular there, decide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import SingularPose
from pteron.kernels import Array, numeric
from pteron.kinematics.evaluate import place
from pteron.kinematics.tilting_assembly import tilting_poses
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import wrap_angle
from pteron.tolerances import LAST_DIGITS, ROUNDING, SAME

_BATCH = 4096
"""Rows of joint coordinates solved at a time."""


_HUGE = 1e30
"""Largest number in the rows of joints that have a pose, so that det G stays finite."""

_COINCIDING = 1e-10
"""Least size of a row after Gram-Schmidt on those before it, from a size of about 1: ten digits of
a smaller one are rounding."""

_VANISHING = 1e-14
"""Size of det G, of orthonormal rows, below which it is rounding: the platform can move with the
joints held."""

_MARGIN = 5e-3
"""Imaginary part, rad, up to which a zero of det G may be real: a fourfold one loses 3/4 of its
digits."""

_LARGEST_RESIDUAL = 0.1
"""Largest relative residual of a closure from which Newton's method starts."""

_STEPS = 20
"""Maximum number of Newton steps: they end where the residual no longer decreases."""

_SPAN = np.pi
"""Scale of a sliding platform's angle, rad: phi = `_SPAN` tan(alpha)."""

_SEPARATION, _LEAST = 6.0, 2e-16
"""Factor and floor of the residual that separates two modes. Midway between two modes the residual
is about a quarter of their squared distance: it must be this many times the residuals of both
poses, and above rounding. It separates modes to some 1e-7 of the size."""


def every_pose(robot: Manipulator, joints: Array, most: int) -> Array:
    """Return all platform poses (..., most, m) with joint coordinates (..., n), padded with NaN.

    Poses are sorted by phi, z, y and x: the coordinates from the last to the first.
    """
    shape = joints.shape[:-1]
    flat = joints.reshape(-1, joints.shape[-1])
    poses_by_state = np.empty((len(flat), most, robot.freedom))
    for start in range(0, len(flat), _BATCH):
        part = slice(start, start + _BATCH)
        if not robot.platform.tilts:
            poses_by_state[part] = _poses(robot, flat[part], most)
            continue
        which, poses, moving = tilting_poses(robot, flat[part])
        if moving.any():
            row = start + int(moving.argmax())
            index = tuple(int(i) for i in np.unravel_index(row, shape)) if shape else ()
            raise SingularPose(
                f"{place('joints', index)}: {robot.name}'s platform can move while these are held "
                f"(a self-motion), so that their poses are no list: {flat[row].tolist()}",
                kind="II",
                measure=0.0,
                index=index,
            )
        poses_by_state[part] = sort_poses(table_poses(poses, which, most, len(moving)))[:, :most]
    return poses_by_state.reshape(*shape, most, robot.freedom)


def _poses(robot: Manipulator, joints: Array, most: int) -> Array:
    """Return the poses (B, most, m) with joint coordinates (B, n), sorted, padded with NaN."""
    slides = robot.platform.slides
    zeroth, first, second, origin, size, _ = numeric(robot, "closure_rows")(joints)
    rows = np.stack([zeroth, first, second], axis=-1)
    rows[~(np.abs(rows) < _HUGE).all(axis=(-3, -2, -1))] = 0.0
    rows = _orthonormal_rows(rows)
    which, phi = _angles(rows, slides)
    which, points, phi = _points(_rows_at(rows[which], phi, slides), which, phi)
    starts = np.column_stack([origin[which] + size[which, None] * points, phi])
    which, poses, residuals = _refine_poses(robot, joints, which, starts)
    around = robot.platform.angular & bool(robot.platform.rotation_axes)
    poses[:, around] = wrap_angle(poses[:, around])
    same = _are_duplicates(robot, joints, which, poses, residuals, size)
    which, poses = which[~same], poses[~same]
    return sort_poses(table_poses(poses, which, most, len(joints)))[:, :most]


def _orthonormal_rows(rows: Array) -> Array:
    """Return orthonormal rows (B, n, d + 2, 3) with the same span at each phi.

    Rows are 0 where they are linearly dependent, so that the platform can move with the joints
    held. Two spheres with equal motion may nearly coincide, as where two rods of a Par4's side are
    parallel: their well-scaled difference then determines where they meet.
    """
    q, r = np.linalg.qr(rows.reshape(*rows.shape[:2], -1).swapaxes(-1, -2))
    is_independent = np.abs(np.diagonal(r, axis1=-2, axis2=-1)).min(axis=-1) > _COINCIDING
    orthonormal = q.swapaxes(-1, -2).reshape(rows.shape)
    return np.where(is_independent[:, None, None, None], orthonormal, 0.0)


def _angles(rows: Array, slides: bool) -> tuple[NDArray[np.int64], Array]:
    """Return the angles phi (K,) at which det G vanishes, and the state's index of each (K,).

    `rows` (B, n, d + 2, 3) are the coefficients of 1, f_1 and f_2 in the closure rows.
    """
    form = _form(rows, slides)
    n = rows.shape[1]
    # alpha = start + atan(t), with the largest determinant found at infinity.
    tried = np.pi * np.arange(4 * n) / (4 * n)
    sizes = np.abs(np.linalg.det(_form_at(form[:, None], tried)))
    able = np.flatnonzero(sizes.max(axis=-1) > _VANISHING)
    form, start = form[able], tried[sizes[able].argmax(axis=-1)] - 0.5 * np.pi
    # low + t middle + t^2 high
    low, high = _form_at(form, start), _form_at(form, start + 0.5 * np.pi)
    middle = 2.0 * _form_at(form, start + 0.25 * np.pi) - low - high
    companion = np.zeros((len(form), 2 * n, 2 * n))
    companion[:, :n, n:] = np.eye(n)
    companion[:, n:, :n] = -np.linalg.solve(high, low)
    companion[:, n:, n:] = -np.linalg.solve(high, middle)
    t = np.linalg.eigvals(companion)
    which, k = np.nonzero(np.abs(t.imag) <= _MARGIN * (1.0 + t.real**2))
    alpha = start[which] + np.arctan(t.real[which, k])
    return able[which], _SPAN * np.tan(alpha) if slides else 2.0 * alpha


def _form(rows: Array, slides: bool) -> Array:
    """Return the coefficients (B, n, n, 3) of c^2, c s, s^2 in the matrix G of angle alpha.

    phi = 2 alpha for a platform that turns; for one that slides phi = `_SPAN` s / c, and the form
    is that of c^2 G.
    """
    low = _gram(_rows_at(rows, 0.0, slides))
    if slides:
        ahead, behind = (_gram(_rows_at(rows, side * _SPAN, slides)) for side in (1.0, -1.0))
        high, middle = 0.5 * (ahead + behind) - low, 0.5 * (ahead - behind)
    else:
        high = _gram(_rows_at(rows, np.pi, slides))
        middle = 2.0 * _gram(_rows_at(rows, 0.5 * np.pi, slides)) - low - high
    return np.stack([low, middle, high], axis=-1)


def _form_at(form: Array, alpha: Array) -> Array:
    """Return the matrix G (..., n, n) at angles alpha (...), rad, from its coefficients."""
    c, s = np.cos(alpha)[..., None, None], np.sin(alpha)[..., None, None]
    total: Array = form[..., 0] * (c * c) + form[..., 1] * (c * s) + form[..., 2] * (s * s)
    return total


def _rows_at(rows: Array, phi: Array | float, slides: bool) -> Array:
    """Return closure rows (..., n, d + 2) at phi from their coefficients (..., 3)."""
    first, second = (phi, phi**2) if slides else (np.cos(phi), np.sin(phi))
    first, second = (np.asarray(f)[..., None, None] for f in (first, second))
    return rows[..., 0] + first * rows[..., 1] + second * rows[..., 2]


def _gram(s: Array) -> Array:
    """Return the matrix (..., n, n) of inner products <s, s'> of rows s (..., n, d + 2)."""
    w, m, h = s[..., 0], s[..., 1:-1], s[..., -1]
    crossed = w[..., :, None] * h[..., None, :]
    return m @ np.swapaxes(m, -1, -2) - 2.0 * (crossed + np.swapaxes(crossed, -1, -2))


def _points(
    rows: Array, which: NDArray[np.int64], phi: Array
) -> tuple[NDArray[np.int64], Array, Array]:
    """Return points (L, d) on the line of the two smallest singular vectors, with state, phi.

    `rows` (K, n, d + 2) are the closure rows at phi (K,).
    """
    _, _, vectors = np.linalg.svd(rows)
    first, second = vectors[:, -1], vectors[:, -2]
    # x = first cos + second sin is a point where x_0 x_last = v.v: a cos^2 + 2 b cos sin + c sin^2
    a, b, c = (_quadric(x, y) for x, y in ((first, first), (first, second), (second, second)))
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    far = -(b + np.copysign(root, b))
    lines = np.stack(
        [far[:, None] * first + a[:, None] * second, c[:, None] * first + far[:, None] * second],
        axis=1,
    )
    with np.errstate(all="ignore"):
        points = lines[..., 1:-1] / lines[..., -1:]
    good = np.isfinite(points).all(axis=-1)
    k, _ = np.nonzero(good)
    return which[k], points[good], phi[k]


def _quadric(x: Array, y: Array) -> Array:
    """Return the quadratic form 0.5 (x_0 y_last + x_last y_0) - v . w (K,) of x, y (K, d + 2)."""
    inner = (x[:, 1:-1] * y[:, 1:-1]).sum(axis=-1)
    return np.asarray(0.5 * (x[:, 0] * y[:, -1] + x[:, -1] * y[:, 0]) - inner)


def _refine_poses(
    robot: Manipulator, joints: Array, which: NDArray[np.int64], poses: Array
) -> tuple[NDArray[np.int64], Array, Array]:
    """Refine poses by Newton's method; return those converged: state index, pose, residual."""
    step = numeric(robot, "newton_step")
    converged, residuals = np.empty_like(poses), np.full(len(poses), _LARGEST_RESIDUAL)
    active = np.arange(len(poses))
    for _ in range(_STEPS):
        tried = poses[active]
        after, step_residuals, _ = step(joints[which[active]], tried)
        better = step_residuals < residuals[active]
        active, tried, after = active[better], tried[better], after[better]
        if not len(active):
            break
        converged[active], residuals[active], poses[active] = tried, step_residuals[better], after
    closed = residuals <= LAST_DIGITS
    return which[closed], converged[closed], residuals[closed]


def _are_duplicates(
    robot: Manipulator,
    joints: Array,
    which: NDArray[np.int64],
    poses: Array,
    residuals: Array,
    size: Array,
) -> NDArray[np.bool_]:
    """Return which poses (K, m) duplicate an earlier pose of the same joint coordinates."""
    count = np.arange(len(which)) - np.searchsorted(which, which)  # they come in order
    is_duplicate = np.zeros(len(which), dtype=bool)
    for back in range(1, int(count.max(initial=0)) + 1):
        later = np.flatnonzero(count >= back)
        difference = poses[later] - poses[later - back]
        if robot.platform.rotation_axes:
            difference[:, -1] = wrap_angle(difference[:, -1])
        units = np.ones_like(difference)
        units[:, :-1] = size[which[later], None]
        is_close = (np.abs(difference) < SAME * units).all(axis=-1)
        later, difference = later[is_close], difference[is_close]
        _, between, _ = numeric(robot, "newton_step")(
            joints[which[later]], poses[later] - 0.5 * difference
        )
        most = np.maximum(np.maximum(residuals[later], residuals[later - back]), _LEAST)
        is_duplicate[later[between <= _SEPARATION * most]] = True
    return is_duplicate


def table_poses(poses: Array, which: NDArray[np.int64], most: int, states: int) -> Array:
    """Return poses (K, m) arranged by state (B, k, m), k >= `most`, padded with NaN."""
    counts = np.bincount(which, minlength=states)
    columns = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.full((states, counts.max(initial=most), poses.shape[-1]), np.nan)
    table[which, columns] = poses
    return table


def sort_poses(poses: Array) -> Array:
    """Return poses (..., k, m) sorted by their last coordinate, then by those before; NaN last."""
    order = np.lexsort([_dense_ranks(poses[..., k]) for k in range(poses.shape[-1])])
    return np.take_along_axis(poses, order[..., None], axis=-2)


def _dense_ranks(coordinates: Array) -> NDArray[np.int64]:
    """Return integer ranks of coordinates (..., k); values equal up to rounding share a rank."""
    order = np.argsort(coordinates, axis=-1)
    steps = ~(np.diff(np.take_along_axis(coordinates, order, axis=-1), axis=-1) <= ROUNDING)
    ranks = np.zeros(coordinates.shape, dtype=np.int64)
    ranks[..., 1:] = np.cumsum(steps, axis=-1)
    np.put_along_axis(ranks, order, ranks.copy(), axis=-1)
    return ranks
