"""Whether motors, gearboxes, rails and joints have room beside each other on base and platform."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from pteron.design.kinds import Kind, joint_kind
from pteron.design.machine_space import segment_distances
from pteron.kernels import Array
from pteron.manipulator import Manipulator

if TYPE_CHECKING:
    from pteron.design.rating import Rating

_Capsules = list[tuple[int, Array, Array, float]]
"""Leg, both ends of the middle line (3,), and radius, m, of each part."""

_ROOM = 0.01
"""Length, m, of overlap that costs as much as a bound missed by 100 %."""


def room_between_parts(rating: Rating, kind: Kind) -> tuple[float, str]:
    """Return the least distance, m, of parts of different legs, below 0 if they overlap, and where.

    Motor and gearbox of a crank lie along its axis, on one side of all cranks; that of a slider
    beyond one end of its rail, along it; that of a ram is in line with the ram.
    """
    robot = rating.machine
    base = max((_least_distance(_on_base(rating, side)), "on the base") for side in (1.0, -1.0))
    platform = _least_distance(_on_platform(rating, kind, robot)), "on the platform"
    return min(base, platform)


def check_room(rating: Rating, kind: Kind) -> None:
    """Record a violation where parts of different legs overlap."""
    distance, where = room_between_parts(rating, kind)
    if distance < 0.0:
        words = f"drives, rails or joints overlap by {-1e3 * distance:.3g} mm {where}"
        rating.miss("room for parts", -distance / _ROOM, words)


def _on_base(rating: Rating, side: float) -> _Capsules:
    """Return the parts on the base, motors on one `side` (1 or -1) of cranks and rails."""
    capsules: _Capsules = []
    legs = zip(rating.machine.legs, rating.options, rating.joints, rating.parts, strict=True)
    for i, (leg, option, joints, parts) in enumerate(legs):
        width, length = option.outline
        start, kind = np.array(leg.guide_point), joint_kind(leg)
        if kind == "rad":
            end = start + side * length * np.array(leg.direction)
            capsules.append((i, start, end, 0.5 * width))
        elif kind == "slider":
            rail = max(p.diameter for j, p in zip(joints, parts, strict=True) if j.kind == "guide")
            axis = np.array(leg.joint_axis)
            low, high = (start + x * axis for x in leg.limits or (0.0, 0.0))
            capsules.append((i, low, high, 0.5 * rail))
            end = high if side > 0.0 else low
            capsules.append((i, end, end + side * length * axis, 0.5 * width))
        else:
            widest = max(
                [
                    width,
                    *(p.diameter for j, p in zip(joints, parts, strict=True) if j.link == "base"),
                ]
            )
            capsules.append((i, start, start, 0.5 * widest))
    return capsules


def _on_platform(rating: Rating, kind: Kind, robot: Manipulator) -> _Capsules:
    """Return the outermost joints in the platform's frame; of a pair of rods both as one bar."""
    spacing = kind.links.pair * kind.platform_radius(robot)
    frame = np.array(robot.platform.frame)
    capsules: _Capsules = []
    for i, (leg, joints, parts) in enumerate(
        zip(robot.legs, rating.joints, rating.parts, strict=True)
    ):
        outer = [
            (j, p) for j, p in zip(joints, parts, strict=True) if j.link in ("lower", "platform")
        ]
        if not outer:
            continue
        joint, part = outer[-1]
        at = np.array(leg.platform_point) @ frame + leg.fixed_offset
        half = np.zeros(3)
        if joint.count > 1:
            bar = np.array(getattr(leg, "bar_direction", None) or leg.direction)
            half = 0.5 * spacing * bar / np.linalg.norm(bar)
        capsules.append((i, at - half, at + half, 0.5 * part.diameter))
    return capsules


def _least_distance(capsules: _Capsules) -> float:
    """Return the least distance, m, of parts of different legs that are not at one point."""
    pairs = [
        (a, b)
        for a, b in combinations(capsules, 2)
        if a[0] != b[0] and np.linalg.norm(a[1] - b[1]) + np.linalg.norm(a[2] - b[2]) > 1e-9
    ]
    if not pairs:
        return np.inf
    ends = [np.array(rows).T for rows in zip(*((*a[1:3], *b[1:3]) for a, b in pairs), strict=True)]
    radii = np.array([a[3] + b[3] for a, b in pairs])
    return float((segment_distances(*ends) - radii).min())
