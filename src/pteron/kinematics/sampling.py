"""Sampling of random poses in reach, from a box about the ball that holds them all."""

from __future__ import annotations

from functools import lru_cache
from operator import itemgetter
from typing import NamedTuple

import casadi as ca
import numpy as np

from pteron.equations.kinematics import passive_joints
from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.legs.leg import Passive
from pteron.manipulator import Manipulator
from pteron.shapes import PoseLike

_BATCH = 4096
"""Poses drawn at a time."""

_ATTEMPTS = 250
"""Batches drawn before it is concluded that poses in reach are too rare."""

_MANY = 50
"""Number of wanted poses from which a search that finds few ends after a quarter of its batches."""

_SPARSE = 32
"""Batches after which a box in which few poses are in reach is left for poses that Newton's method
leads to joint coordinates. The machines of the catalog take up to 11."""

_BARREN = 8
"""Batches that are led so in turn and give no pose, after which none is: each gives some hundred
poses in reach, or the conditions on them are ones that hardly any pose keeps."""

_SCOUTS = 100
"""Poses found first in the whole box; their own bounding box, widened, serves for the others."""

_LEADING = 20
"""Steps of Newton's method that lead a pose to joint coordinates."""

_TILT = 0.5
"""Greatest size of the angles drawn, rad, of a tilting platform whose file does not limit them."""

_SEEN = 1000
"""Poses that show how often limits are kept."""

_PARALLEL = 1e-3
"""Squared angle, about, between guides that count as parallel."""

_SELDOM = 0.1
"""Share of poses at which a passive joint keeps its limits, below which a message names it."""


def drawn_poses(
    robot: Manipulator,
    count: int,
    rng: np.random.Generator,
    type_i: float = 0.0,
    type_ii: float = 0.0,
    *,
    limits: bool = True,
) -> Array:
    """Return poses (count, m) in reach, as `random_poses` does, also if all are singular."""
    low, high = widest_box(robot)
    wanted = _Wanted(type_i, type_ii, limits)
    coarse = np.empty((0, robot.freedom))
    if limits and all(leg.limits for leg in robot.legs):
        coarse = _led(robot, low, high, rng, wanted)
    free, share = np.ones(robot.freedom, dtype=bool), 0.05
    if len(coarse) < _SCOUTS:
        coarse = _drawn(robot, low, high, min(count, _SCOUTS), rng, wanted)
        if len(coarse) >= count:
            return coarse[:count]
        free, share = ~robot.platform.angular, 0.25
    # The ball is generous: with scouts in, their bounding box, widened, serves the rest.
    least, most = coarse.min(axis=0), coarse.max(axis=0)
    margin = share * (most - least)
    low = np.where(free, np.maximum(least - margin, low), low)
    high = np.where(free, np.minimum(most + margin, high), high)
    return _drawn(robot, low, high, count, rng, wanted)[:count]


class _Wanted(NamedTuple):
    """Conditions on a pose in reach."""

    type_i: float
    """Least measure."""
    type_ii: float
    limits: bool
    """Whether limits are kept: those of passive joints, and of actuated ones where it tilts."""

    def reached(self, robot: Manipulator, poses: Array) -> Array:
        """Return those of the poses that are in reach and away from singularities."""
        _, measures, _, _ = numeric(robot, "reach")(poses)
        poses = poses[(measures >= self.type_i).all(axis=-1)]
        if self.type_ii > 0.0 and len(poses):
            poses = poses[type_ii_sizes(robot, poses) >= self.type_ii]
        return poses

    def kept(self, robot: Manipulator, poses: Array) -> Array:
        """Return those of the poses that keep the limits."""
        if self.limits:
            poses = poses[(numeric(robot, "passive_room")(poses)[0] >= 0.0).all(axis=-1)]
        if self.limits and robot.platform.tilts:
            low, high = joint_limits(robot)
            joints = numeric(robot, "joint_coordinates")(poses)[0]
            poses = poses[((low <= joints) & (joints <= high)).all(axis=-1)]
        return poses


def widest_box(robot: Manipulator) -> tuple[Array, Array]:
    """Return the ends of a box (m,) of poses from which to draw."""
    center, radius = search_ball(robot)
    platform = robot.platform
    # Beyond half a turn phi counts where the platform's shaft makes several.
    turn = max((np.pi, *(abs(end) for pair in platform.angle_limits.values() for end in pair)))
    ends = dict.fromkeys(platform.angles, (-turn, turn))
    if platform.tilts:
        ends = dict.fromkeys(platform.angles, (-_TILT, _TILT)) | platform.angle_limits
    angles = np.array(list(ends.values())).reshape(-1, 2)
    low = np.concatenate([center - radius, angles[:, 0]])
    return low, np.concatenate([center + radius, angles[:, 1]])


@lru_cache(maxsize=64)
def joint_limits(robot: Manipulator) -> Array:
    """Return the joints' limits (2, n), m or rad; infinite where there are none."""
    return np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs]).T


def _led(
    robot: Manipulator, low: Array, high: Array, rng: np.random.Generator, wanted: _Wanted
) -> Array:
    """Return usable poses that Newton's method leads from a box to random joint coordinates.

    Short rams and short cranks leave so little of the box that next to no pose of it is in reach.
    None is led where the platform does not tilt, or a joint has no range (`_joint_ranges`).
    """
    ranges = _joint_ranges(robot, limits=wanted.limits)
    if ranges is None:
        return np.empty((0, robot.freedom))
    poses = rng.uniform(low, high, (_BATCH, robot.freedom))
    joints = rng.uniform(ranges[0], ranges[1], (_BATCH, robot.joint_count))
    for _ in range(_LEADING):
        poses = numeric(robot, "newton_step")(joints, poses)[0]
    poses = poses[((low <= poses) & (poses <= high)).all(axis=-1)]
    return wanted.kept(robot, wanted.reached(robot, poses))


def _joint_ranges(robot: Manipulator, *, limits: bool) -> Array | None:
    """Return the ranges (2, n) of joints, m or rad, of a platform that tilts, if all have one.

    A crank has a turn where it has no limits, or where these do not count.
    """
    if not robot.platform.tilts:
        return None
    low, high = joint_limits(robot).copy()
    cranks = np.array([leg.joint.unit == "rad" for leg in robot.legs])
    turning = cranks & (np.isinf(low) if limits else True)
    low[turning], high[turning] = -np.pi, np.pi
    return None if np.isinf(low).any() else np.array([low, high])


def _drawn(
    robot: Manipulator,
    low: Array,
    high: Array,
    count: int,
    rng: np.random.Generator,
    wanted: _Wanted,
) -> Array:
    """Return at least `count` usable poses drawn from a box."""
    found: list[Array] = []
    total = reached = barren = 0
    seen = np.empty((0, robot.freedom))
    attempts = _ATTEMPTS + count // 16
    for k in range(1, attempts + 1):
        poses = rng.uniform(-1.0, 1.0, (_BATCH, robot.freedom))
        poses = wanted.reached(robot, 0.5 * (low + high) + 0.5 * (high - low) * poses)
        reached += len(poses)
        seen = seen if len(seen) >= _SEEN else np.concatenate([seen, poses])
        found.append(wanted.kept(robot, poses))
        total += len(found[-1])
        if total >= count:
            return np.concatenate(found)
        if k >= _SPARSE and barren < _BARREN and total < count * k / attempts:
            # At this rate the box would not give enough.
            found.append(_led(robot, low, high, rng, wanted))
            total += len(found[-1])
            barren = 0 if len(found[-1]) else barren + 1
            if total >= count:
                return np.concatenate(found)
        # A quarter of the attempts tells, where many poses are wanted, that they will not be found.
        if k == attempts // 4 and count >= _MANY and total < count / 16:
            break
    if reached >= count:
        raise ModelError(
            f"only {total} of {reached} random poses in reach of all legs keep the limits of "
            f"{'joints' if robot.platform.tilts else 'passive joints'}: "
            f"{_seldom_kept(robot, seen)}; widen these limits",
            subject=robot.name,
        )
    least = f"measures of at least {wanted.type_i:g} (type I) and {wanted.type_ii:g} (type II)"
    if total or reached:
        raise ModelError(
            f"only {total} of {k * _BATCH} random poses are in reach of all legs, with {least}, "
            f"where {count} are wanted; give poses of your own, or ask for lower measures",
            subject=robot.name,
        )
    raise ModelError(
        f"none of {k * _BATCH} random poses is in reach of all legs with {least}: `pteron check` "
        "says whether any pose is",
        subject=robot.name,
    )


def _seldom_kept(robot: Manipulator, poses: Array) -> str:
    """Return which passive joints seldom keep their limits at given poses, and how often."""
    pose, machine = ca.SX.sym("pose", robot.freedom), Machine.of(robot)
    angles, *legs = passive_joints(machine, pose)
    if robot.platform.tilts:
        for leg, motion, own in zip(robot.legs, machine.state(pose).legs, legs, strict=True):
            if leg.limits is not None:
                own.append(
                    Passive(leg.joint.noun, leg.joint.unit, motion.coordinate, *leg.limits, 1.0)
                )
    found = [("", joint) for joint in angles]
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
    # Guides that are parallel but for tolerances meet nowhere near the machine.
    center = np.linalg.lstsq(normal, right, rcond=_PARALLEL)[0]
    return np.asarray(center, dtype=float), 1.5 * reach


def type_ii_sizes(robot: Manipulator, poses: PoseLike) -> Array:
    """Return the size (...) of the type-II measure of poses (..., m), 0 where it is not finite.

    So a pose out of reach, or where a leg loses its force, passes no floor.
    """
    sizes = np.abs(numeric(robot, "type_ii")(poses)[0])
    return np.where(np.isfinite(sizes), sizes, 0.0)
