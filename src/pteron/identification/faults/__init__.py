"""Fault isolation: faults of logs and machines that a fit's residuals show, and what they spoil."""

from pteron.identification.faults.fault import IsolatedFault
from pteron.identification.faults.isolation import FaultIsolation, delay_of, isolate_faults

__all__ = ["FaultIsolation", "IsolatedFault", "delay_of", "isolate_faults"]


def __dir__() -> list[str]:
    return sorted(__all__)
