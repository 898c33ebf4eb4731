"""Poses in reach, drawn at random from the box about a ball that holds them all."""

from __future__ import annotations

from operator import itemgetter

import casadi as ca
import numpy as np

from pteron.equations.kinematics import passive_joints
from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics.type_ii_sizes import type_ii_sizes
from pteron.manipulator import Manipulator

_BATCH = 4096
"""Poses drawn at a time."""

_ATTEMPTS = 250
"""Batches drawn before it is concluded that poses in reach are too rare."""

_SCOUTS = 100
"""Poses found first in the whole box; their own bounding box, widened, serves for the others."""

_SEEN = 1000
"""Poses that tell how often limits are kept."""

_SELDOM = 0.1
"""Share of poses up to which a passive joint that keeps its limits is named in a message."""


def drawn_poses(
    robot: Manipulator,
    count: int,
    rng: np.random.Generator,
    type_i: float = 0.0,
    type_ii: float = 0.0,
    *,
    limits: bool = True,
) -> Array:
    """Return poses (count, m) in reach, as `random_poses` does, also if all of them are singular.

    Raises
    ------
    ModelError
        If the legs have next to no common reach.
    """
    center, radius = search_ball(robot)
    low, high = center - radius, center + radius
    coarse = _drawn(robot, low, high, min(count, _SCOUTS), rng, type_i, type_ii, limits)
    if len(coarse) >= count:
        return coarse[:count]
    # The ball is generous: with scouts in, their bounding box, widened, serves the rest.
    least, most = (coarse[:, : len(low)].min(axis=0), coarse[:, : len(low)].max(axis=0))
    margin = 0.25 * (most - least)
    low, high = np.maximum(least - margin, low), np.minimum(most + margin, high)
    return _drawn(robot, low, high, count, rng, type_i, type_ii, limits)[:count]


def _drawn(
    robot: Manipulator,
    low: Array,
    high: Array,
    count: int,
    rng: np.random.Generator,
    type_i: float,
    type_ii: float,
    limits: bool,
) -> Array:
    """Return at least `count` usable poses with positions drawn from a box."""
    found: list[Array] = []
    total = reached = 0
    seen = np.empty((0, robot.freedom))
    for _ in range(_ATTEMPTS + count // 16):
        poses = rng.uniform(-1.0, 1.0, (_BATCH, robot.freedom))
        lengths = len(low)
        poses[:, :lengths] = 0.5 * (low + high) + 0.5 * (high - low) * poses[:, :lengths]
        # Beyond half a turn phi counts where the platform's shaft makes several.
        poses[:, lengths:] *= max((np.pi, *map(abs, robot.platform.limits or ())))
        _, measures, _, _ = numeric(robot, "reach")(poses)
        poses = poses[(measures >= type_i).all(axis=-1)]
        if type_ii > 0.0 and len(poses):
            poses = poses[type_ii_sizes(robot, poses) >= type_ii]
        reached += len(poses)
        seen = seen if len(seen) >= _SEEN else np.concatenate([seen, poses])
        if limits:
            poses = poses[(numeric(robot, "passive_room")(poses)[0] >= 0.0).all(axis=-1)]
        found.append(poses)
        total += len(poses)
        if total >= count:
            return np.concatenate(found)
    if reached >= count:
        raise ModelError(
            f"only {total} of {reached} random poses in reach of all legs keep the limits of "
            f"passive joints: {_seldom_kept(robot, seen)}; widen these limits",
            subject=robot.name,
        )
    raise ModelError(
        f"only {total} of {_ATTEMPTS * _BATCH} random poses are in reach of all legs and away from "
        "singularities; bring the guide points nearer or lengthen the links",
        subject=robot.name,
    )


def _seldom_kept(robot: Manipulator, poses: Array) -> str:
    """Return which passive joints seldom keep their limits at given poses, and how often."""
    pose = ca.SX.sym("pose", robot.freedom)
    angle, *legs = passive_joints(Machine.of(robot), pose)
    found = [("", joint) for joint in angle]
    found += [(f"leg {i}: ", joint) for i, leg in enumerate(legs, start=1) for joint in leg]
    value = ca.Function("value", [pose], [ca.vertcat(*(joint.value for _, joint in found))])
    low, high = np.array([(joint.least, joint.most) for _, joint in found]).T
    values = np.asarray(value(poses.T)).T
    kept = ((low <= values) & (values <= high)).mean(axis=0)
    told = [
        f"{leg}{joint.noun} at {100.0 * share:.2g} %"
        for share, (leg, joint) in sorted(zip(kept, found, strict=True), key=itemgetter(0))
        if share <= max(_SELDOM, kept.min())
    ]
    return ", ".join(told)


def search_ball(robot: Manipulator) -> tuple[Array, float]:
    """Return a centre, nearest to all legs' bounds, and a radius that hold every pose in reach.

    The centre's coordinates are the pose's lengths.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    reach = 0.0
    for leg in robot.legs:
        bound = leg.reach_bound
        if bound is None:
            continue
        offset = np.array(leg.fixed_offset)
        line = np.zeros(3) if bound.line is None else np.array(bound.line)
        across = np.eye(3) - np.outer(line, line)
        normal += across
        right += across @ (np.array(bound.point) - offset)
        reach = max(reach, float(np.linalg.norm(leg.platform_point)) + bound.radius)
    directions = robot.platform.directions
    normal, right = directions @ normal @ directions.T, directions @ right
    center = np.linalg.lstsq(normal, right, rcond=None)[0]
    return np.asarray(center, dtype=float), 1.5 * reach
