"""The machine for others: code for a controller, in C99 and Structured Text; files for engines."""

from pteron.export.c import Real, export_c
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
from pteron.export.functions import FUNCTIONS
from pteron.export.structured_text import export_st

__all__ = [
    "FUNCTIONS",
    "Real",
    "Tree",
    "coordinates",
    "export_c",
    "export_mjcf",
    "export_pinocchio",
    "export_sdf",
    "export_st",
    "export_urdf",
    "mjcf",
    "pinocchio_model",
    "tree",
]
