"""The machine for other engines: one description of the opened mechanism, and files from it."""

from pteron.export.engines.coordinates import coordinates
from pteron.export.engines.mjcf import export_mjcf, mjcf
from pteron.export.engines.parts import Closing, Tree, TreeBody, TreeJoint, TreeMotor
from pteron.export.engines.pinocchio import export_pinocchio, pinocchio_model
from pteron.export.engines.sdf import export_sdf
from pteron.export.engines.tree import tree
from pteron.export.engines.urdf import export_urdf

__all__ = [
    "Closing",
    "TreeMotor",
    "Tree",
    "TreeBody",
    "TreeJoint",
    "coordinates",
    "export_mjcf",
    "export_pinocchio",
    "export_sdf",
    "export_urdf",
    "mjcf",
    "pinocchio_model",
    "tree",
]


def __dir__() -> list[str]:
    return sorted(__all__)
