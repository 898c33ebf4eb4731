from pteron.export.c import Real as Real, export_c as export_c
from pteron.export.casadi_functions import (
    casadi_functions as casadi_functions,
    export_casadi as export_casadi,
)
from pteron.export.cuda import export_cuda as export_cuda
from pteron.export.engines import (
    Tree as Tree,
    coordinates as coordinates,
    export_mjcf as export_mjcf,
    export_pinocchio as export_pinocchio,
    export_sdf as export_sdf,
    export_urdf as export_urdf,
    mjcf as mjcf,
    pinocchio_model as pinocchio_model,
    tree as tree,
)
from pteron.export.fmu import export_fmu as export_fmu
from pteron.export.functions import FUNCTIONS as FUNCTIONS
from pteron.export.installed import export_named as export_named, export_names as export_names
from pteron.export.linuxcnc import export_linuxcnc as export_linuxcnc
from pteron.export.printers import (
    export_klipper as export_klipper,
    export_marlin as export_marlin,
    export_reprap as export_reprap,
    from_klipper as from_klipper,
)
from pteron.export.structured_text import export_st as export_st
