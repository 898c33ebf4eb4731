"""What a robot is: legs, platform and inertia as values, their TOML files, and the catalog."""

from pteron.manipulator.files import catalog, load, save
from pteron.manipulator.inertia import PlanarInertia
from pteron.manipulator.leg import Leg
from pteron.manipulator.manipulator import STANDARD_GRAVITY, Manipulator, working_modes
from pteron.manipulator.parameters import (
    BODY_PARAMETERS,
    parameter_names,
    parameter_units,
    parameters,
    with_parameters,
)
from pteron.manipulator.platform import Platform
from pteron.manipulator.turning import turned

__all__ = [
    "BODY_PARAMETERS",
    "STANDARD_GRAVITY",
    "Leg",
    "Manipulator",
    "PlanarInertia",
    "Platform",
    "catalog",
    "load",
    "parameter_names",
    "parameter_units",
    "parameters",
    "save",
    "turned",
    "with_parameters",
    "working_modes",
]
