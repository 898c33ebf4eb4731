"""Limits of a motion along a path s as rows: linear in s'' and s'^2, with friction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pteron.kernels import Array
from pteron.motion.trajectories.demand import Demand
from pteron.motion.trajectories.limits import MotionLimits

_SIDES = 48
"""Sides of the polygon, inscribed in a circle, within which the tool's acceleration stays: 0.2 % of
it are given away where the polygon is nearest to the middle."""

POLYGON_SHARE = math.cos(math.pi / _SIDES)
"""Distance of its sides from the middle, as a share of the circle's radius."""


class LimitRows(NamedTuple):
    """R limits at K points: a u + b x + c + v sqrt(x) <= 1, (K, R) each, and x <= `most` (K,).

    u is s'' and x is s'^2; v is the part of viscous friction.
    """

    a: Array
    b: Array
    c: Array
    v: Array
    most: Array

    def usage(self, u: Array, x: Array) -> Array:
        """Return load / limit (K, R) of R limits at K path points, for s'' and s'^2 (K,) there."""
        u, x = u[:, None], x[:, None]
        return np.asarray(self.a * u + self.b * x + self.c + self.v * np.sqrt(x))


def limit_rows(needs: Demand, limits: MotionLimits) -> LimitRows:
    """Return the motion limits as linear constraints on s'' and s'^2 at K points of a path."""
    count = len(needs.first)
    none = np.zeros((count, 0))
    a, b, c, v = [none], [none], [none], [none]

    def add(linear: Array, square: Array, constant: Array, root: Array, limit: Array) -> None:
        """Append constraint rows to a, b, c and v: coefficients over `limit`, where finite."""
        has = np.isfinite(limit)
        for part, coefficients in zip((a, b, c, v), (linear, square, constant, root), strict=True):
            part.append((np.broadcast_to(coefficients, linear.shape) / limit)[:, has])

    zero = np.zeros_like(needs.first)
    joints, force, fall, back = limits.force_lines
    moving = np.sign(needs.first)
    for side in (1.0, -1.0):
        against = side * moving > 0.0
        dry = np.where(against, needs.dry[1], needs.dry[0]) * side * moving
        add(side * needs.first, side * needs.second, zero, zero, limits.acceleration)
        static_forces = side * needs.static + dry
        root = side * (needs.viscous[joints] + back) * needs.first[:, joints]
        root += fall * np.abs(needs.first[:, joints])
        linear, square = (side * part[:, joints] for part in (needs.growth, needs.square))
        add(linear, square, static_forces[:, joints], root, force)
    speed, bend = needs.tool
    if math.isfinite(limits.tool_acceleration):
        # Speed and bend span a plane: x along the speed, y along the rest of the bend.
        size = np.linalg.norm(speed, axis=-1)
        direction = np.divide(
            speed, size[:, None], out=np.zeros_like(speed), where=size[:, None] > 0.0
        )
        along_speed = np.sum(bend * direction, axis=-1)
        across_speed = np.linalg.norm(bend - along_speed[:, None] * direction, axis=-1)
        angles = 2.0 * np.pi * (np.arange(_SIDES) + 0.5) / _SIDES
        cos, sin = np.cos(angles), np.sin(angles)
        most = np.full(_SIDES, limits.tool_acceleration * POLYGON_SHARE)
        linear = size[:, None] * cos
        square = along_speed[:, None] * cos + across_speed[:, None] * sin
        add(linear, square, np.zeros_like(linear), np.zeros_like(linear), most)
    with np.errstate(divide="ignore"):
        rates = np.minimum(
            (limits.speed / np.abs(needs.first)).min(axis=-1),
            limits.tool_speed / np.linalg.norm(speed, axis=-1),
        )
    matrices = [np.hstack(part) for part in (a, b, c, v)]
    return LimitRows(matrices[0], matrices[1], matrices[2], matrices[3], rates**2)
