from pteron.manipulator.dimensions import with_dimensions as with_dimensions
from pteron.manipulator.distribution import Distribution as Distribution
from pteron.manipulator.files import (
    catalog as catalog,
    from_dict as from_dict,
    load as load,
    loads as loads,
)
from pteron.manipulator.manipulator import (
    STANDARD_GRAVITY as STANDARD_GRAVITY,
    Manipulator as Manipulator,
)
from pteron.manipulator.owner_data import OwnerData as OwnerData
from pteron.manipulator.parameters import (
    parameter_data as parameter_data,
    parameter_names as parameter_names,
    parameter_units as parameter_units,
    parameters as parameters,
    with_parameters as with_parameters,
)
from pteron.manipulator.radii import Radii as Radii
from pteron.manipulator.robot_like import (
    RobotLike as RobotLike,
    as_manipulator as as_manipulator,
)
from pteron.manipulator.saving import dumps as dumps, save as save, to_dict as to_dict
from pteron.manipulator.tool import Tool as Tool
from pteron.manipulator.variants import (
    turned as turned,
    with_pivot as with_pivot,
    working_modes as working_modes,
)
