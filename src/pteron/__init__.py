"""Pteron: parallel manipulators whose legs carry points of the platform.

Kinematics, dynamics by virtual work, and base inertial parameters, for the Quadrupteron and the
Tripteron, Deltas, Par4 and H4, five-bars and other planar machines, hexapods and others that tilt,
and any mixture of their legs. Subpackages have workspaces, motions, control, identification,
calibration, design, pictures, reports and exports.
`robot` is a `Manipulator`; poses, velocities and accelerations have shape (..., m), joint
coordinates and actuator forces (..., n), in SI units and radians.
"""

from typing import TYPE_CHECKING

from pteron.bodies.inertia import PlanarInertia as PlanarInertia, RodInertia as RodInertia
from pteron.bodies.parameters import Parameter as Parameter
from pteron.dynamics import (
    bias_forces as bias_forces,
    coriolis_matrix as coriolis_matrix,
    drive_accelerations as drive_accelerations,
    drive_forces as drive_forces,
    forward_dynamics as forward_dynamics,
    gravity_forces as gravity_forces,
    inverse_dynamics as inverse_dynamics,
    kinetic_energy as kinetic_energy,
    mass_matrix as mass_matrix,
    potential_energy as potential_energy,
    regressor as regressor,
)
from pteron.errors import (
    DataError as DataError,
    ModelError as ModelError,
    OutputError as OutputError,
    PteronError as PteronError,
    SingularPose as SingularPose,
    UnlikelyValue as UnlikelyValue,
    UnreachablePose as UnreachablePose,
)
from pteron.kernels import compile as compile
from pteron.kinematics import (
    Architecture as Architecture,
    JointMotion as JointMotion,
    architecture as architecture,
    assembly_mode as assembly_mode,
    constraint_measure as constraint_measure,
    direct_kinematics as direct_kinematics,
    follow as follow,
    inverse_kinematics as inverse_kinematics,
    is_singular_everywhere as is_singular_everywhere,
    jacobian as jacobian,
    joint_accelerations as joint_accelerations,
    joint_rates as joint_rates,
    joint_screws as joint_screws,
    link_jacobians as link_jacobians,
    link_vectors as link_vectors,
    pose_of as pose_of,
    position_of as position_of,
    random_poses as random_poses,
    rotation_of as rotation_of,
    singular_orientations as singular_orientations,
    twist as twist,
    twist_jacobian as twist_jacobian,
    velocity_of as velocity_of,
    working_mode as working_mode,
)
from pteron.legs import (
    PRR as PRR,
    PRRR as PRRR,
    PSS as PSS,
    RPR as RPR,
    RRR as RRR,
    RSS as RSS,
    RUPU as RUPU,
    Cone as Cone,
    Drive as Drive,
    Stribeck as Stribeck,
)
from pteron.manipulator import (
    Manipulator as Manipulator,
    Radii as Radii,
    catalog as catalog,
    load as load,
    parameter_data as parameter_data,
    parameter_names as parameter_names,
    parameter_units as parameter_units,
    parameters as parameters,
    save as save,
    turned as turned,
    with_parameters as with_parameters,
    working_modes as working_modes,
)
from pteron.platforms import Bar as Bar, Geared as Geared, Platform as Platform
from pteron.public import publish as _publish

Leg = PRRR
"""The kind of leg that a file means where it does not say `type`."""

if TYPE_CHECKING:
    from pteron import (
        calibration as calibration,
        controllers as controllers,
        design as design,
        environments as environments,
        export as export,
        identification as identification,
        indices as indices,
        maps as maps,
        motion as motion,
        plots as plots,
        report as report,
        viewer as viewer,
        workspace as workspace,
    )
    from pteron.export import export_c as export_c, export_st as export_st
    from pteron.reduction import (
        BaseParameters as BaseParameters,
        base_parameters as base_parameters,
        base_regressor as base_regressor,
        cheapest_parameters as cheapest_parameters,
    )

__version__ = "0.2.0"

# SymPy, SciPy, matplotlib and Gymnasium are slow to load.
_publish(
    __name__,
    modules=(
        *("calibration", "controllers", "design", "environments", "export"),
        *("identification", "indices", "maps", "motion", "plots", "report", "viewer", "workspace"),
    ),
    later={
        "pteron.export": ("export_c", "export_st"),
        "pteron.reduction": (
            *("BaseParameters", "base_parameters", "base_regressor", "cheapest_parameters"),
        ),
    },
)
