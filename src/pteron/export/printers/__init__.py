"""Files for 3D printers' firmware: Klipper's configuration, Marlin's and RepRapFirmware's M665."""

from pteron.public import publish as _publish

_publish(__name__)
