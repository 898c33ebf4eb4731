"""Files for 3D printers' firmware: Klipper's configuration, Marlin's and RepRapFirmware's M665."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.export.printers.configuration import export_klipper as export_klipper
    from pteron.export.printers.gcode import (
        export_marlin as export_marlin,
        export_reprap as export_reprap,
    )
    from pteron.export.printers.printer_cfg import from_klipper as from_klipper

_publish(__name__)
