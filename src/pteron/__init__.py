"""Pteron: parallel manipulators whose legs carry points of the platform.

Closed-form kinematics, dynamics by virtual work, and base inertial parameters, for the Quadrupteron,
the Tripteron and their oblique relatives. `robot` is a `Manipulator`; poses, velocities and
accelerations have shape (..., m), slider coordinates and forces (..., n), in SI units and radians.
"""

from pteron.dynamics import (
    bias_forces,
    coriolis_matrix,
    forward_dynamics,
    gravity_forces,
    inverse_dynamics,
    kinetic_energy,
    mass_matrix,
    potential_energy,
    regressor,
)
from pteron.errors import (
    DataError,
    ModelError,
    OutputError,
    PteronError,
    SingularPose,
    UnreachablePose,
)
from pteron.kernels import compile
from pteron.kinematics import (
    JointMotion,
    direct_kinematics,
    inverse_kinematics,
    is_singular_everywhere,
    jacobian,
    joint_rates,
    joint_screws,
    link_jacobians,
    link_vectors,
    random_poses,
    singular_orientations,
)
from pteron.manipulator import (
    Leg,
    Manipulator,
    PlanarInertia,
    Platform,
    catalog,
    load,
    parameter_names,
    parameters,
    save,
    turned,
    with_parameters,
    working_modes,
)

__version__ = "0.1.0"

__all__ = [
    "DataError",
    "JointMotion",
    "Leg",
    "Manipulator",
    "ModelError",
    "OutputError",
    "PlanarInertia",
    "Platform",
    "PteronError",
    "SingularPose",
    "UnreachablePose",
    "bias_forces",
    "catalog",
    "compile",
    "coriolis_matrix",
    "direct_kinematics",
    "forward_dynamics",
    "gravity_forces",
    "inverse_dynamics",
    "inverse_kinematics",
    "is_singular_everywhere",
    "jacobian",
    "joint_rates",
    "joint_screws",
    "kinetic_energy",
    "link_jacobians",
    "link_vectors",
    "load",
    "mass_matrix",
    "parameter_names",
    "parameters",
    "potential_energy",
    "random_poses",
    "regressor",
    "save",
    "singular_orientations",
    "turned",
    "with_parameters",
    "working_modes",
]
