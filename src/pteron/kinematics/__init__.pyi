from pteron.kinematics.architecture import (
    Architecture as Architecture,
    architecture as architecture,
    is_singular_everywhere as is_singular_everywhere,
)
from pteron.kinematics.constraints import constraint_measure as constraint_measure
from pteron.kinematics.direct import (
    assembly_mode as assembly_mode,
    assembly_modes as assembly_modes,
    direct_kinematics as direct_kinematics,
    mode_of as mode_of,
    nearest as nearest,
    working_mode as working_mode,
)
from pteron.kinematics.following import follow as follow
from pteron.kinematics.inverse import (
    inverse_kinematics as inverse_kinematics,
    jacobian as jacobian,
    link_jacobians as link_jacobians,
    link_vectors as link_vectors,
)
from pteron.kinematics.joints import (
    JointMotion as JointMotion,
    joint_accelerations as joint_accelerations,
    joint_rates as joint_rates,
    joint_screws as joint_screws,
)
from pteron.kinematics.pose_conversions import (
    pose_of as pose_of,
    position_of as position_of,
    rotation_of as rotation_of,
    twist as twist,
    twist_jacobian as twist_jacobian,
    velocity_of as velocity_of,
)
from pteron.kinematics.random_poses import random_poses as random_poses
from pteron.kinematics.singularities import singular_orientations as singular_orientations
