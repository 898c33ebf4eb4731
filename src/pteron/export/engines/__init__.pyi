from pteron.export.engines.coordinates import coordinates as coordinates
from pteron.export.engines.mjcf import export_mjcf as export_mjcf, mjcf as mjcf
from pteron.export.engines.parts import (
    Closing as Closing,
    Tree as Tree,
    TreeBody as TreeBody,
    TreeJoint as TreeJoint,
    TreeMotor as TreeMotor,
)
from pteron.export.engines.pinocchio import (
    export_pinocchio as export_pinocchio,
    pinocchio_model as pinocchio_model,
)
from pteron.export.engines.sdf import export_sdf as export_sdf
from pteron.export.engines.tree import tree as tree
from pteron.export.engines.urdf import export_urdf as export_urdf
