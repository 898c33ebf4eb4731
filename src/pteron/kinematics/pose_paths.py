"""Direct kinematics of tilting platforms by homotopy: all poses, followed from a known machine.

`equations.pose_paths` has the method. The file `generic_machines.npz` beside this one has, for each
kind of closures, a start machine in complex numbers with its poses;
`benchmarks/generic_machines.py` makes it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.equations.pose_paths import Closed
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.path_programs import path_kernel, rows_kernel
from pteron.kinematics.pose_curves import ROUNDING, lie_on_curves, normalise_rows, second_slopes

Complex = NDArray[np.complex128]

FILE = Path(__file__).with_name("generic_machines.npz")

_PATHS = 4096
"""Paths followed at a time."""

_STEPS = 500
"""Greatest number of steps of a path: one in a thousand takes more than a third of it."""

_BACK, _FIRST = 0.1, 0.05
"""Straight extrapolation before a path's start, and its first step, in the path's parameter."""

_LEAST = 1e-8
"""Step below which a path fails: it diverges, or nearly meets another path."""

_TRIALS = 4
"""Greatest number of attempts to follow all paths to a machine, if some are lost."""

_DUPLICATE = 1e-6
"""Sine of the angle between two poses z below which they count as one."""

_REAL = 1e-3
"""Greatest imaginary part of a pose z, |z| = 1, that Newton's steps may make real."""

_REFINING = 2
"""Pairs of Newton's steps at the end of a path."""

_CONVERGED = 1e-7
"""Greatest last step of Newton's method: beyond it a path's end may belong to another pose."""

_POLISHING = 8
"""Greatest number of Newton's steps to a real pose."""

_NO_ROTATION = 1e-7
"""Size of z's rotation part x, |z| = 1, below which P would be at infinity; of an end |x.x|."""


class Generic(NamedTuple):
    """A machine in general complex numbers, and its poses."""

    closed: Closed
    machine: Complex
    """(7 k,)."""
    poses: Complex
    """(N, d): z, |z| = 1."""

    @property
    def size(self) -> float:
        """The machine's size: root mean square of its point coordinates on base and platform."""
        points = self.machine.reshape(-1, 7)[: self.closed.spheres, :6]
        return float(np.sqrt((np.abs(points) ** 2).sum(axis=-1).mean()))


@lru_cache
def generic(closed: Closed) -> Generic:
    """Return the start machine, with all its known poses, for a kind of closure equations."""
    key = key_of(closed)
    with np.load(FILE) as file:
        if f"machine {key}" not in file:
            raise ModelError(
                f"direct_kinematics: there is no start machine of the kind {key} to follow poses "
                'from; use "direct_step" from a pose that is near'
            )
        return Generic(closed, file[f"machine {key}"], file[f"poses {key}"])


def key_of(closed: Closed) -> str:
    """Return the name under which the data file holds a kind of closure equations."""
    return "-".join(str(int(part)) for part in closed)


class RealPoses(NamedTuple):
    """The real poses of machines."""

    which: NDArray[np.int64]
    """(K,): the number of the machine of each pose, ascending."""
    poses: Array
    """(K, d): z, |z| = 1."""
    move: NDArray[np.bool_]
    """(B,): whether poses of a machine form a curve, a self-motion; its points are not listed."""


def real_poses(closed: Closed, machines: Array) -> RealPoses:
    """Return all real poses of machines with numbers (B, k, 7), by path following.

    See `advance_path` for the numbers of a machine, which should be of size 1 or so.
    """
    known = generic(closed)
    share = max(_PATHS // len(known.poses), 1)
    batches = [
        _real_poses(known, machines[start : start + share], start)
        for start in range(0, len(machines), share)
    ]
    if not batches:
        return RealPoses(np.empty(0, int), np.empty((0, closed.size)), np.empty(0, bool))
    return RealPoses(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


def _real_poses(known: Generic, machines: Array, first: int) -> RealPoses:
    """Return all real poses of machines (B, k, 7), up to `_TRIALS` random rotations of each."""
    rng = np.random.default_rng(1)
    remaining, move = np.arange(len(machines)), np.zeros(len(machines), dtype=bool)
    which, poses = np.empty(0, dtype=np.int64), np.empty((0, known.closed.size))
    certain = np.empty(0)
    for trial in range(_TRIALS):
        turns = _unit_quaternion(rng), _unit_quaternion(rng)
        turned = _rotate_machines(machines[remaining], *turns)
        ends, arrived, converged = follow_paths(known, turned)
        machine_index, real = _candidates(ends, arrived)
        real = _polish_poses(
            known.closed, machines[remaining[machine_index]], _rotate_back(real, *turns)
        )
        good, radius = _prove_poses(known.closed, machines[remaining[machine_index]], real)
        counts = np.bincount(which, minlength=len(machines))
        which = np.concatenate([which, remaining[machine_index[good]]])
        poses, certain = (
            np.concatenate([poses, real[good]]),
            np.concatenate([certain, radius[good]]),
        )
        order = np.argsort(which, kind="stable")
        which, poses, certain = which[order], poses[order], certain[order]
        is_new = ~_are_duplicates(which, poses, certain)
        which, poses, certain = which[is_new], poses[is_new], certain[is_new]
        missing = ~(converged.all(axis=-1) & _all_differ(ends))
        if trial:  # paths that are lost in every attempt lead to no pose
            missing &= (np.bincount(which, minlength=len(machines)) > counts)[remaining]
        else:
            turns = np.abs((ends[..., :4] ** 2).sum(axis=-1)) > _NO_ROTATION
            machine_index, lost = np.nonzero(~converged & turns)
            starts = normalise_rows(_largest_real(ends[machine_index, lost]).real)
            move[machine_index[lie_on_curves(known.closed, turned[machine_index], starts)]] = True
        remaining = remaining[missing & ~move[remaining]]
        if not len(remaining):
            break
    is_isolated = ~move[which]
    return RealPoses(which[is_isolated] + first, poses[is_isolated], move)


_Step = Callable[[Array, Array], tuple[Array, Array]]


def _step(known: Generic) -> _Step:
    """Return the compiled step of the path tracker from a known machine to real machines."""
    machine = known.machine
    return path_kernel(known.closed, (tuple(machine.real.tolist()), tuple(machine.imag.tolist())))


def _any_step(known: Generic) -> _Step:
    """Return the compiled step of the path tracker from a known machine to complex ones."""
    kernel, start = path_kernel(known.closed, None), _parts(known.machine)
    return lambda at, target: kernel(at, start, target)


def follow_paths(
    known: Generic, targets: Array | Complex
) -> tuple[Complex, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return path ends z (B, N, d) at machines (B, k, 7), whether reached, and whether converged.

    Two arrays (B, N) follow: whether a path has arrived, and whether Newton's method then
    converges.
    """
    count, d = known.poses.shape
    machines = targets.reshape(len(targets), 7 * known.closed.equations)
    general = np.iscomplexobj(machines)
    step = _any_step(known) if general else _step(known)
    parts = _parts(machines.astype(complex)) if general else machines.real
    target = np.repeat(parts, count, axis=0)
    z = np.tile(_parts(known.poses), (len(targets), 1))
    at, arrived = _track_paths(step, target, z, d)
    ends, converged = _refine_ends(step, target, at)
    shape = -1, count
    return (
        _complex(ends, d).reshape(*shape, d),
        arrived.reshape(shape),
        (arrived & converged).reshape(shape),
    )


def _track_paths(step: _Step, target: Array, z: Array, d: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return the ends (K, 2 d) of paths from z to target machines; whether each arrived (K,)."""
    at = _initial_states(z)
    at, _ = step(at, target)  # for dz/dt
    at[:, 4 * d : 8 * d] = at[:, : 4 * d]
    at[:, 4 * d : 6 * d] -= _BACK * at[:, 2 * d : 4 * d]
    at[:, -3:] = _BACK, 0.0, _FIRST
    ends, arrived = np.zeros_like(z), np.zeros(len(z), dtype=bool)
    rows = np.arange(len(z))
    for k in range(_STEPS):
        at, _ = step(at, target)
        there = at[:, -2] >= 1.0
        over = there | ~(at[:, -1] >= _LEAST)
        # Paths that have arrived stay in the batch: that costs less than to remove each.
        if 8 * over.sum() >= len(over) or k == _STEPS - 1:
            arrived[rows], ends[rows] = there, at[:, : 2 * d]
            at, target, rows = at[~over], target[~over], rows[~over]
        if not len(rows):
            break
    return ends, arrived


def _initial_states(z: Array) -> Array:
    """Return initial states (K, 4 d + 3) of the path tracker at z (K, 2 d)."""
    width = z.shape[1]
    at = np.zeros((len(z), 4 * width + 3))
    at[:, :width] = at[:, 2 * width : 3 * width] = z
    at[:, -3] = 1.0
    return at


def _parts(z: Complex) -> Array:
    """Return the real and imaginary parts (..., 2 d) of complex numbers (..., d)."""
    return np.concatenate([z.real, z.imag], axis=-1)


def _complex(parts: Array, d: int) -> Complex:
    """Return complex numbers (..., d) from their parts, the first 2 d columns."""
    return parts[..., :d] + 1j * parts[..., d : 2 * d]


def _all_differ(ends: Complex) -> NDArray[np.bool_]:
    """Return for each machine (B,) whether all its path ends z (B, N, d) differ: none is lost."""
    alike = np.abs(ends.conj() @ np.swapaxes(ends, -1, -2)) ** 2
    pairs = np.triu(np.ones(alike.shape[1:], dtype=bool), 1)
    return np.asarray(~((alike > 1.0 - _DUPLICATE**2) & pairs).any(axis=(-2, -1)))


def _candidates(ends: Complex, arrived: NDArray[np.bool_]) -> tuple[NDArray[np.int64], Array]:
    """Return machine indices (K,) and ends z (K, d), of path ends (B, N, d), that may be real."""
    turned = _largest_real(ends)
    real = arrived & (np.abs(turned.imag).max(axis=-1) <= _REAL)
    return np.nonzero(real)[0], normalise_rows(turned.real[real])


def _largest_real(z: Complex) -> Complex:
    """Return complex z (..., d), each rotated so that its largest coordinate is real."""
    phase = np.take_along_axis(z, np.abs(z).argmax(axis=-1)[..., None], axis=-1)
    with np.errstate(all="ignore"):
        return np.asarray(z * (phase.conj() / np.abs(phase)))


def _refine_ends(step: _Step, target: Array, z: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return path ends z (K, 2 d) after Newton's steps, and whether each converged (K,)."""
    for _ in range(_REFINING):
        at = _initial_states(z)
        at[:, -2] = 1.0
        at, correction = step(at, target)
        z = at[:, : z.shape[1]]
    return z, correction <= _CONVERGED


def _polish_poses(closed: Closed, machines: Array, z: Array) -> Array:
    """Return real poses z (K, d) refined by Newton's steps that reduce their residuals."""
    numbers = machines.reshape(len(z), 7 * closed.equations)
    best, least = z, np.full(len(z), np.inf)
    for _ in range(_POLISHING):
        rows, residuals = rows_kernel(closed)(z, numbers)
        size = np.linalg.norm(residuals, axis=-1)
        better = size < least
        best, least = np.where(better[:, None], z, best), np.where(better, size, least)
        inverse = _invert(np.concatenate([rows, z[:, None]], axis=1))
        with np.errstate(all="ignore"):
            z = z - (inverse[..., :-1] @ residuals[..., None])[..., 0]
            z = z / np.linalg.norm(z, axis=-1, keepdims=True)
        z = np.where(np.isfinite(z).all(axis=-1, keepdims=True), z, best)
    return best


def _prove_poses(closed: Closed, machines: Array, z: Array) -> tuple[NDArray[np.bool_], Array]:
    """Return which z (K, d) are proved to be poses, and the radius in which each is unique (K,).

    The proof is Kantorovich's theorem. A pose next to a singularity, where the theorem does not
    apply, is accepted if its residuals are mere rounding; its radius is then 0.
    """
    if not len(z):
        return np.zeros(0, dtype=bool), np.zeros(0)
    rows, residuals = rows_kernel(closed)(z, machines.reshape(len(z), 7 * closed.equations))
    bend = second_slopes(closed, machines)
    rounding = 16.0 * np.finfo(float).eps * bend
    square_rows = np.concatenate([rows, z[:, None]], axis=1)
    with np.errstate(all="ignore"):
        inverse = np.linalg.norm(_invert(square_rows), axis=(-2, -1))
        newton = inverse * (np.linalg.norm(residuals, axis=-1) + rounding)
        proof = 2.0 * inverse * bend * newton
        radius = np.where(proof <= 1.0, 1.0 / (inverse * bend), 0.0)
    close = np.linalg.norm(residuals, axis=-1) <= ROUNDING * bend
    nowhere = np.linalg.norm(z[:, :4], axis=-1) <= _NO_ROTATION
    return (close | (radius > 0.0)) & ~nowhere, radius


def _invert(matrices: Array) -> Array:
    """Return inverses of matrices (..., d, d); infinite entries for singular ones."""
    try:
        return np.asarray(np.linalg.inv(matrices), dtype=float)
    except np.linalg.LinAlgError:
        singular = np.linalg.cond(matrices) > 1.0 / np.finfo(float).eps
        safe = np.where(singular[:, None, None], np.eye(matrices.shape[-1]), matrices)
        return np.where(singular[:, None, None], np.inf, np.linalg.inv(safe))


def _are_duplicates(which: NDArray[np.int64], z: Array, radius: Array) -> NDArray[np.bool_]:
    """Return which of the poses z (K, d) repeat an earlier pose of the same machine, (K,).

    `which` (K,) is each pose's machine, ascending; `radius` (K,) proves it unique within, if > 0.
    """
    count = np.arange(len(which)) - np.searchsorted(which, which)
    is_duplicate = np.zeros(len(which), dtype=bool)
    for back in range(1, int(count.max(initial=0)) + 1):
        later = np.flatnonzero(count >= back)
        earlier, later_z = z[later - back], z[later]
        cosines = (earlier * later_z).sum(axis=-1, keepdims=True)
        with np.errstate(all="ignore"):
            distances = np.linalg.norm(later_z / cosines - earlier, axis=-1)
        proved_radius = radius[later - back] * (radius[later] > 0.0)
        is_duplicate[
            later[distances <= np.where(proved_radius > 0.0, 0.5 * proved_radius, _DUPLICATE)]
        ] = True
    return is_duplicate


def _unit_quaternion(rng: np.random.Generator) -> Array:
    """Return a random unit quaternion (4,), uniform over rotations."""
    drawn = rng.normal(size=4)
    return np.asarray(drawn / np.linalg.norm(drawn))


def _rotate_machines(machines: Array, base: Array, platform: Array) -> Array:
    """Return machines (B, k, 7) with base and platform points rotated by unit quaternions."""
    turned = machines.copy()
    for columns, q in ((slice(0, 3), base), (slice(3, 6), platform)):
        turned[..., columns] = machines[..., columns] @ rotation(q).T
    return turned


def _rotate_back(z: Array, base: Array, platform: Array) -> Array:
    """Return poses z = (x, y) (K, d) of rotated frames expressed in the original frames."""
    u, v = base * [1.0, -1.0, -1.0, -1.0], platform
    matrix = _left_matrix(u) @ _right_matrix(v)
    return np.concatenate([z[:, k : k + 4] @ matrix.T for k in range(0, z.shape[1], 4)], axis=-1)


def _left_matrix(q: Array) -> Array:
    """Return the matrix (..., 4, 4) of left multiplication x -> q x by quaternions q (..., 4)."""
    w, i, j, k = np.moveaxis(q, -1, 0)
    rows = [[w, -i, -j, -k], [i, w, -k, j], [j, k, w, -i], [k, -j, i, w]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _right_matrix(q: Array) -> Array:
    """Return the matrix (..., 4, 4) of right multiplication x -> x q by quaternions q (..., 4)."""
    w, i, j, k = np.moveaxis(q, -1, 0)
    rows = [[w, -i, -j, -k], [i, w, k, -j], [j, -k, w, i], [k, j, -i, w]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation(x: Array) -> Array:
    """Return the rotation matrix (..., 3, 3) of quaternions x (..., 4), of any length."""
    conjugate = x * [1.0, -1.0, -1.0, -1.0]
    product = _left_matrix(x) @ _right_matrix(conjugate) / (x * x).sum(axis=-1)[..., None, None]
    return np.asarray(product[..., 1:, 1:])


def positions_and_rotations(z: Array) -> tuple[Array, Array]:
    """Return positions of P (K, 3), 0 if fixed, and rotations (K, 3, 3) of states z (K, d)."""
    x, square = z[:, :4], (z[:, :4] ** 2).sum(axis=-1)[:, None]
    place = np.zeros((len(z), 3))
    if z.shape[1] > 4:
        conjugate = x * [1.0, -1.0, -1.0, -1.0]
        product = (_right_matrix(conjugate) @ z[:, 4:, None])[..., 0]
        place = 2.0 * product[:, 1:] / square
    return place, rotation(x)
