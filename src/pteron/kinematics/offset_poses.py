"""Every pose of a 2R platform whose axes do not meet, on two legs that hold points on spheres.

With b = o + Rot(second_axis, beta) s of a leg, o the offset from the first axis a, and A the
sphere's centre from it, the closure is P cos(alpha) + Q sin(alpha) = K: P = A.b and Q = A.(a x b)
across a, and K, are of first degree in cos(beta) and sin(beta). Without alpha two legs leave a
trigonometric polynomial of degree four in beta: at most eight poses. Newton's method makes them
sharp.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.kernels.path_programs import spheres_kernel
from pteron.kinematics.plane_poses import repeats
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import wrap_angle
from pteron.tolerances import SAME

_DEGREE = 4
"""Degree of the trigonometric polynomial."""

_MARGIN = 1e-3
"""Imaginary part of beta, rad, up to which it may be real: a double one loses half its digits."""

_STEPS = 20
"""Maximum number of Newton steps."""

_CLOSED = 1e-11
"""Largest relative residual of the closures at a pose."""


class _Closures:
    """The closures of two legs for joints (B, 2), as functions of alpha and beta."""

    def __init__(self, robot: Manipulator, joints: Array) -> None:
        platform = robot.platform
        a, b0, o, center = (
            np.array(v)
            for v in (
                platform.axis,
                platform.second_axis,
                platform.axis_offset,
                platform.center,
            )
        )
        centers, squares = spheres_kernel(robot)(joints)
        axial_part = (a @ o) * a
        self.a, self.offset, self.b0 = a, o - axial_part, b0
        self.arms = centers - center - axial_part  # (B, 2, 3)
        self.squares = squares
        self.points = np.array([leg.platform_point for leg in robot.legs]) @ np.array(
            platform.frame
        )

    def terms(self, which: NDArray[np.int64], beta: Array) -> tuple[Array, Array, Array]:
        """Return P, Q and K (K, 2) at angles beta (K,) of rows `which` (K,)."""
        arms, b = self.arms[which], self.offset + self._rotate_points(beta)
        normal_part = arms - (arms @ self.a)[..., None] * self.a
        p, q = (normal_part * b).sum(-1), (arms * np.cross(self.a, b)).sum(-1)
        sizes = (arms**2).sum(-1) + (b**2).sum(-1) - self.squares[which]
        return p, q, 0.5 * sizes - (arms @ self.a) * (b @ self.a)

    def _rotate_points(self, beta: Array) -> Array:
        """Return the platform points (K, 2, 3) from P, turned by beta about the second axis."""
        s, c, n = self.points, np.cos(beta)[:, None, None], np.sin(beta)[:, None, None]
        axial_part = (s @ self.b0)[:, None] * self.b0
        return np.asarray(axial_part + c * (s - axial_part) + n * np.cross(self.b0, s))


def offset_poses(robot: Manipulator, joints: Array) -> tuple[NDArray[np.int64], Array]:
    """Return all poses (K, 2) of joint coordinates (B, 2), and the row of each (K,)."""
    closures = _Closures(robot, joints)
    good = np.flatnonzero(np.isfinite(closures.arms).all(axis=(1, 2)))
    count = 4 * _DEGREE
    sampled = 2.0 * np.pi * np.arange(count) / count
    rows = np.repeat(good, count)
    (p1, p2), (q1, q2), (k1, k2) = (
        part.T for part in closures.terms(rows, np.tile(sampled, len(good)))
    )
    samples = (k1 * q2 - k2 * q1) ** 2 + (p1 * k2 - p2 * k1) ** 2 - (p1 * q2 - p2 * q1) ** 2
    waves = np.fft.fft(samples.reshape(-1, count)) / count
    coefficients = np.roll(waves, _DEGREE, axis=1)[:, : 2 * _DEGREE + 1]  # of z^-4 to z^4
    which, betas = [], []
    for row, polynomial in zip(good, coefficients, strict=True):
        beta = -1j * np.log(np.roots(polynomial[::-1]))
        betas.append(beta.real[np.abs(beta.imag) < _MARGIN])
        which.append(np.full(len(betas[-1]), row))
    if not which:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
    indices, beta = np.concatenate(which), np.concatenate(betas)
    p, q, k = (part[:, 0] for part in closures.terms(indices, beta))
    with np.errstate(divide="ignore", invalid="ignore"):
        opening = np.arccos(np.clip(k / np.hypot(p, q), -1.0, 1.0))
    middle = np.arctan2(q, p)
    indices = np.concatenate([indices, indices])
    starts = np.concatenate([middle + opening, middle - opening]), np.concatenate([beta, beta])
    poses, residuals = _refine_poses(closures, indices, np.stack(starts, axis=-1))
    closed = np.flatnonzero(residuals < _CLOSED)
    closed = closed[np.argsort(indices[closed], kind="stable")]
    rows, poses = indices[closed], wrap_angle(poses[closed])

    def are_same(later: slice, earlier: slice) -> NDArray[np.bool_]:
        """Return whether poses are equal up to full turns."""
        away = np.abs(wrap_angle(poses[later] - poses[earlier]))
        return np.asarray(away.max(axis=-1, initial=0.0) < SAME)

    single = ~repeats(rows, are_same, 4 * _DEGREE)
    return rows[single], poses[single]


def _refine_poses(closures: _Closures, which: NDArray[np.int64], x: Array) -> tuple[Array, Array]:
    """Return poses (K, 2) after Newton's method, and their largest relative residual (K,)."""
    size = closures.squares[which].max(axis=-1)
    for _ in range(_STEPS):
        c, s = np.cos(x[:, :1]), np.sin(x[:, :1])
        p, q, k = closures.terms(which, x[:, 1])
        # Of first degree in cos(beta) and sin(beta): the derivative is half a difference.
        ahead, behind = (closures.terms(which, x[:, 1] + t * 0.5 * np.pi) for t in (1, -1))
        dp, dq, dk = (0.5 * (u - v) for u, v in zip(ahead, behind, strict=True))
        missed = p * c + q * s - k
        slopes = np.stack([q * c - p * s, dp * c + dq * s - dk], axis=-1)
        x = x - (np.linalg.pinv(slopes) @ missed[..., None])[..., 0]
    c, s = np.cos(x[:, :1]), np.sin(x[:, :1])
    p, q, k = closures.terms(which, x[:, 1])
    return x, np.abs(p * c + q * s - k).max(axis=-1, initial=0.0) / size
