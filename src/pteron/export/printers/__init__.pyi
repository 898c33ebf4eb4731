from pteron.export.printers.configuration import export_klipper as export_klipper
from pteron.export.printers.gcode import (
    export_marlin as export_marlin,
    export_reprap as export_reprap,
)
from pteron.export.printers.printer_cfg import from_klipper as from_klipper
