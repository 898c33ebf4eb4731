"""Kinematics in numbers: batched, validated, documented."""

from pteron.kinematics.joints import JointMotion, joint_accelerations, joint_rates, joint_screws
from pteron.kinematics.position import (
    assembly_modes,
    direct_kinematics,
    inverse_kinematics,
    jacobian,
    link_jacobians,
    link_vectors,
    mode_of,
)
from pteron.kinematics.sampling import random_poses
from pteron.kinematics.singularities import is_singular_everywhere, singular_orientations

__all__ = [
    "JointMotion",
    "assembly_modes",
    "direct_kinematics",
    "inverse_kinematics",
    "is_singular_everywhere",
    "jacobian",
    "joint_accelerations",
    "joint_rates",
    "joint_screws",
    "link_jacobians",
    "link_vectors",
    "mode_of",
    "random_poses",
    "singular_orientations",
]
