"""The error for a machine without a pose to work in: legs that miss it, or joints beyond limits."""

from __future__ import annotations

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics.limits import LimitedJoint, limited_joints
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator
from pteron.manipulator.manipulator import legs_text
from pteron.workspace.margins import distance_to_limits
from pteron.workspace.volume import deepest

_DRAWN = 20_000
"""Random poses that are tried."""

_STARTS = 5
"""Random poses, the best ones, that are improved by an optimiser."""

_TOUCH = 1e-6
"""Depth of a pose in all legs' reach, over the longest leg, up to which it is out of reach."""


def why_unreachable(robot: Manipulator) -> ModelError:
    """Return the error that a machine reaches no pose, or none within its joints' limits."""
    if not np.isfinite(robot.platform.placement(np.zeros(robot.freedom))[0]).all():
        return ModelError(
            "no pose is in reach of all legs: their planes have no place for the points of a level "
            "platform; turn directions, or move guide points nearer to its axis",
            subject=robot.name,
        )
    pose, random_poses = _deepest(robot)
    margin = numeric(robot, "reach")(pose)[0]
    touch = _TOUCH * max(leg.size for leg in robot.legs)
    if float(margin.min()) > touch:
        within_reach = random_poses[(numeric(robot, "reach")(random_poses)[0] > touch).all(axis=-1)]
        return limits_error(robot, np.array([pose, *within_reach]))
    legs_by_miss: dict[str, list[int]] = {}
    for i, m in enumerate(margin, start=1):
        if m < touch:
            legs_by_miss.setdefault(f"{max(-m, 0.0):.3g} m", []).append(i)
    return ModelError(
        "no pose is in reach of all legs: at the best one they miss by "
        f"{', '.join(f'{way} ({legs_text(legs)})' for way, legs in legs_by_miss.items())}; bring "
        "the guide points nearer or lengthen the links",
        subject=robot.name,
    )


def _deepest(robot: Manipulator) -> tuple[Array, Array]:
    """Return the pose with the greatest margin of reach, and the random poses drawn."""
    center, radius = search_ball(robot)
    lengths = len(center)
    random_poses = np.random.default_rng(0).uniform(-1.0, 1.0, (_DRAWN, robot.freedom))
    random_poses[:, :lengths] = center + radius * random_poses[:, :lengths]
    random_poses[:, lengths:] *= np.pi

    def margins(pose: Array) -> Array:
        """Return the margins of reach at poses (..., m)."""
        return np.asarray(numeric(robot, "reach")(pose)[0])

    starts = random_poses[np.argsort(-margins(random_poses).min(axis=-1))[:_STARTS]]
    best = np.array([*starts, *(deepest(margins, start) for start in starts)])
    return best[np.nanargmax(margins(best).min(axis=-1))], random_poses


def limits_error(robot: Manipulator, poses: Array) -> ModelError:
    """Return the error that a machine exceeds joint limits at all poses in reach."""
    pose = poses[distance_to_limits(robot, poses).min(axis=-1).argmax()]
    exceeded: dict[tuple[str, str], list[LimitedJoint]] = {}
    for joint in limited_joints(robot, pose):
        if not joint.least < joint.value < joint.most:
            exceeded.setdefault((joint.noun, joint.limits_text("{:g}".format)), []).append(joint)
    texts = [f"{_coordinates_text(joints)} of {limits}" for (_, limits), joints in exceeded.items()]
    nearest = f"; nearest to it is one with {'; '.join(texts)}" if texts else ""
    return ModelError(
        f"no pose in reach of all legs keeps the joints' limits{nearest}; widen limits or move the "
        "guide points",
        subject=robot.name,
    )


def _coordinates_text(joints: list[LimitedJoint]) -> str:
    """Return the text of the coordinates of joints with a common noun."""
    first, coordinates = joints[0], [joint.value for joint in joints]
    low, high = (f"{end:.4g}" for end in (min(coordinates), max(coordinates)))
    legs = f"{legs_text([joint.leg for joint in joints])}: " if first.leg else ""
    return f"{legs}{first.noun} at {low if low == high else f'{low} to {high}'} {first.unit}"
