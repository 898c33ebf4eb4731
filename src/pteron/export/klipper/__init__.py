"""Klipper's configuration of a machine."""

from pteron.export.klipper.configuration import export_klipper

__all__ = ["export_klipper"]


def __dir__() -> list[str]:
    return sorted(__all__)
