"""`JointLoads`: the loads on the joints of one machine, and the margins of drives under them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array


@dataclass(frozen=True)
class JointLoads:
    """The loads of the joints of one machine, rigid bodies alone.

    Attributes
    ----------
    squares : tuple of array, shape (B, n, 3)
        Of each cycle at its places the means, its rest included, of f^2, f q'' and q''^2.
    shares : array, shape (C,)
        Of the time that each cycle has in a duty cycle of all; empty where each counts by itself.
    forces, accelerations : array, shape (S, n)
        Of all samples.
    speeds : array, shape (n,)
        The greatest.
    everywhere : array, shape (2, n)
        Worst force at the asked acceleration and speed in any direction, and acceleration there.
    inertia : array, shape (2, n)
        Least and greatest inertia of the load at each joint, kg or kg m^2.
    process : array, shape (n,)
        Greatest force by that of the process, which adds to the others, N or N m.
    """

    squares: tuple[Array, ...]
    shares: Array
    forces: Array
    accelerations: Array
    speeds: Array
    everywhere: Array
    inertia: Array
    process: Array

    def margins(self, numbers: Array, legs: Sequence[int]) -> Array:
        """Return (3, O) margins (limit over load): rated torque, peak torque and speed.

        `numbers` are those of `Options`.
        """
        ratio, inertia, rated, peak, speed, *_ = numbers
        chosen, i, j = list(legs), ratio[:, None], inertia[:, None]
        worst_squares = []
        for part in self.squares:
            f, mixed, a = np.moveaxis(part[None, :, chosen], -1, 0)
            square = f / i[..., None] ** 2 + 2.0 * j[..., None] * mixed
            worst_squares.append((square + (j * i)[..., None] ** 2 * a).max(axis=1))
        square = duty_cycle_mean(np.array(worst_squares), self.shares).max(axis=1)
        process = float(self.process[chosen].max()) / ratio
        margins = [rated / np.maximum(np.sqrt(np.maximum(square, 0.0)) + process, 1e-15)]
        force, rise = (part[:, chosen].ravel() for part in (self.forces, self.accelerations))
        force, rise = _outermost(force, rise)
        worst = np.abs(force / i + j * i * rise).max(axis=1, initial=0.0)
        f, a = self.everywhere[:, chosen]
        worst = np.maximum(worst, (f / i + j * i * a).max(axis=1))
        margins.append(peak / np.maximum(worst + process, 1e-15))
        fastest = float(self.speeds[chosen].max())
        return np.array([*margins, speed / np.maximum(ratio * fastest, 1e-15)])


def duty_cycle_mean(worst: Array, shares: Array) -> Array:
    """Return cycles' worst loads (C, ...) averaged by shares (C,); the maximum without shares."""
    if len(shares):
        return np.tensordot(shares / shares.sum(), worst, axes=1)
    return np.asarray(worst.max(axis=0))


def _outermost(x: Array, y: Array) -> tuple[Array, Array]:
    """Return a cloud's points that are extreme in a direction of 65 sampled ones, (K,) each."""
    sizes = np.abs(x).max(initial=1e-12), np.abs(y).max(initial=1e-12)
    angles = np.linspace(0.0, np.pi, 65)
    way = np.outer(np.cos(angles), x / sizes[0]) + np.outer(np.sin(angles), y / sizes[1])
    chosen = np.unique(np.append(way.argmax(axis=1), way.argmin(axis=1)))
    return x[chosen], y[chosen]
