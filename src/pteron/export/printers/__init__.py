"""Printers' firmware: Klipper's configuration, M665 and M666 of Marlin and RepRapFirmware."""

from pteron.export.printers.configuration import export_klipper
from pteron.export.printers.gcode import export_marlin, export_reprap
from pteron.export.printers.printer_cfg import from_klipper

__all__ = ["export_klipper", "export_marlin", "export_reprap", "from_klipper"]


def __dir__() -> list[str]:
    return sorted(__all__)
