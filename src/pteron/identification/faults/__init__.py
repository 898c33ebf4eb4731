"""Fault isolation: faults of logs or machine that a fit's residuals show, and their effects."""

from typing import TYPE_CHECKING

from pteron.identification.faults.fault import IsolatedFault
from pteron.identification.faults.isolation import FaultIsolation, delay_of, isolate_faults
from pteron.renamed import former_names

__all__ = ["FaultIsolation", "IsolatedFault", "delay_of", "isolate_faults"]

if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
