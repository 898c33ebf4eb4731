"""Fault isolation: faults of logs or machine that a fit's residuals show, and their effects."""

from pteron.identification.faults.fault import IsolatedFault as IsolatedFault
from pteron.identification.faults.isolation import (
    FaultIsolation as FaultIsolation,
    delay_of as delay_of,
    isolate_faults as isolate_faults,
)
from pteron.public import publish as _publish

_publish(__name__)
