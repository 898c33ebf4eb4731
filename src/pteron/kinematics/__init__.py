"""Kinematics in numbers: batched, validated, documented."""

from pteron.kinematics.poses import SINGULAR, usable_poses
from pteron.kinematics.position import direct_kinematics, inverse_kinematics, link_vectors
from pteron.kinematics.sampling import random_poses
from pteron.kinematics.singularities import is_singular_everywhere, singular_orientations
from pteron.kinematics.velocity import (
    JointMotion,
    jacobian,
    joint_rates,
    joint_screws,
    link_jacobians,
)

__all__ = [
    "SINGULAR",
    "JointMotion",
    "direct_kinematics",
    "inverse_kinematics",
    "is_singular_everywhere",
    "jacobian",
    "joint_rates",
    "joint_screws",
    "link_jacobians",
    "link_vectors",
    "random_poses",
    "singular_orientations",
    "usable_poses",
]
