"""Sampling of random poses in reach, from a box about the ball that holds them all."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from operator import itemgetter
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.equations.kinematics import passive_joints
from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics.jacobian_keys import alternatives, jacobian_keys
from pteron.legs.leg import Passive
from pteron.manipulator import Manipulator
from pteron.shapes import PoseLike

_BATCH = 4096
"""Poses drawn at a time: kernels are at their full speed, and 1 MB of memory holds them."""

_ATTEMPTS = 250
"""Batches drawn before it is concluded that poses in reach are too rare: a million poses, a second
of work; what is rarer than one in 10^5 is left to the walk."""

_MANY = 50
"""Number of wanted poses from which a search that finds few ends after a quarter of its batches."""

_SPARSE = 12
"""Batches after which a box in which few poses are in reach is left for poses that Newton's method
leads to joint coordinates. All machines of the catalog but the 5-RPUR take up to 11."""

_BARREN = 8
"""Batches that are led so in turn and give no pose, after which none is: each gives some hundred
poses in reach, or the conditions on them are ones that hardly any pose keeps."""

_SCOUTS = 100
"""Poses found first in the whole box; their own bounding box, widened, serves for the others."""

_STARTS = 8
"""Starts of Newton's method for each pose that is still wanted: hexapods with short rams or cranks
find one from two or three."""

_LEADING = 6, 6
"""Steps of Newton's method that lead poses to joint coordinates, and further steps of those that
are then in the box: of what is outside, or has not converged by the last, one in a thousand would
with 20 steps of all (hexapods with rams and with cranks)."""

_RARE = 1e-3
"""Share of poses in reach of all legs below which a random walk looks for them."""

_ROUNDS = 100
"""Batches of the walk at most: steps shorten to 0.7^100 of the box where nothing is met."""

_SPREAD = 20
"""Batches by which it spreads once it is in reach, before poses are taken."""

_LONGEST = 0.3
"""Longest step of the walk, as a share of the box: a longer one draws from the box again."""

_PARENTS = 200
"""Poses from which the next batch of the walk sets out, where few are in reach."""

_INSIDE = 0.05, 0.3
"""Share of a batch in reach below which the walk's steps shorten, and above which they lengthen."""

_SEEN = 1000
"""Poses that show how often limits are kept: a share of 10 % to within 1 %."""

_PARALLEL = 1e-3
"""Squared angle, about, between guides that count as parallel."""

_SELDOM = 0.1
"""Share of poses at which a passive joint keeps its limits, below which a message names it."""


def draw_poses(
    robot: Manipulator,
    count: int,
    rng: np.random.Generator,
    type_i: float = 0.0,
    type_ii: float = 0.0,
    *,
    limits: bool = True,
) -> Array:
    """Return random poses (count, m) in reach, as `random_poses` does, also if all are singular."""
    conditions = _Conditions(type_i, type_ii, limits)
    sample = _search(robot, count, rng, conditions)
    if len(sample.poses) < count:
        raise _too_few(robot, count, sample, conditions)
    return sample.poses[:count]


def sample_poses(
    robot: Manipulator,
    count: int,
    rng: np.random.Generator,
    type_i: float = 0.0,
    *,
    limits: bool = True,
) -> Array:
    """Return random poses (k, m) in reach; k = count, or less if no more are found.

    Their type-I measure is at least `type_i`; with `limits` they are within the joints' limits.
    """
    return _search(robot, count, rng, _Conditions(type_i, 0.0, limits)).poses[:count]


def _search(
    robot: Manipulator, count: int, rng: np.random.Generator, conditions: _Conditions
) -> _Sample:
    """Return a sample of at least `count` poses that keep the conditions, or of all found."""
    widest = widest_box(robot)
    every = np.ones(robot.freedom, dtype=bool)
    if conditions.limits and all(leg.limits for leg in robot.legs):
        solved = _solved_poses(robot, *widest, _BATCH, rng, conditions)
        if len(solved) >= _SCOUTS:
            return _draw_in_box(
                robot, *_box_about(solved, 0.05, every, widest), count, rng, conditions
            )
    scouts = min(count, _SCOUTS)
    sample = _draw_in_box(robot, *widest, scouts, rng, conditions)
    # The ball is generous: with scouts in, their bounding box, widened, serves the rest.
    if scouts <= len(sample.poses) < count:
        box = _box_about(sample.poses, 0.25, ~robot.platform.angular, widest)
        return _draw_in_box(robot, *box, count, rng, conditions)
    if len(sample.poses) >= count or sample.reachable > _RARE * sample.tried:
        return sample
    walked = _random_walk(robot, *widest, max(count, _SCOUTS), rng, conditions)
    if len(walked) < max(count, _SCOUTS):
        return sample
    near = _draw_in_box(robot, *_box_about(walked, 0.25, every, widest), count, rng, conditions)
    if len(near.poses) < count:
        near.poses = rng.permutation(walked)
    return near


def _box_about(
    poses: Array, share: float, free: NDArray[np.bool_], widest: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return low and high end (m,) of the box around poses, widened by a share of its sides."""
    least, most = poses.min(axis=0), poses.max(axis=0)
    margin = share * (most - least)
    low = np.where(free, np.maximum(least - margin, widest[0]), widest[0])
    return low, np.where(free, np.minimum(most + margin, widest[1]), widest[1])


class _Conditions(NamedTuple):
    """Conditions on a pose in reach."""

    type_i: float
    """Least measure."""
    type_ii: float
    limits: bool
    """Whether limits are kept: those of passive joints, and of actuated ones where it tilts."""

    def select_reachable(
        self, robot: Manipulator, poses: Array, sample: _Sample | None = None
    ) -> Array:
        """Return those of the poses (K, m) in reach with sufficient singularity measures.

        The number in reach and the greatest measures are recorded in `sample`.
        """
        _, measures, _, _ = numeric(robot, "reach")(poses)
        within, bent = (measures >= 0.0).all(axis=-1), (measures >= self.type_i).all(axis=-1)
        poses = poses[bent]
        if sample is not None:
            sample.reachable += int(within.sum())
            least = measures[within].min(axis=-1).max(initial=0.0)
            sample.type_i = max(sample.type_i, float(least))
        if self.type_ii > 0.0 and len(poses):
            sizes = holding_sizes(robot, poses).min(axis=-1)
            poses = poses[sizes >= self.type_ii]
            if sample is not None:
                sample.type_ii = max(sample.type_ii, float(sizes.max()))
        return poses

    def keep_within_limits(self, robot: Manipulator, poses: Array) -> Array:
        """Return those of the poses (K, m) at which joints keep their limits."""
        if self.limits:
            poses = poses[(numeric(robot, "passive_room")(poses)[0] >= 0.0).all(axis=-1)]
        if self.limits and joints_limit_reach(robot):
            low, high = joint_limits(robot)
            joints = numeric(robot, "joint_coordinates")(poses)[0]
            poses = poses[((low <= joints) & (joints <= high)).all(axis=-1)]
        return poses


@dataclass
class _Sample:
    """Usable poses drawn from a box, and statistics of the rejected ones."""

    poses: Array
    """(k, m)."""
    tried: int = 0
    """Poses drawn."""
    reachable: int = 0
    """Those in reach of all legs."""
    regular: int = 0
    """Poses in reach with the required measures."""
    type_i: float = 0.0
    """Greatest type-I measure, the least of all legs, of the poses in reach."""
    type_ii: float = 0.0
    """Greatest type-II measure of those with the type-I measure, where one is wanted."""
    seen: Array = field(default_factory=lambda: np.empty((0, 0)))
    """Some poses with the measures."""


def widest_box(robot: Manipulator) -> tuple[Array, Array]:
    """Return low and high end (m,) of the box from which random poses are drawn."""
    center, radius = search_ball(robot)
    platform = robot.platform
    angles = np.array(list(platform.angle_box.values())).reshape(-1, 2)
    low = np.concatenate([center - radius, angles[:, 0]])
    return low, np.concatenate([center + radius, angles[:, 1]])


@lru_cache(maxsize=64)
def joint_limits(robot: Manipulator) -> Array:
    """Return the joints' limits (2, n), m or rad; infinite where there are none."""
    return np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs]).T


def _solved_poses(
    robot: Manipulator,
    low: Array,
    high: Array,
    starts: int,
    rng: np.random.Generator,
    conditions: _Conditions,
) -> Array:
    """Return poses found by Newton's method from random starts and joint coordinates, if usable.

    With short rams or cranks hardly any pose of the box is in reach. The result is empty if the
    platform does not tilt, or a joint has no range (`_joint_ranges`).
    """
    ranges = _joint_ranges(robot, limits=conditions.limits)
    if ranges is None:
        return np.empty((0, robot.freedom))
    poses = rng.uniform(low, high, (starts, robot.freedom))
    joints = rng.uniform(ranges[0], ranges[1], (starts, robot.joint_count))
    for steps in _LEADING:
        for _ in range(steps):
            poses = numeric(robot, "newton_step")(joints, poses)[0]
        inside = ((low <= poses) & (poses <= high)).all(axis=-1)
        joints, poses = joints[inside], poses[inside]
    return conditions.keep_within_limits(robot, conditions.select_reachable(robot, poses))


def joints_limit_reach(robot: Manipulator) -> bool:
    """Return whether limits of actuated joints bound the reach: only if the platform tilts."""
    return robot.platform.tilts


def _joint_ranges(robot: Manipulator, *, limits: bool) -> Array | None:
    """Return (2, n) low and high joint coordinates of a platform that tilts; None if endless.

    A crank has the range of a full turn if it has no limits, or if limits are ignored.
    """
    if not joints_limit_reach(robot):
        return None
    low, high = joint_limits(robot).copy()
    cranks = np.array([leg.joint.unit == "rad" for leg in robot.legs])
    turning = cranks & (np.isinf(low) if limits else True)
    low[turning], high[turning] = -np.pi, np.pi
    return None if np.isinf(low).any() else np.array([low, high])


def _draw_in_box(
    robot: Manipulator,
    low: Array,
    high: Array,
    count: int,
    rng: np.random.Generator,
    conditions: _Conditions,
) -> _Sample:
    """Draw poses from a box until `count` keep the conditions; return the sample."""
    usable = [np.empty((0, robot.freedom))]
    sample = _Sample(usable[0], seen=usable[0])
    total = drawn = barren = 0
    attempts = _ATTEMPTS + count // 16
    for k in range(1, attempts + 1):
        poses = rng.uniform(-1.0, 1.0, (_BATCH, robot.freedom))
        poses = 0.5 * (low + high) + 0.5 * (high - low) * poses
        poses = conditions.select_reachable(robot, poses, sample)
        sample.tried += _BATCH
        sample.regular += len(poses)
        if len(sample.seen) < _SEEN:
            sample.seen = np.concatenate([sample.seen, poses])
        usable.append(conditions.keep_within_limits(robot, poses))
        total += len(usable[-1])
        drawn += len(usable[-1])
        if k >= _SPARSE and barren < _BARREN and total < count and drawn < count * k / attempts:
            # At its rate the box would not give enough.
            starts = min(_STARTS * (count - total), _BATCH)
            usable.append(_solved_poses(robot, low, high, starts, rng, conditions))
            total += len(usable[-1])
            barren = 0 if len(usable[-1]) else barren + 1
        # A quarter of the attempts tells, where many poses are wanted, that they will not be found.
        few = k == attempts // 4 and count >= _MANY and total < count / 16
        if total >= count or few:
            break
    sample.poses = np.concatenate(usable)
    return sample


def _random_walk(
    robot: Manipulator,
    low: Array,
    high: Array,
    count: int,
    rng: np.random.Generator,
    conditions: _Conditions,
) -> Array:
    """Return usable poses (k, m) that a random walk finds, about `count` of them.

    It serves machines whose poses in reach are so rare that random drawing finds next to none:
    links of very unequal length have a reach as thin as a shell. The walk starts from the poses
    that are least out of reach; from poses in reach it spreads by steps of which some, not all,
    stay in reach.
    """
    poses = rng.uniform(low, high, (_BATCH, robot.freedom))
    kin = poses[:0]
    usable = [kin]
    step, spread = 0.1, 0
    for _ in range(_ROUNDS):
        margins = _least_margins(robot, poses)
        inside = margins > 0.0
        share = inside.mean()
        if share >= _INSIDE[0]:
            spread += 1
            kin = poses[inside]
        else:
            both = np.concatenate([kin, poses])
            kin = both[np.argsort(-_least_margins(robot, both), kind="stable")[:_PARENTS]]
        if spread > _SPREAD:
            usable.append(
                conditions.keep_within_limits(robot, conditions.select_reachable(robot, poses))
            )
            if sum(map(len, usable)) >= count:
                break
        step *= 1.5 if share > _INSIDE[1] else 1.0 if share >= _INSIDE[0] else 0.7
        step = min(step, _LONGEST)
        steps = step * (high - low) * rng.normal(size=(_BATCH, robot.freedom))
        poses = np.clip(kin[rng.integers(len(kin), size=_BATCH)] + steps, low, high)
    return np.concatenate(usable)


def _least_margins(robot: Manipulator, poses: Array) -> Array:
    """Return the least reach margin over legs (K,), m, at poses (K, m); -inf if undefined."""
    margins = numeric(robot, "reach")(poses)[0].min(axis=-1)
    return np.asarray(np.nan_to_num(margins, nan=-np.inf))


def _too_few(
    robot: Manipulator, count: int, sample: _Sample, conditions: _Conditions
) -> ModelError:
    """Return the error that fewer than `count` poses keep the conditions, naming which."""
    total = len(sample.poses)
    if sample.regular >= count:
        text = (
            f"only {total} of {sample.regular} random poses in reach of all legs keep the limits "
            f"of {'joints' if joints_limit_reach(robot) else 'passive joints'}: "
            f"{_rarely_kept_limits_phrase(robot, sample.seen)}; widen these limits"
        )
    elif not (sample.reachable or total):
        text = (
            f"none of {sample.tried} random poses is in reach of all legs: `pteron check` says "
            "whether any pose is"
        )
    elif sample.reachable < count:
        text = (
            f"only {max(sample.reachable, total)} of {sample.tried} random poses are in reach of "
            f"all legs, and {count} are wanted; ask for fewer"
        )
    else:
        text = _too_small_measures_phrase(robot, sample, conditions)
    return ModelError(text, subject=robot.name)


def _too_small_measures_phrase(robot: Manipulator, sample: _Sample, conditions: _Conditions) -> str:
    """Return the message that too few poses in reach have the required singularity measures."""
    head = f"only {sample.regular} of {sample.reachable} random poses in reach of all legs have "
    if sample.type_i < conditions.type_i or conditions.type_ii <= 0.0:
        return (
            f"{head}type-I measures of at least {conditions.type_i:g}; the greatest that was met, "
            f"the least of all legs, is {sample.type_i:.3g}: ask for less (type_i)"
        )
    keys = alternatives(jacobian_keys(robot))
    also = (
        f"type-I measures of at least {conditions.type_i:g} and " if conditions.type_i > 0.0 else ""
    )
    return (
        f"{head}{also}a type-II measure of at least {conditions.type_ii:g}; the greatest that was "
        f"met is {sample.type_ii:.3g}: ask for less (type_ii), or change what the Jacobian depends "
        f"on, the legs' {keys}"
    )


def _rarely_kept_limits_phrase(robot: Manipulator, poses: Array) -> str:
    """Return a phrase that lists the joints rarely within their limits at poses (K, m)."""
    pose, machine = ca.SX.sym("pose", robot.freedom), Machine.numeric(robot)
    angles, *legs = passive_joints(machine, pose)
    if joints_limit_reach(robot):
        for leg, motion, leg_joints in zip(robot.legs, machine.state(pose).legs, legs, strict=True):
            if leg.limits is not None:
                leg_joints.append(
                    Passive(leg.joint.noun, leg.joint.unit, motion.coordinate, *leg.limits, 1.0)
                )
    limited = [("", joint) for joint in angles]
    limited += [(f"leg {i}: ", joint) for i, leg in enumerate(legs, start=1) for joint in leg]
    coordinate_function = ca.Function(
        "value", [pose], [ca.vertcat(*(joint.value for _, joint in limited))]
    )
    low, high = np.array([(joint.least, joint.most) for _, joint in limited]).T
    coordinates = np.asarray(coordinate_function(poses.T)).T
    shares = ((low <= coordinates) & (coordinates <= high)).mean(axis=0)
    phrases = [
        f"{leg}{joint.noun} at {100.0 * share:.2g} %"
        for share, (leg, joint) in sorted(zip(shares, limited, strict=True), key=itemgetter(0))
        if share <= max(_SELDOM, shares.min())
    ]
    return ", ".join(phrases)


def search_ball(robot: Manipulator) -> tuple[Array, float]:
    """Return centre (k,) and radius, m, of a ball that holds every position of P in reach.

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
        projector = np.eye(3) - np.outer(line, line)
        normal += projector
        right += projector @ (np.array(bound.point) - offset)
        reach = max(reach, float(np.linalg.norm(leg.platform_point)) + bound.radius)
    directions = robot.platform.directions
    normal, right = directions @ normal @ directions.T, directions @ right
    # Guides that are parallel but for tolerances meet nowhere near the machine.
    center = np.linalg.lstsq(normal, right, rcond=_PARALLEL)[0]
    return np.asarray(center, dtype=float), 1.5 * reach


def type_ii_sizes(robot: Manipulator, poses: PoseLike) -> Array:
    """Return the absolute type-II measure (...) at poses (..., m); 0 where it is not finite.

    A pose out of reach, or where a leg transmits no force, thus fails any threshold.
    """
    return finite_sizes(numeric(robot, "type_ii")(poses)[0])


def holding_measures(robot: Manipulator) -> tuple[str, ...]:
    """Return the functions of a pose that vanish where drives or legs do not hold the platform.

    They are the type-II measure and, where the legs' couples turn with the pose, the constraint
    measure.
    """
    return ("type_ii", *["constraint"] * any(leg.couples_vary for leg in robot.legs))


def holding_sizes(robot: Manipulator, poses: PoseLike) -> Array:
    """Return the absolute `holding_measures` (..., k) at poses (..., m); 0 where not finite."""
    names = holding_measures(robot)
    return np.stack([finite_sizes(numeric(robot, name)(poses)[0]) for name in names], axis=-1)


def finite_sizes(measures: Array) -> Array:
    """Return the absolute values of measures; 0 where they are not finite."""
    sizes = np.abs(measures)
    return np.where(np.isfinite(sizes), sizes, 0.0)
