"""Models for physics engines (MJCF, SDF, URDF, Pinocchio), made from one tree of bodies."""

from typing import TYPE_CHECKING

from pteron.export.engines.coordinates import coordinates
from pteron.export.engines.mjcf import export_mjcf, mjcf
from pteron.export.engines.parts import Closing, Tree, TreeBody, TreeJoint, TreeMotor
from pteron.export.engines.pinocchio import export_pinocchio, pinocchio_model
from pteron.export.engines.sdf import export_sdf
from pteron.export.engines.tree import tree
from pteron.export.engines.urdf import export_urdf
from pteron.renamed import former_names

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

if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)
