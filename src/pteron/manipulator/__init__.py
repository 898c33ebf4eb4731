"""A robot as a value: legs, platform and gravity, its TOML files, and the catalog."""

from pteron.arguments import check_arguments
from pteron.manipulator.files import catalog, load
from pteron.manipulator.given import RobotLike, as_manipulator
from pteron.manipulator.manipulator import STANDARD_GRAVITY, Manipulator
from pteron.manipulator.parameters import (
    parameter_data,
    parameter_names,
    parameter_units,
    parameters,
    with_parameters,
)
from pteron.manipulator.radii import Radii
from pteron.manipulator.saving import save
from pteron.manipulator.variants import turned, working_modes

__all__ = [
    "STANDARD_GRAVITY",
    "Manipulator",
    "Radii",
    "RobotLike",
    "as_manipulator",
    "catalog",
    "load",
    "parameter_data",
    "parameter_names",
    "parameter_units",
    "parameters",
    "save",
    "turned",
    "with_parameters",
    "working_modes",
]
check_arguments(__name__, classes=("Manipulator",))


def __dir__() -> list[str]:
    return sorted(__all__)
