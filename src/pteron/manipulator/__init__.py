"""What a robot is: legs, platform and gravity as a value, its TOML files, and the catalog."""

from pteron.manipulator.files import catalog, load, save
from pteron.manipulator.manipulator import (
    STANDARD_GRAVITY,
    Manipulator,
    expect_manipulator,
    turned,
    working_modes,
)
from pteron.manipulator.parameters import (
    parameter_data,
    parameter_names,
    parameter_units,
    parameters,
    with_parameters,
)

__all__ = [
    "STANDARD_GRAVITY",
    "Manipulator",
    "catalog",
    "expect_manipulator",
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
