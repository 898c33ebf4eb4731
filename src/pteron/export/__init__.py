"""Exports: code for controllers, files for physics engines, models for other tools."""

from pteron.arguments import check_arguments
from pteron.export.c import Real, export_c
from pteron.export.casadi_functions import casadi_functions, export_casadi
from pteron.export.engines import (
    Tree,
    coordinates,
    export_mjcf,
    export_pinocchio,
    export_sdf,
    export_urdf,
    mjcf,
    pinocchio_model,
    tree,
)
from pteron.export.fmu import export_fmu
from pteron.export.functions import FUNCTIONS
from pteron.export.linuxcnc import export_linuxcnc
from pteron.export.printers import export_klipper, export_marlin, export_reprap, from_klipper
from pteron.export.structured_text import export_st

__all__ = [
    "FUNCTIONS",
    "Real",
    "Tree",
    "casadi_functions",
    "coordinates",
    "export_c",
    "export_casadi",
    "export_fmu",
    "export_klipper",
    "export_linuxcnc",
    "export_marlin",
    "export_mjcf",
    "export_pinocchio",
    "export_reprap",
    "export_sdf",
    "export_st",
    "export_urdf",
    "from_klipper",
    "mjcf",
    "pinocchio_model",
    "tree",
]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
