"""Limits of a motion along a path s as rows for TOPP-RA: linear in s'' and s'^2, with friction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pteron.kernels import Array
from pteron.motion.trajectories.demand import Demand
from pteron.motion.trajectories.limits import MotionLimits

_SIDES = 16
"""Sides of the polygon, inscribed in a circle, within which the tool's acceleration stays."""


class LimitRows(NamedTuple):
    """R limits at K points: a u + b x + c + v sqrt(x) <= 1, (K, R) each, and x <= `most` (K,).

    u is s'' and x is s'^2; v is the part of viscous friction.
    """

    a: Array
    b: Array
    c: Array
    v: Array
    most: Array

    def used(self, u: Array, x: Array) -> Array:
        """Return the share (K, R) of each limit that is used at s'' and s'^2, (K,) each."""
        u, x = u[:, None], x[:, None]
        return np.asarray(self.a * u + self.b * x + self.c + self.v * np.sqrt(x))


def limit_rows(path_demand: Demand, limits: MotionLimits, unit: float) -> LimitRows:
    """Return the limits as rows for the demand at K points of a path.

    Times are in units of `unit`, s.
    """
    count = len(path_demand.first)
    none = np.zeros((count, 0))
    a, b, c, v = [none], [none], [none], [none]

    def add(linear: Array, square: Array, constant: Array, root: Array, limit: Array) -> None:
        has = np.isfinite(limit)
        for part, values in zip(
            (a, b, c, v), (linear / unit**2, square / unit**2, constant, root / unit), strict=True
        ):
            part.append((np.broadcast_to(values, linear.shape) / limit)[:, has])

    zero = np.zeros_like(path_demand.first)
    joints, force, fall, back = limits.force_lines
    moving = np.sign(path_demand.first)
    for side in (1.0, -1.0):
        against = side * moving > 0.0
        dry = np.where(against, path_demand.dry[1], path_demand.dry[0]) * side * moving
        add(side * path_demand.first, side * path_demand.second, zero, zero, limits.acceleration)
        static = side * path_demand.still + dry
        root = side * (path_demand.viscous[joints] + back) * path_demand.first[:, joints]
        root += fall * np.abs(path_demand.first[:, joints])
        linear, square = (
            side * part[:, joints] for part in (path_demand.growth, path_demand.square)
        )
        add(linear, square, static[:, joints], root, force)
    speed, bend = path_demand.tool
    if math.isfinite(limits.tool_acceleration):
        # Speed and bend span a plane: x along the speed, y along the rest of the bend.
        size = np.linalg.norm(speed, axis=-1)
        direction = np.divide(
            speed, size[:, None], out=np.zeros_like(speed), where=size[:, None] > 0.0
        )
        ahead = np.sum(bend * direction, axis=-1)
        aside = np.linalg.norm(bend - ahead[:, None] * direction, axis=-1)
        angles = 2.0 * np.pi * (np.arange(_SIDES) + 0.5) / _SIDES
        cos, sin = np.cos(angles), np.sin(angles)
        most = np.full(_SIDES, limits.tool_acceleration * np.cos(np.pi / _SIDES))
        linear = size[:, None] * cos
        square = ahead[:, None] * cos + aside[:, None] * sin
        add(linear, square, np.zeros_like(linear), np.zeros_like(linear), most)
    with np.errstate(divide="ignore"):
        rates = np.minimum(
            (limits.speed / np.abs(path_demand.first)).min(axis=-1),
            limits.tool_speed / np.linalg.norm(speed, axis=-1),
        )
    stacked = [np.hstack(part) for part in (a, b, c, v)]
    return LimitRows(stacked[0], stacked[1], stacked[2], stacked[3], (rates * unit) ** 2)
