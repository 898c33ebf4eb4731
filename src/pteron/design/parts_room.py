"""Whether motors, gearboxes, rails and joints have room beside each other on base and platform."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from pteron.design.kinds import joint_kind
from pteron.design.machine_space import segment_distances
from pteron.design.structure import Joint
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.parts.drives import Option
from pteron.parts.joints import JointPart

Joints = Sequence[Sequence[Joint]]
Parts = Sequence[Sequence[JointPart]]

_Capsules = list[tuple[int, Array, Array, float]]
"""Leg, both ends of the middle line (3,), and radius, m, of each part."""


def room_between_parts(
    robot: Manipulator, options: Sequence[Option], joints: Joints, parts: Parts, spacing: float
) -> tuple[float, str, Array]:
    """Return the least distance, m, of parts of different legs, where, and the drives' box (2, 3).

    The distance is below 0 if parts overlap.

    Motor and gearbox of a crank lie along its axis, on one side of all cranks; that of a slider
    beyond one end of its rail, along it; that of a ram is in line with the ram. The rods of a pair
    are `spacing` apart, m.
    """
    sides = (_on_base(robot, options, joints, parts, side) for side in (1.0, -1.0))
    drives = max(sides, key=_least_distance)
    ends = np.array([(start, end) for _, start, end, _ in drives])
    radii = np.array([radius for *_, radius in drives])[:, None]
    box = np.array([(ends.min(axis=1) - radii).min(axis=0), (ends.max(axis=1) + radii).max(axis=0)])
    base = _least_distance(drives), "on the base"
    platform = _least_distance(_on_platform(robot, joints, parts, spacing)), "on the platform"
    return *min(base, platform), box


def _on_base(
    robot: Manipulator, options: Sequence[Option], joints: Joints, parts: Parts, side: float
) -> _Capsules:
    """Return the parts on the base, motors on one `side` (1 or -1) of cranks and rails."""
    capsules: _Capsules = []
    for i, (leg, option) in enumerate(zip(robot.legs, options, strict=True)):
        width, length = option.outline
        start, kind = np.array(leg.guide_point), joint_kind(leg)
        base = [
            (joint.kind, part.diameter)
            for joint, part in zip(joints[i], parts[i], strict=True)
            if joint.link == "base"
        ]
        if kind == "rad":
            end = start + side * length * np.array(leg.joint_axis)
            capsules.append((i, start, end, 0.5 * width))
        elif kind == "slider":
            rail = max(diameter for name, diameter in base if name == "guide")
            axis = np.array(leg.joint_axis)
            low, high = (start + x * axis for x in leg.limits or (0.0, 0.0))
            capsules.append((i, low, high, 0.5 * rail))
            end = high if side > 0.0 else low
            capsules.append((i, end, end + side * length * axis, 0.5 * width))
        else:
            widest = max([width, *(diameter for _, diameter in base)])
            capsules.append((i, start, start, 0.5 * widest))
    return capsules


def _on_platform(robot: Manipulator, joints: Joints, parts: Parts, spacing: float) -> _Capsules:
    """Return the outermost joints in the platform's frame; of a pair of rods both as one bar."""
    frame = np.array(robot.platform.frame)
    capsules: _Capsules = []
    for i, leg in enumerate(robot.legs):
        outer = [
            (joint.parts, part.diameter)
            for joint, part in zip(joints[i], parts[i], strict=True)
            if joint.link in ("lower", "platform")
        ]
        if not outer:
            continue
        count, diameter = outer[-1]
        at = np.array(leg.platform_point) @ frame + leg.fixed_offset
        half = np.zeros(3)
        if count > 1 and (bar := leg.bar or leg.joint_axis) is not None:
            half = 0.5 * spacing * np.array(bar) / np.linalg.norm(bar)
        capsules.append((i, at - half, at + half, 0.5 * diameter))
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
