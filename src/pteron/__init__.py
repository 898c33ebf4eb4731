"""Pteron: parallel manipulators whose legs carry points of the platform.

Kinematics, dynamics by virtual work, and base inertial parameters, for the Quadrupteron and the
Tripteron, Deltas, Par4 and H4, five-bars and other planar machines, hexapods and others that tilt,
and any mixture of their legs. Subpackages have workspaces, motions, control, identification,
calibration, design, pictures, reports and exports.
`robot` is a `Manipulator`; poses, velocities and accelerations have shape (..., m), joint
coordinates and actuator forces (..., n), in SI units and radians.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pteron.bodies.inertia import PlanarInertia, RodInertia
from pteron.bodies.parameters import Parameter
from pteron.dynamics import (
    bias_forces,
    coriolis_matrix,
    drive_accelerations,
    drive_forces,
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
    UnlikelyValue,
    UnreachablePose,
)
from pteron.kernels import compile
from pteron.kinematics import (
    Architecture,
    JointMotion,
    architecture,
    assembly_mode,
    constraint_measure,
    direct_kinematics,
    follow,
    inverse_kinematics,
    is_singular_everywhere,
    jacobian,
    joint_accelerations,
    joint_rates,
    joint_screws,
    link_jacobians,
    link_vectors,
    pose_of,
    position_of,
    random_poses,
    rotation_of,
    singular_orientations,
    twist,
    twist_jacobian,
    velocity_of,
    working_mode,
)
from pteron.legs import PRR, PRRR, PSS, RPR, RRR, RSS, RUPU, Cone, Drive, Stribeck
from pteron.manipulator import (
    Manipulator,
    Radii,
    catalog,
    load,
    parameter_data,
    parameter_names,
    parameter_units,
    parameters,
    save,
    turned,
    with_parameters,
    working_modes,
)
from pteron.platforms import Bar, Geared, Platform

Leg = PRRR
"""The kind of leg that a file means where it does not say `type`."""

if TYPE_CHECKING:
    from pteron import (
        controllers,
        design,
        environments,
        export,
        identification,
        indices,
        maps,
        motion,
        plots,
        report,
        viewer,
        workspace,
    )
    from pteron.export import export_c, export_st
    from pteron.reduction import (
        BaseParameters,
        base_parameters,
        base_regressor,
        cheapest_parameters,
    )

__version__ = "0.2.0"

_LATER = {
    "BaseParameters": "pteron.reduction",
    "base_parameters": "pteron.reduction",
    "base_regressor": "pteron.reduction",
    "cheapest_parameters": "pteron.reduction",
    "export_c": "pteron.export",
    "export_st": "pteron.export",
}
_LATER_MODULES = (
    *("controllers", "design", "environments", "export", "identification", "indices"),
    *("maps", "motion", "plots", "report", "viewer", "workspace"),
)
"""Modules imported at their first use: SymPy, SciPy, matplotlib and Gymnasium are slow to load."""


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    if name in _LATER_MODULES:
        return import_module(f"pteron.{name}")
    raise AttributeError(f"module 'pteron' has no attribute {name!r}")


__all__ = [
    "Architecture",
    "Bar",
    "BaseParameters",
    "Cone",
    "DataError",
    "Drive",
    "Geared",
    "JointMotion",
    "Leg",
    "Manipulator",
    "ModelError",
    "OutputError",
    "PRR",
    "PRRR",
    "PSS",
    "Parameter",
    "PlanarInertia",
    "Platform",
    "PteronError",
    "RPR",
    "RRR",
    "RSS",
    "RUPU",
    "Radii",
    "RodInertia",
    "SingularPose",
    "Stribeck",
    "UnlikelyValue",
    "UnreachablePose",
    "architecture",
    "assembly_mode",
    "base_parameters",
    "base_regressor",
    "bias_forces",
    "catalog",
    "cheapest_parameters",
    "compile",
    "constraint_measure",
    "controllers",
    "coriolis_matrix",
    "design",
    "direct_kinematics",
    "drive_accelerations",
    "drive_forces",
    "environments",
    "export",
    "export_c",
    "export_st",
    "follow",
    "forward_dynamics",
    "gravity_forces",
    "identification",
    "indices",
    "inverse_dynamics",
    "inverse_kinematics",
    "is_singular_everywhere",
    "jacobian",
    "joint_accelerations",
    "joint_rates",
    "joint_screws",
    "kinetic_energy",
    "link_jacobians",
    "link_vectors",
    "load",
    "maps",
    "mass_matrix",
    "motion",
    "parameter_data",
    "parameter_names",
    "parameter_units",
    "parameters",
    "plots",
    "pose_of",
    "position_of",
    "potential_energy",
    "random_poses",
    "regressor",
    "report",
    "rotation_of",
    "save",
    "singular_orientations",
    "turned",
    "twist",
    "twist_jacobian",
    "velocity_of",
    "viewer",
    "with_parameters",
    "working_mode",
    "working_modes",
    "workspace",
]
