"""Faults of logs and machines that the residuals of a fit show by name, and what they spoil."""

from pteron.identification.faults.suspicion import Suspicion
from pteron.identification.faults.trial import Trial, delay_of, trial

__all__ = ["Suspicion", "Trial", "delay_of", "trial"]


def __dir__() -> list[str]:
    return sorted(__all__)
