"""The public functions of kinematics: poses, joint coordinates, Jacobians, modes, singularities.

They take a machine and arrays of poses or joint coordinates, check them, and return arrays.
"""

from pteron.arguments import check_arguments
from pteron.kinematics.architecture import Architecture, architecture, is_singular_everywhere
from pteron.kinematics.constraints import constraint_measure
from pteron.kinematics.direct import (
    assembly_mode,
    assembly_modes,
    direct_kinematics,
    mode_of,
    nearest,
    working_mode,
)
from pteron.kinematics.following import follow
from pteron.kinematics.joints import JointMotion, joint_accelerations, joint_rates, joint_screws
from pteron.kinematics.pose_conversions import (
    pose_of,
    position_of,
    rotation_of,
    twist,
    twist_jacobian,
    velocity_of,
)
from pteron.kinematics.position import (
    inverse_kinematics,
    jacobian,
    link_jacobians,
    link_vectors,
)
from pteron.kinematics.random_poses import random_poses
from pteron.kinematics.singularities import singular_orientations

__all__ = [
    "Architecture",
    "architecture",
    "JointMotion",
    "assembly_mode",
    "assembly_modes",
    "constraint_measure",
    "direct_kinematics",
    "follow",
    "inverse_kinematics",
    "is_singular_everywhere",
    "jacobian",
    "joint_accelerations",
    "joint_rates",
    "joint_screws",
    "link_jacobians",
    "link_vectors",
    "mode_of",
    "nearest",
    "pose_of",
    "position_of",
    "random_poses",
    "rotation_of",
    "singular_orientations",
    "twist",
    "twist_jacobian",
    "velocity_of",
    "working_mode",
]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
