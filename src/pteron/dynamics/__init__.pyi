from pteron.dynamics.distribution import null_space as null_space
from pteron.dynamics.forces import (
    drive_accelerations as drive_accelerations,
    drive_forces as drive_forces,
    forward_dynamics as forward_dynamics,
    inverse_dynamics as inverse_dynamics,
    regressor as regressor,
)
from pteron.dynamics.model import (
    bias_forces as bias_forces,
    coriolis_matrix as coriolis_matrix,
    gravity_forces as gravity_forces,
    kinetic_energy as kinetic_energy,
    mass_matrix as mass_matrix,
    potential_energy as potential_energy,
)
