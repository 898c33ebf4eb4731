"""Printers' firmware: Klipper's configuration, M665 and M666 of Marlin and RepRapFirmware."""

from pteron.export.printers.configuration import export_klipper as export_klipper
from pteron.export.printers.gcode import (
    export_marlin as export_marlin,
    export_reprap as export_reprap,
)
from pteron.export.printers.printer_cfg import from_klipper as from_klipper
from pteron.public import publish as _publish

_publish(__name__)
