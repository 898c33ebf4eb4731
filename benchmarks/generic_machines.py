"""Make the start machines of `pteron.kinematics.pose_paths`: random complex ones, all poses known.

It prints how many poses each has. `python benchmarks/generic_machines.py write` writes them to
`generic_machines.npz`, which the library only reads; `--quick` makes the first kind alone. From a
machine with one random pose, paths lead by way of other random machines back to it, to poses that
may be new (monodromy), until all are known.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from measuring import quick

from pteron.equations.pose_paths import Closed
from pteron.kernels import Array
from pteron.kinematics.pose_paths import FILE, Complex, Generic, follow_paths, key_of, rotation

_ALL = {
    Closed(3, 0, False): 8,
    Closed(3, 3, True): 16,
    Closed(6, 0, True): 40,
    Closed(6, 0, True, paired=True): 16,
}
"""The number of poses of machines of each kind."""

_COMPLEX = 0.25
"""Size of the random complex numbers added to real ones of about 0.6."""

_APART = 1e-5
"""Least sine of the angle between the vectors z of two poses that count as different."""


def random_machine(closed: Closed, rng: np.random.Generator) -> tuple[Complex, Complex]:
    """Return a machine, k closures of 7 numbers each, and one pose z of it."""
    x = rng.normal(size=4)
    y = rng.normal(size=4) if closed.moves else np.zeros(4)
    x, y = x / np.linalg.norm(x), 0.3 * (y - x * (x @ y) / (x @ x))
    conjugate = x * [1.0, -1.0, -1.0, -1.0]
    place = 2.0 * _product(y, conjugate)[1:]
    a, b = (
        0.6 * rng.normal(size=(closed.equations, 3)) + _COMPLEX * _drawn(rng, closed.equations)
        for _ in range(2)
    )
    if closed.moves and not closed.planes:
        a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    if closed.paired:
        b[1::2] = b[::2]
    if closed.planes:  # of the same points
        b[closed.spheres :] = b[: closed.planes]
    c = place + b @ rotation(x).T
    r = np.where(
        np.arange(closed.equations) < closed.spheres, ((c - a) ** 2).sum(-1), (a * c).sum(-1)
    )
    pose = np.concatenate([x, y]) if closed.moves else x
    machine = np.column_stack([a, b, r]).ravel()
    return machine, (pose / np.linalg.norm(pose)).astype(complex)


def known_machine(closed: Closed, count: int, rng: np.random.Generator) -> Generic:
    """Return a machine with as many poses."""
    machine, pose = random_machine(closed, rng)
    found = pose[None]
    while len(found) < count:
        ends, here = found, machine
        for there in (*(random_machine(closed, rng)[0] for _ in range(2)), machine):
            ends, _, converged = follow_paths(Generic(closed, here, ends), there[None])
            ends, here = ends[0][converged[0]], there
        for z in ends:
            alike = np.abs(found.conj() @ z) ** 2
            if (alike < 1.0 - _APART**2).all():
                found = np.concatenate([found, z[None]])
    return Generic(closed, machine, found)


def _drawn(rng: np.random.Generator, count: int) -> Complex:
    return np.asarray(rng.normal(size=(count, 3)) + 1j * rng.normal(size=(count, 3)))


def _product(x: Array, y: Array) -> Array:
    (a, u), (b, v) = (x[0], x[1:]), (y[0], y[1:])
    return np.append(a * b - u @ v, a * v + b * u + np.cross(u, v))


def main() -> None:
    """Make the machines, print their numbers of poses, and write the file if that is asked for."""
    rng = np.random.default_rng(0)
    parts: dict[str, Any] = {}
    for closed, count in list(_ALL.items())[: 1 if quick() else None]:
        known = known_machine(closed, count, rng)
        parts |= {f"machine {key_of(closed)}": known.machine}
        parts |= {f"poses {key_of(closed)}": known.poses}
        print(f"{key_of(closed)}: {len(known.poses)} poses")
    if "write" in sys.argv[1:]:
        np.savez(FILE, **parts)


if __name__ == "__main__":
    main()
