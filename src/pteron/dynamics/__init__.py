"""The public functions of dynamics: forces, accelerations, mass matrix, energies, regressor.

They take a machine and arrays of states, check them, and return arrays.
"""

from pteron.arguments import check_arguments
from pteron.dynamics.forces import (
    drive_accelerations,
    drive_forces,
    forward_dynamics,
    inverse_dynamics,
    regressor,
)
from pteron.dynamics.model import (
    bias_forces,
    coriolis_matrix,
    gravity_forces,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)

__all__ = [
    "bias_forces",
    "coriolis_matrix",
    "drive_accelerations",
    "drive_forces",
    "forward_dynamics",
    "gravity_forces",
    "inverse_dynamics",
    "kinetic_energy",
    "mass_matrix",
    "potential_energy",
    "regressor",
]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
