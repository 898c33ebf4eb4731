"""Joints on circles in pairs, as of a hexapod: their radius, the angle of a pair, crank planes.

Azimuths are counted about the platform's axis, from the x axis of its frame at angles zero. Base
joints lie on circles about the line along that axis through the middle of them all, platform joints
on circles about the axis through P.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pteron.bodies.vectors import Vector, vector
from pteron.errors import ModelError
from pteron.manipulator.manipulator import Manipulator

Plate = Literal["base", "platform"]
PLATES: tuple[Plate, ...] = ("base", "platform")

_EVEN = 1e-6
"""Difference of angles, rad, below which joints count as evenly spaced: far below any drawing's."""


@dataclass(frozen=True)
class JointCircle:
    """The joints of a machine's base or platform about its axis.

    Attributes
    ----------
    radii, azimuths : array, shape (n,)
        Distance of each leg's joint from the axis, m, and its azimuth, rad.
    """

    radii: NDArray[np.float64]
    azimuths: NDArray[np.float64]

    @property
    def radius(self) -> float:
        """The greatest distance of a joint from the axis, m."""
        return float(self.radii.max())

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The neighbouring joints of each pair, counterclockwise; [] if they are not in pairs."""
        order, count = np.argsort(self.azimuths), len(self.azimuths)
        gaps = np.diff(self.azimuths[order], append=self.azimuths[order[0]] + 2.0 * math.pi)
        halves = gaps[::2], gaps[1::2]
        if count % 2 or count < 4 or np.ptp(halves, axis=1).max() > 1e-3:
            return []
        first = int(halves[1].sum() < halves[0].sum())
        if abs(halves[0].mean() - halves[1].mean()) < _EVEN:
            return []
        order = np.roll(order, -first)
        return [(int(i), int(j)) for i, j in zip(order[::2], order[1::2], strict=True)]

    @property
    def pair_angle(self) -> float | None:
        """The angle between the joints of a pair, seen from the axis, rad; None without pairs."""
        if not (pairs := self.pairs):
            return None
        i, j = pairs[0]
        return float((self.azimuths[j] - self.azimuths[i]) % (2.0 * math.pi))


def joint_circle(robot: Manipulator, plate: Plate) -> JointCircle:
    """Return the joints of the legs at the base or at the platform, about the axis."""
    radial, _ = _radial(robot, plate)
    x, y, _ = (np.array(axis) for axis in robot.platform.frame)
    azimuths = np.arctan2(radial @ y, radial @ x) % (2.0 * math.pi)
    return JointCircle(np.linalg.norm(radial, axis=1), azimuths)


def with_pairs(robot: Manipulator, plate: Plate, angle: float) -> Manipulator:
    """Return the machine with another angle, rad, between the joints of each pair.

    The middle of each pair remains where it is.

    Raises
    ------
    ModelError
        If the joints are not in pairs, or the angle is none of a pair.
    """
    circle = joint_circle(robot, plate)
    pairs = _expect_pairs(robot, circle, plate)
    if not 0.0 < angle < 2.0 * math.pi / len(pairs):
        raise ModelError(
            f"{plate}_pair: {math.degrees(angle):.4g} deg given, above 0 and below "
            f"{360 / len(pairs):g} deg expected for {len(pairs)} pairs"
        )
    azimuths = circle.azimuths.copy()
    for i, j in pairs:
        middle = circle.azimuths[i] + 0.5 * ((azimuths[j] - azimuths[i]) % (2.0 * math.pi))
        azimuths[i], azimuths[j] = middle - 0.5 * angle, middle + 0.5 * angle
    _, rest = _radial(robot, plate)
    x, y, _ = (np.array(axis) for axis in robot.platform.frame)
    cos, sin = np.cos(azimuths)[:, None], np.sin(azimuths)[:, None]
    points = rest + circle.radii[:, None] * (cos * x + sin * y)
    if plate == "base":
        legs = (
            replace(leg, guide_point=_round_vector(point))
            for leg, point in zip(robot.legs, points, strict=True)
        )
    else:
        frame = np.array(robot.platform.frame)
        legs = (
            replace(leg, platform_point=_round_vector(frame @ (point - np.array(leg.fixed_offset))))
            for leg, point in zip(robot.legs, points, strict=True)
        )
    return replace(robot, legs=tuple(legs), home=None)


def with_crank_planes(robot: Manipulator, angle: float) -> Manipulator:
    """Return the machine with cranks turned about the platform's axis, mirrored in each pair.

    Parameters
    ----------
    robot : Manipulator
        A machine whose legs have cranks, with base joints in pairs.
    angle : float
        From the direction that leads from the axis to the pair's middle to the crank at 0, rad: 0
        is outwards; pi / 2 is away from the other crank of the pair, -pi / 2 towards it.

    Raises
    ------
    ModelError
        If the legs have no cranks, or the base joints are not in pairs.
    """
    if any(leg.crank_at_zero is None for leg in robot.legs):
        raise ModelError(f"crank_plane: the legs of {robot.name} have no cranks")
    circle = joint_circle(robot, "base")
    x, y, axis = (np.array(unit) for unit in robot.platform.frame)
    legs = list(robot.legs)
    for i, j in _expect_pairs(robot, circle, "base"):
        middle = circle.azimuths[i] + 0.5 * ((circle.azimuths[j] - circle.azimuths[i]) % math.tau)
        for k, side in ((i, -1.0), (j, 1.0)):
            zero = np.array(legs[k].crank_at_zero)
            turn = _rotation_about(axis, middle + side * angle - math.atan2(zero @ y, zero @ x))
            if (turned := legs[k].with_turned_crank(turn)) is None:
                raise ModelError(f"crank_plane: the cranks of {robot.name} cannot be turned")
            legs[k] = turned
    return replace(robot, legs=tuple(legs), home=None)


def _expect_pairs(robot: Manipulator, circle: JointCircle, plate: Plate) -> list[tuple[int, int]]:
    """Return the pairs of joints of a plate; raise if they are not in pairs."""
    if not (pairs := circle.pairs):
        raise ModelError(f"{plate}_pair: the {plate} joints of {robot.name} are not in pairs")
    return pairs


def _radial(robot: Manipulator, plate: Plate) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return vectors (n, 3), m, from the axis to each joint, and the points of the axis there."""
    frame = np.array(robot.platform.frame)
    axis = frame[2]
    if plate == "base":
        points = np.array([leg.guide_point for leg in robot.legs])
        origin = points.mean(axis=0)
    else:
        points = np.array(
            [np.array(leg.platform_point) @ frame + leg.fixed_offset for leg in robot.legs]
        )
        origin = np.zeros(3)
    radial = (points - origin) @ (np.eye(3) - np.outer(axis, axis))
    return radial, points - radial


def _rotation_about(axis: NDArray[np.float64], angle: float) -> Callable[[Vector], Vector]:
    """Return the function that turns a unit vector about an axis by an angle, rad."""

    def turn(direction: Vector) -> Vector:
        """Return the direction turned."""
        v = np.array(direction)
        along = axis * (axis @ v)
        across = v - along
        turned = along + math.cos(angle) * across + math.sin(angle) * np.cross(axis, across)
        return _round_vector(turned)

    return turn


def _round_vector(components: NDArray[np.float64]) -> Vector:
    """Return a vector with its components rounded to 12 decimals."""
    return vector([round(float(x), 12) + 0.0 for x in components], "point")
