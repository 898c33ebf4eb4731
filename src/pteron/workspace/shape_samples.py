"""Sample points for `exchange` and `fit`, of a shape that moves and grows and of a fixed region."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pteron.kernels import Array
from pteron.tolerances import ROUNDING


class Shape(NamedTuple):
    """A shape of variable size: the points at which its gauge is at most half its edge."""

    half: Array
    """Half the sides (k,) of the box that holds it where its edge is 2."""
    gauge: Callable[[Array], Array]
    """Function of vectors (..., k) from its centre: half the edge (...) of the shape there."""
    rim: Array
    """Points (N, k) of its surface where its edge is 2, beside those of a lattice."""


def cube(count: int) -> Shape:
    """Return an axis-parallel cube in `count` coordinates."""
    return Shape(np.ones(count), lambda way: np.abs(way).max(axis=-1), np.empty((0, count)))


@dataclass(frozen=True)
class Samples:
    """Points of a moving shape and of a fixed region.

    Attributes
    ----------
    poses : array, shape (N, m)
        The fixed part of each pose; of a point of the shape its orientation.
    units : array, shape (N, k)
        The point's place in the shape, over half its edge.
    inside : array, shape (N,)
        1 for a point of the shape, 0 for a fixed one.
    """

    poses: Array
    units: Array
    inside: Array

    def shape_poses(self, center: Array, edge: float) -> Array:
        """Return the poses (N, m) of the samples, for a shape's centre and edge."""
        poses = self.poses.copy()
        lengths = self.units.shape[1]
        poses[:, :lengths] += self.inside[:, None] * (center + 0.5 * edge * self.units)
        return poses

    def join(self, other: Samples) -> Samples:
        """Return the samples of both, concatenated."""
        return Samples(
            np.vstack([self.poses, other.poses]),
            np.vstack([self.units, other.units]),
            np.append(self.inside, other.inside),
        )


def lattice(shape: Shape, count: int) -> Array:
    """Return coordinates (k, count) of a lattice over the box of a shape whose edge is 2."""
    return np.asarray(shape.half[:, None] * np.linspace(-1.0, 1.0, count))


def shape_samples(shape: Shape, orientations: Array, count: int) -> Samples:
    """Return lattice and boundary points of a shape at every orientation (A, m)."""
    grid = np.stack(np.meshgrid(*lattice(shape, count), indexing="ij"), axis=-1)
    units = grid.reshape(-1, len(shape.half))
    units = np.vstack([units[shape.gauge(units) <= 1.0 + ROUNDING], shape.rim])
    poses = np.repeat(orientations, len(units), axis=0)
    poses[:, : units.shape[1]] = 0.0
    return Samples(poses, np.tile(units, (len(orientations), 1)), np.ones(len(poses)))


def fixed_samples(poses: Array, lengths: int) -> Samples:
    """Return samples at fixed poses (N, m)."""
    return Samples(poses, np.zeros((len(poses), lengths)), np.zeros(len(poses)))
