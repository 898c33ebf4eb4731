"""Export of a machine's kinematics as a configuration of Klipper, the printer firmware."""

from pteron.export.klipper.configuration import export_klipper

__all__ = ["export_klipper"]


def __dir__() -> list[str]:
    return sorted(__all__)
