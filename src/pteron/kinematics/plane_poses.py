"""Every pose of a platform that tilts whose legs keep their points in planes, one for each joint.

The planes n_i . (P + R s_i) = o_i of a Hexapteron are linear in P; without it three equations
linear in R remain, as the three of a spherical machine are, where P stays. With the rotation's
quaternion x they are three quadrics x^T A_k x = 0, which meet in eight points, up to scale:
Macaulay's matrix of degree four has a null space of dimension eight, in which multiplication by a
linear form has the points as its eigenvectors (Cox, Little and O'Shea, Using Algebraic Geometry,
chapter 3). Newton's method makes the real ones sharp.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.equations.closing import held_planes
from pteron.equations.machine import Machine
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms.nearest_pose import nearest_pose
from pteron.tolerances import SAME

_POINTS = 8
"""The number of common points of three quadrics."""

_DEPENDENT = 1e-10
"""Singular value over the largest at which the quadrics meet in a curve: rounding leaves 1e-14."""

_NEARLY_REAL = 1e-3
"""Imaginary part of a unit quaternion up to which a solution may be real: a double one loses half
its digits, a fourfold one three quarters."""

_STEPS = 20
"""Maximum number of Newton steps; near a double solution each halves the distance."""

_CLOSED = 1e-12
"""Largest residual of the scaled quadrics at a solution: some hundred roundings."""


def _monomials(degree: int) -> list[tuple[int, ...]]:
    """Return the monomials of a degree in four variables, as sorted tuples of their factors."""
    return list(combinations_with_replacement(range(4), degree))


_QUADRATIC, _CUBIC, _QUARTIC = (_monomials(degree) for degree in (2, 3, 4))
_PLACE = {monomial: k for k, monomial in enumerate(_QUARTIC)}
_PRODUCTS = np.array([[_PLACE[tuple(sorted(a + b))] for b in _QUADRATIC] for a in _QUADRATIC])
"""The place of the product of two quadratic monomials among those of degree four."""
_MULTIPLES = np.array([[_PLACE[tuple(sorted((*m, i)))] for m in _CUBIC] for i in range(4)])
"""(4, 20): the place of the product of a variable and a cubic monomial."""
_FORMS = np.random.default_rng(0).normal(size=(2, 4))
"""Two linear forms that vanish in no solution but by chance."""


def plane_poses(
    robot: Manipulator, joints: Array
) -> tuple[NDArray[np.int64], Array, NDArray[np.bool_]]:
    """Return all poses of joint coordinates (B, n), the row of each, and whether rows can move.

    As `tilting_assembly.tilting_poses`.
    """
    q = ca.SX.sym("q", robot.joint_count)
    function = ca.Function("planes", [q], list(held_planes(Machine.numeric(robot), q)))
    normals, offsets = (np.asarray(part).T for part in function(joints.T))
    normals = normals.reshape(len(joints), robot.joint_count, 3)
    points = np.array([leg.platform_point for leg in robot.legs])
    center = robot.platform.fixed_point
    matrices = normals[..., :, None] * points[:, None, :]  # <n s^T, R> = n . R s
    if center is not None:
        forms, heights = matrices, offsets - normals @ np.array(center)
    else:
        shares = np.linalg.svd(normals)[0][..., 3:].swapaxes(-1, -2)  # without P
        forms = np.einsum("bki,bijl->bkjl", shares, matrices)
        heights = np.einsum("bki,bi->bk", shares, offsets)
    finite = np.isfinite(forms).all(axis=(1, 2, 3)) & np.isfinite(heights).all(axis=1)
    good = np.flatnonzero(finite)
    which, rotations, curve = quadric_rotations(forms[good], heights[good])
    moving = np.zeros(len(joints), dtype=bool)
    moving[good] = curve
    rows = good[which]
    place = np.broadcast_to(np.zeros(3) if center is None else np.array(center), (len(rows), 3))
    if center is None:
        turned = np.einsum("bijl,bjl->bi", matrices[rows], rotations)
        right = (offsets[rows] - turned)[..., None]
        place = (np.linalg.pinv(normals[rows]) @ right)[..., 0]
    return rows, nearest_pose(robot.platform, place, rotations), moving


def quadric_rotations(
    forms: Array, heights: Array
) -> tuple[NDArray[np.int64], Array, NDArray[np.bool_]]:
    """Return the rotations R (K, 3, 3) with <forms_k, R> = heights_k, and the row of each (K,).

    `forms` is (B, 3, 3, 3), `heights` (B, 3). The third result (B,) is whether a row's rotations
    form a curve.
    """
    quadrics = _quadrics(forms, heights)
    upper = np.triu_indices(4)
    coefficients = (quadrics * (2.0 - np.eye(4)))[..., upper[0], upper[1]]
    rows = np.zeros((len(forms), 3, len(_QUADRATIC), len(_QUARTIC)))
    for k, places in enumerate(_PRODUCTS):
        rows[:, :, k, places] = coefficients
    _, sigmas, axes = np.linalg.svd(rows.reshape(len(forms), -1, len(_QUARTIC)))
    rank = len(_QUARTIC) - _POINTS
    curve = ~(sigmas[:, rank - 1] > _DEPENDENT * sigmas[:, 0])
    null = axes[:, rank:].swapaxes(-1, -2)
    shifted = null[:, _MULTIPLES]  # (B, 4, 20, 8)
    first, second = np.einsum("fi,bijk->fbjk", _FORMS, shifted)
    vectors = np.linalg.eig(np.linalg.pinv(second) @ first)[1]
    scale = second @ vectors
    products = np.einsum("bijk,bkl->bijl", shifted, vectors)
    points = np.einsum("bijl,bjl->bli", products, scale.conj())  # up to scale, (B, 8, 4)
    largest = np.take_along_axis(points, np.abs(points).argmax(-1)[..., None], axis=-1)
    points = points / largest
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    real = (np.abs(points.imag).max(axis=-1) < _NEARLY_REAL) & ~curve[:, None]
    which, _ = np.nonzero(real)
    sharp, residuals = _refine_quaternions(quadrics[which], points.real[real])

    def are_same(later: slice, earlier: slice) -> NDArray[np.bool_]:
        """Return whether quaternions are equal, or opposite."""
        products = (sharp[later] * sharp[earlier]).sum(axis=-1)
        return np.asarray(np.abs(products) > 1.0 - 0.5 * SAME**2)

    single = (residuals < _CLOSED) & ~repeats(which, are_same, _POINTS)
    return which[single], _rotations(sharp[single]), curve


def _quadrics(forms: Array, heights: Array) -> Array:
    """Return A_k (B, 3, 4, 4) with x^T A_k x = <forms_k, R(x)> - heights_k x.x, of size 1."""
    trace = np.trace(forms, axis1=-2, axis2=-1)
    quadrics = np.empty((*heights.shape, 4, 4))
    quadrics[..., 0, 0] = trace - heights
    axial = np.stack([forms[..., i - 1, i - 2] - forms[..., i - 2, i - 1] for i in range(3)], -1)
    quadrics[..., 0, 1:] = quadrics[..., 1:, 0] = axial
    plain = (trace + heights)[..., None, None] * np.eye(3)
    quadrics[..., 1:, 1:] = forms + forms.swapaxes(-1, -2) - plain
    sizes: Array = np.linalg.norm(quadrics, axis=(-2, -1), keepdims=True)
    return np.asarray(quadrics / sizes)


def _refine_quaternions(quadrics: Array, x: Array) -> tuple[Array, Array]:
    """Return unit quaternions (K, 4) after Newton's method, and their largest residual (K,)."""
    for _ in range(_STEPS):
        products = np.einsum("kqij,kj->kqi", quadrics, x)
        rows = np.concatenate([2.0 * products, 2.0 * x[:, None]], axis=1)
        missed = np.einsum("kqi,ki->kq", products, x)
        missed = np.concatenate([missed, (x * x).sum(axis=-1, keepdims=True) - 1.0], axis=1)
        x = x - (np.linalg.pinv(rows) @ missed[..., None])[..., 0]
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    residuals = np.abs(np.einsum("kqij,ki,kj->kq", quadrics, x, x)).max(axis=-1, initial=0.0)
    return x, residuals


def repeats(
    which: NDArray[np.int64], are_same: Callable[[slice, slice], NDArray[np.bool_]], most: int
) -> NDArray[np.bool_]:
    """Return whether an element (K,) is the same as one before it in its row.

    Rows, `which` (K,), follow each other and have at most `most` elements; `are_same` compares the
    elements of two slices.
    """
    repeated = np.zeros(len(which), dtype=bool)
    for shift in range(1, most):
        later, earlier = slice(shift, None), slice(None, -shift)
        repeated[later] |= (which[later] == which[earlier]) & are_same(later, earlier)
    return repeated


def _rotations(x: Array) -> Array:
    """Return the rotation matrices (K, 3, 3) of unit quaternions (K, 4), scalar first."""
    w, v = x[:, 0, None, None], x[:, 1:]
    skew = np.cross(np.eye(3)[None], v[:, None, :])  # rows e_i x v: the transpose of v x
    square = (v * v).sum(axis=-1)[:, None, None]
    outer = v[:, :, None] * v[:, None, :]
    return np.asarray((w * w - square) * np.eye(3) + 2.0 * outer + 2.0 * w * skew)
