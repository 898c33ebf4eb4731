"""The level pose in the middle of the joints' limits, and cones aimed along the legs there.

A machine whose platform moves freely is made from measurements: its height at rest, or else the
height at which its rams or cranks are at mid-stroke, is where its cones have their middle.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pteron.bodies.vectors import vector
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.legs.cones import Cone
from pteron.manipulator import Manipulator
from pteron.manipulator.joint_pairs import joint_circle
from pteron.manipulator.variants import working_modes
from pteron.tolerances import ROUNDING

_HEIGHTS, _ROUNDS = 801, 6
"""Heights compared in each round of the search; a round's range is some 200 times smaller."""


def at_mid_stroke(robot: Manipulator, height: float | None = None) -> Manipulator:
    """Return a machine that moves freely with its home level above the base, at mid-stroke.

    Parameters
    ----------
    robot : Manipulator
        The machine; all its actuated joints have limits.
    height : float, optional
        Height of the platform joints above the base joints at home, along the platform's axis, m;
        negative below them. By default that at which the actuated joints are nearest to the middle
        of their limits; of two such heights the one above the base, against gravity.

    Returns
    -------
    Manipulator
        With the home pose. If a height is given, the legs may all be bent to another side, which
        brings the joints nearer to the middle of their limits there.

    Raises
    ------
    ModelError
        If the platform does not move freely, a joint has no limits, or no level pose is in reach.
    """
    if not robot.platform.moves_freely:
        raise ModelError(
            f"height: the platform of {robot.name} {robot.platform.kind.freedom_text}; one that "
            "moves freely (3T3R) expected"
        )
    if any(leg.limits is None for leg in robot.legs):
        raise ModelError("height: a joint has no limits; give limits")
    every = working_modes(robot)
    modes = [robot] if height is None else [robot, every[0], every[-1]]
    found = [(*_nearest_height(mode, height), k) for k, mode in enumerate(modes)]
    off, best, k = min(found)
    if off > 1.0:
        at = "no height" if height is None else f"the height {height:g} m"
        raise ModelError(
            f"height: at {at} no level pose is within reach and limits of all legs of "
            f"{robot.name}; check radii, lengths and limits"
        )
    pose = _level_poses(modes[k], np.array([best]))[0]
    return replace(modes[k], home=tuple(float(f"{q:.9g}") for q in pose.round(9) + 0.0))


def _level_poses(robot: Manipulator, heights: Array) -> Array:
    """Return level poses (k, 6) on the axis, of platform joints above base joints, m."""
    platform = robot.platform
    frame = np.array(platform.frame)
    base = np.mean([leg.guide_point for leg in robot.legs], axis=0)
    joints = np.mean(
        [np.array(leg.platform_point) @ frame + leg.fixed_offset for leg in robot.legs], axis=0
    )
    axial = frame[2] * (frame[2] @ joints)
    places = base + heights[:, None] * frame[2] - axial
    return np.hstack([places @ platform.directions.T, np.zeros((len(heights), 3))])


def _nearest_height(robot: Manipulator, height: float | None) -> tuple[float, float]:
    """Return how far joints are from mid-stroke, as a share of half the stroke, and the height."""
    limits = np.array([leg.limits for leg in robot.legs])
    middle, half = limits.mean(axis=1), 0.5 * np.ptp(limits, axis=1)
    up = np.sign(-np.array(robot.gravity) @ np.array(robot.platform.axis)) or 1.0

    def shares(heights: Array) -> Array:
        """Return the greatest share of half a stroke that a joint is off its middle, (k,)."""
        joints, *_ = numeric(robot, "inverse_kinematics")(_level_poses(robot, heights))
        off = (np.abs(joints - middle) / half).max(axis=1)
        # Of mirror images the one above the base is first.
        return np.asarray(np.nan_to_num(off, nan=np.inf) + ROUNDING * (up * heights < 0.0))

    if height is not None:
        return float(shares(np.array([height]))[0]), height
    reach = (
        sum(leg.size for leg in robot.legs) / len(robot.legs) + joint_circle(robot, "base").radius
    )
    low, high = -reach, reach
    for _ in range(_ROUNDS):
        heights = np.linspace(low, high, _HEIGHTS)
        off = shares(heights)
        best = heights[off.argmin()]
        step = 2.0 * (heights[1] - heights[0])
        low, high = best - step, best + step
    return float(off.min()), float(f"{best:.9g}")


def with_aimed_cones(
    robot: Manipulator, pose: tuple[float, ...], angle: float | None = None
) -> Manipulator:
    """Return the machine with the cones of its ball joints aimed along the legs at a pose.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : tuple of float
        The pose, m and rad, such as mid-stroke.
    angle : float, optional
        The greatest angle from the cone's axis, rad; joints at base and platform without a cone get
        one. By default each cone keeps its own, and joints without a cone remain so.
    """
    at = np.array(pose)
    upper, last = (np.asarray(part) for part in numeric(robot, "link_vectors")(at)[:2])
    axes = robot.platform.placement(at)[1]
    legs = []
    for leg, crank, way in zip(robot.legs, upper, last, strict=True):
        way = way / np.linalg.norm(way)
        changes = {}
        for name, key in leg.keys.items():
            cone: Any = getattr(leg, name, None)
            is_end = name in (*leg.base_cones, "platform_cone")
            if key.role != "cone" or (cone is None and (angle is None or not is_end)):
                continue
            if name in leg.base_cones:
                axis = way
            elif name == "platform_cone":
                axis = axes @ -way
            else:  # in the crank's frame: x along it, z its axis
                x, z = crank / np.linalg.norm(crank), np.array(leg.joint_axis)
                axis = np.array([x, np.cross(z, x), z]) @ way
            rounded = vector([round(float(component), 9) + 0.0 for component in axis], name)
            changes[name] = Cone(rounded, cone.angle if angle is None else angle)
        legs.append(replace(leg, **changes) if changes else leg)
    return replace(robot, legs=tuple(legs))
