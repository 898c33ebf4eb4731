from pteron import (
    bodies as bodies,
    calibration as calibration,
    controllers as controllers,
    design as design,
    environments as environments,
    export as export,
    identification as identification,
    indices as indices,
    kinematics as kinematics,
    legs as legs,
    manipulator as manipulator,
    maps as maps,
    motion as motion,
    platforms as platforms,
    plots as plots,
    reduction as reduction,
    report as report,
    viewer as viewer,
    workspace as workspace,
)
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
from pteron.export import export_c as export_c, export_st as export_st
from pteron.kernels import compile as compile
from pteron.kinematics import (
    direct_kinematics as direct_kinematics,
    follow as follow,
    inverse_kinematics as inverse_kinematics,
    jacobian as jacobian,
    pose_of as pose_of,
    random_poses as random_poses,
    rotation_of as rotation_of,
    twist as twist,
)
from pteron.manipulator import (
    Manipulator as Manipulator,
    catalog as catalog,
    load as load,
    parameter_names as parameter_names,
    parameters as parameters,
    save as save,
    turned as turned,
    with_parameters as with_parameters,
    working_modes as working_modes,
)
from pteron.reduction import (
    base_parameters as base_parameters,
    base_regressor as base_regressor,
)

__version__: str
